"""What a controller needs, and what is left after it."""
