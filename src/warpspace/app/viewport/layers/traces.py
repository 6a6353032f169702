"""Traces of the rotary axes: nominal light, actual strong, with the exaggeration of the box.

Traces that belong to the positions the axes stand at are dark, those at other tilts paler. Where
actual and nominal coincide on screen only the actual one is drawn.
"""

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.palette import palette
from warpspace.app.viewport.layers import NOTHING, colour_bytes, polyline_pieces
from warpspace.app.viewport.layers.adding import add_lines
from warpspace.app.viewport.tone_map import line_vertex_colours
from warpspace.geometry.traces import TraceGroup
from warpspace.picture.traces import TraceLines

APART = 0.002
"""Distance from which nominal and actual are both drawn, as a part of the longest edge."""


def apart(lines: TraceLines, distance_mm: float) -> NDArray[np.float32]:
    """Give the pieces of the nominal traces that the actual ones do not cover, [S, 2, 3], mm."""
    way = lines.actual_mm - lines.nominal_mm
    far = np.einsum("...i,...i->...", way, way) > distance_mm**2
    kept = (far[..., :-1] | far[..., 1:]).reshape(-1)
    if not kept.any():
        return np.zeros((0, 2, 3), np.float32)
    return polyline_pieces([lines.nominal_mm])[kept]


def is_here(group: TraceGroup, positions: dict[str, float]) -> NDArray[np.bool_]:
    """Tell which traces belong to the positions the rotary axes stand at, [T]."""
    return np.array(
        [all(positions.get(name) == at for name, at in trace.at.items()) for trace in group.traces]
    )


def trace_colours(picture: LivePicture) -> NDArray[np.uint8]:
    """Colour the pieces of all actual traces, [S, 2, 3]."""
    colours = palette(picture)
    found: list[NDArray[np.uint8]] = []
    for lines in picture.traces:
        here = is_here(lines.group, dict(picture.state.positions))
        rgb = np.where(here[:, None], colours.trace_actual, colours.trace_elsewhere)
        pieces = lines.actual_mm.shape[1] - 1
        found.append(np.repeat(rgb.astype(np.uint8), pieces, axis=0))
    flat = np.concatenate(found)
    return line_vertex_colours(np.stack([flat, flat], axis=1))


class TracesLayer:
    """Circles and arcs of the scene's trace points.

    Parameters
    ----------
    scene : viser.SceneApi
    picture : LivePicture
    """

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._drawn_for: tuple[object, ...] = ()
        self._nominal, self._actual = (
            add_lines(scene, name, palette(picture).trace_nominal, thickness)
            for name, thickness in (("/traces/nominal", 1.5), ("/traces/actual", 1.6))
        )
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Move the traces."""
        visible = picture.state.shown.traces and bool(picture.traces)
        self._nominal.put(visible=visible)
        self._actual.put(visible=visible)
        if not visible:
            return
        distance = APART * picture.size_mm
        nominal = np.concatenate([apart(lines, distance) for lines in picture.traces])
        self._nominal.put(
            points=nominal if len(nominal) else NOTHING,
            colors=colour_bytes(palette(picture).trace_nominal),
        )
        self._actual.put(points=polyline_pieces([lines.actual_mm for lines in picture.traces]))
        drawn_for = (Identity(picture.traces[0].group), picture.state.shown.dark)
        if drawn_for != self._drawn_for:
            self._drawn_for = drawn_for
            self._actual.put(colors=trace_colours(picture))
