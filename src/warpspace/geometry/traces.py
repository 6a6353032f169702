"""Traces of rotary axes: the circles and arcs that chosen points run through.

A point of the workpiece frame is carried round by the rotary axes on the workpiece side. Where a
machine has its rotary axes on the tool side, the point is taken in the tool frame.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.description import Vector
from warpspace.units import Array

SAMPLES = 121
TILT_STEP_DEG = 30.0
FULL_TURN_DEG = 360.0


@dataclass(frozen=True, slots=True)
class Trace:
    """What one trace is: which point is turned by which axis, and where the other axes stand."""

    axis: str  # the axis that turns
    point_mm: Vector  # the point in the workpiece (or tool) frame
    at: dict[str, float]  # degrees; positions of the other rotary axes of the branch
    closed: bool  # whether it is a full circle

    @property
    def label(self) -> str:
        """Name for legends, for instance ``C 0…360° at B −30°``."""
        held = ", ".join(f"{name} {value:g}°" for name, value in self.at.items())
        return f"over {self.axis}" + (f" at {held}" if held else "")


@dataclass(frozen=True, slots=True)
class TraceGroup:
    """All traces of one branch, ready to be evaluated in one go."""

    loop: Loop  # loop whose error displaces the traces
    traces: tuple[Trace, ...]  # (T,)
    # mm or degrees; axis positions, [T, n] for the rotary axes of the branch, scalar for the others
    coordinates: dict[str, Array]
    nominal_mm: Array  # [T, n, 3]; nominal points in R


def build_traces(
    model: Model,
    points_mm: Sequence[Vector],
    positions: Mapping[str, float],
    samples: int = SAMPLES,
    held: Mapping[str, Sequence[float]] | None = None,
) -> tuple[TraceGroup, ...]:
    """Lay the traces of points over every rotary axis of a machine."""
    groups: list[TraceGroup] = []
    for side, loop in (("workpiece", Loop.WORKPIECE), ("tool", Loop.TOOL)):
        rotary = [axis.name for axis in model.machine.branch(side) if not axis.is_linear]
        if not rotary or not points_mm:
            continue
        found = [
            trace
            for point in points_mm
            for axis in rotary
            for trace in _traces_of(model, axis, rotary, point, positions, held or {})
        ]
        groups.append(_group(model, side, loop, found, positions, samples))
    return tuple(groups)


def _traces_of(
    model: Model,
    axis: str,
    rotary: Sequence[str],
    point: Vector,
    positions: Mapping[str, float],
    chosen: Mapping[str, Sequence[float]],
) -> list[Trace]:
    low, high = model.machine.axes[axis].travel
    closed = high - low >= FULL_TURN_DEG
    held = {name: positions.get(name, 0.0) for name in rotary if name != axis}
    before, after = rotary[: rotary.index(axis)], rotary[rotary.index(axis) + 1 :]
    neighbour = before[-1] if before else (after[0] if after else "")
    if chosen.get(neighbour):
        return [Trace(axis, point, {**held, neighbour: at}, closed) for at in chosen[neighbour]]
    if not before:
        return [Trace(axis, point, held, closed)]
    tilting = before[-1]
    first, last = model.machine.axes[tilting].travel
    here = positions.get(tilting, 0.0)
    tilts = sorted(
        {here, *(at for at in (here - TILT_STEP_DEG, here + TILT_STEP_DEG) if first <= at <= last)}
    )
    return [Trace(axis, point, {**held, tilting: tilt}, closed) for tilt in tilts]


def _group(
    model: Model,
    side: str,
    loop: Loop,
    traces: Sequence[Trace],
    positions: Mapping[str, float],
    samples: int,
) -> TraceGroup:
    axes = model.machine.axes
    coordinates = {name: np.asarray(positions.get(name, 0.0), dtype=float) for name in axes}
    sweep = np.linspace(0.0, 1.0, samples)
    for name in {trace.axis for trace in traces} | {name for trace in traces for name in trace.at}:
        low, high = axes[name].travel
        high = min(high, low + FULL_TURN_DEG)
        coordinates[name] = np.stack(
            [
                low + (high - low) * sweep
                if trace.axis == name
                else np.full(samples, trace.at[name])
                for trace in traces
            ]
        )
    points = np.array([trace.point_mm for trace in traces])[:, None, :]
    nominal = transforms.apply(branch_pose(model, side, coordinates), points)
    return TraceGroup(loop, tuple(traces), coordinates, nominal)
