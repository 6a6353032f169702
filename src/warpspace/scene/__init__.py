"""Scenes: a machine, its errors and how to look at them, read from validated TOML."""
