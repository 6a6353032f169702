"""HEIDENHAIN nonlinear axis error compensation: tables `.COM`, assigned to axes by a `.CMA`.

HEIDENHAIN Technical Manual MANUALplus 620, pages 713 to 718, and TNC 407/415/425, pages 4-28 to
4-31: columns AXISPOS and BACKLASH and one for each corrected axis, equal steps, at most 256 points,
linear between them; `axis of the column in the .COM = F(axis of the column in the .CMA)`.
"""

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from warpspace.formats.compensation.corrections import RequiredCorrections
from warpspace.formats.registry import ERROR, Files, Format, ReadOptions, describe
from warpspace.formats.source import Source, SourceLine
from warpspace.formats.terms import AxisTable, Tables
from warpspace.machine.axes import TravelDirection
from warpspace.units import Array

MAX_TABLE_POINTS = 256  # entries of one table (TNC 407 Technical Manual, module 9095, error 3)
RESOLUTION = 1e-4  # mm or degrees, as the tables are printed
STEP_SHARE = 1e-3
SIGN = (
    "values are errors, which the control subtracts (TNC 360 Technical Manual, page 4-24: the"
    " table follows the error curve); the sign of a correction is the opposite"
)
TRAVEL = (
    "BACKLASH is the value for travel in the negative direction; the end values apply beyond the"
    " table"
)
POSITION, BACKLASH, NUMBER, ACTIVE = "AXISPOS", "BACKLASH", "NR", "ACTIVE"
WIDTH = 12
Cells = dict[str, str]
Columns = dict[str, list[str]]


def recognise(head: str, _name: str) -> bool:
    is_table = re.match(r"\s*BEGIN\s+\S+\.(?:COM|CMA)\b", head, re.IGNORECASE)
    return is_table is not None or POSITION in head.upper().split()


def _rows(source: Source) -> list[tuple[SourceLine, Cells]]:
    lines = [(source.at(at), text) for at, text in enumerate(source.lines, 1) if text.strip()]
    if lines and lines[0][1].lstrip().upper().startswith("BEGIN"):
        if "INCH" in lines[0][1].upper().split():
            lines[0][0].refuse("is in inches", "a table in millimetres (MM)")
        lines = lines[1:]
    if not lines:
        source.refuse("has no columns", "a line such as NR AXISPOS BACKLASH X")
    head = lines[0][1].upper()
    names = head.lstrip("#").split()
    if not lines[-1][1].strip().upper().startswith("[END]"):
        lines[-1][0].refuse("is not the end", "[END] (is the file truncated?)")
    if len(lines) - 2 > MAX_TABLE_POINTS:
        expected = f"at most {MAX_TABLE_POINTS}, the limit of the control"
        lines[MAX_TABLE_POINTS + 1][0].refuse(f"has {len(lines) - 2} rows", expected)
    starts, end = [0], 0
    for before, name in pairwise(names):
        end = head.index(before, end) + len(before)
        starts.append(head.index(name, end))
    rows: list[tuple[SourceLine, Cells]] = []
    for at, text in lines[1:-1]:
        parts = text.split()
        if len(parts) != len(names):
            ends = [*starts[1:], len(text) + 1]
            parts = [text[low:high].strip() for low, high in zip(starts, ends, strict=True)]
            if any(" " in part for part in parts):
                at.refuse(at.quoted, f"{len(names)} columns: {' '.join(names)}")
        rows.append((at, dict(zip(names, parts, strict=True))))
    return rows


def _assignment(sources: Sequence[Source]) -> tuple[dict[str, list[str]], list[Source]]:
    axes: dict[str, list[str]] = {}
    tables: list[Source] = []
    for source in sources:
        if not source.name.upper().endswith(".CMA"):
            tables.append(source)
            continue
        rows = _rows(source)
        marked = [row for row in rows if row[1].get(ACTIVE, "").strip() == "*"]
        if not rows:
            source.refuse("has no line", "one with the names of .COM tables")
        if len(marked) != 1 and len(rows) > 1:
            source.refuse(f"has {len(marked)} active lines", f"one with * in {ACTIVE}")
        _, cells = (marked or rows)[0]
        for column, name in cells.items():
            if column not in (NUMBER, ACTIVE) and name not in ("", "-"):
                axes.setdefault(Source(name, ()).stem.upper(), []).append(column)
    return axes, tables


def _lookup_axis(source: Source, axes: dict[str, list[str]], options: ReadOptions) -> str:
    named = axes.get(source.stem.upper(), [])
    if len(named) > 1:
        source.refuse(f"is entered for {', '.join(named)}", "one axis per table")
    if named:
        return options.axis_named(named[0], source)
    return options.axis_of_file(source, "its .CMA file with it, or {axis} X")


