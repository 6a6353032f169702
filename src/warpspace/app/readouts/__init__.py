"""Numbers as HTML: pure text, every foreign word escaped."""
