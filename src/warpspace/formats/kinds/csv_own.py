"""The measurement table of warpspace: a CSV file whose header names errors with their units.

Documented in docs/import.md; `warpspace template AXIS` writes one to fill in.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from warpspace.formats.kind import Format, ReadOptions
from warpspace.formats.measured import (
    BACKWARD,
    BOTH,
    FORWARD,
    Imported,
    Plane,
    Run,
    Series,
    merge,
)
from warpspace.formats.numbers import check_error, check_position, read_number, read_whole
from warpspace.formats.parts.csv_header import (
    DIRECTION,
    DIRECTIONS,
    RUN,
    Column,
    fields,
    is_content,
    read_header,
    recognise,
    separator_of,
)
from warpspace.formats.parts.csv_writing import write
from warpspace.formats.parts.planes import SAME, Point, distinct, plane_by_ways
from warpspace.formats.source import Source, shown
from warpspace.machine.limits import MAX_POINTS, MAX_RUNS
from warpspace.machine.parameters import parameter

NAME = "csv"


def read(sources: Sequence[Source], options: ReadOptions) -> Imported:
    """Read tables of measured errors."""
    del options
    return merge([_read_one(source) for source in sources])


def _read_one(source: Source) -> Imported:
    """Read one table."""
    numbered = [(i, text) for i, text in enumerate(source.lines, 1) if is_content(text)]
    if not numbered:
        source.refuse("has no header; expected one such as X [mm],EXX [um]")
    line, header = numbered[0]
    mark = separator_of(header)
    columns = read_header(source, line, fields(header, mark))
    errors = [one for one in columns if one.role == "error"]
    if not errors:
        source.refuse("has no column of an error; expected for instance EXX [um]", line)
    if len(numbered) < 2:
        source.refuse("has no rows below its header; expected at least one", line)
    if len(numbered) - 1 > MAX_POINTS:
        found = f"has {len(numbered) - 1:,} rows"
        source.refuse(f"{found}; expected at most {MAX_POINTS:,}", numbered[MAX_POINTS + 1][0])
    rows = _rows(source, numbered[1:], columns, mark)
    units = tuple(dict.fromkeys(one.unit for one in columns if one.unit))
    positions = [one for one in columns if one.role == "position"]
    if not positions:
        return _constants(source, rows, columns, units, line)
    if any(parameter(one.name).is_constant for one in errors):
        wrong = next(one.name for one in errors if parameter(one.name).is_constant)
        expected = "expected it in a file without positions"
        source.refuse(f"column {wrong} is a constant error; {expected}", line)
    if len(positions) == 2:
        return _planes(source, rows, columns, units, line)
    if len(positions) > 2:
        source.refuse(f"{len(positions)} columns of positions; expected one or two", line)
    axis = positions[0].name
    if other := next((one.name for one in errors if parameter(one.name).axis != axis), ""):
        expected = f"expected errors of {axis} in a table over {axis}"
        source.refuse(f"column {other} is an error of {parameter(other).axis}; {expected}", line)
    series, notes = _all_series(source, rows, columns)
    return Imported(NAME, tuple(series), units=units, notes=(*source.notes, *notes))


Row = tuple[int, dict[tuple[str, str], float]]


def _rows(
    source: Source, numbered: Sequence[tuple[int, str]], columns: Sequence[Column], mark: str
) -> list[Row]:
    """Read the rows in the units of the model."""
    comma = mark != ","
    rows: list[Row] = []
    for number, text in numbered:
        parts = fields(text, mark)
        if len(parts) != len(columns):
            found = f"{len(parts)} fields"
            if mark == "," and len(parts) > len(columns):
                found += " (decimal commas? then semicolons or tabs must part the columns)"
            source.refuse(f"{found}; expected {len(columns)} as in the header", number)
        row: dict[tuple[str, str], float] = {}
        for column, part in zip(columns, parts, strict=True):
            bare = part.strip()
            if column.role == DIRECTION:
                if bare.lower() not in DIRECTIONS:
                    expected = "expected +, - or nothing"
                    source.refuse(f"direction {shown(part)}; {expected}", number)
                row[DIRECTION, DIRECTION] = DIRECTIONS[bare.lower()]
            elif column.role == RUN:
                row[RUN, RUN] = read_whole(part, source, number, RUN, 0, 10**9)
            elif not bare and column.role != "position":
                row[column.role, column.name] = math.nan
            else:
                value = column.factor * read_number(part, source, number, column.name, comma=comma)
                check = check_position if column.role == "position" else check_error
                row[column.role, column.name] = check(value, source, number, column.name)
        rows.append((number, row))
    return rows


def _constants(
    source: Source,
    rows: Sequence[Row],
    columns: Sequence[Column],
    units: tuple[str, ...],
    line: int,
) -> Imported:
    """Read constant errors: one row."""
    if len(rows) != 1:
        expected = "expected one, or a column of positions such as X [mm]"
        source.refuse(f"{len(rows)} rows of errors without positions; {expected}", line)
    _, row = rows[0]
    kinds = {
        role: {c.name: row[role, c.name] for c in columns if c.role == role}
        for role in ("error", "uncertainty")
    }
    if empty := next((key for key, value in kinds["error"].items() if math.isnan(value)), ""):
        source.refuse(f"{empty} is empty; expected a number", rows[0][0])
    return Imported(
        NAME,
        constants=kinds["error"],
        uncertainty={k: v for k, v in kinds["uncertainty"].items() if not math.isnan(v)},
        units=units,
        notes=source.notes,
    )


def _all_series(
    source: Source, rows: Sequence[Row], columns: Sequence[Column]
) -> tuple[list[Series], list[str]]:
    """Sort rows into runs over the positions of one axis."""
    axis = next(one.name for one in columns if one.role == "position")
    at = np.array([row["position", axis] for _, row in rows])
    places = distinct(at)
    ways = [
        (int(row.get((RUN, RUN), 1)), int(row.get((DIRECTION, DIRECTION), BOTH))) for _, row in rows
    ]
    known = list(dict.fromkeys(ways))
    if len(known) > MAX_RUNS:
        source.refuse(f"has {len(known)} runs; expected at most {MAX_RUNS}")
    index = (
        np.abs(places[None, :] - at[:, None]).argmin(axis=1)
        if len(rows) < 5000
        else (np.clip(np.searchsorted(places, at - SAME), 0, len(places) - 1))
    )
    taken: dict[tuple[tuple[int, int], int], int] = {}
    for place, way, (line, _) in zip(index.tolist(), ways, rows, strict=True):
        if (way, place) in taken:
            found = f"position {places[place]:g} of {axis} stands also in line {taken[way, place]}"
            source.refuse(f"{found}; expected columns run and direction to tell them apart", line)
        taken[way, place] = line
    series: list[Series] = []
    for column in columns:
        if column.role != "error":
            continue
        table = {way: np.full(len(places), math.nan) for way in known}
        for place, way, (_, row) in zip(index.tolist(), ways, rows, strict=True):
            table[way][place] = row["error", column.name]
        given = {way: values for way, values in table.items() if not np.isnan(values).all()}
        if not given:
            source.refuse(f"column {column.name} is empty; expected numbers, or no such column")
        holes = np.isnan(np.array(list(given.values()))).all(axis=0)
        if holes.any():
            found = f"{column.name} has no value at {axis} {places[holes][0]:g}"
            source.refuse(f"{found}; expected one at every position")
        _check_ways(source, column.name, given, places, axis)
        runs = tuple(
            Run(number, way, tuple(values.tolist())) for (number, way), values in given.items()
        )
        uncertain = _uncertainty(rows, column.name, index, len(places))
        series.append(Series(column.name, tuple(places.tolist()), runs, uncertain))
    notes: list[str] = []
    if len(known) == 1 and np.any(np.diff(at) < 0.0):
        notes.append(f"rows were sorted by the position of {axis}")
    return series, notes


def _check_ways(
    source: Source,
    key: str,
    given: Mapping[tuple[int, int], np.ndarray],
    places: np.ndarray,
    axis: str,
) -> None:
    """Refuse a position that all runs of one direction left out."""
    for direction in {way for _, way in given}:
        own = np.array([values for (_, way), values in given.items() if way == direction])
        holes = np.isnan(own).all(axis=0)
        if holes.any():
            said = {FORWARD: "forward", BACKWARD: "backward"}.get(direction, "any")
            found = f"{key} has no value at {axis} {places[holes][0]:g} in {said} direction"
            source.refuse(f"{found}; expected every direction at every position")


def _uncertainty(rows: Sequence[Row], key: str, index: np.ndarray, count: int) -> tuple[float, ...]:
    """Give the standard uncertainty at each position, the largest of those given."""
    found = np.zeros(count)
    for place, (_, row) in zip(index.tolist(), rows, strict=True):
        value = row.get(("uncertainty", key), math.nan)
        if not math.isnan(value):
            found[place] = max(found[place], abs(value))
    return tuple(found.tolist()) if found.any() else ()


def _planes(
    source: Source,
    rows: Sequence[Row],
    columns: Sequence[Column],
    units: tuple[str, ...],
    line: int,
) -> Imported:
    """Read errors over two axes: a value a point of a grid, of each direction of travel if told."""
    first, second = (one.name for one in columns if one.role == "position")
    if unknown := next((one for one in columns if one.role in (RUN, "uncertainty")), None):
        what = RUN if unknown.role == RUN else f"u({unknown.name})"
        expected = "expected positions, direction and errors over two axes"
        source.refuse(f"column {what}; {expected}: one value a point", line)
    planes: list[Plane] = []
    for column in columns:
        if column.role != "error":
            continue
        own = parameter(column.name).axis
        if own not in (first, second):
            expected = f"expected errors of {first} or {second}"
            source.refuse(f"column {column.name} is an error of {own}; {expected}", line)
        names = (own, second if own == first else first)
        points: dict[int, list[Point]] = {}
        for number, row in rows:
            at = (row["position", names[0]], row["position", names[1]])
            way = int(row.get((DIRECTION, DIRECTION), BOTH))
            points.setdefault(way, []).append((number, *at, row["error", column.name]))
        planes.append(plane_by_ways(column.name, names, points, source))
    return Imported(NAME, planes=tuple(planes), units=units, notes=source.notes)


FORMAT = Format(
    name=NAME,
    title="measurement table of warpspace",
    source="docs/import.md",
    endings=(".csv", ".txt"),
    holds="any error along its axis, with runs, directions and uncertainties; over two axes, with"
    " directions; constants",
    units="as the header says: um mm nm in, urad mrad rad arcsec deg",
    grid="any positions; over two axes every point of a grid",
    limits=f"{MAX_POINTS:,} rows",
    recognise=recognise,
    read=read,
    write=write,
    points=41,
    most_points=2001,
    parametric=True,
    orientation=True,
)
