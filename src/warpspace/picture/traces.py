"""The traces of the rotary axes as they are drawn: nominal, and displaced by their errors."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from warpspace.field.evaluate import evaluate_first_order
from warpspace.geometry.deform import deform
from warpspace.geometry.traces import SAMPLES, Trace, TraceGroup, build_traces
from warpspace.kinematics.model import Loop
from warpspace.picture.model import same_nodes
from warpspace.scene.model import Scene
from warpspace.units import Array


@dataclass(frozen=True)
class TraceLine:
    """One trace.

    Attributes
    ----------
    trace : Trace
        Which point is turned by which axis.
    loop : Loop
        Loop whose error displaces it.
    nominal_mm : ndarray, [n, 3], mm
    error_um : ndarray, [n, 3], µm
    actual_mm : ndarray, [n, 3], mm
        Where it is drawn.
    """

    trace: Trace
    loop: Loop
    nominal_mm: Array
    error_um: Array
    actual_mm: Array

    @property
    def largest_um(self) -> float:
        """Largest error along it, µm."""
        return float(np.linalg.norm(self.error_um, axis=-1).max())


@dataclass(frozen=True)
class TraceLines:
    """All traces of one branch.

    Attributes
    ----------
    group : TraceGroup
    nominal_mm : ndarray, [T, n, 3], mm
    error_um : ndarray, [T, n, 3], µm
    exaggeration : float
        Display factor they are drawn with.
    """

    group: TraceGroup
    nominal_mm: Array
    error_um: Array
    exaggeration: float

    @cached_property
    def actual_mm(self) -> Array:
        """Where they are drawn, [T, n, 3], mm."""
        return deform(self.nominal_mm, self.error_um, self.exaggeration)

    def each(self) -> Iterator[TraceLine]:
        """Give the traces one by one."""
        for number, trace in enumerate(self.group.traces):
            yield TraceLine(
                trace,
                self.group.loop,
                self.nominal_mm[number],
                self.error_um[number],
                self.actual_mm[number],
            )


def evaluate_traces(
    scene: Scene, exaggeration: float, samples: int = SAMPLES
) -> tuple[TraceLines, ...]:
    """Evaluate the traces of a scene's points over its rotary axes, seen as the scene says.

    Parameters
    ----------
    scene : Scene
        Its reference point is held still here too.
    exaggeration : float
    samples : int, optional
        Points along each trace.

    Returns
    -------
    tuple of TraceLines
        One a branch with rotary axes.
    """
    groups = build_traces(scene.model, scene.trace_points_mm, scene.workspace.positions, samples)
    return tuple(
        TraceLines(
            group,
            group.nominal_mm,
            evaluate_first_order(
                scene.model,
                scene.errors,
                group.coordinates,
                scene.view(group.loop),
                group.nominal_mm,
            ).error_um,
            exaggeration,
        )
        for group in groups
    )


def trace_lines(groups: Sequence[TraceLines]) -> tuple[TraceLine, ...]:
    """Give the traces of all branches one by one."""
    return tuple(line for group in groups for line in group.each())


def subtract_traces(
    one: Sequence[TraceLines], other: Sequence[TraceLines]
) -> tuple[TraceLines, ...]:
    """Subtract the errors of traces, one − other, where they are the same traces."""
    return tuple(
        replace(first, error_um=first.error_um - second.error_um)
        for first, second in zip(one, other, strict=False)
        if same_nodes(first.nominal_mm, second.nominal_mm)
    )
