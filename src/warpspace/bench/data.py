"""Measured readings: CSV files with a header, every problem with its line."""

import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from warpspace.exceptions import SceneError, near_miss
from warpspace.machine.limits import MAX_CSV_BYTES, MAX_ERROR, MAX_POINTS
from warpspace.scene import text_files
from warpspace.units import Array

ColumnKind = Literal["number", "reading", "sign", "name"]
FACTOR = 300.0
"""Readings this much larger or smaller than expected are likely to be in another unit."""
LEAST_UM = 0.05  # readings that are all below it are likely to be in millimetres


@dataclass(frozen=True, slots=True)
class DataColumn:
    """One column of a file of readings."""

    name: str  # in the header, with its unit
    # "reading" for measured values in µm or µrad, "number" for positions, "sign" for + or −
    kind: ColumnKind = "reading"
    # allowed names, any if empty; of a sign, other spellings of + and −
    names: tuple[str, ...] = ()
    default: float | str | None = None  # if the file lacks the column; None: required


DIRECTION = DataColumn("direction", "sign", ("ccw", "cw"), default="+")
ANGLE = DataColumn("angle_deg", "number")
ALONG = (
    replace(DIRECTION, names=()),
    DataColumn("position_mm", "number"),
    DataColumn("deviation_um"),
)
XYZ = tuple(DataColumn(f"{letter}_um") for letter in "xyz")


@dataclass(frozen=True)
class ReadingsFile:
    """Content of a file of readings."""

    source: str  # of messages
    columns: Mapping[str, Array]  # [n]; numbers
    labels: Mapping[str, tuple[str, ...]]  # (n,); columns of names as written
    lines: Array  # [n]; where each row stands
    notes: tuple[str, ...] = ()  # what a reader should doubt

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]

    def __len__(self) -> int:
        return len(self.lines)

    def refuse(self, *problems: str) -> SceneError:
        return SceneError(self.source, problems)

    def check_angles(self, least: int, path: str, noun: str = "positions") -> None:
        if len(self) < least:
            raise self.refuse(f"has {len(self)} {noun}; expected at least {least}")
        if np.ptp(self["angle_deg"]) < 1.0:
            raise self.refuse(f"all readings are at one angle; expected angles along the {path}")

    def unknown_labels(self, name: str, allowed: Sequence[str], expected: str) -> list[str]:
        return [
            f"line {int(line)}, {name}: {label!r}; expected {expected}"
            for line, label in zip(self.lines, self.labels[name], strict=True)
            if label not in allowed
        ]


def read_table(path: str | Path, columns: Sequence[DataColumn]) -> ReadingsFile:
    """Read a file of readings; further columns are ignored."""
    source = str(path)
    text, notes = text_files.read_table_text(Path(path), MAX_CSV_BYTES)
    table = parse_table(text, columns, source)
    return replace(table, notes=(*notes, *table.notes))


def parse_table(text: str, columns: Sequence[DataColumn], source: str) -> ReadingsFile:
    rows = text_files.CsvRows(io.StringIO(text, newline=""), source, MAX_POINTS, unique=True)
    if not rows.header:
        raise SceneError(source, ["is empty; expected a header " + _header(columns)])
    header = [text_files.plain_heading(text_files.translate_heading(name)) for name in rows.header]
    unit_note = _state_unit(header, columns) if rows.runs else ()
    matches = {column.name: text_files.match_column(column.name, header) for column in columns}
    _check_header(header, rows.line, columns, source, matches)
    present = [(column, matches[column.name] or (0, 1.0)) for column in columns]
    present = [pair for pair in present if matches[pair[0].name]]
    values: dict[str, list[float]] = {
        column.name: [] for column in columns if column.kind != "name"
    }
    labels: dict[str, list[str]] = {column.name: [] for column in columns if column.kind == "name"}
    lines: list[int] = []
    for line, row in rows:
        lines.append(line)
        for column, (index, factor) in present:
            if column.kind == "name":
                labels[column.name].append(_word(column, line, row[index], rows))
            else:
                values[column.name].append(_value(column, line, row[index], rows, factor))
    rows.check()
    if not lines:
        raise SceneError(source, ["has no readings below its header"])
    for column in columns:
        if matches[column.name] is None and column.kind != "name":
            default = text_files.DIRECTIONS.get(str(column.default), column.default)
            values[column.name] = [float(default or 0.0)] * len(lines)
    return ReadingsFile(
        source,
        {name: np.array(column) for name, column in values.items()},
        {name: tuple(column) for name, column in labels.items()},
        np.array(lines, dtype=float),
        (*rows.notes, *unit_note, *text_files.radian_notes(values)),
    )


