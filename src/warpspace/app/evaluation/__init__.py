"""Evaluation of states with numpy, independent of the browser."""
