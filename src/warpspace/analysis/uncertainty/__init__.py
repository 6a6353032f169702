"""Uncertainty of errors, propagated to points, statistics and results."""
