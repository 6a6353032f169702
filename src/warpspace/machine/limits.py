"""The largest magnitudes that the model takes, whoever gives them."""

MAX_ERROR = 1e5
"""100 mm in µm and 0.1 rad in µrad: no rigid-body model of small errors holds beyond."""
MAX_LENGTH_MM = 1e5
