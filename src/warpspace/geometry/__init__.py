"""Geometry of the pictures, numpy only: both renderers draw what is computed here."""
