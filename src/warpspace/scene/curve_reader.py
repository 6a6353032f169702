"""Readers of the curves of errors in scene files, and sums of curves."""

import re
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TextIO, cast

import numpy as np

from warpspace.exceptions import OptionError, SceneError, near_miss
from warpspace.machine import limits
from warpspace.machine.axes import PARAMETERS, is_linear, parameter
from warpspace.machine.curves.curve import MISSING, ErrorFunction, Points, ValueReader, is_number
from warpspace.machine.curves.registry import find_form, spell_forms
from warpspace.machine.curves.simple import Constant, Directional, Harmonics, Poly, Ramp
from warpspace.machine.curves.table import TableCurve, TwoArguments
from warpspace.machine.definition import Gantry, default_across
from warpspace.machine.errors import BACKWARD, FORWARD, UNKNOWN, TravelRun
from warpspace.scene import text_files
from warpspace.scene.schema import Problems
from warpspace.units import Array

Weights = tuple[float, float]
MAX_SAMPLES = 20_001
SAMPLING_TOLERANCE = 1e-5  # of a sampled sum between its points, as a share of its largest value


def combine_curves(first: ErrorFunction, second: ErrorFunction, weights: Weights) -> ErrorFunction:
    span = first.span
    for curve, other, weight in ((first, second, weights[0]), (second, first, weights[1])):
        if isinstance(other, Constant) and other.value == 0.0:
            return curve.scaled(weight)
    if isinstance(first, Directional) or isinstance(second, Directional):
        forward, backward = (
            combine_curves(_directed_curve(first, name), _directed_curve(second, name), weights)
            for name in ("forward", "backward")
        )
        return Directional(span, forward, backward)
    if isinstance(first, TwoArguments) or isinstance(second, TwoArguments):
        return _surface(first, second, weights)
    match first, second:
        case (Constant(), Constant()) | (Ramp(), Ramp()) if first.span == second.span:
            return replace(first, value=weights[0] * first.value + weights[1] * second.value)
        case ((Constant() | Ramp() | Poly()), (Constant() | Ramp() | Poly())):
            parts = [
                weight * np.array(_coefficients(curve))
                for curve, weight in ((first, weights[0]), (second, weights[1]))
            ]
            return Poly(span, tuple(np.polynomial.polynomial.polyadd(*parts).tolist()))
        case ((Constant() | Harmonics()), (Constant() | Harmonics())):
            terms = _terms(first, second, weights)
            if len(terms) <= limits.MAX_TERMS:
                return Harmonics(span, terms)
        case ((Constant() | TableCurve()), (Constant() | TableCurve())):
            at = np.union1d(first.kinks, second.kinks)
            if len(at) <= limits.MAX_POINTS:
                return _table(first, second, weights, at)
        case _:
            pass
    return _sampled(first, second, weights)


def _directed_curve(curve: ErrorFunction, direction: str) -> ErrorFunction:
    return getattr(curve, direction) if isinstance(curve, Directional) else curve


def _surface(first: ErrorFunction, second: ErrorFunction, weights: Weights) -> TwoArguments:
    surfaces = [curve for curve in (first, second) if isinstance(curve, TwoArguments)]
    axes = surfaces[0].axes
    if any(surface.axes != axes for surface in surfaces):
        names = " and on ".join(surface.axes[1] for surface in surfaces)
        raise OptionError(f"guides depend on {names}; expected one second axis")
    zero = Constant(first.span)
    plain = [
        curve
        if isinstance(curve, TwoArguments | Constant | TableCurve)
        else _sampled(curve, zero, (1.0, 0.0))
        for curve in (first, second)
    ]
    first_q = np.unique(np.concatenate([np.array(curve.kinks) for curve in plain]))
    second_q = np.unique(np.concatenate([np.array(s.positions[1]) for s in surfaces]))
    count = len(first_q) * len(second_q)
    if count > limits.MAX_POINTS:
        raise OptionError(f"guides need {count:,} points; at most {limits.MAX_POINTS:,}")
    at = {axes[0]: first_q[:, None], axes[1]: second_q}
    total = sum(
        weight * np.broadcast_to(curve.evaluate_at(axes[0], at), (len(first_q), len(second_q)))
        for weight, curve in zip(weights, plain, strict=True)
    )
    positions = (tuple(first_q.tolist()), tuple(second_q.tolist()))
    return TwoArguments(first.span, axes, positions, tuple(map(tuple, np.asarray(total).tolist())))


def _coefficients(curve: Constant | Ramp | Poly) -> tuple[float, ...]:
    if isinstance(curve, Constant):
        return (curve.value,)
    if isinstance(curve, Poly):
        return curve.coefficients
    low, high = curve.span
    slope = curve.value / (high - low)
    return (-slope * low, slope)


def _terms(
    first: Constant | Harmonics, second: Constant | Harmonics, weights: Weights
) -> tuple[tuple[float, float, float], ...]:
    amplitudes: dict[tuple[float, float], float] = {}
    for curve, weight in zip((first, second), weights, strict=True):
        terms = ((0.0, curve.value, 0.0),) if isinstance(curve, Constant) else curve.terms
        for order, amplitude, phase in terms:
            place = (order, phase)
            amplitudes[place] = amplitudes.get(place, 0.0) + weight * amplitude
    return tuple((order, value, phase) for (order, phase), value in amplitudes.items())


