"""Text files of measured data and of controllers: lines, numbers, units and messages."""

import io
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NoReturn

from warpspace.exceptions import SceneError
from warpspace.machine.limits import MAX_ERROR, MAX_LENGTH_MM
from warpspace.scene.text_files import (
    ANGLE_URAD,
    LENGTH_UM,
    UNIT_SPELLING,
    CsvRows,
    decode_text,
    one_line,
    parse_number,
)

MM_PER: Mapping[str, float] = {unit: size * 1e-3 for unit, size in LENGTH_UM.items()}
DEG_PER: Mapping[str, float] = {"deg": 1.0, "rad": 180.0 / math.pi, "arcsec": 1.0 / 3600.0}
DEG_TO_URAD = ANGLE_URAD["deg"]


def format_number(value: float, digits: int) -> str:
    """Format a number with at most so many decimals, without trailing zeros."""
    text = f"{value:.{digits}f}"
    if "." in text:
        integer_part, _, part = text.partition(".")
        text = f"{integer_part}.{part.rstrip('0') or '0'}"
    return "0.0" if text in {"-0.0", "-0"} else text


_DELIMITERS = str.maketrans(dict.fromkeys("();#%*\\", " "))  # also of line continuation
MAX_COMMENT = 200  # characters; LinuxCNC reads lines of 255


def format_comment(opens: str, text: str, closes: str = "") -> str:
    """Format a comment of a controller's file: one line of printable ASCII.

    Some controls read other letters byte by byte and interpret some bytes as the end of a line.
    """
    clean = one_line(text).translate(_DELIMITERS).encode("ascii", "replace").decode()
    return f"{opens}{clean[:MAX_COMMENT]}{closes}"


MAX_BYTES = 64 * 1024 * 1024
MAX_LINES = 2_000_000
MAX_LINE = 16_384  # characters of one line
HEAD_LINES = 60  # by which a format is recognised
MAX_QUOTED = 60  # characters of a line in a message
_LINE_ENDS = re.compile(r"\r\n|\n|\r")


@dataclass(frozen=True)
class Source:
    """A text file in lines."""

    name: str  # in messages
    lines: tuple[str, ...]  # without line ends
    notes: tuple[str, ...] = ()  # assumptions about its encoding

    @property
    def head(self) -> str:
        """The first lines, by which a format is recognised."""
        return "\n".join(line.strip() for line in self.lines[:HEAD_LINES])

    @property
    def text(self) -> str:
        return "\n".join(self.lines)

    @property
    def base(self) -> str:
        return self.name.replace("\\", "/").rsplit("/", 1)[-1]

    @property
    def stem(self) -> str:
        return self.base.rsplit(".", 1)[0]

    def refuse(self, problem: str, expected: str = "") -> NoReturn:
        raise SceneError(self.name, [f"{problem}; expected {expected}" if expected else problem])

    def rows(self, max_rows: int) -> CsvRows:
        """Read a table with a header and at most so many rows."""
        return CsvRows(io.StringIO(self.text), self.name, max_rows, unique=True)

    def at(self, line: int) -> "SourceLine":
        """Return a line, counted from 1."""
        return SourceLine(self, line)

    def scan(self, *comments: str) -> Iterator[tuple["SourceLine", str]]:
        """Yield the lines that are not empty, without comments."""
        for number, text in enumerate(self.lines, start=1):
            bare = text
            for mark in comments:
                bare = bare.split(mark)[0]
            if bare.strip():
                yield SourceLine(self, number), bare.strip()


