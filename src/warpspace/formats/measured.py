"""Imported errors independent of the file format, and their exchange with scenes."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import chain, product
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from warpspace.analysis import blocks
from warpspace.exceptions import OptionError
from warpspace.formats.compensation.corrections import RequiredCorrections
from warpspace.formats.source import Source, SourceLine
from warpspace.kinematics.relative_motion import reading_errors
from warpspace.machine.axes import (
    DIRECTIONS,
    Parameter,
    TravelDirection,
    direction_index,
    is_linear,
    parameter,
)
from warpspace.machine.curves.simple import Directional
from warpspace.machine.curves.table import TableCurve, TwoArguments
from warpspace.machine.definition import Machine
from warpspace.scene.model import Scene
from warpspace.units import Array

FORWARD, BACKWARD, UNDIRECTED = 1, -1, 0
"""Direction of travel of a reading; undirected where a file does not state it."""
SIGNS = {FORWARD: "+", BACKWARD: "-", UNDIRECTED: ""}
REPEATABILITY = 4.0  # ISO 230-2, 3.17: unidirectional repeatability in standard deviations
Matrix = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class MeasuredRun:
    """One measuring run over the positions of a series."""

    number: int
    direction: int  # 1 forward, −1 backward, 0 where not stated
    values: tuple[float, ...]  # (n,), µm or µrad; not a number at positions without a reading


@dataclass(frozen=True)
class ErrorSeries:
    """One error along its axis."""

    key: str  # parameter
    positions: tuple[float, ...]  # (n,), mm or degrees; ascending
    runs: tuple[MeasuredRun, ...]  # at least one
    # (n,), µm or µrad; standard uncertainties (k = 1); empty where none are stated
    uncertainty: tuple[float, ...] = ()

    @classmethod
    def undirected(cls, key: str, positions: ArrayLike, values: ArrayLike) -> "ErrorSeries":
        """Build a series of one run without direction of travel."""
        run = MeasuredRun(1, UNDIRECTED, tuple(np.asarray(values, dtype=float).tolist()))
        return cls(key, tuple(np.asarray(positions, dtype=float).tolist()), (run,))

    def _runs(self, direction: int) -> Array:
        return np.array([run.values for run in self.runs if run.direction == direction])

    def mean(self, direction: int) -> Array | None:
        """Return the mean of the runs in one direction, [n]; None without such runs.

        Forward it is x̄ᵢ↑ of ISO 230-2, backward x̄ᵢ↓.
        """
        runs = self._runs(direction)
        return np.nanmean(runs, axis=0) if len(runs) else None

    def in_direction(self, direction: int) -> Array:
        """Return the mean in a direction of travel, [n]; without such runs that of all."""
        mean = self.mean(direction)
        return self.values if mean is None else mean

    @property
    def values(self) -> Array:
        """Mean bidirectional error, [n], µm or µrad (x̄ᵢ); else the mean of the existing runs."""
        means = [self.mean(direction) for direction in (FORWARD, BACKWARD, UNDIRECTED)]
        return np.mean([mean for mean in means if mean is not None], axis=0)

    def scaled(self, key: str, factor: float) -> "ErrorSeries":
        """Return another error in proportion to this one."""
        runs = (
            replace(run, values=tuple(factor * value for value in run.values)) for run in self.runs
        )
        u = tuple(abs(factor) * value for value in self.uncertainty)
        return replace(self, key=key, runs=tuple(runs), uncertainty=u)

    @property
    def reversal(self) -> Array | None:
        """Reversal error, [n], µm or µrad (Bᵢ = x̄ᵢ↑ − x̄ᵢ↓); None where one direction is missing."""
        forward, backward = self.mean(FORWARD), self.mean(BACKWARD)
        return None if forward is None or backward is None else forward - backward

    def deviation(self, direction: int) -> Array | None:
        """Estimate the standard deviation in a direction, [n] (sᵢ); None below two runs."""
        runs = self._runs(direction)
        return np.nanstd(runs, axis=0, ddof=1) if len(runs) > 1 else None

    @property
    def repeatability(self) -> Array | None:
        """Bidirectional repeatability, [n], µm or µrad (Rᵢ of ISO 230-2); None below two runs.

        The largest of 2·sᵢ↑ + 2·sᵢ↓ + |Bᵢ|, 4·sᵢ↑ and 4·sᵢ↓.
        """
        up, down, reversal = self.deviation(FORWARD), self.deviation(BACKWARD), self.reversal
        if up is None or down is None or reversal is None:
            return None
        half = REPEATABILITY / 2.0
        bidirectional = half * (up + down) + np.abs(reversal)
        return np.max([bidirectional, REPEATABILITY * up, REPEATABILITY * down], axis=0)


@dataclass(frozen=True)
class ErrorSurface:
    """One error over two axes."""

    key: str
    axes: tuple[str, str]
    first: tuple[float, ...]  # mm or degrees; ascending positions of the two axes
    second: tuple[float, ...]
    values: Matrix  # (first, second), µm or µrad; forward values where `backward` is given
    # (first, second), µm or µrad; values for travel of the first axis in the negative direction;
    # empty where they are the same
    backward: Matrix = ()

    def scaled(self, key: str, factor: float) -> "ErrorSurface":
        """Return another error in proportion to this one."""
        forward, backward = (
            tuple(tuple(factor * value for value in row) for row in rows)
            for rows in (self.values, self.backward)
        )
        return replace(self, key=key, values=forward, backward=backward)

    def table(self, direction: int) -> Array:
        """Return the values of a direction of travel, the mean of both for 0, (first, second)."""
        forward = np.array(self.values)
        backward = np.array(self.backward or self.values)
        mean = (forward + backward) / 2.0
        return {FORWARD: forward, BACKWARD: backward, UNDIRECTED: mean}[direction]


def surface_from_directions(
    key: str,
    axes: tuple[str, str],
    positions: tuple[ArrayLike, ArrayLike],
    tables: Mapping[int, Array],
) -> ErrorSurface:
    """Build an error over two axes from its values in both directions of travel."""
    forward = tuple(map(tuple, tables[FORWARD].tolist()))
    backward = tuple(map(tuple, tables[BACKWARD].tolist()))
    first, second = (tuple(np.asarray(at, dtype=float).tolist()) for at in positions)
    return ErrorSurface(key, axes, first, second, forward, () if backward == forward else backward)


@dataclass(frozen=True)
class ImportedErrors:
    """Contents of a file of errors."""

    format: str  # name of its format
    series: tuple[ErrorSeries, ...] = ()
    surfaces: tuple[ErrorSurface, ...] = ()
    constants: Mapping[str, float] = field(default_factory=dict[str, float])  # µm or µrad
    # µm or µrad; standard uncertainty of constants
    uncertainty: Mapping[str, float] = field(default_factory=dict[str, float])
    units: tuple[str, ...] = ()  # of the numbers in the file
    # about facts that the file does not state, a sentence each
    assumed: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()  # for the user
    # convention of its component errors, by kind of axis; empty where the file does not state it
    convention: Mapping[str, str] = field(default_factory=dict[str, str])
    # errors in another form of a scene file than a table: {"poly": […]}
    curves: Mapping[str, Any] = field(default_factory=dict[str, Any])

    @property
    def keys(self) -> tuple[str, ...]:
        tabulated = [error.key for error in (*self.series, *self.surfaces)]
        return tuple(dict.fromkeys((*tabulated, *self.constants, *self.curves)))

    @property
    def axes(self) -> tuple[str, ...]:
        axes = dict.fromkeys(parameter(key).axis for key in self.keys)
        for surface in self.surfaces:
            axes |= dict.fromkeys(surface.axes)
        return tuple(axes)

    @property
    def size(self) -> int:
        series = sum(len(run.values) for series in self.series for run in series.runs)
        surfaces = sum(
            len(surface.first) * len(surface.second) * (2 if surface.backward else 1)
            for surface in self.surfaces
        )
        return series + surfaces + len(self.constants)


ErrorCurve = TypeVar("ErrorCurve", ErrorSeries, ErrorSurface)


def errors_of_readings(imported: ImportedErrors, machine: Machine | None) -> ImportedErrors:
    """Convert readings along programmed directions to the errors of the bodies that move.

    The key of a reading names the axis that moves and the direction that is sensed, as programmed.
    Constants, and errors of rotary axes except their own angle, are those of the bodies already.
    """
    return _converted(imported, machine, _reading_shares) if machine else imported


def readings_of_errors(imported: ImportedErrors, machine: Machine) -> ImportedErrors:
    """Convert errors of bodies to readings; the inverse of `errors_of_readings`.

    Raises
    ------
    OptionError
        If the frame of an axis is not parallel to the programmed directions.
    """
    return _converted(imported, machine, _error_shares)


def _converted(
    imported: ImportedErrors,
    machine: Machine,
    shares_of: Callable[[Machine, Parameter], Mapping[str, float]],
) -> ImportedErrors:
    def parts(curves: Sequence[ErrorCurve]) -> tuple[ErrorCurve, ...]:
        return tuple(
            curve.scaled(key, share)
            for curve in curves
            for key, share in shares_of(machine, parameter(curve.key)).items()
        )

    return replace(imported, series=parts(imported.series), surfaces=parts(imported.surfaces))


def _reading_shares(machine: Machine, row: Parameter) -> Mapping[str, float]:
    sensed = "XYZ"[row.direction]
    if not is_linear(row.axis):
        sensed = row.axis if row.letter == row.axis[0] else ""
    if not {row.axis, sensed} <= machine.axes.keys():
        return {row.key: 1.0}
    return reading_errors(machine, row.axis, sensed, angle=row.is_rotation)


def _error_shares(machine: Machine, row: Parameter) -> Mapping[str, float]:
    for key in (f"E{letter}{row.axis}" for letter in DIRECTIONS):
        shares = _reading_shares(machine, parameter(key))
        if {*shares} == {row.key}:
            return {key: shares[row.key]}
    raise OptionError(
        f"{row.key}: the frame of {row.axis} is inclined to the programmed directions; readings"
        " along these contain several errors"
    )


def merge(parts: Sequence[ImportedErrors]) -> ImportedErrors:
    merged: dict[str, Any] = {"format": " + ".join(dict.fromkeys(part.format for part in parts))}
    for name in (column.name for column in fields(ImportedErrors)[1:]):
        values = [getattr(part, name) for part in parts]
        if isinstance(values[0], Mapping):
            merged[name] = {key: value for table in values for key, value in table.items()}
        else:
            members = [member for group in values for member in group]
            # a repeated error is refused later
            merged[name] = tuple(
                members if name in ("series", "surfaces") else dict.fromkeys(members)
            )
    return ImportedErrors(**merged)


@dataclass(frozen=True, kw_only=True)
class ErrorSummary:
    """Summary of one error for lists."""

    json_keys: ClassVar[tuple[str, ...]] = (
        "key", "unit", "kind", "points", "runs", "directions", "range", "smallest", "largest",
        "mean_reversal", "repeatability", "uncertainty",
    )  # fmt: skip
    key: str  # values below are in the unit, µm or µrad
    # "table", "by direction", "over Z", "over Z, by direction", "constant", or the name of a curve
    kind: str
    points: int = 1
    runs: int = 0
    directions: str = ""  # "+", "-", "+ -", or empty where not stated
    range: tuple[float, float] | None = None  # first and last position, mm or degrees
    smallest: float  # of the mean
    largest: float
    # mean over the positions of the reversal error (B̄ of ISO 230-2)
    mean_reversal: float | None = None
    repeatability: float | None = None  # largest bidirectional repeatability (R of ISO 230-2)
    uncertainty: float | None = None  # largest standard uncertainty

    @property
    def unit(self) -> str:
        return parameter(self.key).unit


def summarise_errors(imported: ImportedErrors) -> list[ErrorSummary]:
    rows: list[ErrorSummary] = []
    for series in imported.series:
        values, reversal, repeatability = series.values, series.reversal, series.repeatability
        if repeatability is not None and np.isnan(repeatability).all():
            repeatability = None
        directions = {run.direction for run in series.runs if run.direction}
        rows.append(
            ErrorSummary(
                key=series.key,
                kind="table" if reversal is None else "by direction",
                points=len(series.positions),
                runs=len(series.runs),
                directions=" ".join(SIGNS[code] for code in sorted(directions, reverse=True)),
                range=(series.positions[0], series.positions[-1]),
                smallest=float(values.min()),
                largest=float(values.max()),
                mean_reversal=None if reversal is None else float(reversal.mean()),
                repeatability=None if repeatability is None else float(np.nanmax(repeatability)),
                uncertainty=max(series.uncertainty) if series.uncertainty else None,
            )
        )
    for surface in imported.surfaces:
        values = surface.table(UNDIRECTED)
        rows.append(
            ErrorSummary(
                key=surface.key,
                kind=f"over {surface.axes[1]}{', by direction' if surface.backward else ''}",
                points=values.size,
                directions="+ -" if surface.backward else "",
                range=(surface.first[0], surface.first[-1]),
                smallest=float(values.min()),
                largest=float(values.max()),
            )
        )
    for key, error in imported.constants.items():
        u = imported.uncertainty.get(key)
        rows.append(
            ErrorSummary(key=key, kind="constant", smallest=error, largest=error, uncertainty=u)
        )
    for key, curve in imported.curves.items():
        ((kind, numbers),) = curve.items()
        last = numbers[-1][1] if kind == "harmonics" else numbers[-1]
        rows.append(
            ErrorSummary(key=key, kind=kind, points=len(numbers), smallest=last, largest=last)
        )
    return rows


def summary_table(imported: ImportedErrors) -> blocks.Table:
    """Return the table of all errors of an import."""
    rows = [
        (
            error.key, error.kind, error.points, error.runs or None, error.directions,
            f"{error.range[0]:g} … {error.range[1]:g}" if error.range else "",
            error.smallest, error.largest, error.unit, error.mean_reversal, error.uncertainty,
        )
        for error in summarise_errors(imported)
    ]  # fmt: skip
    columns = (
        blocks.Column("error", leads=True),
        blocks.Column("as"),
        blocks.Column("points", "d"),
        blocks.Column("runs", "d"),
        blocks.Column("direction"),
        blocks.Column("from … to"),
        *blocks.number_columns(("smallest", "largest"), ".3f"),
        blocks.Column("unit"),
        blocks.Column("reversal", ".3f"),
        blocks.Column("u", ".3f"),
    )
    return blocks.Table(columns, rows)


RUN_DIRECTION = {TravelDirection.FORWARD: FORWARD, TravelDirection.BACKWARD: BACKWARD}
POSITION_TOLERANCE = 1e-9  # mm or degrees; nearer positions are equal
Point = tuple[SourceLine, float, float, float]  # line, position of both axes, value


@dataclass(frozen=True)
class ErrorTable:
    """Errors in the columns of a table: constants, those of one axis, or one over two axes."""

    axes: tuple[str, ...]  # arguments; none for constants
    keys: tuple[str, ...]
    # positions, direction, and a value for each key
    rows: list[tuple[tuple[float, ...], int, Sequence[float]]]


def zero_key(scene: Scene) -> str:
    """Return an error parameter of the machine, written as zero for a scene without errors."""
    axis = next(iter(scene.machine.axes))
    return f"E{'XYZABC'[direction_index(axis) + (0 if is_linear(axis) else 3)]}{axis}"


def sample_errors(corrections: RequiredCorrections) -> ImportedErrors:
    """Compute the errors of a scene at the points of a table."""
    scene = corrections.scene
    constants: dict[str, float] = {}
    series: list[ErrorSeries] = []
    surfaces: list[ErrorSurface] = []
    for key, curve in scene.errors.functions.items():
        row = parameter(key)
        if row.axis not in scene.machine.axes:
            continue
        if row.is_constant:
            constants[key] = float(curve.amplitude)
            continue
        count = corrections.points.get(row.axis) or max(corrections.points.values())
        at = np.linspace(*scene.axis_span(row.axis), count)
        parts = {UNDIRECTED: curve}
        if isinstance(curve, Directional):
            parts = {FORWARD: curve.forward, BACKWARD: curve.backward}
        planes = [part for part in parts.values() if isinstance(part, TwoArguments)]
        axes = {plane.axes[1] for plane in planes}
        is_surface = len(axes) == 1
        is_table = all(isinstance(part, TableCurve | TwoArguments) for part in parts.values())
        if is_table and (is_surface or len(curve.kinks) <= count):
            at = np.array(curve.kinks)
        elif is_surface:
            at = np.union1d(at, curve.kinks)
        if is_surface:
            (axis,) = axes
            places = np.unique(np.concatenate([plane.positions[1] for plane in planes]))
            arguments = {row.axis: at[:, None], axis: places}
            shape = (len(at), len(places))
            tables = {
                direction: np.broadcast_to(
                    parts.get(direction, curve).evaluate_at(row.axis, arguments), shape
                )
                for direction in (FORWARD, BACKWARD)
            }
            surfaces.append(surface_from_directions(key, (row.axis, axis), (at, places), tables))
        else:
            runs = tuple(
                MeasuredRun(1, direction, tuple(np.asarray(part.evaluate(at)).tolist()))
                for direction, part in parts.items()
            )
            series.append(ErrorSeries(key, tuple(at.tolist()), runs))
    return ImportedErrors("scene", tuple(series), tuple(surfaces), constants)


def build_error_tables(imported: ImportedErrors) -> list[ErrorTable]:
    """Build tables of errors with the same arguments, those of one axis at all their positions."""
    tables: list[ErrorTable] = []
    if imported.constants:
        row = ((), UNDIRECTED, tuple(imported.constants.values()))
        tables.append(ErrorTable((), tuple(imported.constants), [row]))
    for axis in dict.fromkeys(parameter(error.key).axis for error in imported.series):
        errors = [error for error in imported.series if parameter(error.key).axis == axis]
        at = np.unique(np.concatenate([error.positions for error in errors]))
        directed = any(error.reversal is not None for error in errors)
        table = ErrorTable((axis,), tuple(error.key for error in errors), [])
        for direction in (FORWARD, BACKWARD) if directed else (UNDIRECTED,):
            columns = [
                np.interp(at, error.positions, error.in_direction(direction)).tolist()
                for error in errors
            ]
            for q, *numbers in zip(at.tolist(), *columns, strict=True):
                table.rows.append(((q,), direction, numbers))
        tables.append(table)
    for surface in imported.surfaces:
        table = ErrorTable(surface.axes, (surface.key,), [])
        points = list(product(surface.first, surface.second))
        for direction in (FORWARD, BACKWARD) if surface.backward else (UNDIRECTED,):
            matrix = surface.backward if direction == BACKWARD else surface.values
            for point, error in zip(points, chain.from_iterable(matrix), strict=True):
                table.rows.append((point, direction, (error,)))
        tables.append(table)
    return tables


def distinct_positions(at: np.ndarray) -> np.ndarray:
    ordered = np.sort(at)
    return ordered[np.concatenate([[True], np.diff(ordered) > POSITION_TOLERANCE])]


def build_surface(
    key: str, axes: tuple[str, str], points: Sequence[Point], source: Source, where: str = ""
) -> ErrorSurface:
    first = distinct_positions(np.array([point[1] for point in points]))
    second = distinct_positions(np.array([point[2] for point in points]))
    values = np.full((len(first), len(second)), math.nan)
    lines: dict[tuple[int, int], SourceLine] = {}
    for at, q1, q2, error in points:
        i, j = int(np.abs(first - q1).argmin()), int(np.abs(second - q2).argmin())
        if (i, j) in lines:
            problem = f"{axes[0]} {q1:g}, {axes[1]} {q2:g}{where} repeats line {lines[i, j].line}"
            at.refuse(problem, "every point once")
        lines[i, j] = at
        values[i, j] = error
    if np.isnan(values).any():
        i, j = (int(index) for index in np.argwhere(np.isnan(values))[0])
        problem = f"{key} has no value at {axes[0]} {first[i]:g}, {axes[1]} {second[j]:g}{where}"
        (lines.get((i, j)) or source).refuse(problem, "a value at every point of the grid")
    rows = tuple(tuple(row) for row in values.tolist())
    return ErrorSurface(key, axes, tuple(first.tolist()), tuple(second.tolist()), rows)


def build_surface_by_direction(
    key: str, axes: tuple[str, str], points: Mapping[int, Sequence[Point]], source: Source
) -> ErrorSurface:
    """Build an error over two axes from its points by direction of travel; see `build_surface`."""
    suffixes = {FORWARD: " forward", BACKWARD: " backward", UNDIRECTED: ""}
    surfaces = {
        direction: build_surface(key, axes, in_direction, source, suffixes[direction])
        for direction, in_direction in points.items()
    }
    if len(surfaces) == 1:
        return next(iter(surfaces.values()))
    if set(surfaces) != {FORWARD, BACKWARD}:
        points[UNDIRECTED][0][0].refuse("has no direction", "+ or - in every row, or in none")
    forward, backward = surfaces[FORWARD], surfaces[BACKWARD]
    if (forward.first, forward.second) != (backward.first, backward.second):
        problem = f"{key} has different points backward and forward"
        points[BACKWARD][0][0].refuse(problem, "the same points")
    tables = {direction: surface.table(UNDIRECTED) for direction, surface in surfaces.items()}
    return surface_from_directions(key, axes, (forward.first, forward.second), tables)
