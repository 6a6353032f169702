"""A part before it is cut: its mesh, its program, and what a machine makes of them."""
