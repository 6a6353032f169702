"""The measured distance as it is drawn: points that were picked, nominal and displaced."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from warpspace.analysis.description import silent
from warpspace.analysis.distance import Distance, DistanceResult
from warpspace.app.evaluation.budget import answer
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState, Picked
from warpspace.app.state.forms import read_form
from warpspace.app.state.leaf import Identity
from warpspace.exceptions import WarpspaceError
from warpspace.units import Array

POINTS = ("start", "end", "corner")
"""Options of the analysis that are points, in the order in which they are picked."""


@dataclass(frozen=True, slots=True)
class Measured:
    """What is measured between points, and where these are drawn."""

    found: DistanceResult
    nominal_mm: Array  # [n, 3]; start, end and corner
    drawn_mm: Array  # [n, 3]; displaced


def point_form(name: str) -> str:
    """Give what forms call a point."""
    return f"{Distance.name}.{name}"


def measured(picture: LivePicture) -> Measured | None:
    """Measure between the points that were chosen; None where there are not two."""
    values = _values(picture.state)
    has_two = values.get("start") and values.get("end")
    return _measured(Identity(picture)) if has_two and not picture.is_difference else None


@lru_cache(maxsize=1)  # lines and words of one picture ask; it keeps the picture
def _measured(of: Identity) -> Measured | None:
    picture: LivePicture = of.thing
    values = _values(picture.state)
    state = picture.drawn_state
    scene = state.active_scene()
    loop, placed = state.seen
    try:
        asked = {**values, "loop": str(loop), "placed": str(int(placed))}
        found = read_form(Distance, Distance.options(), asked, scene).run(scene, silent)
        points = [answer(state, Picked(at), picture.exaggeration) for at in found.at]
    except WarpspaceError:  # said in its section
        return None
    nominal = [one.explanation.nominal_mm + one.shift_mm for one in points]
    return Measured(found, np.stack(nominal), np.stack([one.drawn_mm for one in points]))


def _values(state: AppState) -> Mapping[str, str]:
    own = point_form("")
    return {k.removeprefix(own): v for k, v in state.forms.items() if k.startswith(own)}
