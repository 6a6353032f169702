"""Terms of controller compensation: their evaluation, and the errors that they correct.

A term maps commanded positions of the axes to the correction of each axis that it acts on: the
interpolation, the behaviour at the ends and the direction of travel are those of the controller.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from warpspace.formats import measured
from warpspace.formats.source import DEG_TO_URAD, Source
from warpspace.kinematics.model import Coordinates
from warpspace.kinematics.relative_motion import angle_error, reading_errors
from warpspace.machine.axes import is_linear, sort_axes
from warpspace.machine.definition import Machine, build_machine
from warpspace.scene.text_files import list_repeated
from warpspace.units import UM_PER_MM, URAD_PER_RAD, Array


@dataclass(frozen=True)
class AxisTable:
    """A table over one axis that corrects one axis."""

    source: str  # axis of the position; the target is the corrected axis
    target: str
    positions: tuple[float, ...]  # (n,), mm or degrees; ascending
    # (n,), mm or degrees; corrections of the target, those for forward travel if `backward` is set
    values: tuple[float, ...]
    is_modulo: bool = False  # repeated with the period of the table; otherwise its ends are held
    # (n,); values for travel in the negative direction; empty if they are the same
    backward: tuple[float, ...] = ()
    direction: int = 0  # 1 or −1 if it acts in one direction of travel only, else 0

    @property
    def size(self) -> int:
        """Count of numbers in the controller."""
        return len(self.values) + len(self.backward)

    @property
    def is_directed(self) -> bool:
        return bool(self.direction or self.backward)

    def at(self, position: Array, direction: int = 0) -> Array:
        """Interpolate linearly, [...]; for direction 0 the mean of both directions."""
        if self.backward and direction == 0:
            return (self.at(position, 1) + self.at(position, -1)) / 2.0
        if self.direction and self.direction != direction:
            correction = self.at(position, self.direction)
            return correction / 2.0 if direction == 0 else np.zeros_like(correction)
        values = self.backward if self.backward and direction < 0 else self.values
        first, last = self.positions[0], self.positions[-1]
        if self.is_modulo and last > first:
            position = first + np.mod(position - first, last - first)
        return np.interp(position, self.positions, values)

    def corrections(self, coordinates: Coordinates, direction: int = 0) -> dict[str, Array]:
        """Return the corrections of commanded positions, mm or degrees, by axis."""
        return {self.target: self.at(coordinates[self.source], direction)}


@dataclass(frozen=True)
class Product:
    """The product of two tables, a correction of the target of the first."""

    first: AxisTable  # the corrections by the tables themselves are not included
    second: AxisTable
    sign: float = 1.0  # −1 if the controller subtracts the product

    @property
    def size(self) -> int:
        """Zero: both tables are counted already."""
        return 0

    def corrections(self, coordinates: Coordinates, direction: int = 0) -> dict[str, Array]:
        first, second = (np.asarray(coordinates[line.source]) for line in (self.first, self.second))
        return {self.first.target: self.at(first, second, direction)}

    def at(self, first: Array, second: Array, direction: int = 0) -> Array:
        """Multiply both tables at positions of their axes; for direction 0 the mean of both."""
        if direction == 0 and (self.first.is_directed or self.second.is_directed):
            return (self.at(first, second, 1) + self.at(first, second, -1)) / 2.0
        return self.sign * self.first.at(first, direction) * self.second.at(second, direction)


@dataclass(frozen=True)
class Grid3:
    """Corrections of three axes at the points of a grid, trilinear between them."""

    axes: tuple[str, str, str]
    positions: tuple[tuple[float, ...], ...]  # (3, n); ascending, of each axis
    # [n1, n2, n3, 3], mm; corrections; beyond the grid those of its boundary
    values: Array

    @property
    def size(self) -> int:
        return int(self.values.size)

    def corrections(self, coordinates: Coordinates, direction: int = 0) -> dict[str, Array]:
        from scipy.interpolate import RegularGridInterpolator

        del direction
        points = np.broadcast_arrays(*(coordinates[axis] for axis in self.axes))
        pairs = zip(points, self.positions, strict=True)
        clipped = np.stack([np.clip(at, along[0], along[-1]) for at, along in pairs], axis=-1)
        positions = tuple(map(np.array, self.positions))
        interpolated = RegularGridInterpolator(positions, self.values)(clipped)
        return {axis: interpolated[..., index] for index, axis in enumerate(self.axes)}


@dataclass(frozen=True)
class Affine:
    """Corrections that are linear in the commanded positions."""

    axes: tuple[str, ...]  # (n,)
    # (n, n); correction of the row's axis per position of the column's axis
    matrix: tuple[tuple[float, ...], ...]

    @property
    def size(self) -> int:
        return sum(1 for row in self.matrix for value in row if value)

    def corrections(self, coordinates: Coordinates, direction: int = 0) -> dict[str, Array]:
        del direction
        at = [np.asarray(coordinates[axis], dtype=float) for axis in self.axes]
        return {
            axis: sum((weight * q for weight, q in zip(row, at, strict=True)), np.zeros(()))
            for axis, row in zip(self.axes, self.matrix, strict=True)
        }


Term: TypeAlias = AxisTable | Product | Grid3 | Affine
"""One additive term of a controller's compensation."""


