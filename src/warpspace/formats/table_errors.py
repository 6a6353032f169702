"""Errors behind the tables of a controller: what it corrects is taken for the error itself."""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from warpspace.formats.kind import ReadOptions
from warpspace.formats.measured import (
    BACKWARD,
    BOTH,
    FORWARD,
    Imported,
    Plane,
    Run,
    Series,
    plane_by_direction,
)
from warpspace.formats.numbers import DEG_TO_URAD, MM_TO_UM, RAD_TO_URAD
from warpspace.formats.source import Source
from warpspace.formats.terms import Affine, Grid3, Line, Product, Tables
from warpspace.machine.axes import direction_index, is_linear
from warpspace.machine.description import Machine
from warpspace.units import Array

SQUARENESS = {("X", "Y"): ("EC0Y", -1.0), ("X", "Z"): ("EB0Z", 1.0), ("Y", "Z"): ("EA0Z", -1.0)}
"""Squareness that an error of the first axis in proportion to the second one is, and its sign."""
WAYS = (FORWARD, BACKWARD)
NEGLIGIBLE = 1e-9
"""µm or µrad."""


def errors_of(tables: Tables, name: str, source: Source, options: ReadOptions) -> Imported:
    """Give the errors that the tables of a controller correct.

    Parameters
    ----------
    tables : Tables
    name : str
        Of the format.
    source : Source
        For messages.
    options : ReadOptions

    Returns
    -------
    Imported

    Raises
    ------
    SceneError
        If a correction is none of an error that the machine can have.
    """
    machine = options.machine
    lines = [term for term in tables.terms if isinstance(term, Line)]
    series = [_series(key, parts, machine) for key, parts in _by_key(lines, source).items()]
    planes = [_plane(term, machine, source) for term in tables.terms if isinstance(term, Product)]
    notes = list(tables.notes)
    for term in tables.terms:
        if isinstance(term, Grid3):
            found, left = _grid_planes(term, machine)
            planes += found
            if left > NEGLIGIBLE:
                notes.append(
                    f"up to {left:.3g} µm depend on all three axes together, which no error of two"
                    " axes holds: left out"
                )
    series, planes = _joined(series, planes, source)
    constants: dict[str, float] = {}
    curves: dict[str, object] = {}
    for term in tables.terms:
        if isinstance(term, Affine):
            _affine(term, machine, constants, curves)
    side = "" if machine is not None else " (all axes taken to carry the tool)"
    assumed = (*tables.assumed, f"what the table corrects is taken for the whole error{side}")
    return Imported(
        name,
        tuple(one for one in series if _matters(one)),
        tuple(planes),
        constants,
        units=tables.units,
        assumed=assumed,
        notes=tuple(notes),
        curves=curves,
    )


def error_key(source_axis: str, target: str) -> str:
    """Name the error of one axis that shows as a displacement of another: EXY for X over Y."""
    letters = "XYZ" if is_linear(target) else "ABC"
    return f"E{letters[direction_index(target)]}{source_axis}"


def sense(machine: Machine | None, axis: str) -> float:
    """Give +1 where an axis moves the tool in its direction against the workpiece, else −1."""
    if machine is None or axis not in machine.axes:
        return 1.0
    return side(machine, axis) * machine.axes[axis].direction


def side(machine: Machine | None, axis: str) -> float:
    """Give +1 for an axis that carries the tool, −1 for one that carries the workpiece."""
    return -1.0 if machine is not None and axis in machine.chain.workpiece else 1.0


def _factor(machine: Machine | None, source_axis: str, target: str) -> float:
    """Factor from a correction in mm or degrees of an axis to the error in µm or µrad."""
    size = MM_TO_UM if is_linear(target) else DEG_TO_URAD
    return -size * sense(machine, target) * side(machine, source_axis)


def _by_key(lines: Sequence[Line], source: Source) -> dict[str, list[Line]]:
    """Sort tables by the error they are."""
    found: defaultdict[str, list[Line]] = defaultdict(list)
    for line in lines:
        if not is_linear(line.target) and line.source != line.target:
            source.refuse(
                f"corrects the rotary axis {line.target} over {line.source}: no error parameter"
                " is such a correction; expected tables of linear axes, or of a rotary axis itself"
            )
        found[error_key(line.source, line.target)].append(line)
    return found


def _series(key: str, parts: Sequence[Line], machine: Machine | None) -> Series:
    """Add up the tables of one error over all their positions."""
    at = np.unique(np.concatenate([part.positions for part in parts]))
    factor = _factor(machine, parts[0].source, parts[0].target)
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite the scene refuses
        ways = {way: factor * np.sum([part.at(at, way) for part in parts], axis=0) for way in WAYS}
    if np.array_equal(ways[FORWARD], ways[BACKWARD]):
        runs = (Run(1, BOTH, tuple(ways[FORWARD].tolist())),)
    else:
        runs = tuple(Run(1, way, tuple(values.tolist())) for way, values in ways.items())
    return Series(key, tuple(at.tolist()), runs)


