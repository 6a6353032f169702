"""What leaves the program: figures and files."""
