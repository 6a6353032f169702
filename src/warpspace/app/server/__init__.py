"""Starts viser and gives each browser tab its session."""
