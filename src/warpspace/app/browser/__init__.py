"""Scripts and style of the page, its HTML and messages, and the private parts of viser."""
