"""Schemas of the sections of scene and machine files, and the list of their problems."""

import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from warpspace.exceptions import SHOWN_PROBLEMS, near_miss
from warpspace.kinematics.conversion import SquarenessSign
from warpspace.kinematics.model import ComponentErrors, Loop, convention_names
from warpspace.machine import errors, limits
from warpspace.machine.adjusters import AdjusterKind
from warpspace.machine.axes import TravelDirection
from warpspace.machine.curves.curve import MISSING, Path, ValueReader
from warpspace.machine.curves.table import MAX_COLUMN_NAME, MAX_FILE_NAME
from warpspace.machine.definition import MESH_UNITS, ORIGIN, TOOL_SHAPES, BodySource
from warpspace.scene.notes import KINDS, MEASURES, STATUSES, Note, NoteAnchor, Reply
from warpspace.scene.text_files import location, spell_value

Kind = Callable[[ValueReader, Any, Path], Any]
"""Reader of one raw value: returns the parsed value, or notes problems."""


class Problems:
    """Problems of a file, one per line."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def add(self, key: str, text: str, value: object = ...) -> None:
        assignment = "" if value is ... else f" = {spell_value(value)}"
        self.lines.append(f"{key}{assignment}: {text}" if key else text)

    def only(self, section: str, names: Iterable[str], allowed: Collection[str], what: str) -> None:
        """Note each name of a section that is not allowed."""
        for name in names:
            if name not in allowed:
                hint = near_miss(name, allowed) if len(self.lines) < SHOWN_PROBLEMS else ""
                self.lines.append(f"{location(section, [name])}: unknown {what}{hint}")

    def add_findings(self, key: str, reader: ValueReader) -> bool:
        """Note the findings of a reader below a key; return True without findings."""
        for finding in reader.findings:
            self.add(location(key, finding.path), finding.text, finding.value)
        return not reader.findings

    def read(self, kind: Kind, key: str, value: object) -> Any:
        """Read one value; None if it has problems."""
        reader = ValueReader()
        content = kind(reader, value, ())
        return content if self.add_findings(key, reader) else None

    def table(self, key: str, value: object) -> dict[str, object]:
        """Return a table as a dictionary; an empty one with a note for anything else."""
        return self.read(ValueReader.dictionary, key, {} if value is None else value) or {}


def _number(
    low: float, high: float, least: float = limits.MIN_NUMBER, expected: str = "a number"
) -> Kind:
    return lambda reader, value, path: reader.number(value, path, low, high, least, expected)


def _numbers(spelling: str, *bounds: float) -> Kind:
    limits = [(-one, one) for one in bounds]
    return lambda reader, value, path: reader.row(value, path, spelling, limits)


def _span(reader: ValueReader, value: Any, path: Path) -> tuple[float, float]:
    before = len(reader.findings)
    low, high = reader.row(value, path, "[lower, upper]", (LIMIT, LIMIT))
    if len(reader.findings) == before and high - low < limits.MIN_SPAN:
        reader.note(path, "expected [lower, upper] with lower < upper", value)
    return low, high


def _by_name(kind: Kind, allowed: Collection[str] = ()) -> Kind:
    def read(reader: ValueReader, value: Any, path: Path) -> dict[str, Any]:
        table = reader.dictionary(value, path)
        names = allowed or table
        reader.only(table, path, names)
        return {name: kind(reader, table[name], (*path, name)) for name in names if name in table}

    return read


def _text(max_length: int, min_length: int = 0, pattern: str = "", expected: str = "") -> Kind:
    def read(reader: ValueReader, value: Any, path: Path) -> str:
        text = reader.text(value, path, max_length, min_length)
        if pattern and not re.fullmatch(pattern, text):
            reader.note(path, f"expected {expected}", value)
        return text

    return read


def _choice(names: Callable[[], Iterable[object]], template: str = "{} or {}") -> Kind:
    def read(reader: ValueReader, value: Any, path: Path) -> Any:
        choices = list(names())
        is_alike = isinstance(value, bool) == isinstance(choices[0], bool)  # True and 1 are equal
        if value in choices and is_alike and type(value) is not float:
            return value
        *first_names, last = [spell_value(name) for name in choices]
        if "{}" in template:
            reader.note(path, f"expected {template.format(', '.join(first_names), last)}", value)
        else:
            reader.note(path, f"expected {template} {', '.join([*first_names, last])}", value)
        return choices[0]

    return read


def _one_of(names: Iterable[str]) -> Kind:
    return _choice(lambda: names, "one of")


def _exaggeration(reader: ValueReader, value: Any, path: Path) -> float | None:
    if value == "auto":
        return None
    (low, high), above = limits.EXAGGERATION, "a number above 0"
    factor = reader.number(value, path, least=0.0, expected=f'"auto" or {above}')
    if factor <= 0.0:
        reader.note(path, f"expected {above}", value)
    elif not low <= factor <= high and not reader.findings:
        limit = f"at most {high:,.0f}" if factor > high else f"at least {low:g}"
        reader.note(path, f"expected {limit}", value)
    return factor


def _reference(reader: ValueReader, value: Any, path: Path) -> dict[str, float] | None:
    if isinstance(value, dict):
        return _by_name(LENGTH)(reader, value, path)
    if value != "absolute":
        axes = "axis coordinates, for instance { X = 0, Y = 0, Z = -280 }"
        reader.note(path, f'expected "absolute" or {axes}', value)
    return None


def _component_errors(reader: ValueReader, value: Any, path: Path) -> str | dict[str, str]:
    name = _choice(convention_names)
    return (_by_name(name) if isinstance(value, dict) else name)(reader, value, path)


def _date(reader: ValueReader, value: Any, path: Path) -> Any:
    if not isinstance(value, datetime) or value.tzinfo is None:
        reader.note(path, "expected a time with its zone, for instance 2026-11-22T10:00:00Z", value)
    return value


def _step(reader: ValueReader, value: Any, path: Path) -> int:
    number = reader.number(value, path, 0.0, limits.MAX_NOTES)
    if number % 1.0 > 0.0:
        reader.note(path, "expected a whole number", value)
    return int(number) if number % 1.0 == 0.0 else 0


def _list(kind: Kind, max_count: int, min_count: int = 0) -> Kind:
    def read(reader: ValueReader, value: Any, path: Path) -> tuple[Any, ...]:
        entries = reader.entries(value, path, max_count, min_count)
        return tuple(kind(reader, entry, (*path, index)) for index, entry in enumerate(entries))

    return read


@dataclass(frozen=True)
class TableSchema:
    """Schema of a table: by key the reader of its value, and a default."""

    fields: Mapping[str, tuple[Kind, Any]]
    build: Callable[..., Any] = dict

    def __call__(self, reader: ValueReader, value: Any, path: Path) -> Any:
        before = len(reader.findings)
        table = reader.dictionary(value, path)
        if len(reader.findings) > before:
            return None
        entries: dict[str, Any] = {}
        for name, (kind, default) in self.fields.items():
            if name in table:
                entries[name] = kind(reader, table[name], (*path, name))
                continue
            if default is MISSING:
                reader.note((*path, name), "", MISSING)
            entries[name] = default
        reader.only(table, path, self.fields)
        return self.build(**entries)


LIMIT = (-limits.MAX_LENGTH_MM, limits.MAX_LENGTH_MM)
LENGTH = _number(*LIMIT)
POINT = _numbers("[x, y, z]", *[limits.MAX_LENGTH_MM] * 3)
TURN = _numbers("[x, y, z]", *[limits.FULL_TURN_DEG] * 3)
TEXT = _text(limits.MAX_TEXT)
_LINE = r"[^\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]*", "one line without control characters"
TITLE = _text(limits.MAX_TEXT, 0, *_LINE)
_HALF_WIDTH = 0.0, limits.MAX_ERROR, limits.MIN_HALF_WIDTH
GANTRY = TableSchema(
    {
        "span_mm": (_number(*limits.GANTRY_SPAN_MM), MISSING),
        "across": (_choice(lambda: "xyz"), None),
    }
)
_NAME = _text(100, 1, *_LINE)
ADJUSTER = TableSchema(
    {
        "name": (_NAME, MISSING),
        "body": (_text(8, 1), MISSING),
        "kind": (_one_of(AdjusterKind), MISSING),
        "step": (_number(1e-6, limits.MAX_LENGTH_MM), MISSING),
        "range": (_span, MISSING),
        "at_mm": (POINT, None),
        "direction": (_numbers("[x, y, z]", *[limits.MAX_LENGTH_MM] * 3), None),
        "pitch_mm": (_number(*limits.PITCH_MM), None),
        "groups": (_list(_NAME, limits.MAX_ADJUSTERS), ()),
    }
)
MACHINE = TableSchema(
    {
        "title": (TITLE, ""),
        "description": (TEXT, ""),
        "source": (TEXT, ""),
        "chain": (_text(100), MISSING),
        "offset_mm": (_by_name(POINT), {}),
        "rotation_deg": (_by_name(TURN), {}),
        "travel": (_by_name(_span), {}),
        "direction": (_by_name(_choice(lambda: (1, -1))), {}),
        "gantry": (_by_name(GANTRY), {}),
        "columns": (_by_name(_text(20, 1, "[A-Za-z][A-Za-z0-9]*", "letters and digits")), {}),
        "bodies": (_by_name(lambda _reader, value, _path: value), {}),
        "adjusters": (_list(ADJUSTER, limits.MAX_ADJUSTERS), ()),
    }
)
BODY = TableSchema(
    {
        "file": (_text(MAX_FILE_NAME), ""),
        "unit": (_one_of(MESH_UNITS), ""),
        "offset_mm": (POINT, ORIGIN),
        "rotation_deg": (TURN, ORIGIN),
        "shape": (_one_of(TOOL_SHAPES), ""),
    },
    BodySource,
)
CONVENTION = TableSchema(
    {
        "component_errors": (_component_errors, ComponentErrors.AFTER_MOTION.value),
        "reference_axis": (_choice(lambda: ("fixed", "free")), "fixed"),
        "direction": (_one_of(tuple(TravelDirection)), TravelDirection.MEAN.value),
        "squareness": (_one_of(tuple(SquarenessSign)), SquarenessSign.RIGHT_HAND.value),
        "measuring_line_mm": (_by_name(POINT), {}),
    }
)
POINTS = TableSchema(
    {
        "tool": (POINT, ORIGIN),
        "workpiece": (POINT, ORIGIN),
        "traces": (_list(POINT, limits.MAX_TRACES), ()),
    }
)
VIEW = TableSchema(
    {
        "exaggeration": (_exaggeration, None),
        "reference": (_reference, None),
        "placed": (_choice(lambda: (True, False)), False),
        "limit_um": (_number(*limits.LIMIT_UM), None),
    }
)
PART = TableSchema(
    {
        "file": (_text(MAX_FILE_NAME), ""),
        "place": (_numbers("[x, y, z, a, b, c]", *[limits.MAX_LENGTH_MM] * 6), None),
        "unit": (_one_of(MESH_UNITS), ""),
        "features": (_text(MAX_FILE_NAME), ""),
        "program": (_text(MAX_FILE_NAME), ""),
        "tcp": (_one_of(("program", "always", "never")), ""),
    }
)
DEFAULTS = _by_name(_number(*_HALF_WIDTH), errors.TOLERANCE_CLASSES)
_RANGE = TableSchema(
    {
        "centre": (_number(-limits.MAX_ERROR, limits.MAX_ERROR), 0.0),
        "half_width": (_number(*_HALF_WIDTH), MISSING),
    },
    errors.Tolerance,
)
_WIDTH = _number(*_HALF_WIDTH, "a half width or { centre = , half_width = }")
_PLACE = _number(*LIMIT, expected="a number or [lower, upper]")
_READING = _numbers("[position, value]", limits.MAX_LENGTH_MM, limits.MAX_ERROR)


def workspace_range(reader: ValueReader, value: Any, path: Path) -> tuple[float, float]:
    """Read the range of an axis in the working volume; equal ends for one position."""
    if isinstance(value, list | tuple):
        return _span(reader, value, path)
    at = _PLACE(reader, value, path)
    return at, at


_RUN = TableSchema(
    {
        "direction": (
            _choice(lambda: errors.RUN_DIRECTIONS, "{} or {} (not known)"),
            errors.UNKNOWN,
        ),
        "points": (_list(_READING, limits.MAX_POINTS, min_count=1), MISSING),
    },
    errors.TravelRun,
)
RUNS = TableSchema({"runs": (_list(_RUN, limits.MAX_RUNS, min_count=1), MISSING)})
CSV_RUNS = TableSchema(
    {"csv": (_text(MAX_FILE_NAME, 1), MISSING), "column": (_text(MAX_COLUMN_NAME, 1), MISSING)}
)
_PRODUCT = _number(-(limits.MAX_ERROR**2), limits.MAX_ERROR**2)
_KEYS = _list(_text(8, 1), limits.MAX_COVARIANCE)
COVARIANCE = TableSchema(
    {
        "keys": (_KEYS, ()),
        "matrix": (_list(_list(_PRODUCT, limits.MAX_COVARIANCE, 1), limits.MAX_COVARIANCE), ()),
        "sha256": (_text(64), ""),
        "dof": (_number(1.0, 1e9), math.inf),
        "measured_range": (_by_name(workspace_range), {}),
        "undetermined": (_KEYS, ()),
        "lack_of_fit": (_number(0.0, 1e9), 0.0),
    }
)
ACTS = "each", "all", "scale"  # readings that a contribution acts on
DIVISORS = {"normal": 1.0, "rectangular": 3**0.5, "triangular": 6**0.5, "u-shaped": 2**0.5}
_CONTRIBUTION = TableSchema(
    {
        "name": (_text(100, 1, *_LINE), MISSING),
        "type": (_choice(lambda: ("A", "B")), MISSING),
        "distribution": (_one_of(DIVISORS), MISSING),
        "value": (_number(1e-9, limits.MAX_ERROR), MISSING),
        "unit": (_text(20, 1, *_LINE), MISSING),
        "acts": (_one_of(ACTS), MISSING),
        "sensitivity": (_number(1e-9, limits.MAX_ERROR), MISSING),
        "dof": (_number(1.0, 1e9), math.inf),
        "source": (_text(limits.MAX_TEXT), ""),
    }
)
INSTRUMENT = TableSchema(
    {
        "title": (TITLE, ""),
        "source": (TEXT, ""),
        "contributions": (_list(_CONTRIBUTION, limits.MAX_TERMS, 1), MISSING),
    }
)
_MEASURED = _by_name(_number(0.0, limits.MAX_ERROR * 10.0), MEASURES)
_VERSION = _text(16, 1, r"[a-z0-9]*", "small letters and digits")
# line breaks and tabulators, but no other control characters
_PLAIN = r"[^\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff]*", "a text without control characters"
_ANCHOR = TableSchema(
    {"loop": (_one_of(Loop), ""), "point_mm": (POINT, None), "body": (_text(8), "")}, NoteAnchor
)
_NOTE: dict[str, tuple[Kind, Any]] = {
    "id": (_VERSION, MISSING),
    "kind": (_one_of(KINDS), "note"),
    "at": (_by_name(LENGTH), {}),
    "on": (_ANCHOR, None),
    "text": (_text(limits.MAX_NOTE_TEXT, 1, *_PLAIN), MISSING),
    "author": (_text(100, 0, *_LINE), ""),
    "date": (_date, MISSING),
    "status": (_one_of(STATUSES), "open"),
    "loop": (_one_of(Loop), Loop.TOOL.value),
    "numbers": (_MEASURED, {}),
    "before": (_MEASURED, {}),
    "change": (_by_name(_numbers("[from, to]", *[limits.MAX_ERROR] * 2)), {}),
    "step": (_step, 0),
    "view": (_text(limits.MAX_NOTE_VIEW), ""),
    "replaces": (_list(_VERSION, limits.MAX_REPLACED), ()),
}
_REPLY = TableSchema({name: _NOTE[name] for name in ("text", "author", "date")}, Reply)
_ATTACHED: dict[str, tuple[Kind, Any]] = {
    "replies": (_list(_REPLY, limits.MAX_REPLIES), ()),
    "versions": (_list(TableSchema(_NOTE, Note), limits.MAX_REPLIES), ()),
}
NOTES = _list(TableSchema(_NOTE | _ATTACHED, Note), limits.MAX_NOTES)


def _band(reader: ValueReader, value: Any, path: Path) -> tuple[float, float]:
    if isinstance(value, list | tuple):
        return _span(reader, value, path)
    half_width = reader.number(value, path, *_HALF_WIDTH[:2], expected="a number or [lower, upper]")
    return -half_width, half_width


def _before(reader: ValueReader, value: Any, path: Path) -> str | dict[str, float]:
    if isinstance(value, str):
        return _text(MAX_FILE_NAME, 1)(reader, value, path)
    return _by_name(_number(-limits.MAX_ERROR, limits.MAX_ERROR))(reader, value, path)


_DONE = TableSchema({"acts": (_by_name(LENGTH), MISSING), "before": (_before, MISSING)})
DONE_ACTS = TableSchema({"done": (_list(_DONE, limits.MAX_NOTES), ())})
LEAST_SQUARES, EXTREME_FITS = "least squares", ("inscribed", "circumscribed")
FITS = LEAST_SQUARES, "minimum zone", *EXTREME_FITS
_FEATURE = TableSchema(
    {
        "name": (_text(100, 1, *_LINE), ""),
        "is": (_text(100, 1), MISSING),
        "near": (POINT, None),
        "fit": (_one_of(FITS), ""),
        "measure": (_text(100), ""),
        "to": (_list(_text(100, 1), 6), ()),
        "tolerance_um": (_band, None),
        "tolerance_urad": (_band, None),
    }
)
FEATURES = TableSchema({"features": (_list(_FEATURE, limits.MAX_TOLERANCES, 1), MISSING)})


def tolerance(reader: ValueReader, value: Any, path: Path) -> errors.Tolerance:
    if isinstance(value, dict):
        return _RANGE(reader, value, path)
    return errors.Tolerance(0.0, _WIDTH(reader, value, path))
