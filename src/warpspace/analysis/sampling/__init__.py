"""Machines drawn from tolerances, and what is computed from them."""
