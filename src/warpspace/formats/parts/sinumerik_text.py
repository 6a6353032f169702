"""Assignments of system variables in SINUMERIK archives: `$NAME[index, …] = value ; comment`."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from warpspace.formats.kind import Files
from warpspace.formats.numbers import read_number, read_whole, spell
from warpspace.formats.source import Source, shown
from warpspace.formats.terms import HELD, MODULO, Line
from warpspace.units import Array

DIGITS = 7
"""Digits behind the point of a value: a tenth of a nanometre."""
STEP_SHARE = 1e-4
"""Share of a step by which start, end and step may disagree."""
MOST_INDEX = 100_000
NUMBERS = ("STEP", "MIN", "MAX")
"""Range of a table."""
_ASSIGNMENT = re.compile(r"\$([A-Z_]+)\s*\[([^\]]*)\]\s*=\s*(.+)")
_QUIET = re.compile(r"(%.*|;.*|CHANDATA\(\d+\)|M17|M30|M02|N\d+)?", re.IGNORECASE)


@dataclass(frozen=True)
class Assignment:
    """One line of an archive.

    Attributes
    ----------
    line : int
    name : str
        Without the dollar sign.
    indices : tuple of str
    value : str
    """

    line: int
    name: str
    indices: tuple[str, ...]
    value: str


@dataclass
class Table:
    """What a file says of one table, as it is read line by line.

    Attributes
    ----------
    line : int
        Where it begins.
    values : dict of int to float
        By interpolation point.
    numbers : dict of str to float
        STEP, MIN and MAX.
    switches : dict of str to int
        IS_MODULO and the like; 0 where they are not set.
    """

    line: int
    values: dict[int, float] = field(default_factory=dict[int, float])
    numbers: dict[str, float] = field(default_factory=dict[str, float])
    switches: dict[str, int] = field(default_factory=dict[str, int])


def assigns(name: str, head: str) -> bool:
    """Tell whether a line of a file's head assigns a variable, or one whose name begins so."""
    return re.search(rf"^\s*(?:N\d+\s+)?\${name}[A-Z_]*\s*\[", head, re.MULTILINE) is not None


def assignments(source: Source, names: Sequence[str]) -> Iterator[Assignment]:
    """Give the assignments of a file.

    Parameters
    ----------
    source : Source
    names : sequence of str
        Variables that are understood.

    Yields
    ------
    Assignment

    Raises
    ------
    SceneError
        If a line is no assignment, or of another variable.
    """
    for number, text in enumerate(source.lines, start=1):
        bare = text.split(";")[0].strip()
        bare = re.sub(r"^N\d+\s+", "", bare)
        if _QUIET.fullmatch(bare):
            continue
        found = _ASSIGNMENT.fullmatch(bare)
        if found is None:
            expected = "expected $VARIABLE[index, …] = value"
            source.refuse(f"{source.shown(number)}; {expected}", number)
        name, indices, value = found.groups()
        if name not in names:
            expected = ", ".join(f"${known}" for known in names)
            source.refuse(f"variable ${name}; expected one of {expected}", number)
        parts = tuple(part.strip() for part in re.split(r"[,.]", indices))
        yield Assignment(number, name, parts, value.strip())


def places_of(start: float, end: float, step: float, source: Source, what: str, line: int) -> Array:
    """Give the interpolation points of a table.

    Raises
    ------
    SceneError
        If start, end and step do not fit together, as the controller would find.
    """
    if step <= 0.0 or end <= start:
        found = f"{what}: step {step:g} from {start:g} to {end:g}"
        source.refuse(f"{found}; expected a step above 0 and an end above the start", line)
    count = (end - start) / step
    if abs(count - round(count)) > STEP_SHARE:
        found = f"{what}: {start:g} to {end:g} is no whole number of steps of {step:g}"
        source.refuse(f"{found} ({count:.4g}); expected equal steps from start to end", line)
    if round(count) > MOST_INDEX:
        source.refuse(f"{what}: {round(count):,} steps; expected at most {MOST_INDEX:,}", line)
    return start + step * np.arange(round(count) + 1, dtype=np.float64)


