"""Traces of the rotary axes for drawing, and the error motion along one of them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpspace.analysis.axis_motion import AxisMotion, ErrorMotion, axis_motion, points_on_axis
from warpspace.analysis.blocks import Curve, Lines
from warpspace.field.evaluate import ErrorField, evaluate_first_order
from warpspace.geometry.surfaces import deform
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.definition import Vector
from warpspace.scene.model import Scene
from warpspace.units import Array, spell_fixed, spell_short

SAMPLES = 121
TILT_STEP_DEG = 30.0
FULL_TURN_DEG = 360.0


@dataclass(frozen=True, slots=True)
class Trace:
    """One trace: a point rotated by an axis, with the positions of the other rotary axes."""

    axis: str  # the axis that turns
    point_mm: Vector  # the point in the workpiece (or tool) frame
    at: dict[str, float]  # degrees; positions of the other rotary axes of the branch
    closed: bool  # True for a full circle

    @property
    def label(self) -> str:
        """Name for legends, for instance ``C 0…360° at B −30°``."""
        positions = ", ".join(f"{name} {value:g}°" for name, value in self.at.items())
        return f"over {self.axis}" + (f" at {positions}" if positions else "")


@dataclass(frozen=True, slots=True)
class TraceGroup:
    """All traces of one branch, evaluated together."""

    loop: Loop  # whose error displaces the traces
    traces: tuple[Trace, ...]  # (T,)
    # mm or degrees; axis positions, [T, n] for the rotary axes of the branch, scalar for the others
    coordinates: dict[str, Array]
    nominal_mm: Array  # [T, n, 3]; nominal points in R


def build_traces(
    model: Model,
    points_mm: Sequence[Vector],
    positions: Mapping[str, float],
    samples: int = SAMPLES,
    fixed: Mapping[str, Sequence[float]] | None = None,
) -> tuple[TraceGroup, ...]:
    """Build the traces of points over every rotary axis of a machine."""
    groups: list[TraceGroup] = []
    axes, sweep = model.machine.axes, np.linspace(0.0, 1.0, samples)
    for side, loop in (("workpiece", Loop.WORKPIECE), ("tool", Loop.TOOL)):
        rotary = [axis.name for axis in model.machine.branch(side) if not axis.is_linear]
        if not rotary or not points_mm:
            continue
        traces = [
            trace
            for point in points_mm
            for axis in rotary
            for trace in _traces_of(model, axis, rotary, point, positions, fixed or {})
        ]
        coordinates = {name: np.asarray(positions.get(name, 0.0), dtype=float) for name in axes}
        for name in rotary:
            low, high = axes[name].travel
            turn = low + (min(high, low + FULL_TURN_DEG) - low) * sweep
            still = np.ones(samples)
            coordinates[name] = np.stack(
                [
                    trace.at.get(name, 0.0) * still if trace.axis != name else turn
                    for trace in traces
                ]
            )
        points = np.array([trace.point_mm for trace in traces])[:, None, :]
        nominal = transforms.apply(branch_pose(model, side, coordinates), points)
        groups.append(TraceGroup(loop, tuple(traces), coordinates, nominal))
    return tuple(groups)


def _traces_of(
    model: Model,
    axis: str,
    rotary: Sequence[str],
    point: Vector,
    positions: Mapping[str, float],
    fixed: Mapping[str, Sequence[float]],
) -> list[Trace]:
    low, high = model.machine.axes[axis].travel
    closed = high - low >= FULL_TURN_DEG
    standing = {name: positions.get(name, 0.0) for name in rotary if name != axis}
    before, after = rotary[: rotary.index(axis)], rotary[rotary.index(axis) + 1 :]
    neighbour = before[-1] if before else (after[0] if after else "")
    if fixed.get(neighbour):
        return [Trace(axis, point, {**standing, neighbour: at}, closed) for at in fixed[neighbour]]
    if not before:
        return [Trace(axis, point, standing, closed)]
    tilting = before[-1]
    first, last = model.machine.axes[tilting].travel
    centre = positions.get(tilting, 0.0)
    neighbours = (centre - TILT_STEP_DEG, centre + TILT_STEP_DEG)
    tilts = sorted({centre, *(at for at in neighbours if first <= at <= last)})
    return [Trace(axis, point, {**standing, tilting: tilt}, closed) for tilt in tilts]


@dataclass(frozen=True)
class TraceLine:
    """One trace."""

    trace: Trace
    loop: Loop  # whose error displaces it
    nominal_mm: Array  # [n, 3]
    error_um: Array  # [n, 3]
    actual_mm: Array  # [n, 3]; displaced with the exaggeration

    @property
    def largest_um(self) -> float:
        """Largest error along it, µm."""
        return float(np.linalg.norm(self.error_um, axis=-1).max())


@dataclass(frozen=True)
class TraceLines:
    """All traces of one branch."""

    group: TraceGroup
    nominal_mm: Array  # [T, n, 3]
    error_um: Array  # [T, n, 3]
    exaggeration: float  # display factor they are drawn with

    @cached_property
    def actual_mm(self) -> Array:
        """Displaced points, [T, n, 3], mm."""
        return deform(self.nominal_mm, self.error_um, self.exaggeration)

    def each(self) -> Iterator[TraceLine]:
        lines = zip(self.group.traces, self.nominal_mm, self.error_um, self.actual_mm, strict=True)
        for trace, nominal_mm, error_um, actual_mm in lines:
            yield TraceLine(trace, self.group.loop, nominal_mm, error_um, actual_mm)


def evaluate_traces(
    scene: Scene, exaggeration: float, samples: int = SAMPLES
) -> tuple[TraceLines, ...]:
    groups: list[TraceLines] = []
    model, positions = scene.model, scene.workspace.positions
    for group in build_traces(model, scene.trace_points_mm, positions, samples):
        view, points = scene.view(group.loop), group.nominal_mm
        field = evaluate_first_order(model, scene.errors, group.coordinates, view, points)
        groups.append(TraceLines(group, points, field.error_um, exaggeration))
    return tuple(groups)


def trace_lines(groups: Sequence[TraceLines]) -> tuple[TraceLine, ...]:
    return tuple(line for group in groups for line in group.each())


LEAST_RADIUS_MM = 1e-3  # A point nearer to the axis is on it and has no direction from it
LEAST_UM = 1e-6  # traces with smaller errors count as not displaced
MOTION_SAMPLES = 181  # places of a turn: every two degrees


def is_moved(line: TraceLine) -> bool:
    return line.largest_um > LEAST_UM


def name_trace(trace: Trace) -> str:
    """Name a trace: ``C at B −30°, point (275, 0, 0) mm``."""
    positions = ", ".join(f"{axis} {spell_short(value)}°" for axis, value in trace.at.items())
    point = ", ".join(map(spell_short, trace.point_mm))
    return f"{trace.axis}{f' at {positions}' if positions else ''}, point ({point}) mm"


def evaluate_axis_motion(
    scene: Scene, line: TraceLine, evaluate: Callable[..., ErrorField] = evaluate_first_order
) -> AxisMotion | None:
    trace = line.trace
    groups = build_traces(
        scene.model,
        (trace.point_mm,),
        {**scene.workspace.positions, **trace.at},
        MOTION_SAMPLES,
        {name: (at,) for name, at in trace.at.items()},
    )
    group = next((g for g in groups if g.loop is line.loop and trace in g.traces), None)
    if group is None:
        return None
    number = group.traces.index(trace)
    nominal = group.nominal_mm[number]
    if np.ptp(nominal, axis=0).max() < LEAST_RADIUS_MM:
        return None
    coordinates = {
        name: values[number] if values.ndim == 2 else values
        for name, values in group.coordinates.items()
    }
    on_axis, above = (
        evaluate(scene.model, scene.errors, coordinates, scene.view(group.loop), point).error_um
        for point in points_on_axis(nominal)
    )
    return axis_motion(nominal, coordinates[trace.axis], on_axis, above, closed=trace.closed)


PERIODS = {1: "once a turn", 2: "twice a turn"}
POSITIVE = {
    "radial": "towards the point",
    "axial": "along the axis",
    "tilt": "leans towards the point",
}
"""Which deviation is positive."""


def motion_lines(name: str, motion: AxisMotion, part: ErrorMotion) -> Lines:
    """Build the polar chart of one deviation over the position of its axis."""
    turns = turn_words(part.times_a_turn) if motion.closed else "an arc"
    values = (
        f"peak to valley {spell_fixed(part.peak_to_valley)} {part.unit}, {turns};"
        f" {spell_fixed(part.motion_value)} {part.unit} about the average line"
    )
    towards = f"actual − nominal, + {POSITIVE[part.name]}"
    return Lines(
        "polar",
        f"{name}: {part.iso}",
        "",
        part.unit,
        (
            Curve(towards, motion.angle_deg, part.values),
            Curve("about the average line", motion.angle_deg, part.about_line, 1, "dashed"),
        ),
        note=values,
    )


def turn_words(times: int | None) -> str:
    """Format the period of a deviation: ``twice a turn``; a dash where it does not vary."""
    return "–" if times is None else PERIODS.get(times, f"{times} times a turn")
