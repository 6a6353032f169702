"""The browser app: one private session per tab, drawn with viser."""
