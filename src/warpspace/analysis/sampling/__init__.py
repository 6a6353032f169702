"""Machines drawn from tolerances, and their statistics."""
