"""The measurement table of warpspace: a CSV file with errors and their units in the header."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpspace.exceptions import SceneError, near_miss
from warpspace.formats import measured
from warpspace.formats.compensation.corrections import RequiredCorrections
from warpspace.formats.registry import Files, Format, ReadOptions, describe
from warpspace.formats.source import (
    DEG_PER,
    MM_PER,
    Source,
    SourceLine,
    format_number,
    quote,
    source_of_text,
)
from warpspace.machine.axes import PARAMETERS, is_axis_name, is_linear, parameter
from warpspace.machine.limits import MAX_POINTS, MAX_RUNS
from warpspace.scene import text_files
from warpspace.scene.text_files import ANGLE_URAD, LENGTH_UM, CsvRows, list_repeated, unguard_cell
from warpspace.units import Array

RUN, DIRECTION = "run", "direction"
DIGITS = 6  # decimals of a value, µm or µrad
UNITS = "# Units are in brackets and may be changed: um mm nm in, urad mrad rad arcsec deg."


def default_positions(axis: str) -> tuple[float, ...]:
    """Return the default positions of a template, mm or degrees."""
    return (-250, -125, 0, 125, 250) if is_linear(axis) else (0, 90, 180, 270, 360)


def _position(axis: str) -> str:
    return f"{axis} [{'mm' if is_linear(axis) else 'deg'}]"


def _value(key: str, template: str = "{}") -> str:
    unit = "urad" if parameter(key).is_rotation else "um"
    return f"{template.format(key)} [{unit}]"


def _lines(rows: Iterable[Iterable[str]]) -> str:
    return "".join(",".join(row) + "\n" for row in rows)


def surface_template(axes: tuple[str, str], places: tuple[Sequence[float], Sequence[float]]) -> str:
    axis, other = axes
    lines = [
        f"# Errors of the {axis} axis over {axis}, {other}: actual - nominal, one row per point.",
        "# Every point of the grid occurs once, in any order. Interpolation is bilinear; beyond",
        "# the grid, the values of its edge apply. Columns that are not needed may be deleted.",
    ]
    cells = [f"{first:g},{second:g}" for first in places[0] for second in places[1]]
    return _to_fill_in(axis, lines, map(_position, axes), cells)


def template(axis: str, places: Sequence[float] = ()) -> str:
    spans = places or default_positions(axis)
    lines = [
        f"# Errors of the {axis} axis: actual - nominal, one row per position and run.",
        "# run: 1, 2, 3 …; direction: + for increasing positions, - for decreasing positions.",
        "# u(…): standard uncertainties (k = 1). Columns that are not needed may be deleted.",
    ]
    cells = [f"{q:g},1,+" for q in spans] + [f"{q:g},1,-" for q in reversed(spans)]
    return _to_fill_in(axis, lines, (_position(axis), RUN, DIRECTION), cells, uncertain=True)


def _to_fill_in(
    axis: str,
    comments: list[str],
    columns: Iterable[str],
    cells: list[str],
    *,
    uncertain: bool = False,
) -> str:
    keys = [f"E{letter}{axis}" for letter in "XYZABC"]
    values = [*map(_value, keys), *(_value(key, "u({})") for key in keys if uncertain)]
    lines = [comments[0], UNITS, *comments[1:]]
    lines += [f"# {key}: {parameter(key).name}" for key in keys]
    lines += [",".join([*columns, *values]), *(row + "," * len(values) for row in cells)]
    return "\n".join(lines) + "\n"


def write(corrections: RequiredCorrections) -> Files:
    """Write the errors of a scene: constants in the main file, and one further file per axis."""
    files: dict[str, str] = {}
    errors = measured.sample_errors(corrections)
    readings = measured.readings_of_errors(errors, corrections.scene.machine)
    for table in measured.build_error_tables(readings):
        directed = [DIRECTION] if any(direction for _, direction, _ in table.rows) else []
        rows = [[*map(_position, table.axes), *directed, *map(_value, table.keys)]]
        for at, direction, values in table.rows:
            signs = [measured.SIGNS[direction]] if directed else []
            numbers = [format_number(number, DIGITS) for number in values]
            rows.append([*map(repr, at), *signs, *numbers])
        name = ("constant", *table.axes[:1], table.keys[0])[len(table.axes)]
        files[f"_{name}.csv"] = _lines(rows)
    if not files:
        return {"": _lines([[_value(measured.zero_key(corrections.scene))], ["0.0"]])}
    files[""] = files.pop(next(iter(files)))
    return files


NAME = "csv"
POSITION, ERROR, UNCERTAINTY, IGNORED = "position", "error", "uncertainty", "ignored"
DIRECTIONS: Mapping[str, int] = {
    **dict.fromkeys(("", "0"), measured.UNDIRECTED),
    **text_files.DIRECTIONS,
}
GENERIC = {"TARGET": POSITION, "POSITION": POSITION, "DEVIATION": ERROR}
"""Headings that do not name the axis: of a laser interferometer, positioning."""
_HEADING = re.compile(
    r"(?:(u)\s*\(\s*)?([A-Za-z0-9]+)\s*\)?\s*"
    r"(?:\[\s*([^\]]+?)\s*\]|\(\s*([^)]+?)\s*\)|_([A-Za-zµμ°/]+))?"
)
_AXIS_POSITION = re.compile(
    r"^(?:target|position|sollposition|zielposition)\s+(?=[XYZABCUVW]\s*[\[(_])", re.IGNORECASE
)


@dataclass(frozen=True)
class _CsvColumn:
    """One column of a table: its role, and the factor to µm, µrad, mm or degrees."""

    role: str
    name: str
    factor: float = 1.0
    unit: str = ""

    def value(self, cell: str, at: SourceLine, table: CsvRows) -> float:
        if self.role == DIRECTION:
            direction = unguard_cell(cell).lower()
            if direction not in DIRECTIONS:
                at.refuse(f"direction {quote(cell)}", "+, - or nothing")
            return DIRECTIONS[direction]
        if self.role == RUN:
            return at.integer(cell, RUN, 0, 10**9)
        if not cell and self.role != POSITION:
            return math.nan
        number = self.factor * table.number(cell, at.line, self.name)
        if self.role == POSITION:
            return at.checked_position(number, self.name)
        if self.role == UNCERTAINTY and number <= 0.0:
            at.refuse(f"u({self.name}) {quote(cell)}", "a standard uncertainty above 0")
        return at.checked_error(number, self.name)


_Row = tuple[SourceLine, dict[tuple[str, str], float]]


@dataclass(frozen=True)
class _CsvTable:
    """The columns and rows of a file."""

    source: Source
    head: SourceLine
    columns: tuple[_CsvColumn, ...]
    rows: tuple[_Row, ...]

    def names_with_role(self, role: str) -> list[str]:
        return [column.name for column in self.columns if column.role == role]

    def directions(self) -> list[int]:
        return [int(row.get((DIRECTION, DIRECTION), measured.UNDIRECTED)) for _, row in self.rows]


def recognise(head: str, name: str) -> bool:
    try:
        rows = source_of_text(head, name).rows(1)
    except SceneError:
        return False
    matches = [match for match in map(_heading, map(_plain, rows.header)) if match]
    has_unit = any(match[3] or match[4] or match[5] for match in matches)
    names = {match[2].upper() for match in matches}
    return has_unit and bool(rows.runs or "DEVIATION" in names or names & PARAMETERS.keys())


def _plain(heading: str) -> str:
    """Translate a heading; ``Position X [mm]`` is the position ``X [mm]``."""
    return _AXIS_POSITION.sub("", text_files.translate_heading(heading))


def _heading(text: str) -> re.Match[str] | None:
    return _HEADING.fullmatch(" ".join(text.split()))  # long blanks would cause backtracking


def _columns(at: SourceLine, rows: CsvRows, options: ReadOptions) -> tuple[_CsvColumn, ...]:
    headings = [
        f"{heading} [um]" if rows.runs and heading == text_files.DEVIATION else heading
        for heading in map(_plain, rows.header)
    ]
    names = [match[2].upper() for match in map(_heading, headings) if match]
    axes = [name for name in names if is_axis_name(name)]
    if not options.axis and len(axes) == 1:
        options = replace(options, axis=axes[0])
    columns = [_column(at, heading, options) for heading in headings]
    keys = [(column.role, column.name) for column in columns if column.role != IGNORED]
    repeated = list_repeated(keys)
    if repeated:
        at.refuse(f"column {repeated[0][1]} occurs twice", "it once")
    return tuple(columns)


def _column(at: SourceLine, heading: str, options: ReadOptions) -> _CsvColumn:
    lower = heading.strip().lower()
    if lower in (RUN, DIRECTION):
        return _CsvColumn(lower, lower)
    matched = _heading(heading)
    if _is_ignored(heading, matched):
        return _CsvColumn(IGNORED, heading)
    if matched is None:
        expected = "headings such as X [mm], EXX [um], u(EXX) [um], run, direction"
        at.refuse(f"column {quote(heading)}", expected)
    uncertain, name = bool(matched[1]), matched[2].upper()
    if name in GENERIC and not uncertain:
        if not options.axis:
            at.refuse(f"column {quote(heading)} does not state its axis", "{axis} X")
        axis = options.axis_named(options.axis, at)
        along = "ABCXYZXYZ"["ABCXYZUVW".index(axis[0])]
        name = axis if GENERIC[name] == POSITION else f"E{along}{axis}"
    unit = (matched[3] or matched[4] or matched[5] or "").strip()
    if name in PARAMETERS:
        factors = ANGLE_URAD if parameter(name).is_rotation else LENGTH_UM
        role = UNCERTAINTY if uncertain else ERROR
    elif is_axis_name(name) and not uncertain:
        factors, role = MM_PER if is_linear(name) else DEG_PER, POSITION
    else:
        errors = (f"E{a}{b}" for a in "XYZABC" for b in "XYZABC")
        hint = near_miss(name, [*"XYZABCUVW", *errors])
        expected = f"an axis, an error, u(error), run or direction{hint}"
        at.refuse(f"column {quote(heading)}", expected)
    if not unit:
        expected = f"{name} [unit], with one of {', '.join(factors)}"
        at.refuse(f"column {name} has no unit", expected)
    return _CsvColumn(role, name, at.unit(unit, factors, name), unit)


def _is_ignored(heading: str, matched: re.Match[str] | None) -> bool:
    """Return true for a column that is not needed: without a unit, and unlike an error or axis."""
    name = matched[2].upper() if matched else ""
    is_known = name in PARAMETERS or name in GENERIC or is_axis_name(name)
    is_similar = bool(re.fullmatch(r"E[A-Z0-9]{2,3}", name)) or (matched and matched[1])
    return not (is_known or is_similar or text_files.heading_unit(heading))


def read(sources: Sequence[Source], options: ReadOptions) -> measured.ImportedErrors:
    readings = measured.merge([_read_one(source, options) for source in sources])
    return measured.errors_of_readings(readings, options.machine)


def _read_one(source: Source, options: ReadOptions) -> measured.ImportedErrors:
    csv_rows = source.rows(MAX_POINTS)
    if not csv_rows.header:
        source.refuse("has no header", "one such as X [mm],EXX [um]")
    head = source.at(csv_rows.line)
    columns = _columns(head, csv_rows, options)
    if not any(column.role == ERROR for column in columns):
        head.refuse("has no column of an error", "one such as EXX [um]")
    rows: list[_Row] = []
    for number, cells in csv_rows:
        at = source.at(number)
        row = {
            (column.role, column.name): column.value(cell, at, csv_rows)
            for column, cell in zip(columns, cells, strict=True)
            if column.role != IGNORED
        }
        rows.append((at, row))
    csv_rows.check()
    if not rows:
        head.refuse("has no rows below its header", "at least one")
    imported = _errors(_CsvTable(source, head, columns, tuple(rows)))
    units = tuple(dict.fromkeys(column.unit for column in columns if column.unit))
    ignored = ", ".join(column.name for column in columns if column.role == IGNORED)
    notes = (*source.notes, *csv_rows.notes, *imported.notes)
    if csv_rows.runs and text_files.DEVIATION in csv_rows.header:
        notes += ("runs without a unit: read as µm",)
    if ignored:
        notes += (f"ignored columns: {ignored}",)
    return replace(imported, units=units, notes=notes)


def _errors(table: _CsvTable) -> measured.ImportedErrors:
    errors, positions = table.names_with_role(ERROR), table.names_with_role(POSITION)
    if not positions:
        return _constants(table)
    constant = next((key for key in errors if parameter(key).is_constant), "")
    if constant:
        expected = "it in a file without positions"
        table.head.refuse(f"column {constant} is a constant error", expected)
    if len(positions) > 2:
        table.head.refuse(f"{len(positions)} columns of positions", "one or two")
    if len(positions) == 2:
        return _surfaces(table)
    (axis,) = positions
    other = next((key for key in errors if parameter(key).axis != axis), "")
    if other:
        expected = f"errors of {axis} in a table over {axis}"
        table.head.refuse(f"column {other} is an error of {parameter(other).axis}", expected)
    return _series(table, axis)


def _constants(table: _CsvTable) -> measured.ImportedErrors:
    if len(table.rows) != 1:
        expected = "one, or a column of positions such as X [mm]"
        table.head.refuse(f"{len(table.rows)} rows of errors without positions", expected)
    ((at, row),) = table.rows
    constants = {key: row[ERROR, key] for key in table.names_with_role(ERROR)}
    empty = next((key for key, constant in constants.items() if math.isnan(constant)), "")
    if empty:
        at.refuse(f"{empty} is empty", "a number")
    cells = {key: row[UNCERTAINTY, key] for key in table.names_with_role(UNCERTAINTY)}
    uncertainty = {key: u for key, u in cells.items() if not math.isnan(u)}
    return measured.ImportedErrors(NAME, constants=constants, uncertainty=uncertainty)


def _series(table: _CsvTable, axis: str) -> measured.ImportedErrors:
    at = np.array([row[POSITION, axis] for _, row in table.rows])
    places = measured.distinct_positions(at)
    runs = [int(row.get((RUN, RUN), 1)) for _, row in table.rows]
    row_runs = list(zip(runs, table.directions(), strict=True))
    distinct_runs = list(dict.fromkeys(row_runs))
    if len(distinct_runs) > MAX_RUNS:
        table.source.refuse(f"has {len(distinct_runs)} runs", f"at most {MAX_RUNS}")
    index = np.searchsorted((places[1:] + places[:-1]) / 2.0, at).tolist()
    lines: dict[tuple[tuple[int, int], int], int] = {}
    for place, run, (line, _) in zip(index, row_runs, table.rows, strict=True):
        if (run, place) in lines:
            problem = f"position {places[place]:g} of {axis} repeats line {lines[run, place]}"
            line.refuse(problem, "columns run and direction that distinguish them")
        lines[run, place] = line.line
    series: list[measured.ErrorSeries] = []
    for key in table.names_with_role(ERROR):
        readings = {run: np.full(len(places), math.nan) for run in distinct_runs}
        u = np.zeros(len(places))
        for place, run, (_, row) in zip(index, row_runs, table.rows, strict=True):
            readings[run][place] = row[ERROR, key]
            u[place] = np.fmax(u[place], row.get((UNCERTAINTY, key), 0.0))
        readings = {run: errors for run, errors in readings.items() if not np.isnan(errors).all()}
        if not readings:
            table.source.refuse(f"column {key} is empty", "numbers, or no such column")
        _check_complete(table.source, key, readings, places, axis)
        measured_runs = tuple(
            measured.MeasuredRun(*run, tuple(errors.tolist())) for run, errors in readings.items()
        )
        uncertainty = tuple(u.tolist()) if u.any() else ()
        positions = tuple(places.tolist())
        series.append(measured.ErrorSeries(key, positions, measured_runs, uncertainty))
    sorted_rows = len(distinct_runs) == 1 and np.any(np.diff(at) < 0.0)
    notes = (f"rows were sorted by the position of {axis}",) if sorted_rows else ()
    return measured.ImportedErrors(NAME, tuple(series), notes=notes)


def _check_complete(
    source: Source, key: str, readings: Mapping[tuple[int, int], Array], places: Array, axis: str
) -> None:
    names = {measured.FORWARD: "forward", measured.BACKWARD: "backward"}
    for direction in (None, *dict.fromkeys(way for _, way in readings)):
        runs = [errors for (_, way), errors in readings.items() if direction in (None, way)]
        missing = np.isnan(runs).all(axis=0)
        if missing.any():
            is_any = direction is None
            place = "" if is_any else f" in {names.get(direction, 'any')} direction"
            expected = "one at every position" if is_any else "every direction at every position"
            source.refuse(f"{key} has no value at {axis} {places[missing][0]:g}{place}", expected)


def _surfaces(table: _CsvTable) -> measured.ImportedErrors:
    first, second = table.names_with_role(POSITION)
    for column in table.columns:
        if column.role in (RUN, UNCERTAINTY):
            heading = RUN if column.role == RUN else f"u({column.name})"
            expected = "positions, direction and errors over two axes: one value per point"
            table.head.refuse(f"column {heading}", expected)
    surfaces: list[measured.ErrorSurface] = []
    for key in table.names_with_role(ERROR):
        axis = parameter(key).axis
        if axis not in (first, second):
            expected = f"errors of {first} or {second}"
            table.head.refuse(f"column {key} is an error of {axis}", expected)
        other = second if axis == first else first
        points: dict[int, list[measured.Point]] = {}
        for direction, (at, row) in zip(table.directions(), table.rows, strict=True):
            point = (at, row[POSITION, axis], row[POSITION, other], row[ERROR, key])
            points.setdefault(direction, []).append(point)
        axes = (axis, other)
        surfaces.append(measured.build_surface_by_direction(key, axes, points, table.source))
    return measured.ImportedErrors(NAME, surfaces=tuple(surfaces))


FORMATS = (
    Format(
        **describe(NAME), limits=f"{MAX_POINTS:,} rows", recognise=recognise, read=read, write=write
    ),
)
