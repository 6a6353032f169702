"""Inspection reports: nominal and measured coordinates of the holes of a part, as a table.

The headings are recognised by their words, in any order. A length without a unit in its heading is
in the unit that a line above the table states, else in mm.
"""

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from warpspace.exceptions import SceneError
from warpspace.machine.limits import MAX_CSV_BYTES, MAX_CSV_LINE, MAX_ERROR, MAX_LENGTH_MM
from warpspace.scene.text_files import (
    LENGTH_UM,
    MAX_PREAMBLE,
    UNIT_SPELLING,
    parse_number,
    read_table_text,
    spell_value,
    unguard_cell,
)
from warpspace.units import MM_PER_UM, Array

MAX_HOLES = 5_000  # rows of a report
ROLES: Mapping[str, Sequence[str]] = {
    "nominal": ("nominal", "nom", "soll", "sollwert", "theoretical", "theo", "target", "cad"),
    "measured": ("measured", "meas", "actual", "act", "ist", "istwert", "messwert"),
    "deviation": ("deviation", "dev", "error", "err", "abweichung", "abw"),
}
"""Words of headings, in lower case."""
DIAMETER = "d", "dia", "diam", "diameter", "durchmesser", "ø", "⌀"
NAMES = "name", "feature", "hole", "id", "label", "no", "nr", "number", "merkmal", "bohrung"
FORM = {"round", "roundness", "rundheit", "circularity", "cylindricity", "form"}
TOLERANCE = {"tol", "tolerance", "lower", "upper", "ltol", "utol", "usl", "lsl", "toleranz"}
FILLERS = {"value", "coordinate", "coord", "position", "pos", "axis", "k=2", "k", "2", "centre"}
FILLERS |= {"center", "of", "point", "wert"}
UNITS = {**{name: name for name in ("mm", "um", "in", "inch")}, "inches": "inch", "zoll": "inch"}
STATED = re.compile(
    r"\b(?:units?|einheit(?:en)?|dimensions?|maße|values?|lengths?)\b[\s:=]*(?:are\b|in\b|\s)*"
    r"([^\W\d]+)",
    re.IGNORECASE,
)
"""Line above the table that states a unit."""
MARKS = (r"\t", ";", ",", r"\s{2,}", r"\s+")  # between cells, in the order of trials
ROUNDING = 1e-9  # mm, in the comparison of stated deviations


class ReportColumn(NamedTuple):
    """Meaning of one heading."""

    role: str  # a key of ROLES, "U", "u", "name" or "" where it is ignored
    quantity: str = ""  # x, y, z or d
    unit: str = ""  # a key of LENGTH_UM; empty where the heading has none


@dataclass(frozen=True, eq=False)
class InspectionReport:
    """Holes or points of one part: nominal positions, and deviations measured − nominal."""

    source: str
    names: tuple[str, ...]  # (n,)
    nominal_mm: Array  # [n, 3], in the frame of the report; z is 0 where it has none
    deviation_mm: Array | None  # [n, d], along x, y or x, y, z; None of a nominal report
    diameter_mm: Array | None = None  # [n, 2], nominal and measured − nominal
    u_um: Array | None = None  # [n], standard uncertainty of a coordinate
    lines: tuple[int, ...] = ()  # (n,)
    notes: tuple[str, ...] = ()

    @property
    def file(self) -> str:
        return Path(self.source).name

    @property
    def dimension(self) -> int:
        """Number of coordinates that count: 2 in the plane, else 3."""
        return 3 if self.deviation_mm is None else self.deviation_mm.shape[1]


def is_report(text: str) -> bool:
    """Check for a table with nominal coordinates among its first lines."""
    return _find_header(text.splitlines()) is not None


def load_report(name: str | Path, *, nominal_only: bool = False) -> InspectionReport:
    """Read a report from a text table, CSV or a spreadsheet.

    With `nominal_only`, measured coordinates may be absent.
    """
    text, notes = read_table_text(Path(name), MAX_CSV_BYTES)
    return parse_report(text, str(name), notes, nominal_only=nominal_only)


