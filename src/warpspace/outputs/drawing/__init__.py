"""Drawing tools of the figures: canvas, projection, off-screen bodies, labels."""