@dataclass(frozen=True)
class Tables:
    """The compensation of a controller, as read from its files."""

    terms: tuple[Term, ...]  # their corrections are added
    assumed: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    units: tuple[str, ...] = ("mm",)

    @property
    def size(self) -> int:
        return sum(term.size for term in self.terms)

    def corrections(self, coordinates: Coordinates, direction: int = 0) -> Mapping[str, Array]:
        total: dict[str, Array] = {}
        for term in self.terms:
            for axis, value in term.corrections(coordinates, direction).items():
                total[axis] = total[axis] + value if axis in total else np.asarray(value)
        return total


DIRECTIONS: tuple[int, ...] = (measured.FORWARD, measured.BACKWARD)
NEGLIGIBLE = 1e-9  # µm or µrad


def errors_from_tables(
    tables: Tables, name: str, source: Source, machine: Machine | None = None
) -> measured.ImportedErrors:
    carried = "" if machine is not None else ", and all axes carry the tool"
    machine = machine or _tool_side_machine(tables)
    lines = [term for term in tables.terms if isinstance(term, AxisTable)]
    series = [_series(key, parts) for key, parts in _by_key(lines, machine, source).items()]
    surfaces: list[measured.ErrorSurface] = []
    constants: dict[str, float] = {}
    curves: dict[str, object] = {}
    notes = list(tables.notes)
    for term in tables.terms:
        if isinstance(term, Product):
            surfaces += _product_surfaces(term, machine, source)
        elif isinstance(term, Grid3):
            grid_surfaces, ignored_um = _grid_surfaces(term, machine)
            surfaces += grid_surfaces
            if ignored_um > NEGLIGIBLE:
                notes.append(
                    f"ignored up to {ignored_um:.3g} µm that depend on all three axes together: no"
                    " error parameter does"
                )
        elif isinstance(term, Affine):
            _affine(term, machine, constants, curves)
    series, surfaces = _merged(series, surfaces, source)
    series = [
        error for error in series if np.any(np.abs([run.values for run in error.runs]) > NEGLIGIBLE)
    ]
    assumed = (*tables.assumed, f"the table corrects the entire error{carried}")
    return measured.ImportedErrors(
        name,
        tuple(series),
        tuple(surfaces),
        constants,
        units=tables.units,
        assumed=assumed,
        notes=tuple(notes),
        curves=curves,
    )


def _tool_side_machine(tables: Tables) -> Machine:
    axes: set[str] = set()
    for term in tables.terms:
        if isinstance(term, Grid3 | Affine):
            axes |= {*term.axes}
        else:
            parts = (term.first, term.second) if isinstance(term, Product) else (term,)
            axes |= {axis for part in parts for axis in (part.source, part.target)}
    return build_machine(f"wF{''.join(sort_axes(axes or 'X'))}t")  # a chain has an axis


def _factors(machine: Machine, moving: str, target: str) -> dict[str, float]:
    """Return the errors that a correction of an axis compensates, µm or µrad per mm or degree."""
    size = UM_PER_MM if is_linear(target) else DEG_TO_URAD
    return {key: -size * share for key, share in reading_errors(machine, moving, target).items()}


def _by_key(
    lines: Sequence[AxisTable], machine: Machine, source: Source
) -> dict[str, list[tuple[float, AxisTable]]]:
    parts_by_key: defaultdict[str, list[tuple[float, AxisTable]]] = defaultdict(list)
    for line in lines:
        if not is_linear(line.target) and line.source != line.target:
            source.refuse(
                f"corrects the rotary axis {line.target} over {line.source}, which no error"
                " parameter represents",
                "tables of linear axes, or of a rotary axis over itself",
            )
        for key, factor in _factors(machine, line.source, line.target).items():
            parts_by_key[key].append((factor, line))
    return parts_by_key


def _series(key: str, parts: Sequence[tuple[float, AxisTable]]) -> measured.ErrorSeries:
    at = np.unique(np.concatenate([line.positions for _, line in parts]))
    with np.errstate(over="ignore", invalid="ignore"):  # the scene refuses what is not finite
        forward, backward = (
            np.sum([factor * line.at(at, direction) for factor, line in parts], axis=0)
            for direction in DIRECTIONS
        )
    if np.array_equal(forward, backward):
        return measured.ErrorSeries.undirected(key, at, forward)
    runs = (
        measured.MeasuredRun(1, measured.FORWARD, tuple(forward.tolist())),
        measured.MeasuredRun(1, measured.BACKWARD, tuple(backward.tolist())),
    )
    return measured.ErrorSeries(key, tuple(at.tolist()), runs)