def _state_unit(header: list[str], columns: Sequence[DataColumn]) -> tuple[str, ...]:
    """Assign the unit of the test to runs in columns without one; return a note on it."""
    names = [column.name for column in columns if column.name.startswith(text_files.DEVIATION)]
    if text_files.DEVIATION not in header or not names:
        return ()
    header[header.index(text_files.DEVIATION)] = names[0]
    unit = names[0].rpartition("_")[2].replace("u", "µ", 1)
    return (f"runs without a unit: read as {unit}",)


def _header(columns: Sequence[DataColumn]) -> str:
    return ",".join(column.name for column in columns)


def _check_header(
    header: list[str],
    line: int,
    columns: Sequence[DataColumn],
    source: str,
    matches: Mapping[str, object],
) -> None:
    problems: list[str] = []
    for column in columns:
        if header.count(column.name) > 1:
            problems.append(f"line {line}: column {column.name!r} stands there twice")
        if column.default is None and matches[column.name] is None:
            hint = near_miss(column.name, header) if len(header) > 1 else ""
            hint = hint if "did you mean" in hint else f"; the header is {','.join(header)[:200]}"
            hint = hint.replace("did you mean", "is it")
            expected = f"expected {_header(columns)}"
            problems.append(f"line {line}: column {column.name!r} not found{hint}; {expected}")
    if problems:
        raise SceneError(source, problems)


def _value(
    column: DataColumn, line: int, text: str, rows: text_files.CsvRows, factor: float
) -> float:
    if column.kind == "sign":
        text = text_files.unguard_cell(text)
        signs = {**text_files.DIRECTIONS, **dict(zip(column.names, (1, -1), strict=False))}
        if text.lower() not in signs:
            rows.note(
                f"line {line}, {column.name}: {text_files.spell_value(text)}; expected + or -"
            )
        return signs.get(text.lower(), math.nan)
    hint = ", in µm or µrad: is the file in nm?" if column.kind == "reading" else ""
    return factor * rows.number(text, line, column.name, MAX_ERROR / factor, hint)


def _word(column: DataColumn, line: int, text: str, rows: text_files.CsvRows) -> str:
    text = text_files.unguard_cell(text)
    if column.names and text not in column.names:
        hint = near_miss(text, column.names)
        rows.note(f"line {line}, {column.name}: {text_files.spell_value(text)}{hint}")
    return text


def unit_notes(measured: Array, model: Array, unit: str) -> tuple[str, ...]:
    """Return a note if readings are probably in another unit than µm or µrad."""
    spread, expected = float(np.ptp(measured)), float(np.ptp(model))
    coarser, finer = ("mm", "nm") if unit == "µm" else ("mrad", "nrad")
    if 0.0 < spread < LEAST_UM:
        finding, likely_unit = f"differ by {spread:.3g} {unit} at most", coarser
    elif expected > LEAST_UM and spread > FACTOR * expected:
        finding = (
            f"spread over {spread:.4g} {unit}, {spread / expected:,.0f} times what the model gives"
        )
        finding, likely_unit = f"{finding} ({expected:.3g} {unit})", finer
    elif spread > 0.0 and expected > FACTOR * spread:
        times = f"{expected / spread:,.0f} times as much ({expected:.3g} {unit})"
        finding, likely_unit = f"spread over {spread:.3g} {unit}, the model gives {times}", coarser
    else:
        return ()
    return (f"the readings {finding}: are they in {likely_unit}? expected {unit}",)
