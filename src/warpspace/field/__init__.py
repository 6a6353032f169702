"""Error fields: errors over points, paths and the grid of the working volume."""
