"""The linear correction, of few numbers, that leaves the smallest RMS over the volume."""

from collections.abc import Sequence

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.formats.compensation.wanted import OTHER_NODES, Wanted
from warpspace.units import Array

AXES = ("X", "Y", "Z")


def fit_linear(wanted: Wanted, allowed: Sequence[tuple[str, str]]) -> dict[tuple[str, str], float]:
    """Fit corrections of one axis in proportion to the position of another.

    Parameters
    ----------
    wanted : Wanted
    allowed : sequence of tuple of str
        Corrected axis, and axis it is in proportion to.

    Returns
    -------
    dict of tuple of str to float
        mm per mm. Where the scene holds a point still, the correction of that point counts for
        nothing.

    Raises
    ------
    OptionError
        If the machine lacks one of X, Y and Z.

    Notes
    -----
    Least squares over the working volume, its nodes weighed by their share of it. There is no
    constant part: such a controller has no place for one.
    """
    machine = wanted.scene.machine
    if missing := [axis for axis in AXES if axis not in machine.axes]:
        found_axes = ", ".join(machine.axes)
        raise OptionError(
            f"the matrix is of X, Y and Z; the machine {machine.chain} has {found_axes}, no"
            f" {missing[0]}"
        )
    places = {
        axis: np.linspace(*wanted.scene.workspace.ranges[axis], OTHER_NODES) for axis in wanted.axes
    }
    needed = wanted.corrections(places)
    weights = np.ones(())
    for _ in wanted.axes:
        along = np.ones(OTHER_NODES)
        along[[0, -1]] = 0.5
        weights = weights[..., None] * along
    at = dict(
        zip(wanted.axes, np.meshgrid(*(places[a] for a in wanted.axes), indexing="ij"), strict=True)
    )
    held = wanted.scene.reference or {}
    found: dict[tuple[str, str], float] = {}
    for target in dict.fromkeys(target for target, _ in allowed):
        sources = [axis for one, axis in allowed if one == target and axis in at]
        if target not in needed or not sources:
            continue
        columns = [at[axis] - held.get(axis, 0.0) for axis in sources]
        aim = needed[target]
        if held:
            aim = aim - _at_reference(wanted, target)
        root = np.sqrt(weights).ravel()
        matrix = np.stack([column.ravel() * root for column in columns], -1)
        solved = np.linalg.lstsq(matrix, aim.ravel() * root, rcond=None)[0]
        found |= {(target, axis): float(v) for axis, v in zip(sources, solved, strict=True)}
    return found


def _at_reference(wanted: Wanted, target: str) -> Array:
    """Give the correction at the point that is held still."""
    still = {**wanted.scene.workspace.positions, **(wanted.scene.reference or {})}
    coordinates = {axis: np.asarray(still[axis]) for axis in wanted.scene.machine.axes}
    return wanted.corrector.moves(coordinates)[target]
