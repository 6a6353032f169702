"""Acceptance tests: the machines that pass them, and the largest error these may have."""
