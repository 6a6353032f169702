"""Words beside points of the drawing: axes and their numbers, worst point, corners, names.

The page places them as the camera moves (`browser/room.js`); an offline page has them in 3-D.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from warpspace.app.evaluation.bench import BenchPicture
from warpspace.app.evaluation.budget import answer
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine import tool_point
from warpspace.app.evaluation.rotation import chosen_trace, moved_traces
from warpspace.app.viewport.marks import corner_arrows, spell_micrometres, worst_point
from warpspace.geometry.colour import tick_values
from warpspace.machine.axes import is_linear, parameter
from warpspace.picture.words import list_axes, own_axes, spell_coordinate, spell_factor
from warpspace.units import MICROMETRE, Array

AWAY = 0.13
"""Distance of the axes from the nominal box, as a part of the longest edge: the bend has room."""
TICK = 0.022
MAX_TICKS = 6
LEVER_AT = 0.25  # place of the lever's label between point and frame


@dataclass(frozen=True, slots=True)
class Label:
    """Words, and the point that they belong to."""

    text: str
    at_mm: Array
    kind: str = "name"  # "tick", "axis" (its name), "worst", "corner", "asked", "name"
    from_mm: Array | None = None  # of axes: a point that the words stand away from
    axis: int = 0


@dataclass(frozen=True, slots=True)
class Axis:
    """An axis beside the nominal box, numbered in positions of the machine's axis along it."""

    name: str  # "X"; "x in R" where no linear axis of the machine runs along it
    ends_mm: Array  # [2, 3]
    out: Array  # [3]; the way its ticks point
    ticks: tuple[tuple[str, Array], ...]  # number and place


def axes(picture: LivePicture) -> tuple[Axis, ...]:
    """Lay out the axes: X along the front, Y along the right, Z up the left of the front."""
    grid, longest = picture.grid, picture.size_mm
    low, high = grid.bounds_mm
    away = AWAY * longest
    frames = (
        (np.array([0.0, low[1] - away, low[2]]), np.array([0.0, -1.0, 0.0])),
        (np.array([high[0] + away, 0.0, low[2]]), np.array([1.0, 0.0, 0.0])),
        (np.array([low[0] - away, low[1], 0.0]), np.array([-1.0, 0.0, 0.0])),
    )
    found: list[Axis] = []
    for k, (foot, out) in enumerate(frames):
        along, name, way, shift = np.eye(3)[k], grid.axes[k], 1.0, 0.0
        if name and is_linear(name):
            # position of the axis = way × (place in R) + shift
            way = float(grid.ways[k])
            start = float(low[k] if way > 0.0 else high[k])
            shift = float(np.min(grid.coordinates[name])) - way * start
        else:
            name = f"{'xyz'[k]} in R"
        first, last = sorted((way * float(low[k]) + shift, way * float(high[k]) + shift))
        ticks = tuple(
            (spell_coordinate(value), foot + way * (value - shift) * along)
            for value in tick_values(first, last, MAX_TICKS)
        )
        found.append(
            Axis(name, np.stack([foot + low[k] * along, foot + high[k] * along]), out, ticks)
        )
    return tuple(found)


def axis_labels(picture: LivePicture) -> list[Label]:
    """Give names and numbers of the axes."""
    state = picture.state
    if not state.shown.axes or state.machine.shown:  # their numbers would cover the machine
        return []
    tick = TICK * picture.size_mm
    found: list[Label] = []
    for k, axis in enumerate(axes(picture)):
        found += [Label(text, at + tick * axis.out, "tick", at, k) for text, at in axis.ticks]
        middle = axis.ends_mm.mean(axis=0)
        found.append(Label(f"{axis.name} [mm]", middle + tick * axis.out, "axis", middle, k))
    return found


def point_labels(picture: LivePicture) -> list[Label]:
    """Give what is written beside points of the volume, what matters most first."""
    return [*_worst(picture), *_asked(picture), *_names(picture), *_corners(picture)]


def _worst(picture: LivePicture) -> Iterator[Label]:
    found = worst_point(picture.values, picture.grid.nominal_mm, picture.drawn_mm)
    if picture.state.look.worst and found.value != 0.0:
        unit = picture.scale.unit
        value = (
            spell_micrometres(found.value)
            if unit == MICROMETRE
            else f"{found.value:.1f} {unit}".replace("-", "−")
        )
        yield Label(f"max {value}", found.drawn_mm, "worst")


def _corners(picture: LivePicture) -> Iterator[Label]:
    look = picture.state.look
    if not look.arrows:
        return
    arrows = corner_arrows(
        picture.grid.shape, picture.grid.nominal_mm, picture.field.error_um, picture.exaggeration
    )
    says_max = look.worst and not look.tilts and picture.state.component == "norm"
    worst = worst_point(picture.values, picture.grid.nominal_mm, picture.drawn_mm)
    for text, start, end in zip(arrows.texts, arrows.start_mm, arrows.end_mm, strict=True):
        if not (says_max and np.allclose(start, worst.nominal_mm)):
            yield Label(text, end, "corner")


def _asked(picture: LivePicture) -> Iterator[Label]:
    picked, state = picture.state.picked, picture.drawn_state
    if picked is None or (picture.compared is not None and picture.is_difference):
        return
    found = answer(state, picked, picture.exaggeration)
    length = float(np.linalg.norm(found.drawn_um))
    where = list_axes(own_axes(state.scene, found.at))
    yield Label(f"{length:.1f} µm at {where}", found.drawn_mm, "asked")
    for part in found.explanation.contributions:
        if part.key != picture.state.lever:
            continue
        point = found.explanation.nominal_mm + found.shift_mm
        origin = part.origin_mm + found.shift_mm
        way = "about" if parameter(part.key).is_rotation else "along"
        yield Label(f"{part.key} {way} this axis", origin, "asked")
        lever = float(np.linalg.norm(part.lever_mm))
        yield Label(f"lever {lever:.0f} mm", point + LEVER_AT * (origin - point), "asked")


def _names(picture: LivePicture) -> Iterator[Label]:
    state, found = picture.state, picture.bench
    if isinstance(found, BenchPicture) and state.bench.path:
        ends = np.concatenate([other for _, other in found.lines_mm(picture.exaggeration)])
        words = f"{found.prepared.test.title}: max {spell_micrometres(found.largest_um)}"
        factor = spell_factor(picture.exaggeration)
        yield Label(f"{words}, drawn {factor}", ends[np.argmax(ends[:, 2])])
    moved = moved_traces(picture)
    name = chosen_trace(picture, moved)
    if name:
        lengths = np.linalg.norm(moved[name].error_um, axis=-1)
        worst = int(np.argmax(lengths))
        words = f"{name}: max {spell_micrometres(float(lengths[worst]))}"
        yield Label(words, moved[name].actual_mm[worst])
    if state.machine.shown:
        point = tool_point(picture)
        length = float(np.linalg.norm(point.error_um))
        yield Label(f"tool point: {spell_micrometres(length)}", point.drawn_mm, "asked")