def _lines(source: Source, along: str, options: ReadOptions, notes: list[str]) -> list[AxisTable]:
    rows = _rows(source)
    if not rows:
        source.refuse("has no compensation points", "at least one")
    columns = [
        name
        for name in rows[0][1]
        if name not in (NUMBER, POSITION, BACKLASH) and any(cells[name] for _, cells in rows)
    ]
    if POSITION not in rows[0][1] or not columns:
        source.refuse(f"expected the columns {POSITION} and one for each corrected axis")
    places = np.array([at.position(cells[POSITION], POSITION) for at, cells in rows])
    steps = np.diff(places)
    for before, place, step, (at, _) in zip(places[:-1], places[1:], steps, rows[1:], strict=True):
        at.ascending(place, before, POSITION)
        if abs(step - steps[0]) > max(STEP_SHARE * steps[0], 2.0 * RESOLUTION):
            expected = "equal steps, a requirement of the control"
            at.refuse(f"step of {step:g} after steps of {steps[0]:g}", expected)
    factor = options.factor(ERROR)
    lines: list[AxisTable] = []
    for column in columns:
        empty = [at.line for at, cells in rows if not cells[column]]
        if empty:
            notes.append(f"{source.base}: {column} is empty in line {empty[0]}: interpolated")
        target = options.axis_named(column, rows[0][0])
        points = [
            (q, at.position(cells[column], column))
            for q, (at, cells) in zip(places, rows, strict=True)
            if cells[column]
        ]
        values = factor * np.interp(places, *np.array(points).T)
        backward: tuple[float, ...] = ()
        if any(cells.get(BACKLASH) for _, cells in rows):
            if len(columns) > 1:
                expected = "one corrected axis in a table with BACKLASH"
                rows[0][0].refuse(f"has {BACKLASH} and {len(columns)} axes", expected)
            backward = tuple(
                factor * at.position(cells[BACKLASH] or cells[column], BACKLASH)
                for at, cells in rows
            )
        corrections = tuple(values.tolist())
        table = AxisTable(along, target, tuple(places.tolist()), corrections, backward=backward)
        lines.append(table)
    return lines


def read_tables(sources: Sequence[Source], options: ReadOptions) -> Tables:
    axes, tables = _assignment(sources)
    if not tables:
        sources[0].refuse("names tables", "these .COM files with it")
    terms: list[AxisTable] = []
    notes: list[str] = []
    for source in tables:
        along = _lookup_axis(source, axes, options)
        if any(term.source == along for term in terms):
            source.refuse(f"is a second table over {along}", "one active table per axis")
        terms += _lines(source, along, options, notes)
    return Tables(tuple(terms), (options.sign_statement(SIGN), TRAVEL), tuple(notes))


def write(required: RequiredCorrections) -> Files:
    stem = required.stem.upper()
    files: dict[str, str] = {}
    mean = {axis: float(value) for axis, value in required.averaged([]).items()}
    targets = required.corrector.moved
    for axis in required.axes:
        places = required.positions(axis)
        # the mean of each target is part of one table only
        home = {
            target: target if target in required.axes else required.axes[0] for target in targets
        }
        offsets = {target: 0.0 if home[target] == axis else mean[target] for target in targets}
        columns = _with_backlash(required, axis, offsets)
        if not columns:
            columns = _format_columns(required, required.averaged([axis]), offsets)
        rows = [(POSITION, *columns)]
        rows += zip([f"{q:+.4f}" for q in places], *columns.values(), strict=True)
        files[f"_{axis}.COM"] = _format_table(f"{stem}_{axis}.COM", rows)
    assignment = [(ACTIVE, *required.axes), ("*", *(f"{stem}_{axis}" for axis in required.axes))]
    files[""] = _format_table(f"{stem}.CMA", assignment, width=24)
    return files


def _format_columns(
    required: RequiredCorrections, moves: Mapping[str, Array], offsets: Mapping[str, float]
) -> Columns:
    """Format the corrections of each axis, less the offsets that another table contains."""
    factor = required.factor(ERROR)
    return {
        target: [f"{v:+.4f}" for v in required.round(factor * (moves[target] - offset))]
        for target, offset in offsets.items()
    }


def _with_backlash(
    required: RequiredCorrections, axis: str, offsets: Mapping[str, float]
) -> Columns:
    """Format the single column of a table and its values for travel in the negative direction.

    Empty where they do not depend on the direction, and where several axes are corrected over the
    axis: the meaning of BACKLASH is not published for this case.
    """
    if axis not in required.directional_axes:
        return {}
    forward, backward = (
        _format_columns(required, required.for_direction(direction, axis).averaged([axis]), offsets)
        for direction in (TravelDirection.FORWARD, TravelDirection.BACKWARD)
    )
    used = [target for target in forward if any(map(float, (*forward[target], *backward[target])))]
    if len(used) != 1 or forward == backward:
        return {}
    return {BACKLASH: backward[used[0]], used[0]: forward[used[0]]}


def _format_table(name: str, rows: Sequence[Sequence[str]], width: int = WIDTH) -> str:
    lines = [f"BEGIN {name} MM"]
    for number, row in enumerate(rows):
        first = NUMBER if number == 0 else str(number - 1)
        lines.append(first.ljust(6) + "".join(cell.ljust(width) for cell in row).rstrip())
    return "\r\n".join([*lines, "[END]"]) + "\r\n"


FORMATS = (
    Format(
        **describe("heidenhain"), recognise=recognise, tables=read_tables, write=write,
        most_points=MAX_TABLE_POINTS,
    ),
)  # fmt: skip