@dataclass(frozen=True)
class SourceLine:
    """A line of a file, with checked conversions that refer to it in messages."""

    source: Source
    line: int

    @property
    def quoted(self) -> str:
        return quote(self.source.lines[self.line - 1])

    def refuse(self, problem: str, expected: str = "") -> NoReturn:
        self.source.refuse(f"line {self.line}: {problem}", expected)

    def number(self, text: str, quantity: str) -> float:
        try:
            return parse_number(text)
        except ValueError:
            if "," in text:
                self.refuse(f"{quantity} {quote(text)} has a decimal comma", "a point")
            self.refuse(f"{quantity} {quote(text)}", "a finite number")

    def integer(self, text: str, quantity: str, low: int, high: int) -> int:
        value = self.number(text, quantity)
        if value != int(value) or not low <= value <= high:
            self.refuse(f"{quantity} {quote(text)}", f"a whole number {low} … {high}")
        return int(value)

    def position(self, text: str, quantity: str) -> float:
        """Parse a position within the limits of a machine, mm or degrees."""
        return self.checked_position(self.number(text, quantity), quantity)

    def checked_position(self, value: float, quantity: str) -> float:
        """Check a position against the limits of a machine, mm or degrees."""
        if abs(value) > MAX_LENGTH_MM:
            self.refuse(f"{quantity} {value:g}", f"at most ±{MAX_LENGTH_MM:g} mm or degrees")
        return value

    def error(self, text: str, quantity: str, scale: float = 1.0) -> float:
        """Parse an error in the unit of the file; return it in µm or µrad."""
        return self.checked_error(self.number(text, quantity) * scale, quantity)

    def checked_error(self, value: float, quantity: str) -> float:
        """Check an error against the limits of the rigid-body model, µm or µrad."""
        if abs(value) > MAX_ERROR:
            expected = f"at most ±{MAX_ERROR:g} (is the unit right?)"
            self.refuse(f"{quantity} {value:g} µm or µrad", expected)
        return value

    def unit(self, unit: str, factors: Mapping[str, float], quantity: str) -> float:
        bare = unit.translate(UNIT_SPELLING)
        if bare not in factors:
            expected = f"one of the units {', '.join(factors)}"
            self.refuse(f"{quantity} in {quote(unit)}", expected)
        return factors[bare]

    def ascending(self, value: float, before: float, quantity: str, of: str = "") -> None:
        if value <= before:
            self.refuse(f"{quantity} {value:g}{of} after {before:g}", "ascending positions")


MAX_LISTED = 6  # lines that are not read, in a note


def unread_notes(lines: Sequence[SourceLine]) -> tuple[str, ...]:
    """Return a note on the lines of a file that contain no error; none without such lines."""
    if not lines:
        return ()
    listed = ", ".join(f"line {at.line} {at.quoted}" for at in lines[:MAX_LISTED])
    count = len(lines) - MAX_LISTED
    remainder = f" and {count:,} more" if count > 0 else ""
    return (f"{lines[0].source.base}: ignored {listed}{remainder}",)


def quote(text: str) -> str:
    """Quote text of a file for a message, shortened and without control characters."""
    clean = one_line(text.strip())
    return repr(clean if len(clean) <= MAX_QUOTED else clean[: MAX_QUOTED - 1] + "…")


def source_of_bytes(content: bytes, name: str) -> Source:
    if len(content) > MAX_BYTES:
        problem = f"is {len(content):,} bytes long; expected at most {MAX_BYTES:,} bytes"
        raise SceneError(name, [problem])
    text, notes = decode_text(content, name)
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise SceneError(name, [f"line {line}: contains null bytes; expected a text file"])
    source = source_of_text(text, name, notes)
    if not any(line.strip() for line in source.lines):
        source.refuse("is empty", "measured data or a table of a controller")
    return source


def source_of_text(text: str, name: str, notes: tuple[str, ...] = ()) -> Source:
    """Split a text into lines at any kind of line end."""
    count = text.count("\n") + text.count("\r") - text.count("\r\n") + (text[-1:] not in "\r\n")
    if count > MAX_LINES:  # counted first: splitting four million lines blocks the server
        raise SceneError(name, [f"has {count:,} lines; expected at most {MAX_LINES:,}"])
    lines = _LINE_ENDS.split(text)
    if lines and not lines[-1]:
        lines.pop()
    for number, line in enumerate(lines, start=1):
        if len(line) > MAX_LINE:
            problem = f"is longer than {MAX_LINE:,} characters; expected shorter lines"
            raise SceneError(name, [f"line {number} {problem}"])
    return Source(name, tuple(lines), notes)