def filled(
    values: dict[int, float], count: int, source: Source, what: str, line: int
) -> tuple[float, ...]:
    """Give the values of a table in order.

    Raises
    ------
    SceneError
        If a point has no value (the controller would keep an old one there), or there are too many.
    """
    missing = next((index for index in range(count) if index not in values), None)
    if missing is not None:
        found = f"{what}: interpolation point {missing} has no value"
        source.refuse(f"{found}; expected points 0 … {count - 1}, as start, end and step say", line)
    if len(values) > count:
        found = f"{what}: interpolation point {max(values)}"
        source.refuse(f"{found}; expected the last one to be {count - 1} at the end position", line)
    return tuple(values[index] for index in range(count))


def set_once(
    table: dict[int, float], index: int, value: float, source: Source, line: int, what: str
) -> None:
    """Note the value of an interpolation point.

    Raises
    ------
    SceneError
        If it has one already.
    """
    if index in table:
        source.refuse(f"{what}: interpolation point {index} is given twice; expected it once", line)
    table[index] = value


def index_of(text: str, source: Source, line: int) -> int:
    """Read the index of a table or of an interpolation point."""
    return read_whole(text, source, line, "index", 0, MOST_INDEX)


def flag_of(text: str, source: Source, line: int, what: str) -> bool:
    """Read 0 or 1."""
    return bool(read_whole(text, source, line, what, 0, 1))


def line_of(
    table: Table, axes: tuple[str, str], prefix: str, what: str, source: Source, factor: float
) -> Line:
    """Build a table as the controller evaluates it.

    Parameters
    ----------
    table : Table
    axes : tuple of str
        That looked up, and that corrected.
    prefix : str
        What its variables begin with.
    what : str
        What the table is called in messages.
    source : Source
    factor : float
        From a value to a correction.

    Raises
    ------
    SceneError
        If something is missing, or does not fit together.
    """
    for setting in NUMBERS:
        if setting not in table.numbers:
            found = f"{what}: ${prefix}_{setting} is missing; expected it (is the file cut off?)"
            source.refuse(found, table.line)
    step, start, end = (table.numbers[setting] for setting in NUMBERS)
    places = places_of(start, end, step, source, what, table.line)
    values = filled(table.values, len(places), source, what, table.line)
    return Line(
        *axes,
        tuple(places.tolist()),
        tuple(factor * value for value in values),
        MODULO if table.switches.get("IS_MODULO") else HELD,
        direction=table.switches.get("DIRECTION", 0),
    )


def point_lines(prefix: str, point: Callable[[int], str], values: Array) -> list[str]:
    """Spell the values of a table; the indices of each point are given by a function."""
    return [f"${prefix}[{point(i)}]={value_text(v)}" for i, v in enumerate(values.tolist())]


def range_lines(prefix: str, index: str, places: Array) -> list[str]:
    """Spell the range of a table in equal steps, whose own indices are given."""
    step = (places[-1] - places[0]) / (len(places) - 1)
    bounds = zip(NUMBERS, (step, places[0], places[-1]), strict=True)
    return [f"${prefix}_{setting}[{index}]={float(number)!r}" for setting, number in bounds]


def archive(name: str, body: Sequence[str]) -> Files:
    """Spell an archive with its head and its end."""
    return {"": "\n".join([f"%_N_{name}_INI", "CHANDATA(1)", *body, "M17"]) + "\n"}


def value_text(value: float) -> str:
    """Spell a value."""
    return spell(value, DIGITS)


def number_of(found: Assignment, source: Source) -> float:
    """Read the value of an assignment."""
    return read_number(found.value, source, found.line, f"${found.name}")


def name_of(text: str, source: Source, line: int) -> str:
    """Read the name of an axis: X1, (X1) or "X1"."""
    bare = text.strip().strip("()").strip().strip('"').strip()
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9]{0,15}", bare):
        source.refuse(f"axis {shown(text)}; expected the name of an axis", line)
    return bare.upper()
