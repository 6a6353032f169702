"""Everything in 3-D, and the camera."""
