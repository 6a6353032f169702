"""Labels of points of the drawing: axes and their numbers, worst point, corners, names.

The page places them as the camera moves (`browser/overlay.js`); an offline page has them in 3-D.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine_bodies import (
    chosen_trace,
    diagnosed_guides,
    drawn_bodies,
    tool_point,
)
from warpspace.app.evaluation.point_explanation import drawn_places, explain_point, measure_distance
from warpspace.app.evaluation.scene_overlays import planned_adjusters
from warpspace.app.state.app_state import Picked
from warpspace.app.state.leaf import Identity
from warpspace.field.grid import Grid
from warpspace.geometry.colour import tick_values
from warpspace.geometry.surfaces import corners, is_thin
from warpspace.machine.axes import is_linear, parameter
from warpspace.picture import formatting
from warpspace.picture.traces import TraceLine
from warpspace.units import MICROMETRE, MINUS, MM_PER_UM, Array

AWAY = 0.13
"""Distance of the axes from the nominal box, relative to its longest edge."""
TICK = 0.022
MAX_TICKS = 4
LEVER_AT = 0.25  # place of the lever's label between point and frame


@dataclass(frozen=True, slots=True)
class Label:
    text: str
    at_mm: Array
    # "tick", "axis" (its name), "worst", "corner", "asked", "measured", "name", "note"
    kind: str = "name"
    from_mm: Array | None = None  # of axes: the label is moved away from this point
    axis: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class AxisLabels:
    """An axis beside the nominal box, with positions of the machine axis along it."""

    name: str  # "X"; "x in R" where no linear axis of the machine runs along it
    ends_mm: Array  # [2, 3]
    out: Array  # [3]; direction of its ticks
    ticks: tuple[tuple[str, Array], ...]  # number and place


def axes(picture: LivePicture) -> tuple[AxisLabels, ...]:
    """Build the axes: X along the front, Y along the right, Z up the left of the front."""
    return _axes(Identity(picture.grid), AWAY * picture.size_mm)


@lru_cache(maxsize=32)
def _axes(of: Identity, away: float) -> tuple[AxisLabels, ...]:
    grid: Grid = of.target
    low, high = grid.bounds_mm
    frames = (
        (np.array([0.0, low[1] - away, low[2]]), np.array([0.0, -1.0, 0.0])),
        (np.array([high[0] + away, 0.0, low[2]]), np.array([1.0, 0.0, 0.0])),
        (np.array([low[0] - away, low[1], 0.0]), np.array([-1.0, 0.0, 0.0])),
    )
    labels: list[AxisLabels] = []
    for k, (foot, out) in enumerate(frames):
        along, name, sign, shift = np.eye(3)[k], grid.axes[k], 1.0, 0.0
        if name and is_linear(name):
            # position of the axis = sign × (place in R) + shift
            sign = float(grid.directions[k])
            start = float(low[k] if sign > 0.0 else high[k])
            shift = float(np.min(grid.coordinates[name])) - sign * start
        else:
            name = f"{'xyz'[k]} in R"
        first, last = sorted((sign * float(low[k]) + shift, sign * float(high[k]) + shift))
        ticks = tuple(
            (formatting.spell_coordinate(value), foot + sign * (value - shift) * along)
            for value in tick_values(first, last, MAX_TICKS)
        )
        labels.append(
            AxisLabels(name, np.stack([foot + low[k] * along, foot + high[k] * along]), out, ticks)
        )
    return tuple(labels)


def axes_room_mm(picture: LivePicture) -> Array:
    low, high = picture.grid.bounds_mm
    away = (AWAY + TICK) * picture.size_mm
    x, y, z = (low[0] - away, high[0] + away), (low[1] - away, high[1]), (low[2], high[2])
    room = [np.stack(np.meshgrid(x, y, z), axis=-1)]
    if is_thin(picture.shape):
        # a machine with at most one linear axis shows traces only
        room += [at for of in picture.traces for at in (of.nominal_mm, of.actual_mm)]
    return np.concatenate([points.reshape(-1, 3) for points in room])


def axis_labels(picture: LivePicture) -> list[Label]:
    state = picture.state
    hidden = state.machine.shown or picture.is_rotary
    if not state.shown.axes or hidden:  # numbers would cover the machine
        return []
    return _axis_labels(axes(picture), TICK * picture.size_mm)


@lru_cache(maxsize=32)
def _axis_labels(of: tuple[AxisLabels, ...], tick: float) -> list[Label]:
    labels: list[Label] = []
    for k, axis in enumerate(of):
        labels += [Label(text, at + tick * axis.out, "tick", at, k) for text, at in axis.ticks]
        middle = axis.ends_mm.mean(axis=0)
        labels.append(Label(f"{axis.name} [mm]", middle + tick * axis.out, "axis", middle, k))
    return labels


def _spell(value: float, unit: str = MICROMETRE, plus_minus: str = "") -> str:
    """Format an error: ``23.6 µm``, ``23.6 ± 1.2 µm``, from 10 mm up ``12.3 mm``."""
    if unit == MICROMETRE and abs(value) >= 1e4:
        value, unit, plus_minus = value * MM_PER_UM, "mm", ""
    return f"{value:.1f}{plus_minus} {unit}".replace("-", MINUS)


def point_labels(picture: LivePicture) -> list[Label]:
    """List the labels of points of the volume or of the traces, by priority."""
    if picture.is_rotary:
        return [*_traces(picture)]
    worst, point = [*_worst(picture)], [*_point(picture)]
    for label, other in zip(worst, point, strict=False):
        distance = np.linalg.norm(label.at_mm - other.at_mm)
        same_text = other.text.startswith(label.text.removeprefix("max "))
        if same_text and distance < TICK * picture.size_mm:
            worst = []
    acts = [Label(text, at) for text, at, _ in planned_adjusters(picture.state) if text]
    places = (*_diagnosed(picture), *_measured(picture), *_names(picture), *_corners(picture))
    return [*worst, *point, *acts, *places]


def trace_label(picture: LivePicture, line: TraceLine) -> str:
    """Name a trace by its point: ``P1 over C at B −30°``."""
    name = picture.traced_points[line.trace.point_mm]
    return f"{name} {line.trace.label}".replace("-", MINUS)


def _traces(picture: LivePicture) -> Iterator[Label]:
    """Name each trace at its largest error, the largest first."""
    for line in sorted(picture.moved_traces.values(), key=lambda line: -line.largest_um):
        worst = int(np.argmax(np.linalg.norm(line.error_um, axis=-1)))
        text = f"{trace_label(picture, line)}: {_spell(line.largest_um)}"
        yield Label(text, line.actual_mm[worst])


def _worst(picture: LivePicture) -> Iterator[Label]:
    worst = picture.worst_node
    value = float(picture.values.flat[worst])
    if picture.state.look.worst and value != 0.0:
        plus_minus, u95_um = "", picture.u95_um
        if picture.uncertainty is not None and picture.quantity == "position":
            plus_minus = formatting.u95_behind(None if u95_um is None else u95_um.item(worst))
        text = f"max {_spell(value, picture.scale.unit, plus_minus)}"
        yield Label(text, picture.drawn_mm.reshape(-1, 3)[worst], "worst")


def _corners(picture: LivePicture) -> Iterator[Label]:
    look, uncertainty = picture.state.look, picture.uncertainty
    if not look.arrows and not (look.ellipsoids and uncertainty):
        return
    is_length = picture.quantity == "position" and picture.component == "norm"
    for node in corners(picture.shape):
        if not (look.worst and is_length and node == picture.worst_node):
            plus_minus = formatting.length_words(uncertainty, int(node))
            text = _spell(float(picture.field.norm_um.flat[node]), plus_minus=plus_minus)
            yield Label(text, picture.drawn_mm.reshape(-1, 3)[node], "corner")


def _point(picture: LivePicture) -> Iterator[Label]:
    picked, state = picture.state.picked, picture.drawn_state
    if picked is None or picture.is_difference:
        return
    explained = explain_point(state, picked, picture.exaggeration)
    length = float(np.linalg.norm(explained.drawn_um))
    where = formatting.list_axes(formatting.point_axes(state.scene, explained.at))
    text = f"{length:.1f}{formatting.length_words(explained.uncertainty)} µm at {where}"
    yield Label(text, explained.drawn_mm, "asked")
    for part in explained.explanation.contributions:
        if part.key != picture.state.lever:
            continue
        point = explained.explanation.nominal_mm + explained.shift_mm
        origin = part.origin_mm + explained.shift_mm
        relation = "about" if parameter(part.key).is_rotation else "along"
        yield Label(f"{part.key} {relation} this axis", origin, "asked")
        lever = float(np.linalg.norm(part.lever_mm))
        yield Label(f"lever {lever:.0f} mm", point + LEVER_AT * (origin - point), "asked")


def _diagnosed(picture: LivePicture) -> Iterator[Label]:
    element, guides = picture.state.page.element, diagnosed_guides(picture)
    if element is not None and len(guides):
        yield Label(element.text, guides[0].mean(axis=0), "measured")


def _measured(picture: LivePicture) -> Iterator[Label]:
    measurement = measure_distance(picture)
    if measurement is None:
        return
    distance, _, (start, end, *corner) = measurement
    places = (*[(start + end) / 2.0] * 2, *corner)
    for text, at in zip(distance.lines(), places, strict=True):
        yield Label(text, at, "measured")


def _names(picture: LivePicture) -> Iterator[Label]:
    state, overlay = picture.state, picture.bench
    if overlay is not None:
        ends = overlay.drawn_mm(picture.exaggeration)[np.unique(overlay.at)]
        largest = np.linalg.norm(overlay.error_um[np.unique(overlay.at)], axis=-1).max()
        text = f"{overlay.of}: max {_spell(float(largest))}"
        factor = formatting.spell_factor(picture.exaggeration)
        yield Label(f"{text}, drawn {factor}", ends[np.argmax(ends[:, 2])])
    moved = picture.moved_traces
    name = chosen_trace(picture)
    if name:
        lengths = np.linalg.norm(moved[name].error_um, axis=-1)
        worst = int(np.argmax(lengths))
        text = f"{name}: max {_spell(float(lengths[worst]))}"
        yield Label(text, moved[name].actual_mm[worst])
    if state.machine.shown:
        drawn_mm, error_um = tool_point(picture)
        length = float(np.linalg.norm(error_um))
        yield Label(f"tool point: {_spell(length)}", drawn_mm, "asked")


def note_labels(picture: LivePicture) -> list[Label]:
    """List the flags of review notes: their numbers, at the present places in the drawing."""
    if picture.is_difference or not picture.state.review:
        return []
    state, factor = picture.drawn_state, picture.exaggeration
    bodies = drawn_bodies(picture) if picture.state.machine.shown else ()
    places: dict[str, Array] = {}
    surface_points: dict[str, Mapping[str, float]] = {}  # evaluated together
    for number, note in enumerate(picture.state.review, 1):
        text, picked = f"⚑ {number}", Picked.of_note(note)
        if picked and picked.point_mm:
            places[text] = explain_point(state, picked, factor).drawn_mm
        elif picked:
            surface_points[text] = picked.at
        elif note.on:
            vertices = [part.vertices_mm for part in bodies if part.body.frame == note.on.body]
            if vertices:
                points = np.concatenate(vertices)
                places[text] = (points.min(axis=0) + points.max(axis=0)) / 2.0
    if surface_points:
        drawn_mm = drawn_places(state, [*surface_points.values()], factor)
        places |= zip(surface_points, drawn_mm, strict=True)
    return [Label(text, at, "note") for text, at in places.items()]
