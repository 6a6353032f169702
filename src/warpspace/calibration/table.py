"""A CSV file of readings: named columns of numbers, and where each row stands in the file."""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from warpspace.exceptions import SceneError, near_miss
from warpspace.machine.limits import MAX_CSV_BYTES
from warpspace.scene.files import read_text
from warpspace.units import Array

MAX_READINGS = 20_000
"""Rows that a file of readings may have."""
LABELS = ("session", "run")
"""Columns that hold a name; the first that is there tells sessions apart."""
MAX_LABEL = 60
MAX_SESSIONS = 100
"""Set-ups in one file: each has unknowns of its own."""


@dataclass(frozen=True, slots=True)
class ReadingTable:
    """The rows of a file of readings.

    Attributes
    ----------
    source : str
        Name of the file, for messages.
    columns : mapping of str to ndarray, [n]
        Numbers by the name of their column, in small letters.
    labels : mapping of str to tuple of str, (n,)
        Names by column: `session` and `run`.
    lines : tuple of int, (n,)
        Line of the file that each row stands on.
    text : str
        All of the file, for kinds that have columns of their own.
    """

    source: str
    columns: Mapping[str, Array]
    labels: Mapping[str, tuple[str, ...]]
    lines: tuple[int, ...]
    text: str = ""

    def __len__(self) -> int:
        """Count the rows."""
        return len(self.lines)

    def need(self, names: Sequence[str]) -> Array:
        """Give columns that must be there, [n, len(names)].

        Raises
        ------
        SceneError
            If one is missing.
        """
        missing = [name for name in names if name not in self.columns]
        if missing:
            there = ", ".join((*self.labels, *self.columns)) or "none"
            found = f"has no column {', '.join(missing)}{near_miss(missing[0], self.columns)}"
            expected = f"expected {', '.join(names)} (the columns there are: {there})"
            raise SceneError(self.source, [f"{found}; {expected}"])
        return np.column_stack([self.columns[name] for name in names])

    @property
    def session(self) -> tuple[str, ...] | None:
        """Names of the sessions, (n,); None where the file has no such column."""
        return next((self.labels[name] for name in LABELS if name in self.labels), None)


def read_table(path: Path) -> ReadingTable:
    """Read a CSV file; see `parse_table`."""
    return parse_table(read_text(path, MAX_CSV_BYTES), str(path))


def parse_table(text: str, source: str) -> ReadingTable:
    """Read the text of a CSV file with a header; lines that begin with # are remarks.

    Parameters
    ----------
    text : str
    source : str
        Name of the file, for messages; nothing is opened.

    Returns
    -------
    ReadingTable

    Raises
    ------
    SceneError
        If it is no table, or holds something that is no finite number.
    """
    lines = text.splitlines()
    kept = [
        (number, line)
        for number, line in enumerate(lines, 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not kept:
        raise SceneError(source, ["is empty; expected a header and rows of readings"])
    if len(kept) - 1 > MAX_READINGS:
        found = f"has {len(kept) - 1:,} rows; expected at most {MAX_READINGS:,}"
        raise SceneError(source, [found])
    delimiter = ";" if ";" in kept[0][1] else ","
    try:
        rows = list(
            csv.reader(io.StringIO("\n".join(line for _, line in kept)), delimiter=delimiter)
        )
    except csv.Error as error:
        raise SceneError(source, [f"is not valid CSV: {error}"]) from None
    if len(rows) != len(kept):
        raise SceneError(source, ["has texts over several lines; expected one row a line"])
    header = [name.strip().lower() for name in rows[0]]
    repeated = {name for name in header if header.count(name) > 1}
    if repeated:
        raise SceneError(source, [f"names column {min(repeated)!r} twice; expected each once"])
    body = [(number, row) for (number, _), row in zip(kept[1:], rows[1:], strict=True)]
    if not body:
        raise SceneError(source, ["has a header but no rows; expected readings below it"])
    table = replace(_parse(source, header, body), text=text)
    named = len(set(table.session or ()))
    if named > MAX_SESSIONS:
        found = f"names {named:,} sessions; expected at most {MAX_SESSIONS}"
        raise SceneError(source, [found])
    return table


def _parse(
    source: str, header: Sequence[str], body: Sequence[tuple[int, list[str]]]
) -> ReadingTable:
    """Turn the fields into numbers and names."""
    problems: list[str] = []
    numbers: dict[str, list[float]] = {name: [] for name in header if name not in LABELS}
    labels: dict[str, list[str]] = {name: [] for name in header if name in LABELS}
    for line, row in body:
        if len(row) != len(header):
            problems.append(f"line {line} has {len(row)} fields; expected {len(header)}")
            continue
        for name, field in zip(header, row, strict=True):
            if name in labels:
                labels[name].append(field.strip()[:MAX_LABEL])
                continue
            value = _number(field)
            if value is None:
                expected = "expected a finite number"
                if "," in field:
                    expected += " with a decimal point"
                problems.append(f"line {line}, {name} = {field.strip()[:40]!r}; {expected}")
            numbers[name].append(math.nan if value is None else value)
    if problems:
        raise SceneError(source, problems)
    return ReadingTable(
        source,
        {name: np.array(values) for name, values in numbers.items()},
        {name: tuple(values) for name, values in labels.items()},
        tuple(line for line, _ in body),
    )


def _number(text: str) -> float | None:
    """Read a finite number; None where it is none."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) and abs(value) < 1e9 else None
