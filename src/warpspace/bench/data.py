"""Measured readings: CSV files with a header, every problem with its line."""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from warpspace.exceptions import SceneError, near_miss
from warpspace.machine.limits import MAX_CSV_BYTES, MAX_CSV_COLUMNS, MAX_ERROR, MAX_POINTS
from warpspace.scene.files import read_text
from warpspace.scene.words import spell_value
from warpspace.units import Array

ColumnKind = Literal["number", "reading", "sign", "name"]
SIGNS = {"+": 1.0, "+1": 1.0, "1": 1.0, "-": -1.0, "−": -1.0, "-1": -1.0}
FACTOR = 300.0
"""Readings this much larger or smaller than expected are likely to be in another unit."""
LEAST_UM = 0.05
"""Readings that are all below it are likely to be in millimetres."""


@dataclass(frozen=True, slots=True)
class DataColumn:
    """One column of a file of readings.

    Attributes
    ----------
    name : str
        In the header, with its unit.
    kind : str
        "reading" for measured values in µm or µrad, "number" for positions, "sign" for + or −,
        "name" for a word.
    names : tuple of str
        Words that are allowed; any where empty.
    default : float, str or None
        Where the file has no such column; None where it must.
    """

    name: str
    kind: ColumnKind = "reading"
    names: tuple[str, ...] = ()
    default: float | str | None = None


@dataclass(frozen=True)
class Table:
    """What a file of readings holds.

    Attributes
    ----------
    source : str
        Of messages.
    columns : mapping of str to ndarray, [n]
        Numbers; of a column of names their index among the allowed ones.
    words : mapping of str to tuple of str, (n,)
        Columns of names as written.
    lines : ndarray of int, [n]
        Where each row stands.
    """

    source: str
    columns: Mapping[str, Array]
    words: Mapping[str, tuple[str, ...]]
    lines: Array

    def __getitem__(self, name: str) -> Array:
        """Give a column of numbers."""
        return self.columns[name]

    def __len__(self) -> int:
        """Count the rows."""
        return len(self.lines)

    def refuse(self, *problems: str) -> SceneError:
        """Build the exception that says what is wrong with the file."""
        return SceneError(self.source, problems)


def read_table(path: str | Path, columns: Sequence[DataColumn]) -> Table:
    """Read a file of readings.

    Parameters
    ----------
    path : str or Path
    columns : sequence of DataColumn
        Others in the file are left aside.

    Returns
    -------
    Table

    Raises
    ------
    SceneError
        If the file cannot be read, lacks a column, or holds what is no finite number: all
        problems at once, each with its line.
    """
    source = str(path)
    text = read_text(Path(path), MAX_CSV_BYTES, source)
    return parse_table(text, columns, source)


def parse_table(text: str, columns: Sequence[DataColumn], source: str) -> Table:
    """Read the text of a file of readings; see `read_table`."""
    reader = csv.reader(io.StringIO(text), strict=True)
    try:
        rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader if any(row)]
    except csv.Error as error:
        raise SceneError(source, [f"line {reader.line_num}: is not valid CSV: {error}"]) from None
    if not rows:
        raise SceneError(source, ["is empty; expected a header " + _header(columns)])
    (_, header), body = rows[0], rows[1:]
    _check_header(header, columns, source)
    if not body:
        raise SceneError(source, ["has no readings below its header"])
    if len(body) > MAX_POINTS:
        raise SceneError(source, [f"has {len(body):,} rows; expected at most {MAX_POINTS:,}"])
    problems: list[str] = []
    for line, row in body:
        if len(row) != len(header):
            found = f"line {line}: {len(row)} fields; expected {len(header)} as in the header"
            problems.append(found + (" (decimal commas?)" if len(row) > len(header) else ""))
    if problems:
        raise SceneError(source, problems)
    values: dict[str, Array] = {}
    words: dict[str, tuple[str, ...]] = {}
    for column in columns:
        if column.name in header:
            index = header.index(column.name)
            cells = [(line, row[index]) for line, row in body]
        else:
            cells = [(line, str(column.default)) for line, _ in body]
        if column.kind == "name":
            words[column.name] = tuple(_word(column, *cell, problems) for cell in cells)
        else:
            values[column.name] = np.array([_value(column, *cell, problems) for cell in cells])
    if problems:
        raise SceneError(source, problems)
    return Table(source, values, words, np.array([line for line, _ in body], dtype=float))