def _product_surfaces(
    term: Product, machine: Machine, source: Source
) -> Iterator[measured.ErrorSurface]:
    axes, target = (term.first.source, term.second.source), term.first.target
    if axes[0] == axes[1] or not is_linear(target):
        source.refuse(
            f"multiplies tables over {axes[0]} and {axes[1]} for {target}",
            "tables over two axes that correct a linear axis",
        )
    places = (term.first.positions, term.second.positions)
    first, second = np.meshgrid(*places, indexing="ij")
    for key, factor in _factors(machine, axes[0], target).items():
        tables = {direction: factor * term.at(first, second, direction) for direction in DIRECTIONS}
        yield measured.surface_from_directions(key, axes, places, tables)


def _grid_surfaces(term: Grid3, machine: Machine) -> tuple[list[measured.ErrorSurface], float]:
    surfaces: list[measured.ErrorSurface] = []
    ignored_um = 0.0
    for index, target in enumerate(term.axes):
        values = term.values[..., index]
        means = {
            axes: values.mean(axis=axes, keepdims=True)
            for axes in ((0,), (1,), (2,), (0, 1), (0, 2), (1, 2), (0, 1, 2))
        }
        parts = {
            (0, 1): means[2,],
            (1, 2): means[0,] - means[0, 2],
            (2, 0): means[1,] - means[1, 2] - means[0, 1] + means[0, 1, 2],
        }
        remainder = np.abs(values - sum(parts.values())).max()
        ignored_um = max(ignored_um, float(remainder) * UM_PER_MM)
        for (first, second), part in parts.items():
            flat = part.squeeze(axis=3 - first - second)
            table = flat if first < second else flat.T
            axes = (term.axes[first], term.axes[second])
            places = (term.positions[first], term.positions[second])
            for key, factor in _factors(machine, axes[0], target).items():
                scaled: Array = factor * table
                tables = dict.fromkeys(DIRECTIONS, scaled)
                surfaces.append(measured.surface_from_directions(key, axes, places, tables))
    large = [surface for surface in surfaces if np.abs(surface.values).max() > NEGLIGIBLE]
    return large, ignored_um


def _merged(
    series: list[measured.ErrorSeries], surfaces: list[measured.ErrorSurface], source: Source
) -> tuple[list[measured.ErrorSeries], list[measured.ErrorSurface]]:
    """Add surfaces with the same arguments, and each series to the surface of its error."""
    merged: dict[tuple[str, tuple[str, str]], measured.ErrorSurface] = {}
    for surface in surfaces:
        place = (surface.key, surface.axes)
        merged[place] = _added(merged[place], surface) if place in merged else surface
    repeated = list_repeated(key for key, _ in merged)
    if repeated:
        source.refuse(f"has products of {repeated[0]} with two other axes", "one per error")
    single_axis: list[measured.ErrorSeries] = []
    for error in series:
        place = next((place for place in merged if place[0] == error.key), None)
        if place is None:
            single_axis.append(error)
            continue
        ends = (merged[place].second[0], merged[place].second[-1])
        columns = {
            direction: np.repeat(error.in_direction(direction)[:, None], 2, axis=1)
            for direction in DIRECTIONS
        }
        positions = (error.positions, ends)
        surface = measured.surface_from_directions(error.key, place[1], positions, columns)
        merged[place] = _added(merged[place], surface)
    return single_axis, list(merged.values())


def _added(surface: measured.ErrorSurface, other: measured.ErrorSurface) -> measured.ErrorSurface:
    first = np.union1d(surface.first, other.first)
    second = np.union1d(surface.second, other.second)
    totals = {
        direction: _resampled(surface, direction, first, second)
        + _resampled(other, direction, first, second)
        for direction in DIRECTIONS
    }
    return measured.surface_from_directions(surface.key, surface.axes, (first, second), totals)


def _resampled(plane: measured.ErrorSurface, direction: int, first: Array, second: Array) -> Array:
    rows = np.array([np.interp(second, plane.second, row) for row in plane.table(direction)])
    return np.array([np.interp(first, plane.first, column) for column in rows.T]).T


def _affine(
    term: Affine, machine: Machine, constants: dict[str, float], curves: dict[str, object]
) -> None:
    for row, target in enumerate(term.axes):
        for column, axis in enumerate(term.axes):
            value = term.matrix[row][column]
            if value and row < column:  # the correction makes the angle narrower, the error wider
                key, change = angle_error(machine, target, axis)
                constants[key] = constants.get(key, 0.0) + value * URAD_PER_RAD / change
            elif value:
                for key, factor in _factors(machine, axis, target).items():
                    curves[key] = {"poly": [0.0, value * factor]}
