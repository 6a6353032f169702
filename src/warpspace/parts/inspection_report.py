"""Inspection reports: nominal and measured coordinates of the holes of a part, as a table.

Headings are recognised by their words, in any order. A length without a unit in its heading is in
the unit that a line above the table states, else in mm.
"""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from warpspace.exceptions import SceneError
from warpspace.machine.limits import MAX_CSV_BYTES, MAX_CSV_LINE, MAX_ERROR, MAX_LENGTH_MM
from warpspace.resources import find_data
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
MAX_SESSION_U = 1e4  # µm/m and µrad, between parts
REPORT_ENDINGS = ".txt", ".csv", ".tsv", ".dat", ".xlsx", ".xls", ".ods"
WORDS = {
    word: (kind, meaning)
    for kind, meaning, words in (
        ("role", "nominal", "nominal nom soll sollwert theoretical theo target cad"),
        ("role", "measured", "measured meas actual act ist istwert messwert"),
        ("role", "deviation", "deviation dev error err abweichung abw"),
        ("role", "U", "u95"),
        ("quantity", "x", "x"),
        ("quantity", "y", "y"),
        ("quantity", "z", "z"),
        ("quantity", "d", "d dia diam diameter durchmesser ø ⌀"),
        ("unit", "mm", "mm"),
        ("unit", "um", "um"),
        ("unit", "in", "in inch inches zoll"),
        ("name", "", "name feature hole id label no nr number merkmal bohrung"),
        ("ignored", "", "round roundness rundheit circularity form tol tolerance toleranz"),
        ("ignored", "", "lower upper ltol utol lsl usl outtol status remark comment date time"),
        ("filler", "", "value wert coordinate coord position pos axis centre center point"),
    )
    for word in words.split()
}
"""Kind and meaning of the words of headings, in lower case."""
UNIT_LINE = re.compile(
    r"(?:\b(units?|einheit(?:en)?)\b|\b(?:dimensions?|values?|lengths?|maße)\b.*\bin\b)"
    r"[\s:=]*(?:in\s+)?([^\W\d]+)",
    re.IGNORECASE,
)
MARKS = (r"\t", ";", ",", r"\s{2,}", r"\s+")  # between cells, in the order of trials
Column = tuple[str, str, str]
"""Role and quantity of a column, and its unit: a key of LENGTH_UM, empty where none is stated."""


@dataclass(frozen=True, eq=False)
class InspectionReport:
    """Holes or points of one part: nominal positions, and deviations measured − nominal."""

    source: str
    names: tuple[str, ...]  # (n,)
    lines: tuple[int, ...]  # (n,)
    nominal_mm: Array  # [n, 3], in the frame of the report; z is 0 where it has none
    deviation_mm: Array | None  # [n, d], along x, y or x, y, z; None of a nominal report
    diameter_mm: Array | None = None  # [n, 2], nominal and measured − nominal
    u_um: Array | None = None  # [n], standard uncertainty of a coordinate
    notes: tuple[str, ...] = ()

    @property
    def file(self) -> str:
        return Path(self.source).name

    @property
    def dimension(self) -> int:
        """Number of coordinates that are compared, 2 or 3."""
        is_flat = not np.ptp(self.nominal_mm[:, 2])
        return 3 - is_flat if self.deviation_mm is None else self.deviation_mm.shape[1]


def is_report(text: str) -> bool:
    """Check for the headings of an inspection report among the first lines."""
    header = _find_header(text.splitlines())
    return header is not None and {("nominal", "x"), ("nominal", "y")} <= _meanings(header[2])


def load_report(name: str | Path, *, nominal_only: bool = False) -> InspectionReport:
    """Read a report: a text table, CSV or a spreadsheet; see `parse_report`."""
    path = find_data(str(name))
    text, notes = read_table_text(path, MAX_CSV_BYTES)
    return parse_report(text, str(path), notes, nominal_only=nominal_only)


def parse_report(
    text: str, source: str, notes: Sequence[str] = (), *, nominal_only: bool = False
) -> InspectionReport:
    """Parse a report; raise SceneError with line and word for anything that is not understood.

    With `nominal_only`, measured coordinates may be absent.
    """
    lines = text.splitlines()
    header = _find_header(lines)
    if header is None:
        expected = "expected headings such as Nom X, Nom Y, Meas X, Meas Y, and a row for each hole"
        raise SceneError(source, [f"has no coordinates X and Y; {expected}"])
    number, mark, headings = header
    table = _ReportColumns(source, number, mark, headings)
    table.read_rows(lines)
    unit, unit_notes = table.find_unit(lines[: number - 1])
    measured = {quantity for role, quantity in table.values if role in ("measured", "deviation")}
    letters = "xyz" if "z" in measured else "xy"
    nominal = np.zeros((len(table.lines), 3))
    for at, letter in enumerate("xyz"):
        if letter in letters or ("nominal", letter) in table.values:
            nominal[:, at] = table.length("nominal", letter, unit)
    if len(nominal) < 2 or not np.ptp(nominal, axis=0).any():
        raise SceneError(source, ["has a single hole; expected two at least, at different points"])
    deviation = None
    if measured & {*"xyz"} or not nominal_only:
        deviation = np.column_stack([table.deviation(letter, unit) for letter in letters])
    diameter = None
    if ("nominal", "d") in table.values and "d" in measured:
        columns = table.length("nominal", "d", unit), table.deviation("d", unit)
        diameter = np.column_stack(columns)
    names = table.names or tuple(f"hole {at}" for at in range(1, len(nominal) + 1))
    return InspectionReport(
        source, names, tuple(table.lines), nominal, deviation, diameter,
        table.standard_uncertainty(), (*notes, *unit_notes),
    )  # fmt: skip


