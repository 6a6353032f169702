"""The 3-D drawing and its camera."""