def _plane(term: Product, machine: Machine | None, source: Source) -> Plane:
    """Spell a product of tables as an error of two axes, by direction where they are."""
    one, other = term.first, term.second
    if one.source == other.source or not is_linear(one.target):
        source.refuse(
            f"multiplies tables over {one.source} and {other.source} for {one.target}; expected"
            " tables over two axes that correct a linear axis"
        )
    factor = _factor(machine, one.source, one.target)
    first, second = np.meshgrid(one.positions, other.positions, indexing="ij")
    tables = {way: factor * term.at(first, second, way) for way in WAYS}
    key = error_key(one.source, one.target)
    return plane_by_direction(
        key, (one.source, other.source), (one.positions, other.positions), tables
    )


def _grid_planes(term: Grid3, machine: Machine | None) -> tuple[list[Plane], float]:
    """Split a grid of corrections into errors of two axes each; give what is left over, µm."""
    planes: list[Plane] = []
    left = 0.0
    for index, target in enumerate(term.axes):
        values = term.values[..., index]
        over = {
            axes: values.mean(axis=axes, keepdims=True)
            for axes in ((0,), (1,), (2,), (0, 1), (0, 2), (1, 2), (0, 1, 2))
        }
        parts = {
            (0, 1): over[2,],
            (1, 2): over[0,] - over[0, 2],
            (2, 0): over[1,] - over[1, 2] - over[0, 1] + over[0, 1, 2],
        }
        rest = np.abs(values - sum(parts.values())).max()
        left = max(left, float(rest) * MM_TO_UM)
        for (first, second), part in parts.items():
            flat = part.squeeze(axis=3 - first - second)
            table = flat if first < second else flat.T
            axis = term.axes[first]
            planes.append(
                Plane(
                    error_key(axis, target),
                    (axis, term.axes[second]),
                    term.positions[first],
                    term.positions[second],
                    _rows(_factor(machine, axis, target) * table),
                )
            )
    return [plane for plane in planes if np.abs(plane.values).max() > NEGLIGIBLE], left


def _joined(
    series: list[Series], planes: list[Plane], source: Source
) -> tuple[list[Series], list[Plane]]:
    """Put a series and planes of one error together: a scene has one curve for each."""
    joined: dict[tuple[str, tuple[str, str]], Plane] = {}
    for plane in planes:
        place = (plane.key, plane.axes)
        joined[place] = _added(joined[place], plane) if place in joined else plane
    keys = [key for key, _ in joined]
    if twice := next((key for key in keys if keys.count(key) > 1), ""):
        source.refuse(f"has products of {twice} with two other axes; expected one for each error")
    left: list[Series] = []
    for one in series:
        place = next((place for place in joined if place[0] == one.key), None)
        if place is None:
            left.append(one)
            continue
        ends = (joined[place].second[0], joined[place].second[-1])
        columns = {
            way: np.repeat((one.values if mean is None else mean)[:, None], 2, axis=1)
            for way in WAYS
            for mean in (one.mean(way),)
        }
        own = plane_by_direction(one.key, place[1], (one.positions, ends), columns)
        joined[place] = _added(joined[place], own)
    return left, list(joined.values())


def _added(one: Plane, other: Plane) -> Plane:
    """Add two planes over all their positions."""
    first = np.union1d(one.first, other.first)
    second = np.union1d(one.second, other.second)
    totals = {
        way: _resampled(one, way, first, second) + _resampled(other, way, first, second)
        for way in WAYS
    }
    return plane_by_direction(one.key, one.axes, (first.tolist(), second.tolist()), totals)


def _resampled(plane: Plane, direction: int, first: Array, second: Array) -> Array:
    """Interpolate a plane linearly at other positions, ends held."""
    rows = np.array([np.interp(second, plane.second, row) for row in plane.table(direction)])
    return np.array([np.interp(first, plane.first, column) for column in rows.T]).T


def _rows(values: Array) -> tuple[tuple[float, ...], ...]:
    """Spell a matrix as tuples."""
    return tuple(tuple(row) for row in values.tolist())


def _affine(
    term: Affine,
    machine: Machine | None,
    constants: dict[str, float],
    curves: dict[str, object],
) -> None:
    """Spell a matrix as squareness errors, and scales and slopes along the axes."""
    for target, row in zip(term.axes, term.matrix, strict=True):
        for axis, value in zip(term.axes, row, strict=True):
            if not value:
                continue
            if (target, axis) in SQUARENESS:
                key, sign = SQUARENESS[target, axis]
                turned = sense(machine, target) * sense(machine, axis)
                constants[key] = -value * sign * turned * RAD_TO_URAD
            else:
                slope = value * _factor(machine, axis, target)
                curves[error_key(axis, target)] = {"poly": [0.0, slope]}


def _matters(one: Series) -> bool:
    """Tell whether an error is more than zero."""
    return any(abs(value) > NEGLIGIBLE for run in one.runs for value in run.values)