def parse_report(
    text: str, source: str, notes: Sequence[str] = (), *, nominal_only: bool = False
) -> InspectionReport:
    """Parse a report; raise SceneError with line and word for anything that is not understood."""
    lines = text.splitlines()
    header = _find_header(lines)
    if header is None:
        expected = "expected a header such as Nom X, Nom Y, Meas X, Meas Y, and a row for each hole"
        raise SceneError(source, [f"has no nominal coordinates X and Y; {expected}"])
    number, mark, headings = header
    table = _ReportTable(source, number, mark, headings)
    table.read_columns(lines)
    unit, unit_notes = table.find_unit(lines[: number - 1])
    size = 3 if {("measured", "z"), ("deviation", "z")} & {*table.values} else 2
    roles = {role for role, quantity in table.values if quantity in tuple("xyz")}
    if roles == {"nominal"} and nominal_only:
        size, deviation = 3 if ("nominal", "z") in table.values else 2, None
    else:
        deviation = np.column_stack([table.deviation(letter, unit) for letter in "xyz"[:size]])
        limit_mm = MAX_ERROR * MM_PER_UM
        if np.abs(deviation).max() > limit_mm:
            at = int(np.argmax(np.abs(deviation).max(axis=1)))
            raise table.refuse(
                table.lines[at],
                f"deviation of {np.abs(deviation[at]).max():.4g} mm; expected at most {limit_mm:g}"
                " mm. Are nominal and measured values in one frame and unit?",
            )
    count = len(table.lines)
    if count < 2:
        raise SceneError(source, ["has a single hole; expected at least two"])
    nominal = np.zeros((count, 3))
    for at, letter in enumerate("xyz"):
        if at < size or ("nominal", letter) in table.values:
            nominal[:, at] = table.length("nominal", letter, unit)
    if np.ptp(nominal[:, : max(size, 2)], axis=0).max() <= 0.0:
        raise SceneError(source, ["has all holes at one point; expected at least two points"])
    diameter = None
    if ("nominal", "d") in table.values:
        deviation_d = table.deviation("d", unit) if len(table.roles("d")) > 1 else np.zeros(count)
        diameter = np.column_stack([table.length("nominal", "d", unit), deviation_d])
    names = table.names or tuple(f"hole {at}" for at in range(1, count + 1))
    return InspectionReport(
        source, names, nominal, deviation, diameter, table.standard_uncertainty(),
        tuple(table.lines), (*notes, *unit_notes),
    )  # fmt: skip


def _find_header(lines: Sequence[str]) -> tuple[int, str, list[str]] | None:
    """Find the line with nominal x and y: its number, the mark between cells, its cells."""
    for number, line in enumerate(lines[: 2 * MAX_PREAMBLE], 1):
        for mark in MARKS if len(line) <= MAX_CSV_LINE else ():
            cells = _split(line, mark)
            columns = [_recognise(cell) for cell in cells]
            present = {(column.role, column.quantity) for column in columns if column}
            if {("nominal", "x"), ("nominal", "y")} <= present or (
                {("measured", "x"), ("measured", "y")} <= present
                or {("deviation", "x"), ("deviation", "y")} <= present
            ):
                return number, mark, cells
    return None


def _split(line: str, mark: str) -> list[str]:
    if mark in (";", ","):
        cells = next(csv.reader([line], delimiter=mark), [])
    else:
        cells = re.split(mark, line.strip())
    return [unguard_cell(cell.strip()) for cell in cells]


