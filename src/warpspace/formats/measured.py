"""What a file of errors holds, whatever its format: the neutral form of imports and of scenes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from warpspace.analysis import blocks
from warpspace.formats.compensation.corrections import RequiredCorrections
from warpspace.formats.source import Source, SourceLine
from warpspace.machine.axes import TravelDirection, direction_index, is_linear, parameter
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.curves.simple import Directional
from warpspace.machine.curves.table import TableCurve, TwoArguments
from warpspace.scene.model import Scene
from warpspace.units import Array

FORWARD, BACKWARD, UNDIRECTED = 1, -1, 0
"""Direction of travel in which a value was taken; both where a file does not tell."""
REPEATABILITY = 4.0  # ISO 230-2, 3.17: unidirectional repeatability in standard deviations
Matrix = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class MeasuredRun:
    """One run over the positions of a series."""

    number: int
    direction: int  # 1 forward, −1 backward, 0 where not told
    values: tuple[float, ...]  # (n,), µm or µrad; not a number where a position was left out


@dataclass(frozen=True)
class ErrorSeries:
    """One error along its axis."""

    key: str  # parameter
    positions: tuple[float, ...]  # (n,), mm or degrees; ascending
    runs: tuple[MeasuredRun, ...]  # at least one
    # (n,), µm or µrad; standard uncertainties (k = 1); empty where none are given
    uncertainty: tuple[float, ...] = ()

    def _runs(self, direction: int) -> Array:
        return np.array([run.values for run in self.runs if run.direction == direction])

    def mean(self, direction: int) -> Array | None:
        """Give the mean of the runs in one direction, [n]; None where there are none.

        Forward it is x̄ᵢ↑ of ISO 230-2, backward x̄ᵢ↓.
        """
        runs = self._runs(direction)
        return np.nanmean(runs, axis=0) if len(runs) else None

    def in_direction(self, direction: int) -> Array:
        """Give the mean in a direction of travel, [n]; of both where there are no such runs."""
        mean = self.mean(direction)
        return self.values if mean is None else mean

    @property
    def values(self) -> Array:
        """Mean bidirectional error, [n], µm or µrad (x̄ᵢ); the mean of what there is otherwise."""
        means = [
            found
            for way in (FORWARD, BACKWARD, UNDIRECTED)
            if (found := self.mean(way)) is not None
        ]
        return np.mean(means, axis=0)

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

    def table(self, direction: int) -> Array:
        """Give the values of a direction of travel, the mean of both for 0, (first, second)."""
        forward = np.array(self.values)
        backward = np.array(self.backward) if self.backward else forward
        return {FORWARD: forward, BACKWARD: backward, UNDIRECTED: (forward + backward) / 2.0}[
            direction
        ]


def surface_from_directions(
    key: str,
    axes: tuple[str, str],
    positions: tuple[ArrayLike, ArrayLike],
    tables: Mapping[int, Array],
) -> ErrorSurface:
    """Build an error over two axes of its values in both directions of travel."""
    forward, backward = (
        tuple(tuple(row) for row in tables[way].tolist()) for way in (FORWARD, BACKWARD)
    )
    first, second = (tuple(np.asarray(at, dtype=float).tolist()) for at in positions)
    return ErrorSurface(key, axes, first, second, forward, () if backward == forward else backward)


@dataclass(frozen=True)
class ImportedErrors:
    """What a file holds."""

    format: str  # name of its format
    series: tuple[ErrorSeries, ...] = ()
    surfaces: tuple[ErrorSurface, ...] = ()
    constants: Mapping[str, float] = field(default_factory=dict[str, float])  # µm or µrad
    # µm or µrad; standard uncertainty of constants
    uncertainty: Mapping[str, float] = field(default_factory=dict[str, float])
    units: tuple[str, ...] = ()  # units that the file has its numbers in
    # what the file does not say and was taken for granted, a sentence each
    assumed: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()  # what else a user should know
    # where its component errors act, by kind of axis; empty where the file does not tell
    convention: Mapping[str, str] = field(default_factory=dict[str, str])
    # errors that no table but another spelling of a scene file holds: {"poly": […]}
    curves: Mapping[str, Any] = field(default_factory=dict[str, Any])

    @property
    def keys(self) -> tuple[str, ...]:
        own = [one.key for one in (*self.series, *self.surfaces)]
        return tuple(dict.fromkeys((*own, *self.constants, *self.curves)))

    @property
    def axes(self) -> tuple[str, ...]:
        own = [parameter(key).axis for key in self.keys]
        return tuple(dict.fromkeys((*own, *(axis for one in self.surfaces for axis in one.axes))))

    @property
    def size(self) -> int:
        series = sum(len(run.values) for one in self.series for run in one.runs)
        planes = sum(
            len(one.first) * len(one.second) * (2 if one.backward else 1) for one in self.surfaces
        )
        return series + planes + len(self.constants)


def merge(parts: Sequence[ImportedErrors]) -> ImportedErrors:
    merged: dict[str, Any] = {"format": " + ".join(dict.fromkeys(part.format for part in parts))}
    for name in (entry.name for entry in fields(ImportedErrors)[1:]):
        values = [getattr(part, name) for part in parts]
        if isinstance(values[0], Mapping):
            merged[name] = {key: value for table in values for key, value in table.items()}
        else:
            entries = [one for value in values for one in value]
            # an error that is given twice is refused later
            merged[name] = tuple(
                entries if name in ("series", "surfaces") else dict.fromkeys(entries)
            )
    return ImportedErrors(**merged)


@dataclass(frozen=True, kw_only=True)
class ErrorSummary:
    """One error."""

    keys: ClassVar[tuple[str, ...]] = (
        "key", "unit", "kind", "points", "runs", "directions", "range", "smallest", "largest",
        "mean_reversal", "repeatability", "uncertainty",
    )  # fmt: skip
    key: str  # values below are in the unit, µm or µrad
    # "table", "by direction", "over Z", "over Z, by direction", "constant", or the name of a curve
    kind: str
    points: int = 1
    runs: int = 0
    directions: str = ""  # "+", "-", "+ -", or empty where not told
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
    rows = [_of_series(one) for one in imported.series]
    for plane in imported.surfaces:
        values = plane.table(UNDIRECTED)
        rows.append(
            ErrorSummary(
                key=plane.key,
                kind=f"over {plane.axes[1]}{', by direction' if plane.backward else ''}",
                points=values.size,
                directions="+ -" if plane.backward else "",
                range=(plane.first[0], plane.first[-1]),
                smallest=float(values.min()),
                largest=float(values.max()),
            )
        )
    for key, value in imported.constants.items():
        standard_uncertainty = imported.uncertainty.get(key)
        row = ErrorSummary(
            key=key,
            kind="constant",
            smallest=value,
            largest=value,
            uncertainty=standard_uncertainty,
        )
        rows.append(row)
    for key, curve in imported.curves.items():
        ((kind, numbers),) = curve.items()
        last = numbers[-1][1] if kind == "harmonics" else numbers[-1]
        rows.append(
            ErrorSummary(key=key, kind=kind, points=len(numbers), smallest=last, largest=last)
        )
    return rows


def summary_table(imported: ImportedErrors) -> blocks.Table:
    """List all errors of an import."""
    rows = [
        (
            one.key, one.kind, one.points, one.runs or None, one.directions,
            f"{one.range[0]:g} … {one.range[1]:g}" if one.range else "",
            one.smallest, one.largest, one.unit, one.mean_reversal, one.uncertainty,
        )
        for one in summarise_errors(imported)
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


def _of_series(series: ErrorSeries) -> ErrorSummary:
    values, reversal, repeatability = series.values, series.reversal, series.repeatability
    if repeatability is not None and np.isnan(repeatability).all():
        repeatability = None
    directions = {run.direction for run in series.runs}
    return ErrorSummary(
        key=series.key,
        kind="table" if reversal is None else "by direction",
        points=len(series.positions),
        runs=len(series.runs),
        directions=" ".join(
            sign for sign, way in (("+", FORWARD), ("-", BACKWARD)) if way in directions
        ),
        range=(series.positions[0], series.positions[-1]),
        smallest=float(values.min()),
        largest=float(values.max()),
        mean_reversal=None if reversal is None else float(reversal.mean()),
        repeatability=None if repeatability is None else float(np.nanmax(repeatability)),
        uncertainty=max(series.uncertainty) if series.uncertainty else None,
    )


RUN_DIRECTION = {TravelDirection.FORWARD: FORWARD, TravelDirection.BACKWARD: BACKWARD}
POSITION_TOLERANCE = 1e-9  # mm or degrees: positions nearer than this are one
Point = tuple[SourceLine, float, float, float]  # line, position of both axes, value


@dataclass(frozen=True)
class ErrorTable:
    """Errors side by side: constants, those of one axis, or one over two axes."""

    axes: tuple[str, ...]  # that they are over; none for constants
    keys: tuple[str, ...]
    # positions, direction, and a value for each key
    rows: list[tuple[tuple[float, ...], int, Sequence[float]]]

    @property
    def directed(self) -> bool:
        return any(way != UNDIRECTED for _, way, _ in self.rows)


def zero_key(scene: Scene) -> str:
    """Give an error of the machine for a file of a scene without any: its value is zero."""
    axis = next(iter(scene.machine.axes))
    return f"E{'XYZABC'[direction_index(axis) + (0 if is_linear(axis) else 3)]}{axis}"


def sample_errors(corrections: RequiredCorrections) -> ImportedErrors:
    """Sample the errors of a scene at the points of a table."""
    scene = corrections.scene
    constants: dict[str, float] = {}
    series: list[ErrorSeries] = []
    planes: list[ErrorSurface] = []
    for key, curve in scene.errors.functions.items():
        row = parameter(key)
        if row.axis not in scene.machine.axes:
            continue
        if row.is_constant:
            constants[key] = float(curve.amplitude)
            continue
        count = corrections.points.get(row.axis) or max(corrections.points.values())
        at = np.linspace(*scene.axis_span(row.axis), count)
        curves = _curves_by_direction(curve)
        other = _second_axis(curve)
        tabled = all(
            isinstance(one, TableCurve | TwoArguments) for one in curves.values() or [curve]
        )
        if tabled and (other is not None or len(curve.kinks) <= count):
            at = np.array(curve.kinks)
        elif other is not None:
            at = np.union1d(at, curve.kinks)
        if other is not None:
            tables = {
                way: np.asarray(
                    part.evaluate_at(row.axis, {row.axis: at[:, None], other[0]: other[1]})
                )
                + np.zeros((len(at), len(other[1])))
                for way, part in {FORWARD: curve, BACKWARD: curve, **curves}.items()
            }
            planes.append(
                surface_from_directions(key, (row.axis, other[0]), (at, other[1]), tables)
            )
        else:
            runs = tuple(
                MeasuredRun(1, way, tuple(np.asarray(part.evaluate(at)).tolist()))
                for way, part in (curves or {UNDIRECTED: curve}).items()
            )
            series.append(ErrorSeries(key, tuple(at.tolist()), runs))
    return ImportedErrors("scene", tuple(series), tuple(planes), constants)


def to_single_direction(
    imported: ImportedErrors, corrections: RequiredCorrections
) -> ImportedErrors:
    """Give errors by direction of travel as the scene has them in the direction it looks at."""
    direction = RUN_DIRECTION.get(TravelDirection(corrections.scene.model.direction), UNDIRECTED)

    return replace(
        imported,
        series=tuple(
            ErrorSeries(
                one.key,
                one.positions,
                (MeasuredRun(1, UNDIRECTED, tuple(one.in_direction(direction).tolist())),),
            )
            for one in imported.series
        ),
        surfaces=tuple(
            replace(one, values=tuple(map(tuple, one.table(direction).tolist())), backward=())
            for one in imported.surfaces
        ),
    )


def _curves_by_direction(curve: ErrorFunction) -> dict[int, ErrorFunction]:
    if not isinstance(curve, Directional):
        return {}
    return {FORWARD: curve.forward, BACKWARD: curve.backward}


def _second_axis(curve: ErrorFunction) -> tuple[str, Array] | None:
    surfaces = [
        one
        for one in (curve, *_curves_by_direction(curve).values())
        if isinstance(one, TwoArguments)
    ]
    axes = {one.axes[1] for one in surfaces}
    if len(axes) != 1:
        return None
    at = np.unique(np.concatenate([one.positions[1] for one in surfaces]))
    return axes.pop(), at


def build_error_tables(imported: ImportedErrors) -> list[ErrorTable]:
    """Put errors over the same axes side by side, those of one axis at all their positions."""
    tables: list[ErrorTable] = []
    if imported.constants:
        row = ((), UNDIRECTED, tuple(imported.constants.values()))
        tables.append(ErrorTable((), tuple(imported.constants), [row]))
    for axis in dict.fromkeys(parameter(one.key).axis for one in imported.series):
        series = [one for one in imported.series if parameter(one.key).axis == axis]
        at = np.unique(np.concatenate([one.positions for one in series]))
        directed = any(one.reversal is not None for one in series)
        table = ErrorTable((axis,), tuple(one.key for one in series), [])
        for direction in (FORWARD, BACKWARD) if directed else (UNDIRECTED,):
            columns = [
                np.interp(at, one.positions, one.in_direction(direction)).tolist() for one in series
            ]
            found = zip(at.tolist(), *columns, strict=True)
            table.rows.extend(((q,), direction, values) for q, *values in found)
        tables.append(table)
    for plane in imported.surfaces:
        table = ErrorTable(plane.axes, (plane.key,), [])
        for direction in (FORWARD, BACKWARD) if plane.backward else (UNDIRECTED,):
            values = plane.backward if direction == BACKWARD else plane.values
            for first, row in zip(plane.first, values, strict=True):
                points = zip(plane.second, row, strict=True)
                table.rows.extend(
                    ((first, second), direction, (value,)) for second, value in points
                )
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
    for at, first_position, second_position, value in points:
        i = int(np.abs(first - first_position).argmin())
        j = int(np.abs(second - second_position).argmin())
        if (i, j) in lines:
            problem = f"{axes[0]} {first_position:g}, {axes[1]} {second_position:g}{where} stands also in line"
            at.refuse(f"{problem} {lines[i, j].line}", "every point once")
        lines[i, j] = at
        values[i, j] = value
    if np.isnan(values).any():
        i, j = (int(index) for index in np.argwhere(np.isnan(values))[0])
        problem = f"{key} has no value at {axes[0]} {first[i]:g}, {axes[1]} {second[j]:g}{where}"
        (lines.get((i, j)) or source).refuse(problem, "a value at every point of the grid")
    rows = tuple(tuple(row) for row in values.tolist())
    return ErrorSurface(key, axes, tuple(first.tolist()), tuple(second.tolist()), rows)


def build_surface_by_direction(
    key: str, axes: tuple[str, str], points: Mapping[int, Sequence[Point]], source: Source
) -> ErrorSurface:
    """Build an error of two axes from its points by direction of travel, see `plane_of`."""
    suffixes = {FORWARD: " forward", BACKWARD: " backward", UNDIRECTED: ""}
    planes = {
        way: build_surface(key, axes, own, source, suffixes[way]) for way, own in points.items()
    }
    if len(planes) == 1:
        return next(iter(planes.values()))
    if set(planes) != {FORWARD, BACKWARD}:
        expected = "+ or - in every row, or in none"
        points[UNDIRECTED][0][0].refuse("has no direction", expected)
    forward, backward = planes[FORWARD], planes[BACKWARD]
    if (forward.first, forward.second) != (backward.first, backward.second):
        problem = f"{key} has other points backward than forward"
        points[BACKWARD][0][0].refuse(problem, "the same")
    tables = {way: plane.table(UNDIRECTED) for way, plane in planes.items()}
    return surface_from_directions(key, axes, (forward.first, forward.second), tables)
