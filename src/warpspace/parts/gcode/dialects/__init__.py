"""Dialects of G-code, one module each."""