def _recognise(heading: str) -> ReportColumn | None:
    """Find the meaning of a heading by its words; None where one of them is unknown."""
    words = re.findall(r"[^\s_./:()\[\]-]+", heading.translate(UNIT_SPELLING))
    role = quantity = unit = ""
    for spelling in words:
        word = spelling.lower()
        meaning = next((name for name, known in ROLES.items() if word in known), "")
        if word in UNITS and words.index(spelling):
            meaning, unit, previous = "unit", UNITS[word], unit
        elif meaning:
            meaning, role, previous = "role", meaning, role
        elif spelling in ("U", "U95", "u95", "u"):
            meaning, role, previous = "role", "u" if spelling == "u" else "U", role
        elif word in ("x", "y", "z", *DIAMETER):
            meaning, quantity, previous = "quantity", "d" if word in DIAMETER else word, quantity
        else:
            previous = ""
        if previous or not (meaning or word in {*NAMES, *FORM, *TOLERANCE, *FILLERS}):
            return None
    ignored = {word.lower() for word in words}
    if ignored & (FORM | TOLERANCE):
        return ReportColumn("")
    if role in ("U", "u") or (role and quantity):
        return ReportColumn(role, quantity, unit)
    is_name = ignored & {*NAMES} and not (role or quantity)
    return ReportColumn("name") if is_name else None