def _find_header(lines: Sequence[str]) -> tuple[int, str, list[str]] | None:
    """Find the line with headings of x and y: its number, the mark between cells, its cells."""
    for number, line in enumerate(lines[: 2 * MAX_PREAMBLE], 1):
        for mark in MARKS if len(line) <= MAX_CSV_LINE else ():
            cells = _split(line, mark)
            meanings = _meanings(cells)
            if any({(role, "x"), (role, "y")} <= meanings for role, _ in meanings):
                return number, mark, cells
    return None


def _split(line: str, mark: str) -> list[str]:
    is_csv = mark in (";", ",")
    cells = next(csv.reader([line], delimiter=mark), []) if is_csv else re.split(mark, line.strip())
    return [unguard_cell(cell.strip()) for cell in cells]


def _meanings(headings: Sequence[str]) -> set[tuple[str, str]]:
    return {column[:2] for column in map(_recognise, headings) if column}


def _recognise(heading: str) -> Column | None:
    """Find the meaning of a heading; None where a word is unknown, missing or contradictory."""
    by_kind: dict[str, str] = {}
    for spelling in re.findall(r"[^\s_./:()\[\]-]+", heading.translate(UNIT_SPELLING)):
        word = spelling.lower()
        kind, meaning = WORDS.get(word, ("", "")) if word != "u" else ("role", spelling)
        if not kind or by_kind.get(kind, meaning) != meaning:
            return None
        by_kind[kind] = meaning
    role, quantity = by_kind.get("role", ""), by_kind.get("quantity", "")
    if "ignored" in by_kind or ("name" in by_kind and not (role or quantity)):
        return ("ignored" if "ignored" in by_kind else "name"), "", ""
    if role in ("U", "u") or (role and quantity):
        return role, quantity, by_kind.get("unit", "")
    return None


