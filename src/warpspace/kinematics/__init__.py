"""Kinematic chains: propagation of axis errors, exactly and to first order."""
