"""What several formats share, and the parts of large ones."""