def _table(first: ErrorFunction, second: ErrorFunction, weights: Weights, at: Array) -> TableCurve:
    value = weights[0] * first.evaluate(at) + weights[1] * second.evaluate(at)
    return TableCurve(first.span, tuple(zip(at.tolist(), value.tolist(), strict=True)))


def _sampled(first: ErrorFunction, second: ErrorFunction, weights: Weights) -> TableCurve:
    kinks = [q for q in (*first.kinks, *second.kinks) if first.span[0] < q < first.span[1]]
    count = 65
    while True:
        at = np.union1d(np.linspace(*first.span, count), kinks[: limits.MAX_POINTS - MAX_SAMPLES])
        curve = _table(first, second, weights, at)
        between = (at[1:] + at[:-1]) / 2.0
        exact = weights[0] * first.evaluate(between) + weights[1] * second.evaluate(between)
        largest = max(float(np.abs(exact).max()), abs(curve.amplitude))
        deviation = float(np.abs(exact - curve.evaluate(between)).max())
        if deviation <= SAMPLING_TOLERANCE * largest or count >= MAX_SAMPLES:
            return curve
        count = min(2 * count - 1, MAX_SAMPLES)


GUIDES = "guides"  # key of the positioning errors of the two guides of a gantry
RUN, DIRECTION = "run", "direction"  # columns that a file of runs may have
SIGNS = {1: FORWARD, -1: BACKWARD}


def read_csv_column(path: Path, column: str, where: str = "") -> list[tuple[float, float]]:
    """Read positions (mm or degrees, ascending, first column) and a named column (µm or µrad)."""
    return _read_csv(path, lambda rows: _points(rows, column, where))


def read_csv_runs(path: Path, column: str, where: str = "") -> tuple[TravelRun, ...]:
    """Read the runs of one error, one reading per row, with columns ``run`` and ``direction``."""
    return _read_csv(path, lambda rows: _runs(rows, column, where))


def _read_csv(path: Path, read: Callable[[text_files.CsvRows], text_files.T]) -> text_files.T:
    def parse(file: TextIO) -> text_files.T:
        rows = text_files.CsvRows(file, str(path), limits.MAX_POINTS)
        content = read(rows)
        rows.check()
        return content

    return text_files.parse_table_file(path, limits.MAX_CSV_BYTES, parse)


