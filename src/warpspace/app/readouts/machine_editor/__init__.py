"""HTML of the machine editor: its boxes, and the machines to start from."""
