"""Machine description: axes, error parameters and error curves."""
