"""Traces of the rotary axes: one in colour, with its nominal circle and its name; the others faint.

What no error moves is not drawn. All have the exaggeration of the box. Where the actual trace that
is looked at and its nominal one coincide on screen only the actual one is drawn.
"""

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.chosen_trace import chosen_trace, moved_traces
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.palette import palette
from warpspace.app.viewport.layers import NOTHING, SCENE_PER_MM, colour_bytes, polyline_pieces
from warpspace.app.viewport.layers.adding import add_lines
from warpspace.picture.marks import spell_micrometres
from warpspace.picture.traces import TraceLine
from warpspace.units import Array

APART = 0.002
"""Distance from which nominal and actual are both drawn, as a part of the longest edge."""
NAME_AWAY = 0.03
"""Distance of the name from the trace, likewise."""


def apart(nominal_mm: Array, actual_mm: Array, distance_mm: float) -> NDArray[np.float32]:
    """Give the pieces of a nominal trace that the actual one does not cover, [S, 2, 3], mm.

    Parameters
    ----------
    nominal_mm, actual_mm : ndarray, [..., n, 3], mm
    distance_mm : float, mm
    """
    way = actual_mm - nominal_mm
    far = np.einsum("...i,...i->...", way, way) > distance_mm**2
    kept = (far[..., :-1] | far[..., 1:]).reshape(-1)
    if not kept.any():
        return np.zeros((0, 2, 3), np.float32)
    return polyline_pieces([nominal_mm])[kept]


def name_place(line: TraceLine, size_mm: float) -> tuple[Array, float]:
    """Find where a trace is named: outside of its place of the largest error.

    Parameters
    ----------
    line : TraceLine
    size_mm : float, mm
        Longest edge of the picture.

    Returns
    -------
    tuple of (ndarray, [3], mm, and float, µm)
        The place and the largest error.
    """
    lengths = np.linalg.norm(line.error_um, axis=-1)
    worst = int(np.argmax(lengths))
    away = line.actual_mm[worst] - line.actual_mm.mean(axis=0)
    length = float(np.linalg.norm(away))
    outwards = away / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    return line.actual_mm[worst] + NAME_AWAY * size_mm * outwards, float(lengths[worst])


class TracesLayer:
    """Circles and arcs of the scene's trace points, as far as errors move them.

    Parameters
    ----------
    scene : viser.SceneApi
    picture : LivePicture
    """

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        colours = palette(picture)
        self._others = add_lines(scene, "/traces/others", colours.trace_elsewhere, 1.0)
        self._nominal = add_lines(scene, "/traces/nominal", colours.trace_nominal, 1.5)
        self._actual = add_lines(scene, "/traces/actual", colours.trace_actual, 3.0)
        self._name = Handle(
            scene.add_label(
                "/traces/name", "", visible=False, font_screen_scale=0.8, anchor="bottom-center"
            )
        )
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Draw the traces."""
        moved = moved_traces(picture)
        name = chosen_trace(picture, moved)
        for part in (self._actual, self._nominal, self._name):
            part.put(visible=bool(name))
        others = [line.actual_mm for other, line in moved.items() if other != name]
        self._others.put(visible=bool(others))
        colours = palette(picture)
        if others:
            self._others.put(
                points=polyline_pieces(others), colors=colour_bytes(colours.trace_elsewhere)
            )
        if not name:
            return
        line = moved[name]
        nominal = apart(line.nominal_mm, line.actual_mm, APART * picture.size_mm)
        self._nominal.put(
            points=nominal if len(nominal) else NOTHING,
            colors=colour_bytes(colours.trace_nominal),
        )
        self._actual.put(
            points=polyline_pieces([line.actual_mm]), colors=colour_bytes(colours.trace_actual)
        )
        place, largest = name_place(line, picture.size_mm)
        self._name.put(
            text=f"{name}: max {spell_micrometres(largest)}", position=place * SCENE_PER_MM
        )
