"""What is written on the map: corner arrows, the worst point, scale bars."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine import machine_room_mm
from warpspace.app.evaluation.palette import palette
from warpspace.app.viewport.layers import SCENE_PER_MM, colour_bytes
from warpspace.app.viewport.layers.adding import add_ball, add_lines
from warpspace.app.viewport.layers.axes import AWAY
from warpspace.geometry.arrows import build_arrows
from warpspace.picture.marks import (
    CornerArrows,
    ScaleBar,
    WorstPoint,
    corner_arrows,
    scale_bars,
    spell_micrometres,
    worst_point,
)
from warpspace.picture.words import spell_factor
from warpspace.units import MICROMETRE, Array

RADIUS, HEAD, BALL = 0.0032, 0.034, 0.009
"""Shaft and head of an arrow, and the marker of the worst point, as parts of the longest edge."""
BAR_BELOW, BAR_GAP, BAR_TICK = 0.2, 0.055, 0.012
"""Where scale bars lie below what they belong to and each other, and their end ticks, likewise."""
CORNERS = 8


def _spell_value(value: float, unit: str) -> str:
    """Spell a largest value with its unit."""
    if unit == MICROMETRE:
        return f"max {spell_micrometres(value)}"
    return f"max {value:.1f} {unit}".replace("-", "−")


def bar_room_mm(picture: LivePicture) -> tuple[Array, float]:
    """Give the left front lower corner that scale bars lie below, [3], and the longest edge, mm."""
    if picture.state.machine.shown:
        points = machine_room_mm(picture)
        return points.min(axis=0), float(np.ptp(points, axis=0).max())
    longest = picture.size_mm
    return picture.grid.bounds_mm[0] - AWAY * longest * np.array([1.0, 1.0, 0.0]), longest


def bar_lines(picture: LivePicture) -> tuple[tuple[ScaleBar, ScaleBar], Array, Array]:
    """Lay the scale bars in front of the box, below the numbers of the X axis.

    Parameters
    ----------
    picture : LivePicture

    Returns
    -------
    bars : tuple of ScaleBar, (2,)
    lines_mm : ndarray, [6, 2, 3], mm
        Each bar with a tick at either end.
    labels_mm : ndarray, [2, 3], mm
        Right ends, where the lengths are written.
    """
    low, longest = bar_room_mm(picture)
    bars = scale_bars(longest, picture.exaggeration)
    tick = np.array([0.0, 0.0, BAR_TICK * longest])
    lines: list[Array] = []
    labels: list[Array] = []
    for number, bar in enumerate(bars):
        start = low - longest * np.array(
            [0.0, number * BAR_GAP, BAR_BELOW + 0.7 * number * BAR_GAP]
        )
        end = start + np.array([bar.drawn_mm, 0.0, 0.0])
        lines += [np.stack([start, end]), *(np.stack([p, p + tick]) for p in (start, end))]
        labels.append(end + longest * np.array([0.015, 0.0, 0.0]))
    return bars, np.stack(lines), np.stack(labels)


class AnnotationsLayer:
    """Arrows, marker, bars and their numbers.

    Parameters
    ----------
    scene : viser.SceneApi
    picture : LivePicture
    """

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._scene = scene
        self._arrows: Handle | None = None
        self._corner_labels = [
            self._label(f"/marks/corner{n}", "bottom-center") for n in range(CORNERS)
        ]
        self._ball: Handle | None = None
        self._worst = self._label("/marks/max", "bottom-center")
        self._bars = add_lines(scene, "/marks/bars", palette(picture).edge, 2.4)
        self._bar_labels = [
            self._label(f"/marks/bar{n}", "center-left", hidden=False) for n in range(2)
        ]
        self._bars_for: tuple[object, ...] = ()
        self.show(picture)

    def _label(self, name: str, anchor: Any, *, hidden: bool = True) -> Handle:
        """Add a label without text yet; one that the map may hide, or one always in front."""
        return Handle(
            self._scene.add_label(
                name, "", visible=False, font_screen_scale=0.8, anchor=anchor, depth_test=hidden
            )
        )

    def show(self, picture: LivePicture) -> None:
        """Follow the picture."""
        worst = worst_point(picture.values, picture.grid.nominal_mm, picture.drawn_mm)
        self._show_arrows(picture, worst)
        self._show_worst(picture, worst)
        self._show_bars(picture)

    def _show_arrows(self, picture: LivePicture, worst: WorstPoint) -> None:
        """Draw the displacement of the corners."""
        if not picture.state.look.arrows:
            for part in (*self._corner_labels, *([self._arrows] if self._arrows else ())):
                part.put(visible=False)
            return
        arrows = corner_arrows(
            picture.grid.shape,
            picture.grid.nominal_mm,
            picture.field.error_um,
            picture.exaggeration,
            picture.size_mm,
        )
        for label in self._corner_labels[len(arrows.norm_um) :]:
            label.put(visible=False)
        longest = picture.size_mm
        vertices, triangles = build_arrows(
            arrows.start_mm, arrows.end_mm, RADIUS * longest, HEAD * longest
        )
        if self._arrows is None or len(self._arrows.handle.vertices) != len(vertices):
            self._arrows = Handle(
                self._scene.add_mesh_simple(
                    "/marks/arrows",
                    vertices.astype(np.float32),
                    triangles.astype(np.uint32),
                    color=palette(picture).edge,
                    scale=SCENE_PER_MM,
                    cast_shadow=False,
                    receive_shadow=False,
                )
            )
        self._arrows.put(
            vertices=vertices.astype(np.float32), color=palette(picture).edge, visible=True
        )
        marked = carries_worst(picture, arrows, worst)
        for label, text, at, hidden in zip(
            self._corner_labels, arrows.texts, arrows.label_mm, marked, strict=False
        ):
            label.put(text=text, position=at * SCENE_PER_MM, visible=not hidden)

    def _show_worst(self, picture: LivePicture, found: WorstPoint) -> None:
        """Mark the largest value."""
        on = picture.state.look.worst and found.value != 0.0
        self._worst.put(visible=on)
        if self._ball is not None:
            self._ball.put(visible=on)
        if not on:
            return
        longest = picture.size_mm
        if self._ball is None:
            self._ball = add_ball(self._scene, "/marks/ball", BALL * longest, palette(picture).edge)
        self._ball.put(position=found.drawn_mm * SCENE_PER_MM, color=palette(picture).edge)
        middle = picture.grid.bounds_mm.mean(axis=0)
        outwards = np.sign(np.round(found.nominal_mm - middle, 9)) * (1.0, 1.0, 0.0)
        self._worst.put(
            text=_spell_value(found.value, picture.scale.unit),
            position=(found.drawn_mm + 0.03 * longest * outwards) * SCENE_PER_MM,
        )

    def _show_bars(self, picture: LivePicture) -> None:
        """Draw the two lengths, where they have changed."""
        state = picture.state
        on = state.look.bars
        self._bars.put(visible=on)
        for label in self._bar_labels:
            label.put(visible=on)
        bars_for = (
            Identity(picture.grid),
            picture.exaggeration,
            state.shown.dark,
            Identity(state.machine),
            Identity(state.positions),
        )
        if not on or bars_for == self._bars_for:
            return
        self._bars_for = bars_for
        bars, lines, labels = bar_lines(picture)
        self._bars.put(points=lines.astype(np.float32), colors=colour_bytes(palette(picture).edge))
        texts = (
            f"{bars[0].text} geometry",
            f"{bars[1].text} error, drawn {spell_factor(picture.exaggeration)}",
        )
        for label, text, at in zip(self._bar_labels, texts, labels, strict=True):
            label.put(text=text, position=at * SCENE_PER_MM)


def carries_worst(
    picture: LivePicture, arrows: CornerArrows, worst: WorstPoint
) -> NDArray[np.bool_]:
    """Tell which corners carry the mark of the largest error, which says the same number."""
    look = picture.state.look
    if not look.worst or look.tilts or picture.state.component != "norm":
        return np.zeros(len(arrows.norm_um), dtype=bool)
    return np.all(np.isclose(arrows.start_mm, worst.nominal_mm), axis=1)
