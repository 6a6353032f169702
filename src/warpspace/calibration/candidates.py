"""Measurements that could be made next: poses and small tests on the machine of a scene."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from warpspace.calibration.kinds.points import nominal_tip
from warpspace.calibration.readings import Readings
from warpspace.machine.axes import sort_axes
from warpspace.scene.model import Scene
from warpspace.units import Array

PLACES = (0.0, 0.5, 1.0)
TURNS_DEG = (-90.0, -60.0, -30.0, 0.0, 30.0, 60.0, 90.0, 180.0, 270.0)
ON_LINE, ON_CIRCLE = 11, 36
SESSION = "next"
"""The set-up of a measurement not made yet: a sphere put somewhere anew."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A measurement that could be made.

    Attributes
    ----------
    name : str
        In words, with the poses.
    readings : Readings
        Nominal ones.
    """

    name: str
    readings: Readings


def candidates(scene: Scene) -> tuple[Candidate, ...]:
    """List measurements that suit a machine: points, lines, circles, a sphere about rotary axes.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    tuple of Candidate
    """
    return (*_corners(scene), *_lines(scene), *_circles(scene), *_spheres(scene))


def _spans(scene: Scene) -> dict[str, tuple[float, float]]:
    """Give the axes that span the working volume, and their ranges."""
    ranges = scene.workspace.ranges
    return {name: span for name, span in ranges.items() if span[0] < span[1]}


def _at(scene: Scene, kind: str, positions: Mapping[str, Array], session: str = "") -> Readings:
    """Give nominal readings at positions of some axes."""
    count = max(len(values) for values in positions.values())
    complete = {
        name: np.broadcast_to(
            np.asarray(positions.get(name, scene.workspace.positions[name]), float), count
        ).copy()
        for name in scene.machine.axes
    }
    tip = nominal_tip(scene, complete)
    observed = np.zeros_like(tip) if kind == "points" else tip
    return Readings(
        kind, complete, tip, observed, None, (session,) * count, tuple(range(1, count + 1)), ""
    )


def _corners(scene: Scene) -> Iterator[Candidate]:
    """Go through error vectors at points of the volume, each alone."""
    spans = _spans(scene)
    for shares in product(PLACES, repeat=len(spans)):
        place = {
            name: np.array([low + share * (high - low)])
            for share, (name, (low, high)) in zip(shares, spans.items(), strict=True)
        }
        spelled = ", ".join(f"{name} {values[0]:g}" for name, values in place.items())
        yield Candidate(f"error vector at {spelled}", _at(scene, "points", place))


def _lines(scene: Scene) -> Iterator[Candidate]:
    """Go through body diagonals."""
    spans = _spans(scene)
    share = np.linspace(0.0, 1.0, ON_LINE)
    for signs in product((False, True), repeat=max(len(spans) - 1, 0)):
        towards = (False, *signs)
        place = {
            name: low + (1.0 - share if back else share) * (high - low)
            for back, (name, (low, high)) in zip(towards, spans.items(), strict=True)
        }
        spelled = ", ".join(
            f"{name} {values[0]:g} to {values[-1]:g}" for name, values in place.items()
        )
        yield Candidate(f"{ON_LINE} points on the diagonal {spelled}", _at(scene, "points", place))


def _circles(scene: Scene) -> Iterator[Candidate]:
    """Go through circles in the planes of two linear axes, low and high in the third."""
    spans = {
        name: span for name, span in _spans(scene).items() if scene.machine.axes[name].is_linear
    }
    names = sort_axes(spans)
    angle = 2.0 * np.pi * np.arange(ON_CIRCLE) / ON_CIRCLE
    for at, first in enumerate(names):
        for second in names[at + 1 :]:
            others = [name for name in names if name not in (first, second)]
            radius = 0.4 * min(spans[name][1] - spans[name][0] for name in (first, second))
            for share in PLACES[:: 2 if others else 3]:
                place = {
                    first: np.mean(spans[first]) + radius * np.cos(angle),
                    second: np.mean(spans[second]) + radius * np.sin(angle),
                }
                where = ""
                for name in others:
                    low, high = spans[name]
                    value = low + share * (high - low)
                    place[name] = np.full(ON_CIRCLE, value)
                    where += f" at {name} {value:g}"
                title = f"circle {first}{second}, radius {radius:g} mm{where}, {ON_CIRCLE} points"
                yield Candidate(title, _at(scene, "points", place))


def _spheres(scene: Scene) -> Iterator[Candidate]:
    """Go through poses about a sphere, TCP correction on, the sphere anew at two heights."""
    rotary = [name for name, axis in scene.machine.axes.items() if not axis.is_linear]
    turns = {
        name: np.array([turn for turn in TURNS_DEG if _within(scene, name, turn)])
        for name in rotary
    }
    for name in rotary:
        others = [other for other in rotary if other != name] or [""]
        for other in others:
            for turn in turns.get(other, np.zeros(1)):
                if len(turns[name]) < 2 or (other and abs(turn) > 90.0):
                    continue
                place = {name: turns[name]}
                held = ""
                if other:
                    place[other] = np.full(len(turns[name]), turn)
                    held = f" at {other} {turn:g}°"
                title = f"sphere, TCP on: {name} at {_list(turns[name])}°{held}"
                yield Candidate(title, _at(scene, "sphere-tcp", place, SESSION))


def _within(scene: Scene, name: str, turn: float) -> bool:
    """Tell whether a rotary axis reaches a position."""
    low, high = scene.machine.axes[name].travel
    return low <= turn <= high


def _list(values: Array) -> str:
    """Spell positions."""
    return ", ".join(f"{value:g}" for value in values)