def _units(where: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the units of positions and values of the error in the path of a finding."""
    keys = [part for part in re.split(r"[.\[]", where) if part in PARAMETERS]
    if not keys:
        return ("mm", "deg"), ("um", "urad")
    row = parameter(keys[-1])
    return ("mm" if is_linear(row.axis) else "deg",), ("urad" if row.is_rotation else "um",)


def _column(rows: text_files.CsvRows, column: str, where: str) -> tuple[int, int, float, float]:
    """Find the columns of positions and of values, with or without their unit, and their factors.

    Positions are in the first column that is neither the run nor the direction.
    """
    first = next(
        (n for n, name in enumerate(rows.header) if name.lower() not in (RUN, DIRECTION)), 0
    )
    columns = rows.header[first + 1 :]
    headings = columns
    if column not in columns:
        plain = [text_files.plain_heading(name) for name in columns]
        headings = [name.removesuffix(f"_{text_files.heading_unit(name)}") for name in plain]
    if headings.count(column) == 1:
        index = headings.index(column)
        position, error = _units(where)
        scale = _factor(rows, rows.header[first], position)
        return first, first + 1 + index, scale, _factor(rows, columns[index], error)
    problem = "occurs twice" if column in headings else "not found"
    hint = "" if column in headings else near_miss(column, columns)
    raise SceneError(rows.source, [f"column {column!r} {problem}{hint}"])


def _factor(rows: text_files.CsvRows, heading: str, targets: tuple[str, ...]) -> float:
    """Return the factor from the unit of a heading to that of its quantity; 1 without a unit."""
    unit = text_files.heading_unit(heading)
    factors = [text_files.unit_factor(unit, target) for target in targets]
    factor = next((factor for factor in factors if factor), None)
    if factor is None and (unit or heading.endswith("]")):
        expected = f"expected a unit such as {' or '.join(targets)}"
        raise SceneError(rows.source, [f"column {heading!r}; {expected}"])
    return factor or 1.0


def _points(rows: text_files.CsvRows, column: str, where: str) -> list[tuple[float, float]]:
    points: list[tuple[float, float]] = []
    first, index, scale, factor = _column(rows, column, where) if rows.header else (0, 0, 1.0, 1.0)
    for line, row in rows:
        position = scale * rows.number(row[first], line, limit=limits.MAX_ERROR / scale)
        value = factor * rows.number(row[index], line, limit=limits.MAX_ERROR / factor)
        if points and position <= points[-1][0]:
            problem = f"position {position:g} after {points[-1][0]:g}"
            rows.note(f"line {line}: {problem}; expected ascending positions")
        points.append((position, value))
    if not points and not rows.problems:
        rows.note("has 0 rows below the header; expected a header and at least one row")
    return points


def _runs(rows: text_files.CsvRows, column: str, where: str) -> tuple[TravelRun, ...]:
    position_at, value_at, scale, factor = _column(rows, column, where)
    headings = [name.lower() for name in rows.header]
    run_at, direction_at = (
        headings.index(name) if name in headings else None for name in (RUN, DIRECTION)
    )
    readings: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for line, row in rows:
        text = "" if direction_at is None else text_files.unguard_cell(row[direction_at])
        direction = SIGNS.get(text_files.DIRECTIONS.get(text.lower(), 0), UNKNOWN)
        if text and direction == UNKNOWN:
            spelling = text_files.spell_value(text)
            rows.note(f"line {line}: direction {spelling}; expected +, - or nothing")
        position = scale * rows.number(row[position_at], line, limit=limits.MAX_LENGTH_MM / scale)
        value = factor * rows.number(row[value_at], line, limit=limits.MAX_ERROR / factor)
        run = "" if run_at is None else text_files.unguard_cell(row[run_at])
        readings.setdefault((run, direction), []).append((position, value))
        if len(readings) > limits.MAX_RUNS:
            raise SceneError(
                rows.source, [f"has more than {limits.MAX_RUNS} runs; expected at most so many"]
            )
    if not readings and not rows.problems:
        rows.note("has 0 rows below the header; expected at least one")
    return tuple(TravelRun(way, tuple(points)) for (_, way), points in readings.items())


@dataclass(frozen=True)
class CurveReader:
    """A reader of the curves of one axis."""

    problems: Problems
    span: tuple[float, float]
    axis: str = ""
    axes: Collection[str] = ()
    folder: Path | None = None  # where CSV files are; None where they are not read

    def read(self, raw: object, where: str, *, constant: bool = False) -> ErrorFunction | None:
        before = len(self.problems.lines)
        curve = self._read(raw, where, constant)
        if constant and not is_number(raw) and len(self.problems.lines) == before:
            self.problems.add(where, "is constant along its axis; expected a number", raw)
        return curve if len(self.problems.lines) == before else None

    def _read(self, raw: object, where: str, constant: bool) -> ErrorFunction | None:
        if raw is MISSING:
            self.problems.add(where, "is missing")
            return None
        reader = ValueReader(
            # a constant is a number: the file of a table is not read
            (lambda _file, _column: ())
            if constant
            else self.folder and partial(self._csv_points, where),
            axis=self.axis,
            axes=self.axes,
            nested=lambda part, path: self._read(part, text_files.location(where, path), constant),
        )
        table = cast("dict[str, object]", raw) if isinstance(raw, dict) else {}
        form_of_table = find_form(table) if table else None
        if is_number(raw):
            curve, form = Constant.read(raw, self.span, reader), ()
        elif form_of_table is not None:
            kind, form = form_of_table
            curve = kind.read({**dict.fromkeys(form, MISSING), **table}, self.span, reader)
        else:
            self.problems.add(where, f"expected {spell_forms()}", raw)
            return None
        self.problems.add_findings(where, reader)
        self.problems.only(where, table, form, "key")
        return curve

    def _csv_points(self, where: str, file: str, column: str) -> Points:
        return read_csv_column(cast("Path", self.folder) / file, column, where)

    def guides(
        self,
        key: str,
        raw: dict[str, object],
        where: str,
        gantry: Gantry | None,
        keys: Collection[str],
    ) -> dict[str, ErrorFunction]:
        """Read ``{ guides = [CURVE, CURVE] }`` of a gantry: a mean, and a rotation."""
        axis, problems = self.axis, self.problems
        if gantry is None:
            # an arbitrary distance, to check the remaining entries
            expected = f"[machine.gantry] {axis} = {{ span_mm = 1800 }} (a linear axis)"
            problems.add(where, f"guides need the distance between them; expected {expected}")
            gantry = Gantry(axis, 1000.0, default_across(axis))
        if key != gantry.positioning_key:
            expected = f"expected guides in {gantry.positioning_key}, the positioning of {axis}"
            problems.add(where, expected, raw)
            return {}
        if gantry.rotation_key in keys:
            problem = f"follows from the guides of {key}; expected one of the two"
            problems.add(f"errors.{gantry.rotation_key}", problem)
        problems.only(where, raw, (GUIDES,), "key")
        pair = raw[GUIDES]
        entries = cast("list[object]", pair) if isinstance(pair, list) else []
        if len(entries) != 2:
            problems.add(f"{where}.{GUIDES}", "expected [first guide, second guide]", pair)
            return {}
        first, second = (
            self.read(entry, f"{where}.{GUIDES}[{index}]") for index, entry in enumerate(entries)
        )
        if first is None or second is None:
            return {}
        weight = gantry.rotation_weight
        try:
            return {
                key: combine_curves(first, second, (0.5, 0.5)),
                gantry.rotation_key: combine_curves(first, second, (-weight, weight)),
            }
        except OptionError as error:
            problems.add(where, str(error))
            return {}