def _header(columns: Sequence[DataColumn]) -> str:
    """Spell the header that is expected."""
    return ",".join(column.name for column in columns)


def _check_header(header: list[str], columns: Sequence[DataColumn], source: str) -> None:
    """Refuse a header that lacks a column or has one twice."""
    problems: list[str] = []
    if len(header) > MAX_CSV_COLUMNS:
        problems.append(f"has {len(header)} columns; expected at most {MAX_CSV_COLUMNS}")
    for column in columns:
        if header.count(column.name) > 1:
            problems.append(f"line 1: column {column.name!r} stands there twice")
        if column.default is None and column.name not in header:
            hint = near_miss(column.name, header) if len(header) > 1 else ""
            hint = hint if "did you mean" in hint else f"; the header is {','.join(header)[:200]}"
            hint = hint.replace("did you mean", "is it")
            expected = f"expected {_header(columns)}"
            problems.append(f"line 1: column {column.name!r} not found{hint}; {expected}")
    if problems:
        raise SceneError(source, problems)


def _value(column: DataColumn, line: int, text: str, problems: list[str]) -> float:
    """Read one number; note what is wrong with it."""
    place = f"line {line}, {column.name}"
    if column.kind == "sign":
        if text not in SIGNS:
            problems.append(f"{place}: {spell_value(text)}; expected + or -")
        return SIGNS.get(text, math.nan)
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        problems.append(f"{place}: {spell_value(text)}; expected a finite number")
    elif abs(value) > MAX_ERROR:
        hint = ", in µm or µrad: is the file in nm?" if column.kind == "reading" else ""
        problems.append(f"{place}: {value:g}; expected at most ±{MAX_ERROR:g}{hint}")
    return value


def _word(column: DataColumn, line: int, text: str, problems: list[str]) -> str:
    """Read one word; note one that is not allowed."""
    if column.names and text not in column.names:
        known = near_miss(text, column.names)
        problems.append(f"line {line}, {column.name}: {spell_value(text)}{known}")
    return text


def unit_notes(measured: Array, model: Array, unit: str) -> tuple[str, ...]:
    """Say where readings are likely to be in another unit.

    Parameters
    ----------
    measured, model : ndarray, [m], µm or µrad
    unit : str

    Returns
    -------
    tuple of str
    """
    spread, expected = float(np.ptp(measured)), float(np.ptp(model))
    notes: list[str] = []
    if 0.0 < spread < LEAST_UM:
        finer = "mm" if unit == "µm" else "mrad"
        notes.append(
            f"the readings differ by {spread:.3g} {unit} at most: are they in {finer}?"
            f" expected {unit}"
        )
    elif expected > LEAST_UM and spread > FACTOR * expected:
        finer = "nm" if unit == "µm" else "nrad"
        notes.append(
            f"the readings spread over {spread:.4g} {unit}, {spread / expected:,.0f} times what the"
            f" model gives ({expected:.3g} {unit}): are they in {finer}? expected {unit}"
        )
    elif spread > 0.0 and expected > FACTOR * spread:
        coarser = "mm" if unit == "µm" else "mrad"
        notes.append(
            f"the readings spread over {spread:.3g} {unit}, the model gives"
            f" {expected / spread:,.0f} times as much ({expected:.3g} {unit}): are they in"
            f" {coarser}? expected {unit}"
        )
    return tuple(notes)
