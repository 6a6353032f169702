"""Remarks on a scene that are no errors: what a reader of its numbers should know."""

from warpspace.field.grid import Workspace
from warpspace.machine.axes import direction_index, is_linear
from warpspace.machine.description import Machine
from warpspace.machine.errors import ErrorSet, Harmonics
from warpspace.machine.parameters import PARAMETERS, ErrorKind

MANY_COSINES = 10_000_000
"""Cosines that the curves of a scene take before it is said: about a second of computing."""


def scene_notes(machine: Machine, workspace: Workspace, errors: ErrorSet) -> tuple[str, ...]:
    """Remark on volumes beyond the travel, on squareness of carried axes and on costly curves."""
    return (
        *_travel_notes(machine, workspace),
        *_carried_notes(machine, errors),
        *_costly_notes(errors),
    )


def _travel_notes(machine: Machine, workspace: Workspace) -> tuple[str, ...]:
    """Remark on axes that are drawn outside their travel."""
    notes: list[str] = []
    for name in machine.axes:
        (low, high), (first, last) = workspace.ranges[name], machine.axes[name].travel
        if low < first or high > last:
            unit = machine.axes[name].unit
            notes.append(
                f"workspace.{name} {low:g} … {high:g} {unit} reaches beyond the travel"
                f" {first:g} … {last:g} {unit}"
            )
    return tuple(notes)


def _costly_notes(errors: ErrorSet) -> tuple[str, ...]:
    """Remark on harmonics that take long to evaluate: many terms with short waves."""
    curves = [part for curve in errors.functions.values() for part in curve.parts]
    waves = [curve for curve in curves if isinstance(curve, Harmonics)]
    if sum(curve.cosines for curve in waves) <= MANY_COSINES:
        return ()
    terms = sum(len(curve.terms) for curve in waves)
    found = f"errors: {len(waves)} curves with {terms} harmonics, many of short wavelength"
    return (f"{found}: opening the scene takes seconds; fewer terms are faster",)


def _carried_notes(machine: Machine, errors: ErrorSet) -> tuple[str, ...]:
    """Remark on squareness errors of an axis that carries the axis it is measured against."""
    notes: list[str] = []
    for key in errors:
        row = PARAMETERS[key]
        if row.kind is not ErrorKind.SQUARENESS or errors.amplitude(key) == 0.0:
            continue
        own = direction_index(row.axis)
        if row.direction == own:
            continue
        branches = (machine.chain.tool, machine.chain.workpiece)
        branch = next(branch for branch in branches if row.axis in branch)
        notes += [
            f"errors.{key} turns {other} as well, which rides on {row.axis}: the angle"
            f" between them stays, the pair turns as a whole"
            for other in branch[branch.index(row.axis) + 1 :]
            if is_linear(other) and direction_index(other) == 3 - row.direction - own
        ]
    return tuple(notes)