@dataclass
class _ReportColumns:
    """Columns of a report by their role and quantity."""

    source: str
    line: int  # of the header
    mark: str
    headings: list[str]
    lines: list[int] = field(default_factory=list[int])
    values: dict[tuple[str, str], list[float]] = field(
        default_factory=dict[tuple[str, str], list[float]]
    )
    units: dict[tuple[str, str], str] = field(default_factory=dict[tuple[str, str], str])
    rounding: dict[tuple[str, str], float] = field(default_factory=dict[tuple[str, str], float])
    names: tuple[str, ...] = ()
    decimal_sign: str = ""

    def refuse(self, line: int, problem: str) -> SceneError:
        return SceneError(self.source, [f"line {line}: {problem}"])

    def read_rows(self, lines: Sequence[str]) -> None:
        rows: list[list[str]] = []
        for number, line in enumerate(lines[self.line :], self.line + 1):
            cells = _split(line, self.mark) if len(line) <= MAX_CSV_LINE else [line[:20]]
            if len(cells) != len(self.headings) and self.mark == MARKS[3]:
                cells = line.split()
            while len(cells) > len(self.headings) and not cells[-1]:
                cells.pop()
            if not any(cells) or cells == self.headings:
                continue
            if len(cells) != len(self.headings):
                start, expected = spell_value(line.strip()[:40]), len(self.headings)
                raise self.refuse(number, f"{start}: {len(cells)} cells; expected {expected}")
            if len(rows) == MAX_HOLES:
                raise self.refuse(number, f"more than {MAX_HOLES:,} holes; expected at most these")
            self.lines.append(number)
            rows.append(cells)
        if not rows:
            raise self.refuse(self.line, "headings without rows; expected a row for each hole")
        for heading, texts in zip(self.headings, zip(*rows, strict=True), strict=False):
            self._add(heading, texts)

    def _add(self, heading: str, texts: Sequence[str]) -> None:
        column = _recognise(heading)
        if column is None and any(re.search(r"\d", text) for text in texts):
            problem = f"unknown heading {spell_value(heading)}"
            expected = "nominal, measured or deviation of X, Y, Z or D; U95 [µm]; or a name"
            raise self.refuse(self.line, f"{problem}; expected {expected}")
        if column is None or column[0] == "ignored":
            return
        if column[0] == "name":
            self.names = self.names or tuple(texts)
            return
        key = column[:2]
        if key in self.values:
            raise self.refuse(self.line, f"heading {spell_value(heading)} twice; expected one")
        rows = zip(texts, self.lines, strict=True)
        self.values[key] = [self._number(text, line, heading) for text, line in rows]
        places = (len(re.split("[.,]", text + ".")[1]) for text in texts)
        self.units[key], self.rounding[key] = column[2], 0.5 * 10.0 ** -max(places)

    def _number(self, text: str, line: int, heading: str) -> float:
        sign = next((letter for letter in text if letter in ",."), "")
        self.decimal_sign = self.decimal_sign or sign
        try:
            number = parse_number(text.replace(",", "."))
        except ValueError:
            problem = f"{heading}: {spell_value(text)}; expected a number"
            raise self.refuse(line, problem) from None
        if sign not in ("", self.decimal_sign):
            raise self.refuse(line, f"{spell_value(text)}; expected one decimal sign in a file")
        return number

    def find_unit(self, preamble: Sequence[str]) -> tuple[str, tuple[str, ...]]:
        """Find the unit of coordinates, and a note where none is stated; refuse several."""
        stated: dict[str, int] = {}
        for number, line in enumerate(preamble, 1):
            match = UNIT_LINE.search(line)
            kind, unit = WORDS.get(match[2].lower(), ("", "")) if match else ("", "")
            if kind == "unit":
                stated.setdefault(unit, number)
            elif match and match[1]:
                raise self.refuse(number, f"unit {spell_value(match[2])}; expected mm or inch")
        for (role, _), unit in self.units.items():
            if unit and role in ("nominal", "measured"):
                stated.setdefault(unit, self.line)
        if len(stated) > 1:
            units = " and ".join(f"{unit} (line {line})" for unit, line in stated.items())
            raise SceneError(self.source, [f"mixed units: {units}; expected one of coordinates"])
        if stated:
            return next(iter(stated)), ()
        return "mm", (f"{Path(self.source).name}: no unit is stated; read in mm",)

    def length(self, role: str, quantity: str, unit: str) -> Array:
        """Return a column in mm, [n]; refuse a missing one and numbers beyond the limits."""
        key = role, quantity
        if key not in self.values:
            expected = f"expected one (headings: {', '.join(filter(None, self.headings))})"
            raise SceneError(self.source, [f"has no {role} {quantity.upper()}; {expected}"])
        values = np.array(self.values[key]) * self._size_mm(key, unit)
        return self._within(values, MAX_LENGTH_MM, f"{role} {quantity.upper()}")

    def _size_mm(self, key: tuple[str, str], unit: str) -> float:
        return LENGTH_UM[self.units[key] or unit] * MM_PER_UM

    def _within(self, values: Array, limit_mm: float, quantity: str) -> Array:
        at = int(np.argmax(np.abs(values)))
        if abs(values[at]) > limit_mm:
            problem = f"{quantity} {values[at]:.6g} mm; expected at most ±{limit_mm:g} mm"
            raise self.refuse(self.lines[at], problem)
        return values

    def deviation(self, quantity: str, unit: str) -> Array:
        """Return measured − nominal, [n], mm; refuse a stated deviation that differs."""
        keys = [(role, quantity) for role in ("nominal", "measured", "deviation")]
        limit, name = MAX_ERROR * MM_PER_UM, f"deviation of {quantity.upper()}"
        nominal = self.length(*keys[0], unit)
        if keys[1] not in self.values and keys[2] in self.values:
            return self._within(self.length(*keys[2], unit), limit, name)
        difference = self.length(*keys[1], unit) - nominal
        if keys[2] in self.values:
            stated = self.length(*keys[2], unit)
            exact, *rounded = (self.rounding[key] * self._size_mm(key, unit) for key in keys)
            rounding = 2.0 * min(exact, rounded[0]) + rounded[1]  # a nominal 10 is exact
            at = int(np.argmax(np.abs(stated - difference)))
            if abs(stated[at] - difference[at]) > rounding * (1.0 + 1e-6):
                expected = f"expected measured − nominal = {difference[at]:.6g} mm"
                raise self.refuse(self.lines[at], f"{name} {stated[at]:.6g} mm; {expected}")
        return self._within(difference, limit, name)

    def standard_uncertainty(self) -> Array | None:
        """Return the standard uncertainty of a coordinate, [n], µm: U95 / 2, or u."""
        keys = [key for key in self.values if key[0] in ("U", "u")]
        if not keys:
            return None
        if len(keys) > 1 or keys[0][1] or not self.units[keys[0]]:
            expected = "expected one for all coordinates, with its unit, such as U95 [µm]"
            raise self.refuse(self.line, f"uncertainties; {expected}")
        values = np.array(self.values[keys[0]]) * LENGTH_UM[self.units[keys[0]]]
        if values.min() <= 0.0:
            at = int(np.argmin(values))
            problem = f"uncertainty {values[at]:g} µm; expected a number above 0"
            raise self.refuse(self.lines[at], problem)
        return values / (2.0 if keys[0][0] == "U" else 1.0)
