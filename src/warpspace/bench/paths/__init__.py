"""Where axes have to stand for a test: on a plane, on a point of the workpiece, along a flank."""