class _ReportTable:
    """Columns of a report by their meaning."""

    def __init__(self, source: str, number: int, mark: str, headings: Sequence[str]) -> None:
        self.source, self.number, self.mark, self.headings = source, number, mark, headings
        self.lines: list[int] = []
        self.values: dict[tuple[str, str], list[float]] = {}
        self.half_digit: dict[tuple[str, str], float] = {}  # largest rounding, in its unit
        self.units: dict[tuple[str, str], str] = {}
        self.names: tuple[str, ...] = ()
        self._decimal_sign = ""

    def refuse(self, line: int, problem: str) -> SceneError:
        return SceneError(self.source, [f"line {line}: {problem}"])

    def read_columns(self, lines: Sequence[str]) -> None:
        cells: list[list[str]] = []
        for number, line in enumerate(lines[self.number :], self.number + 1):
            row = self._row(number, line)
            if any(row) and row != self.headings:
                self.lines.append(number)
                cells.append(row)
            if len(cells) > MAX_HOLES:
                raise self.refuse(number, f"more than {MAX_HOLES:,} holes; expected at most these")
        if not cells:
            raise SceneError(
                self.source, ["has a header but no rows; expected a row for each hole"]
            )
        for heading, texts in zip(self.headings, zip(*cells, strict=True), strict=True):
            self._add(heading, texts)

    def _row(self, number: int, line: str) -> list[str]:
        count = len(self.headings)
        if len(line) > MAX_CSV_LINE:
            raise self.refuse(number, f"longer than {MAX_CSV_LINE:,} characters")
        row = _split(line, self.mark) if line.strip() else []
        if len(row) != count and self.mark == MARKS[3]:
            row = line.split()
        while len(row) > count and not row[-1]:
            row.pop()
        if any(row) and len(row) != count:
            start = spell_value(line.strip()[:40])
            raise self.refuse(
                number, f"{start} has {len(row)} cells; expected {count} as the header"
            )
        return row

    def _add(self, heading: str, texts: Sequence[str]) -> None:
        column = _recognise(heading)
        if column is None:
            if any(map(_is_number, texts)):
                raise self.refuse(
                    self.number,
                    f"unknown heading {spell_value(heading)}; expected nominal, measured or"
                    " deviation with X, Y, Z or D, U95 with a unit, or a name",
                )
            return
        key = column[:2]
        if column.role == "name":
            self.names = self.names or tuple(texts)
        elif column.role:
            if key in self.values:
                raise self.refuse(self.number, f"heading {spell_value(heading)} occurs twice")
            self.values[key] = [
                self._number(text, line, heading)
                for text, line in zip(texts, self.lines, strict=True)
            ]
            places = max(len(re.split("[.,]", text)[1]) if re.search("[.,]", text) else 0
                         for text in texts)  # fmt: skip
            self.half_digit[key], self.units[key] = 0.5 * 10.0**-places, column.unit

    def _number(self, text: str, line: int, heading: str) -> float:
        sign = next((letter for letter in ",." if letter in text), "")
        self._decimal_sign = self._decimal_sign or sign
        if not _is_number(text):
            what = f"{heading}: {spell_value(text)}"
            raise self.refuse(line, f"{what}; expected a number")
        if sign not in ("", self._decimal_sign):
            raise self.refuse(line, f"{spell_value(text)}; expected one decimal sign in a file")
        return parse_number(text.replace(",", "."))

    def find_unit(self, preamble: Sequence[str]) -> tuple[str, tuple[str, ...]]:
        """Find the unit of coordinates; refuse several."""
        stated: dict[str, int] = {}
        for number, line in enumerate(preamble, 1):
            match = STATED.search(line)
            if match and match[1].lower() in UNITS:
                stated.setdefault(UNITS[match[1].lower()], number)
            elif match and re.search(r"\bunits?\b|\beinheit", line, re.IGNORECASE):
                problem = f"unit {spell_value(match[1])}; expected mm or inch"
                raise self.refuse(number, problem)
        for (role, _), unit in self.units.items():
            if unit and role in ("nominal", "measured"):
                stated.setdefault(unit, self.number)
        sizes = {LENGTH_UM[unit] for unit in stated}
        if len(sizes) > 1:
            mixed = " and ".join(f"{unit} (line {line})" for unit, line in stated.items())
            raise SceneError(self.source, [f"has mixed units: {mixed}; expected one"])
        if stated:
            return next(iter(stated)), ()
        return "mm", (f"{Path(self.source).name}: states no unit; read in mm",)

    def roles(self, quantity: str) -> list[str]:
        return [role for role, of in self.values if of == quantity]

    def length(self, role: str, quantity: str, unit: str) -> Array:
        """Return a column in mm, [n]; refuse a missing one."""
        key = role, quantity
        if key not in self.values:
            present = ", ".join(filter(None, self.headings))
            raise SceneError(
                self.source,
                [f"has no {role} {quantity.upper()}; expected one (headings: {present})"],
            )
        values = np.array(self.values[key]) * self._size_mm(key, unit)
        if role != "deviation" and np.abs(values).max() > MAX_LENGTH_MM:
            at = int(np.argmax(np.abs(values)))
            problem = f"{values[at]:g} mm; expected at most ±{MAX_LENGTH_MM:g} mm"
            raise self.refuse(self.lines[at], problem)
        return values

    def _size_mm(self, key: tuple[str, str], unit: str) -> float:
        return LENGTH_UM[self.units[key] or unit] * MM_PER_UM

    def deviation(self, quantity: str, unit: str) -> Array:
        """Return measured − nominal, [n], mm; refuse a stated deviation that differs."""
        nominal = self.length("nominal", quantity, unit)
        keys = [(role, quantity) for role in ROLES if (role, quantity) in self.values]
        if ("measured", quantity) not in keys:
            return self.length("deviation", quantity, unit)
        difference = self.length("measured", quantity, unit) - nominal
        if ("deviation", quantity) in keys:
            stated = self.length("deviation", quantity, unit)
            rounding = sum(self.half_digit[key] * self._size_mm(key, unit) for key in keys)
            away = np.abs(stated - difference)
            at = int(np.argmax(away))
            if away[at] > rounding + ROUNDING:
                raise self.refuse(
                    self.lines[at],
                    f"deviation {quantity.upper()} {stated[at]:.6g} mm; expected measured − nominal"
                    f" = {difference[at]:.6g} mm",
                )
        return difference

    def standard_uncertainty(self) -> Array | None:
        """Return the standard uncertainty of a coordinate, [n], µm: U95 / 2, or u."""
        keys = [key for key in self.values if key[0] in ("U", "u")]
        if not keys:
            return None
        if len(keys) > 1 or keys[0][1]:
            problem = "several columns of uncertainties"
            raise self.refuse(self.number, f"{problem}; expected one, U95 or u, of a coordinate")
        (key,) = keys
        if not self.units[key]:
            problem = "column of uncertainties without a unit"
            raise self.refuse(self.number, f"{problem}; expected one such as U95 [µm]")
        values = np.array(self.values[key]) * LENGTH_UM[self.units[key]]
        for line, value in zip(self.lines, values, strict=True):
            if value <= 0.0:
                raise self.refuse(line, f"uncertainty {value:g} µm; expected a number above 0")
        return values / 2.0 if key[0] == "U" else values


def _is_number(text: str) -> bool:
    try:
        parse_number(text.replace(",", "."))
    except ValueError:
        return False
    return True
