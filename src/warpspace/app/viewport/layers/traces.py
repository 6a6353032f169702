"""Traces of the rotary axes: one in colour, with its nominal circle; the others faint.

What no error moves is not drawn. All have the exaggeration of the box. Where the actual trace that
is looked at and its nominal one coincide on screen only the actual one is drawn.
"""

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.palette import palette
from warpspace.app.evaluation.rotation import chosen_trace, moved_traces, points_on_traces
from warpspace.app.viewport.layers import NOTHING, SCENE_PER_MM, colour_bytes, polyline_pieces
from warpspace.app.viewport.layers.adding import add_lines
from warpspace.units import Array

APART = 0.002
"""Distance from which nominal and actual are both drawn, as a part of the longest edge."""


def apart(nominal_mm: Array, actual_mm: Array, distance_mm: float) -> NDArray[np.float32]:
    """Give the pieces of a nominal trace that the actual one does not cover, [S, 2, 3], mm."""
    way = actual_mm - nominal_mm
    far = np.einsum("...i,...i->...", way, way) > distance_mm**2
    kept = (far[..., :-1] | far[..., 1:]).reshape(-1)
    if not kept.any():
        return np.zeros((0, 2, 3), np.float32)
    return polyline_pieces([nominal_mm])[kept]


class TracesLayer:
    """Circles and arcs of the scene's trace points, as far as errors move them."""

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        colours = palette(picture)
        self._others = add_lines(scene, "/traces/others", colours.trace_elsewhere, 1.0)
        self._nominal = add_lines(scene, "/traces/nominal", colours.trace_nominal, 1.5)
        self._actual = add_lines(scene, "/traces/actual", colours.trace_actual, 3.0)
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Draw the traces."""
        moved = moved_traces(picture)
        name = chosen_trace(picture, moved)
        for part in (self._actual, self._nominal):
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


# --- The traced points while the table turns ------------------------------------------------------
# Nominal light, actual dark, on their circles.

SIZE = 0.014  # diameter of a point, as a part of the longest edge


class RotationLayer:
    """A pair of points on every circle of the played axis; nothing while none is played."""

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._scene = scene
        self._picture = picture
        self._position: dict[str, float] | None = None
        self._clouds: list[Any] = []

    def show(self, picture: LivePicture) -> None:
        """Follow the picture."""
        self._picture = picture
        self._draw()

    def turn(self, position: dict[str, float] | None) -> None:
        """Draw the points at a position of the played axis, degrees; None takes them away."""
        self._position = position
        self._draw()

    def _draw(self) -> None:
        picture, position = self._picture, self._position
        visible = False
        if position is not None and picture.state.shown.traces:
            points = points_on_traces(picture, position)
            visible = len(points[0]) > 0
            if visible:
                self._place(points)
        for cloud in self._clouds:
            cloud.visible = visible

    def _place(self, points: tuple[Array, Array]) -> None:
        if self._clouds:
            for cloud, at in zip(self._clouds, points, strict=True):
                cloud.points = at.astype(np.float32)
            return
        colours = palette(self._picture)
        for name, at, rgb in zip(
            ("nominal", "actual"),
            points,
            (colours.trace_nominal, colours.trace_actual),
            strict=True,
        ):
            self._clouds.append(
                self._scene.add_point_cloud(
                    f"/rotation/{name}",
                    at.astype(np.float32),
                    np.array(rgb, dtype=np.uint8),
                    point_size=SIZE * self._picture.size_mm,
                    point_shape="circle",
                    point_shading="flat",
                    precision="float32",
                    scale=SCENE_PER_MM,
                )
            )


# --- Play and pause of a rotation: a clock of its own that stops with its session -----------------

RATE_HZ = 8.0  # pictures a second: modest, since each is sent to the page
SPEED_DEG_S = 30.0
FULL_TURN_DEG = 360.0


class Player:
    """Turns an angle on while it plays."""

    def __init__(self, ask: Callable[[], None]) -> None:
        self._ask = ask
        self._lock = threading.Lock()
        self._cancel: threading.Event | None = None
        self._angle = 0.0

    @property
    def playing(self) -> bool:
        """Whether it turns."""
        return self._cancel is not None

    @property
    def angle_deg(self) -> float:
        """How far it has turned, degrees, 0 … 360."""
        return self._angle

    def play(self) -> None:
        """Turn on from where it was paused; one thread at a time."""
        with self._lock:
            if self._cancel is not None:
                return
            cancel = threading.Event()
            self._cancel = cancel
        threading.Thread(
            target=self._run, args=(cancel,), name="warpspace-rotation", daemon=True
        ).start()

    def pause(self) -> None:
        """Stand still."""
        with self._lock:
            cancel, self._cancel = self._cancel, None
        if cancel is not None:
            cancel.set()

    def rewind(self) -> bool:
        """Stand still where the play began; tell whether there was anything to take back."""
        moved = self.playing or self._angle != 0.0
        self.pause()
        self._angle = 0.0
        return moved

    def _run(self, cancel: threading.Event) -> None:
        """Turn at a steady rate until cancelled; time lost is skipped, not made up for."""
        before = time.monotonic()
        while not cancel.wait(1.0 / RATE_HZ):
            now = time.monotonic()
            self._angle = (self._angle + SPEED_DEG_S * min(now - before, 0.5)) % FULL_TURN_DEG
            before = now
            self._ask()
