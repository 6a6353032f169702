"""HEIDENHAIN nonlinear axis error compensation: tables `.COM`, assigned to axes by a `.CMA`.

HEIDENHAIN Technical Manual MANUALplus 620, pages 713 to 718, and TNC 407/415/425, pages 4-28 to
4-31: columns AXISPOS and BACKLASH and one for each corrected axis, equal steps, at most 256 points,
linear between them; `axis of the column in the .COM = F(axis of the column in the .CMA)`.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.kind import ERROR, Files, Format, ReadOptions, resolve_axis
from warpspace.formats.measured import Imported
from warpspace.formats.numbers import check_position, read_number
from warpspace.formats.source import Source
from warpspace.formats.table_errors import errors_of
from warpspace.formats.terms import HELD, Line, Tables
from warpspace.machine.travel import TravelDirection
from warpspace.units import Array

MOST_POINTS = 256
"""Entries of one table (TNC 407 Technical Manual, module 9095, error 3)."""
RESOLUTION = 1e-4
"""mm or degrees, as the tables are printed."""
STEP_SHARE = 1e-3
SIGN = (
    "values are errors, which the control takes back (TNC 360 Technical Manual, page 4-24: the"
    " table follows the error curve); --sign correction says otherwise"
)
TRAVEL = (
    "BACKLASH is the value for travel in the negative direction; positions beyond the table take"
    " its end values"
)
POSITION, BACKLASH, NUMBER, ACTIVE = "AXISPOS", "BACKLASH", "NR", "ACTIVE"
WIDTH = 12
Cells = dict[str, str]
Columns = dict[str, list[str]]


def recognise(head: str, name: str) -> bool:
    """Tell it by its first line or its columns."""
    if name.upper().endswith((".COM", ".CMA")) and "BEGIN" in head.upper():
        return True
    return POSITION in head.upper().split()


def _rows(source: Source) -> list[tuple[int, Cells]]:
    """Read a table: its columns by the places of their headings, its rows by line."""
    lines = [(number, text) for number, text in enumerate(source.lines, 1) if text.strip()]
    if lines and lines[0][1].lstrip().upper().startswith("BEGIN"):
        if "INCH" in lines[0][1].upper().split():
            source.refuse("is in inches; expected a table in millimetres (MM)", lines[0][0])
        lines = lines[1:]
    if not lines:
        source.refuse("has no columns; expected a line such as NR AXISPOS BACKLASH X")
    _, head = lines[0]
    names = head.upper().lstrip("#").split()
    if not lines[-1][1].strip().upper().startswith("[END]"):
        source.refuse("is not the end; expected [END] (is the file cut off?)", lines[-1][0])
    starts = [_start(head.upper(), names, index) for index in range(len(names))]
    if len(lines) - 2 > MOST_POINTS:
        found = f"has {len(lines) - 2} rows"
        expected = f"expected at most {MOST_POINTS}, as the control takes"
        source.refuse(f"{found}; {expected}", lines[MOST_POINTS + 1][0])
    rows: list[tuple[int, Cells]] = []
    for number, text in lines[1:-1]:
        parts = text.split()
        if len(parts) != len(names):
            ends = [*starts[1:], len(text) + 1]
            parts = [text[low:high].strip() for low, high in zip(starts, ends, strict=True)]
            if any(" " in part for part in parts):
                expected = f"expected {len(names)} columns: {' '.join(names)}"
                source.refuse(f"{source.shown(number)}; {expected}", number)
        rows.append((number, dict(zip(names, parts, strict=True))))
    return rows


def _start(head: str, names: Sequence[str], index: int) -> int:
    """Find where a column begins."""
    at = 0
    for name in names[:index]:
        at = head.index(name, at) + len(name)
    return 0 if index == 0 else head.index(names[index], at)


def _assignment(sources: Sequence[Source]) -> tuple[dict[str, list[str]], list[Source]]:
    """Read which table belongs to which axes: file name in capitals to axes; and the tables."""
    axes: dict[str, list[str]] = {}
    tables: list[Source] = []
    for source in sources:
        if not source.name.upper().endswith(".CMA"):
            tables.append(source)
            continue
        rows = _rows(source)
        marked = [row for row in rows if row[1].get(ACTIVE, "").strip() == "*"]
        if not rows:
            source.refuse("has no line; expected one with the names of .COM tables")
        if len(marked) != 1 and len(rows) > 1:
            source.refuse(f"has {len(marked)} active lines; expected one with * in {ACTIVE}")
        _, cells = (marked or rows)[0]
        for column, value in cells.items():
            if column not in (NUMBER, ACTIVE) and value not in ("", "-"):
                axes.setdefault(_stem(value), []).append(column)
    return axes, tables


def _stem(name: str) -> str:
    """Give the name of a file in capitals, without folder and ending."""
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    return last.rsplit(".", 1)[0].upper()


def _looked_up(source: Source, axes: dict[str, list[str]], options: ReadOptions) -> str:
    """Find the axis that a table is looked up over."""
    named = axes.get(_stem(source.name), [])
    if len(named) > 1:
        source.refuse(f"is entered for {', '.join(named)}; expected one axis a table")
    if named:
        return resolve_axis(named[0], source, None, options)
    last = _stem(source.name).rsplit("_", 1)[-1]
    if options.axis:
        return resolve_axis(options.axis, source, None, options)
    if len(last) == 1 and last in "XYZUVWABC":
        return resolve_axis(last, source, None, options)
    expected = "expected its .CMA file beside it, or --axis X"
    raise source.unsaid(f"does not say over which axis; {expected}")


def _lines(source: Source, along: str, options: ReadOptions) -> list[Line]:
    """Build the tables of one .COM file."""
    rows = _rows(source)
    if not rows:
        source.refuse("has no compensation points; expected at least one")
    columns = [name for name in rows[0][1] if name not in (NUMBER, POSITION, BACKLASH)]
    if POSITION not in rows[0][1] or not columns:
        source.refuse(f"expected the columns {POSITION} and one for each corrected axis")
    places = np.array([_value(cells[POSITION], source, line, POSITION) for line, cells in rows])
    _check_steps(places, rows, source)
    factor = options.factor(ERROR)
    lines: list[Line] = []
    for column in columns:
        if all(not cells[column] for _, cells in rows):
            continue
        target = resolve_axis(column, source, rows[0][0], options)
        known = [
            (q, _value(cells[column], source, line, column))
            for q, (line, cells) in zip(places, rows, strict=True)
            if cells[column]
        ]
        at, found = np.array(known).T
        values = factor * np.interp(places, at, found)
        backward: tuple[float, ...] = ()
        if any(cells.get(BACKLASH) for _, cells in rows):
            if len(columns) > 1:
                expected = "expected one corrected axis in a table with BACKLASH"
                source.refuse(f"gives {BACKLASH} and {len(columns)} axes; {expected}", rows[0][0])
            backward = tuple(
                factor * _value(cells[BACKLASH] or cells[column], source, line, BACKLASH)
                for line, cells in rows
            )
        lines.append(
            Line(along, target, tuple(places.tolist()), tuple(values.tolist()), HELD, backward)
        )
    return lines


def _check_steps(places: np.ndarray, rows: Sequence[tuple[int, Cells]], source: Source) -> None:
    """Refuse positions that do not ascend in equal steps."""
    steps = np.diff(places)
    if not len(steps):
        return
    for index, step in enumerate(steps):
        line = rows[index + 1][0]
        if step <= 0.0:
            found = f"{POSITION} {places[index + 1]:g} after {places[index]:g}"
            source.refuse(f"{found}; expected ascending positions", line)
        if abs(step - steps[0]) > max(STEP_SHARE * steps[0], 2.0 * RESOLUTION):
            found = f"step of {step:g} after steps of {steps[0]:g}"
            source.refuse(f"{found}; expected equal steps, as the control does", line)


def _value(text: str, source: Source, line: int, what: str) -> float:
    """Read a number of a table."""
    return check_position(read_number(text, source, line, what), source, line, what)


def read_tables(sources: Sequence[Source], options: ReadOptions) -> Tables:
    """Read the tables as the control holds them."""
    axes, tables = _assignment(sources)
    if not tables:
        sources[0].refuse("names tables; expected the .COM files it names beside it")
    terms: list[Line] = []
    for source in tables:
        along = _looked_up(source, axes, options)
        if any(term.source == along for term in terms):
            source.refuse(f"is a second table over {along}; expected one active table an axis")
        terms += _lines(source, along, options)
    said = f"sign: {options.sign}" if options.sign else SIGN
    return Tables(tuple(terms), (said, TRAVEL))


def read(sources: Sequence[Source], options: ReadOptions) -> Imported:
    """Read the errors that the tables correct."""
    return errors_of(read_tables(sources, options), FORMAT.name, sources[0], options)


def write(wanted: Wanted) -> Files:
    """Write a table for each axis that spans the volume, and the file that assigns them."""
    stem = wanted.stem.upper()
    files: dict[str, str] = {}
    mean = {axis: float(value) for axis, value in wanted.averaged([]).items()}
    targets = wanted.corrector.moved
    for axis in wanted.axes:
        places = wanted.places(axis)
        values = wanted.averaged([axis])
        home = {target: target if target in wanted.axes else wanted.axes[0] for target in targets}
        taken = {target: 0.0 if home[target] == axis else mean[target] for target in targets}

        def spelled(found: Mapping[str, Array], taken: Mapping[str, float] = taken) -> Columns:
            """Spell what is needed of each axis, without what stands in another table."""
            factor = wanted.factor(ERROR)
            return {
                target: [
                    f"{v:+.4f}" for v in wanted.round(factor * (found[target] - taken[target]))
                ]
                for target in targets
            }

        columns = _with_backlash(wanted, axis, spelled) or spelled(values)
        rows = [(POSITION, *columns)]
        rows += [(f"{q:+.4f}", *found) for q, *found in zip(places, *columns.values(), strict=True)]
        files[f"_{axis}.COM"] = _spelled(f"{stem}_{axis}.COM", rows)
    header = (ACTIVE, *wanted.axes)
    files[""] = _spelled(
        f"{stem}.CMA", [header, ("*", *(f"{stem}_{axis}" for axis in wanted.axes))], width=24
    )
    return files


def _with_backlash(
    wanted: Wanted, axis: str, spelled: Callable[[Mapping[str, Array]], Columns]
) -> Columns:
    """Spell the one column of a table and its values for travel in the negative direction.

    Empty where they do not depend on the direction, and where several axes are corrected over the
    one: which of them BACKLASH belongs to is not published then.
    """
    if axis not in wanted.directed:
        return {}
    there, back = (
        spelled(wanted.toward(way, axis).averaged([axis]))
        for way in (TravelDirection.FORWARD, TravelDirection.BACKWARD)
    )
    used = [
        target for target in there if any(float(value) for value in (*there[target], *back[target]))
    ]
    if len(used) != 1 or there == back:
        return {}
    return {BACKLASH: back[used[0]], used[0]: there[used[0]]}


def _spelled(name: str, rows: Sequence[Sequence[str]], width: int = WIDTH) -> str:
    """Spell a table in columns."""
    lines = [f"BEGIN {name} MM"]
    for number, row in enumerate(rows):
        first = NUMBER if number == 0 else str(number - 1)
        lines.append(first.ljust(6) + "".join(cell.ljust(width) for cell in row).rstrip())
    return "\r\n".join([*lines, "[END]"]) + "\r\n"


FORMAT = Format(
    name="heidenhain",
    title="HEIDENHAIN .COM and .CMA, nonlinear axis error compensation",
    source="HEIDENHAIN, Technical Manual MANUALplus 620 (01/2012), 6.10.3, pages 713 to 718",
    endings=(".cma", ".com"),
    holds="displacements of any axis over any axis; by direction where a table corrects one axis",
    units="mm, degrees",
    grid="equal steps along the axis looked up",
    limits="256 points a table, 0.0001 mm",
    recognise=recognise,
    read=read,
    tables=read_tables,
    write=write,
    most_points=MOST_POINTS,
)
