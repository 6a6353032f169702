"""Picked points: their selection by a click, and the contributions to their error."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.interpolate import make_interp_spline

from warpspace.analysis.commands.contributions import Explanation, PointContribution, explain
from warpspace.analysis.commands.distance import Distance, DistanceResult
from warpspace.analysis.uncertainty.propagation import FieldUncertainty, field_uncertainty
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState, Picked
from warpspace.app.state.form_values import option_values, read_form, with_form
from warpspace.app.state.leaf import Identity
from warpspace.exceptions import WarpspaceError
from warpspace.field.evaluate import ErrorField, evaluate_exact, evaluate_first_order
from warpspace.field.grid import seen_from_workpiece
from warpspace.geometry.rays import pick_point, pick_surface
from warpspace.geometry.surfaces import deform
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, nominal_point
from warpspace.kinematics.model import Coordinates, Loop
from warpspace.machine.axes import is_linear
from warpspace.picture.formatting import spell_at
from warpspace.picture.map_mesh import solid_map
from warpspace.picture.traces import TraceLine, is_moved
from warpspace.units import Array

TOLERANCE_RAD = 0.0032  # from a click to a trace: about seven pixels of the default view
BETWEEN = 5  # points per sample of a trace: one degree apart
REACH_MM = 1e7  # largest distance of a camera


@dataclass(frozen=True)
class PointExplanation:
    """Error of a picked point, its contributions, and its place in the drawing."""

    at: Mapping[str, float]  # mm or degrees; positions of all axes
    loop: Loop
    explanation: Explanation
    # [3]; from R to the drawing, on machines whose linear axes carry the workpiece
    shift_mm: Array
    drawn_mm: Array  # [3]; displaced point in the drawing
    # [3]; drawn error: the explained one, or the residual error of a compensation table
    drawn_um: Array
    uncertainty: FieldUncertainty | None  # of the explained error; None where unknown

    @property
    def is_corrected(self) -> bool:
        return not np.array_equal(self.drawn_um, self.explanation.error_um)

    @property
    def length_um(self) -> float:
        return float(np.linalg.norm(self.explanation.error_um))

    @cached_property
    def ranked(self) -> list[PointContribution]:
        """Contributions, the largest component along the error first."""
        return sorted(self.explanation.contributions, key=lambda part: -abs(part.along_um))


def pick(picture: LivePicture, origin_mm: Array, direction: Array) -> tuple[Picked, Array] | None:
    """Find the nearest point of a trace or surface on a ray, and its place in the drawing, [3]."""
    ray = np.concatenate([np.ravel(origin_mm), np.ravel(direction)]).astype(float)
    if ray.shape != (6,) or not np.isfinite(ray).all() or np.abs(ray).max() > REACH_MM:
        return None
    length = float(np.linalg.norm(ray[3:]))
    if length == 0.0:
        return None
    origin, unit = ray[:3], ray[3:] / length
    traces = _on_traces(picture, origin, unit) if picture.state.shown.traces else ()
    hits = [*traces, *_on_surfaces(picture, origin, unit)]
    if not hits:
        return None
    picked, distance = min(hits, key=lambda hit: hit[1])
    return picked, origin + distance * unit


def worst_traced(picture: LivePicture) -> tuple[TraceLine, float]:
    """Return the trace with the largest error, and the position of its axis there, degrees."""
    largest: tuple[float, TraceLine, float] | None = None
    for of in picture.traces:
        for number, line in enumerate(of.each()):
            if largest is None or line.largest_um > largest[0]:
                node = int(np.argmax(np.linalg.norm(line.error_um, axis=-1)))
                at = float(of.group.coordinates[line.trace.axis][number][node])
                largest = line.largest_um, line, at
    if largest is None:
        raise ValueError("no traces")
    return largest[1:]


def pick_worst(picture: LivePicture) -> Picked:
    """Return the node, or the traced point, with the largest position error of the picture."""
    if picture.is_rotary and picture.traced_um.any():
        line, at = worst_traced(picture)
        loop, trace = line.loop, line.trace
        return Picked({**trace.at, trace.axis: at}, loop, trace.point_mm)
    axes = picture.statistics.max_at_axes
    return Picked(
        {name: at for name, at in axes.items() if is_linear(name) or name in picture.grid.axes}
    )


def _on_surfaces(
    picture: LivePicture, origin: Array, unit: Array
) -> Iterator[tuple[Picked, float]]:
    for mapped in picture.slices or (picture,):
        points, triangles, node_of = solid_map(mapped)
        hit = pick_surface(origin, unit, points, triangles)
        if hit is not None:
            vertices, weights, distance = hit
            nodes, grid = node_of[vertices], mapped.grid
            at = {
                name: float(np.broadcast_to(values, grid.shape).reshape(-1)[nodes] @ weights)
                for name, values in grid.coordinates.items()
                if is_linear(name) or name in grid.axes
            }
            yield Picked(at), distance


def _on_traces(picture: LivePicture, origin: Array, unit: Array) -> Iterator[tuple[Picked, float]]:
    for lines in picture.traces:
        drawn = [number for number, line in enumerate(lines.each()) if is_moved(line)]
        dense = _denser(lines.actual_mm[drawn])
        hit = pick_point(origin, unit, dense.reshape(-1, 3), TOLERANCE_RAD)
        if hit is None:
            continue
        row, sample = divmod(hit[0], dense.shape[1])
        number, shape = drawn[row], lines.actual_mm.shape[:2]
        at = {
            name: float(_denser(np.broadcast_to(values, shape)[..., None])[number, sample, 0])
            for name, values in lines.group.coordinates.items()
        }
        yield Picked(at, lines.group.loop, lines.group.traces[number].point_mm), hit[1]


def pick_line(picture: LivePicture, origin_mm: Array, direction: Array) -> int | None:
    path = picture.path
    if path is None or not direction.any():
        return None
    hit = pick_point(origin_mm, direction, path.drawn_mm(picture.exaggeration), TOLERANCE_RAD)
    return None if hit is None else int(path.of.line[hit[0]])


def _denser(samples: Array) -> Array:
    last = samples.shape[1] - 1
    linear = make_interp_spline(np.arange(last + 1), samples, k=1, axis=1)
    return linear(np.linspace(0.0, last, last * BETWEEN + 1))


def explain_point(state: AppState, picked: Picked, exaggeration: float) -> PointExplanation:
    scene, model = state.active_scene(), state.scene.model
    stands = {**state.scene.workspace.positions, **state.positions, **picked.at}
    at = {name: stands.get(name, 0.0) for name in model.machine.axes}
    coordinates = {name: np.asarray(value) for name, value in at.items()}
    loop = picked.loop or state.loop
    if picked.point_mm is None:
        point = nominal_point(model, Loop.TOOL, coordinates)
        volume = state.scene.workspace.moved(state.positions)
        shift = seen_from_workpiece(model, coordinates, volume, point) - point
    else:
        side = "workpiece" if loop is Loop.WORKPIECE else "tool"
        pose = branch_pose(model, side, coordinates)
        point, shift = transforms.apply(pose, np.asarray(picked.point_mm)), np.zeros(3)
    view = state.view(loop)
    explanation = explain(model, scene.errors, coordinates, view, point)
    nominal, drawn_um = explanation.nominal_mm, explanation.error_um
    uncertainty = field_uncertainty(scene, drawn_um, coordinates, view, nominal)
    if state.controller is not None:
        drawn_um = state.controller.field(coordinates, nominal, scene, loop, nominal).error_um
    drawn = deform(nominal + shift, drawn_um, exaggeration)
    return PointExplanation(at, loop, explanation, shift, drawn, drawn_um, uncertainty)


def drawn_places(
    state: AppState, points: Sequence[Mapping[str, float]], exaggeration: float
) -> Array:
    """Compute the places of points of the surface in the drawing, [n, 3], mm."""
    stands = {**state.scene.workspace.positions, **state.positions}
    at = {
        name: np.array([point.get(name, stands.get(name, 0.0)) for point in points])
        for name in state.scene.machine.axes
    }
    drawn_mm, field = drawn_field(state, at)
    return deform(drawn_mm, field.error_um, exaggeration)


def drawn_field(
    state: AppState, at: Coordinates, *, exact: bool = False
) -> tuple[Array, ErrorField]:
    """Compute the nominal places of points in the drawing, and their errors in R, [n]."""
    scene, model, loop = state.active_scene(), state.scene.model, state.loop
    nominal = nominal_point(model, Loop.TOOL, at)
    drawn_mm = seen_from_workpiece(model, at, scene.workspace, nominal)
    if state.controller is not None:
        return drawn_mm, state.controller.field(at, nominal, scene, loop, nominal)
    solve = evaluate_exact if exact else evaluate_first_order
    return drawn_mm, solve(model, scene.errors, at, state.view(), nominal)


def with_picked(state: AppState, picked: Picked | None) -> AppState:
    return replace(state, picked=picked, lever=state.lever if picked else "")


# --- A distance between points of the map ---------------------------------------------------------

POINTS = {
    f"{Distance.name}.start": "Click the first point on the map.",
    f"{Distance.name}.end": "Click the second point.",
    f"{Distance.name}.corner": "Click the corner of an angle, or stop.",
}
"""Prompts for the points of a distance, by form; an empty form waits for a click."""


def awaited_form(state: AppState) -> str:
    """Return the form of the point that the next click sets; empty where it picks a point."""
    page = state.page
    is_open = Distance.name in page.open and page.task == Distance.task and not page.notes
    return next((form for form in POINTS if is_open and state.forms.get(form) == ""), "")


def with_clicked(state: AppState, picked: Picked) -> AppState:
    """Set the awaited point of a distance to a clicked one, or pick it."""
    point = awaited_form(state)
    if not point:
        return with_picked(state, picked)
    if picked.point_mm is not None:
        return state.noted("expected a click on the map, not on a trace")
    return with_form(state, point, spell_at(picked.at))


def measure_distance(picture: LivePicture) -> tuple[DistanceResult, Array, Array] | None:
    """Evaluate the distance of two selected points; None where they are not set.

    Also return the places of start, end and corner in the drawing, [n, 3], nominal and displaced.
    """
    return None if picture.is_difference else _measure_distance(Identity(picture))


@lru_cache(maxsize=1)  # lines and labels of one picture use it
def _measure_distance(of: Identity) -> tuple[DistanceResult, Array, Array] | None:
    picture: LivePicture = of.target
    state, option_texts = picture.drawn_state, option_values(picture.state, Distance.name)
    if not (option_texts.get("start") and option_texts.get("end")):
        return None
    scene = state.active_scene()
    try:
        distance = read_form(Distance, Distance.options(), option_texts, scene)
        distance = replace(distance, loop=state.loop)
        at = distance.places(scene, distance.corner)
        drawn_mm, field = drawn_field(state, at, exact=distance.exact)
        measurement = distance.between(scene, at, field)
    except WarpspaceError:  # reported in its section
        return None
    return measurement, drawn_mm, deform(drawn_mm, field.error_um, picture.exaggeration)
