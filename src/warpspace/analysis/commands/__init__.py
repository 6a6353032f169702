"""The analyses, one module per command."""
