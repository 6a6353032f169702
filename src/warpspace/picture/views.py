"""Named views: from where a picture is looked at."""

from collections.abc import Mapping

from warpspace.geometry.faces import MIN_CUT_NODES
from warpspace.geometry.surfaces import Shape

Direction = tuple[float, float, float]

VIEWS: Mapping[str, Direction] = {
    "iso": (0.53, -0.85, 0.55),
    "front": (0.0, -1.0, 0.0),
    "right": (1.0, 0.0, 0.0),
    "top": (0.0, 0.0, 1.0),
}
"""Direction from what is looked at towards the viewer, in R; the operator stands on the −Y side."""
UPWARDS: Mapping[str, Direction] = {"top": (0.0, 1.0, 0.0)}
"""What points upwards in a view, in R, where it is not z."""
VIEW_WORDS = {
    "front": "front view, from the operator",
    "right": "view from the right",
    "top": "view from above",
}


def view_words(view: str, shape: Shape) -> str:
    """Say where the volume is looked at from, and what of it is cut away."""
    if view == "iso":
        return "octant towards the viewer cut away" if min(shape) >= MIN_CUT_NODES else "iso view"
    return VIEW_WORDS[view]
