"""The measurement table of warpspace: a CSV file whose header names errors with their units.

Documented in docs/import.md; `warpspace template AXIS` writes one to fill in.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.exceptions import near_miss
from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.kind import Files, Format, ReadOptions
from warpspace.formats.kinds.parametric import sampled, table_of
from warpspace.formats.measured import BACKWARD, BOTH, FORWARD, Imported, Plane, Run, Series, merge
from warpspace.formats.numbers import (
    DEG_PER,
    MM_PER,
    UM_PER,
    URAD_PER,
    check_error,
    check_position,
    read_number,
    read_whole,
    spell,
    unit_factor,
)
from warpspace.formats.source import Source, shown
from warpspace.machine.axes import is_axis_name, is_linear
from warpspace.machine.limits import MAX_CSV_COLUMNS, MAX_POINTS, MAX_RUNS
from warpspace.machine.parameters import PARAMETERS, parameter

NAME = "csv"
SEPARATORS = (";", "\t", ",")
DIRECTIONS: Mapping[str, int] = {
    "": BOTH,
    "0": BOTH,
    "+": FORWARD,
    "1": FORWARD,
    "+1": FORWARD,
    "forward": FORWARD,
    "-": BACKWARD,
    "-1": BACKWARD,
    "−": BACKWARD,
    "backward": BACKWARD,
}
RUN, DIRECTION = "run", "direction"
SAME = 1e-9
"""mm or degrees: positions nearer than this are one."""
_HEADING = re.compile(r"(?:(u)\s*\(\s*)?([A-Za-z0-9]+)\s*\)?\s*(?:\[\s*([^\]]+?)\s*\]|_([A-Za-zµμ°/]+))?")


@dataclass(frozen=True)
class _Column:
    """One column of a table: what it holds, and the factor to µm, µrad, mm or degrees."""

    role: str
    name: str
    factor: float = 1.0
    unit: str = ""


def recognise(head: str, name: str) -> bool:
    """Tell it by a header that names an axis or an error with its unit."""
    del name
    line = next((text for text in head.splitlines() if _is_content(text)), "")
    parts = [part.strip() for part in line.split(_separator(line))]
    found = [_HEADING.fullmatch(part) for part in parts]
    if not any(one and (one[2] in PARAMETERS) for one in found):
        return False
    return any(one and (one[3] or one[4]) for one in found)


def _is_content(text: str) -> bool:
    """Tell a line from a comment or an empty one."""
    return bool(text.strip().strip(",;\t")) and not text.lstrip().startswith("#")


def _separator(header: str) -> str:
    """Find what parts the columns."""
    return next((mark for mark in SEPARATORS if mark in header), ",")


def _columns(source: Source, line: int, parts: Sequence[str]) -> list[_Column]:
    """Read the header."""
    found: list[_Column] = []
    if len(parts) > MAX_CSV_COLUMNS:
        source.refuse(f"{len(parts)} columns; expected at most {MAX_CSV_COLUMNS}", line)
    for part in parts:
        lower = part.strip().lower()
        if lower in (RUN, DIRECTION):
            found.append(_Column(lower, lower))
            continue
        matched = _HEADING.fullmatch(part.strip())
        if matched is None:
            expected = "expected headings such as X [mm], EXX [um], u(EXX) [um], run, direction"
            source.refuse(f"column {shown(part)}; {expected}", line)
        name, unit = matched[2].upper(), (matched[3] or matched[4] or "").strip()
        uncertain = bool(matched[1])
        if name in PARAMETERS:
            known = URAD_PER if parameter(name).is_rotation else UM_PER
            _need_unit(unit, name, known, source, line)
            role = "uncertainty" if uncertain else "error"
            found.append(_Column(role, name, unit_factor(unit, known, source, line), unit))
        elif is_axis_name(name) and not uncertain:
            known = MM_PER if is_linear(name) else DEG_PER
            _need_unit(unit, name, known, source, line)
            found.append(_Column("position", name, unit_factor(unit, known, source, line), unit))
        else:
            hint = near_miss(name, [*"XYZABCUVW", *(f"E{a}{b}" for a in "XYZABC" for b in "XYZABC")])
            source.refuse(f"column {shown(part)} is no axis and no error{hint}", line)
    seen = [(one.role, one.name) for one in found]
    if twice := next((one for one in seen if seen.count(one) > 1), None):
        source.refuse(f"column {twice[1]} stands there twice", line)
    return found


def _need_unit(unit: str, name: str, known: Mapping[str, float], source: Source, line: int) -> None:
    """Refuse a column without a unit: nothing is assumed."""
    if not unit:
        units = ", ".join(one for one in known if one.isascii())
        source.refuse(f"column {name} has no unit; expected {name} [unit], of {units}", line)


def read(sources: Sequence[Source], options: ReadOptions) -> Imported:
    """Read tables of measured errors."""
    del options
    return merge([_read_one(source) for source in sources])


def _read_one(source: Source) -> Imported:
    """Read one table."""
    numbered = [(i, text) for i, text in enumerate(source.lines, 1) if _is_content(text)]
    if not numbered:
        source.refuse("has no header")
    line, header = numbered[0]
    mark = _separator(header)
    columns = _columns(source, line, header.split(mark))
    errors = [one for one in columns if one.role == "error"]
    if not errors:
        source.refuse("has no column of an error; expected for instance EXX [um]", line)
    if len(numbered) < 2:
        source.refuse("has no rows below its header", line)
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
        return _planes(source, rows, columns, units)
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
    source: Source, numbered: Sequence[tuple[int, str]], columns: Sequence[_Column], mark: str
) -> list[Row]:
    """Read the rows in the units of the model."""
    comma = mark != ","
    rows: list[Row] = []
    for number, text in numbered:
        parts = text.split(mark)
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
    source: Source, rows: Sequence[Row], columns: Sequence[_Column], units: tuple[str, ...], line: int
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
    source: Source, rows: Sequence[Row], columns: Sequence[_Column]
) -> tuple[list[Series], list[str]]:
    """Sort rows into runs over the positions of one axis."""
    axis = next(one.name for one in columns if one.role == "position")
    at = np.array([row["position", axis] for _, row in rows])
    places = _distinct(at)
    ways = [(int(row.get((RUN, RUN), 1)), int(row.get((DIRECTION, DIRECTION), BOTH)))
            for _, row in rows]
    known = list(dict.fromkeys(ways))
    if len(known) > MAX_RUNS:
        source.refuse(f"has {len(known)} runs; expected at most {MAX_RUNS}")
    index = np.abs(places[None, :] - at[:, None]).argmin(axis=1) if len(rows) < 5000 else (
        np.clip(np.searchsorted(places, at - SAME), 0, len(places) - 1))
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
            source.refuse(f"column {column.name} is empty")
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


def _distinct(at: np.ndarray) -> np.ndarray:
    """Give the positions, each once, ascending."""
    ordered = np.sort(at)
    return ordered[np.concatenate([[True], np.diff(ordered) > SAME])]


def _uncertainty(
    rows: Sequence[Row], key: str, index: np.ndarray, count: int
) -> tuple[float, ...]:
    """Give the standard uncertainty at each position, the largest of those given."""
    found = np.zeros(count)
    for place, (_, row) in zip(index.tolist(), rows, strict=True):
        value = row.get(("uncertainty", key), math.nan)
        if not math.isnan(value):
            found[place] = max(found[place], abs(value))
    return tuple(found.tolist()) if found.any() else ()


def _planes(
    source: Source, rows: Sequence[Row], columns: Sequence[_Column], units: tuple[str, ...]
) -> Imported:
    """Read errors over two axes."""
    first, second = (one.name for one in columns if one.role == "position")
    planes = []
    for column in columns:
        if column.role != "error":
            continue
        own = parameter(column.name).axis
        if own not in (first, second):
            expected = f"expected errors of {first} or {second}"
            source.refuse(f"column {column.name} is an error of {own}; {expected}")
        names = (own, second if own == first else first)
        points = [
            (line, row["position", names[0]], row["position", names[1]], row["error", column.name])
            for line, row in rows
        ]
        planes.append(plane_of(column.name, names, points, source))
    return Imported(NAME, planes=tuple(planes), units=units, notes=source.notes)


def plane_of(
    key: str,
    axes: tuple[str, str],
    points: Sequence[tuple[int, float, float, float]],
    source: Source,
) -> Plane:
    """Build an error of two axes from its points: line, both positions, value.

    Raises
    ------
    SceneError
        If they are no full grid.
    """
    first = _distinct(np.array([point[1] for point in points]))
    second = _distinct(np.array([point[2] for point in points]))
    values = np.full((len(first), len(second)), math.nan)
    for line, one, other, value in points:
        i = int(np.abs(first - one).argmin())
        j = int(np.abs(second - other).argmin())
        if not math.isnan(values[i, j]):
            found = f"{axes[0]} {one:g}, {axes[1]} {other:g} stands there twice"
            source.refuse(f"{found}; expected every point once", line)
        values[i, j] = value
    if np.isnan(values).any():
        i, j = np.argwhere(np.isnan(values))[0]
        found = f"{key} has no value at {axes[0]} {first[i]:g}, {axes[1]} {second[j]:g}"
        source.refuse(f"{found}; expected a value at every point of the grid")
    rows = tuple(tuple(row) for row in values.tolist())
    return Plane(key, axes, tuple(first.tolist()), tuple(second.tolist()), rows)


def template(axis: str, places: Sequence[float] = ()) -> str:
    """Write a table to fill in for an axis."""
    linear = is_linear(axis)
    keys = [f"E{letter}{axis}" for letter in "XYZABC"]
    spans = places or ((-250, -125, 0, 125, 250) if linear else (0, 90, 180, 270, 360))
    unit = {key: "urad" if parameter(key).is_rotation else "um" for key in keys}
    header = [
        f"{axis} [{'mm' if linear else 'deg'}]",
        RUN,
        DIRECTION,
        *(f"{key} [{unit[key]}]" for key in keys),
        *(f"u({key}) [{unit[key]}]" for key in keys),
    ]
    lines = [
        f"# Errors of the {axis} axis: actual - nominal, a row a position of a run.",
        "# Units stand in brackets and may be changed: um mm nm in, urad mrad rad arcsec deg.",
        "# run: 1, 2, 3 …; direction: + towards growing positions, - towards falling ones.",
        "# u(…): standard uncertainties (k = 1). Columns that are not needed may be left out.",
        *(f"# {key}: {parameter(key).name}" for key in keys),
        ",".join(header),
    ]
    blank = "," * (2 * len(keys))
    for direction, ordered in (("+", spans), ("-", tuple(reversed(spans)))):
        lines += [f"{q:g},1,{direction}{blank}" for q in ordered]
    return "\n".join(lines) + "\n"


def write(wanted: Wanted) -> Files:
    """Write the errors of a scene: constants in the main file, one file an axis beside it."""
    held = sampled(wanted)
    digits = 6
    files: dict[str, str] = {}
    if held.constants:
        keys = list(held.constants)
        units = ["urad" if parameter(key).is_rotation else "um" for key in keys]
        head = ",".join(f"{key} [{unit}]" for key, unit in zip(keys, units, strict=True))
        files["_constant.csv"] = head + "\n" + ",".join(
            spell(held.constants[key], digits) for key in keys) + "\n"
    for axis in dict.fromkeys(parameter(one.key).axis for one in held.series):
        rows = table_of([one for one in held.series if parameter(one.key).axis == axis])
        unit = "mm" if is_linear(axis) else "deg"
        heads = [f"{key} [{'urad' if parameter(key).is_rotation else 'um'}]" for key in rows.keys]
        lines = [",".join([f"{axis} [{unit}]", *([DIRECTION] if rows.directed else []), *heads])]
        for position, way, values in rows.rows:
            told = [{FORWARD: "+", BACKWARD: "-"}.get(way, "")] if rows.directed else []
            lines.append(",".join([repr(position), *told, *(spell(v, digits) for v in values)]))
        files[f"_{axis}.csv"] = "\n".join(lines) + "\n"
    for plane in held.planes:
        unit = "urad" if parameter(plane.key).is_rotation else "um"
        units = ["mm" if is_linear(axis) else "deg" for axis in plane.axes]
        heads = [f"{axis} [{one}]" for axis, one in zip(plane.axes, units, strict=True)]
        lines = [",".join([*heads, f"{plane.key} [{unit}]"])]
        for i, first in enumerate(plane.first):
            lines += [
                f"{first!r},{second!r},{spell(plane.values[i][j], digits)}"
                for j, second in enumerate(plane.second)
            ]
        files[f"_{plane.key}.csv"] = "\n".join(lines) + "\n"
    names = list(files)
    if not names:
        return {"": "EXX [um]\n0.0\n"}
    files[""] = files.pop(names[0])
    return files


FORMAT = Format(
    name=NAME,
    title="measurement table of warpspace",
    source="docs/import.md",
    endings=(".csv", ".txt"),
    holds="any error along its axis or over two axes, runs, directions, uncertainties; constants",
    units="as the header says: um mm nm in, urad mrad rad arcsec deg",
    grid="any positions",
    limits=f"{MAX_POINTS:,} rows",
    recognise=recognise,
    read=read,
    write=write,
    points=41,
    most_points=2001,
    parametric=True,
    orientation=True,
)
