"""What figures are drawn with: canvas, projection, off-screen bodies, labels."""
