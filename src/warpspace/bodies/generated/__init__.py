"""Bodies of any machine, generated from its description alone."""
