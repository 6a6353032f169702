"""Readers of text files: TOML and CSV tables, with limits and messages."""

import csv
import io
import math
import os
import re
import sys
import time as clock
import tomllib
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from datetime import date, time
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import TextIO, TypeVar

from warpspace.exceptions import OutputError, SceneError
from warpspace.machine import limits

if sys.platform != "win32":
    import fcntl

LOCK_WAIT_S = 60.0
T = TypeVar("T")

# The memory of a TOML reader grows with the square of the parts of one key, and with each table.
# One pass over the text, in linear time, counts both.

_TOKENS = re.compile(
    r'"""(?:[^"\\]++|\\.|"(?!""))*+(?:"{3,5})?'  # a text may end with two quotes of its own
    r"|'''(?:[^']++|'(?!''))*+(?:'{3,5})?"
    r'|"(?:[^"\\\n]++|\\[^\n])*+"?'
    r"|'[^'\n]*+'?"
    r"|#[^\n]*+"
    r"|[.,=\n\[\]{}]",
    re.DOTALL,
)
"""Tokens of TOML: punctuation; texts and remarks, which are skipped."""


def check_outline(text: str, source: str) -> None:
    """Raise an error for text with too many or too deeply nested keys."""
    dots = depth = keys = 0
    for count, match in enumerate(_TOKENS.finditer(text)):
        mark = match[0]
        if mark == ".":  # between the parts of a key; a number has one at most
            dots += 1
        elif mark[0] not in "\"'#":
            if mark == "=" or (mark == "]" and depth == 1):
                keys += dots + 1
            elif mark == "{":
                keys += 1
            dots = 0
            if mark in "]}":
                depth = max(depth - 1, 0)
            elif mark in "[{":
                depth += 1
        if count >= limits.MAX_MARKS:
            problem = (
                f"more than {limits.MAX_MARKS:,} brackets, commas, dots and lines; expected long"
            )
            problem += " tables in CSV files of their own"
        elif dots >= limits.MAX_KEY_PARTS:
            expected = f"expected at most {limits.MAX_KEY_PARTS}"
            problem = f"a key of over {limits.MAX_KEY_PARTS} parts; {expected}"
        elif keys > limits.MAX_KEYS:
            problem = f"more than {limits.MAX_KEYS:,} parts of keys"
        elif depth > limits.MAX_NESTING:
            problem = f"is not valid TOML: nested too deeply, more than {limits.MAX_NESTING} levels"
        else:
            continue
        line = text.count("\n", 0, match.start()) + 1
        raise SceneError(source, [f"line {line}: {problem}"])


def read_text(path: Path, limit_bytes: int, source: str | None = None) -> str:
    source = source or str(path)
    try:
        return read_bytes(path, limit_bytes, source).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = f"is not UTF-8 text (byte {error.start}); expected a UTF-8 file"
        raise SceneError(source, [text]) from None


def read_table_text(path: Path, limit_bytes: int) -> tuple[str, tuple[str, ...]]:
    """Read a table as text, in any encoding, with notes on it."""
    return decode_text(read_bytes(path, limit_bytes), str(path))


def parse_table_file(path: Path, limit_bytes: int, parse: Callable[[TextIO], T]) -> T:
    """Parse a table in any encoding; UTF-8 is read line by line, in bounded memory."""
    check_file(path, limit_bytes, str(path))
    try:
        with path.open("rb") as file:
            sample = file.read(_SAMPLE_BYTES)
        if not (sample.startswith(SPREADSHEET) or _utf16(sample)):
            with path.open(encoding="utf-8-sig", newline="") as file:
                return parse(file)
    except UnicodeDecodeError:
        pass
    except OSError as error:
        raise SceneError(str(path), [f"cannot be read: {error.strerror or error}"]) from None
    return parse(io.StringIO(read_table_text(path, limit_bytes)[0], newline=""))


SPREADSHEET = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")
"""First bytes of .xlsx and .ods, and of .xls."""
_SAMPLE_BYTES = 4096
_UTF16_SHARE = 0.3
"""Smallest share of zero bytes at every other position of UTF-16 without a byte order mark."""


def decode_text(content: bytes, name: str, errors: str = "strict") -> tuple[str, tuple[str, ...]]:
    """Decode text in UTF-8, UTF-16 or Windows-1252, or a spreadsheet, with notes."""
    if content.startswith(SPREADSHEET):
        return _sheet_text(content, name)
    encoding = _utf16(content)
    if encoding:
        try:
            return content.decode(encoding, errors), ("read as UTF-16",)
        except UnicodeDecodeError:
            problem = "begins as UTF-16 text, but is not valid; expected a text file"
            raise SceneError(name, [problem]) from None
    try:
        return content.decode("utf-8-sig"), ()
    except UnicodeDecodeError as error:
        try:
            text = content.decode("cp1252", errors)
        except UnicodeDecodeError:
            problem = f"is not text in UTF-8, UTF-16 or Windows-1252 (byte {error.start})"
            raise SceneError(name, [f"{problem}; expected a text file"]) from None
        return text, ("read as Windows-1252, because it is not UTF-8",)


def _sheet_text(content: bytes, name: str) -> tuple[str, tuple[str, ...]]:
    """Read the first sheet of a spreadsheet as a table with semicolons."""
    expected = "a sheet that is saved as CSV"
    try:
        zipfile, reader = import_module("zipfile"), import_module("python_calamine")
    except ImportError:
        problem = f"is a spreadsheet; expected the package python-calamine, or {expected}"
        raise SceneError(name, [problem]) from None
    try:
        size = 0
        if zipfile.is_zipfile(io.BytesIO(content)):
            with zipfile.ZipFile(io.BytesIO(content)) as parts:
                size = sum(part.file_size for part in parts.infolist())
        if size > limits.MAX_CSV_BYTES:
            limit = f"expected at most {limits.MAX_CSV_BYTES:,}"
            raise SceneError(name, [f"is {size:,} bytes long when unpacked; {limit}"])
        workbook = reader.CalamineWorkbook.from_filelike(io.BytesIO(content))
        rows = workbook.get_sheet_by_index(0).to_python(skip_empty_area=False)
    except (
        reader.CalamineError,
        zipfile.BadZipFile,
        NotImplementedError,
        UnicodeDecodeError,
    ) as error:
        problem = f"is no readable spreadsheet ({one_line(str(error))}); expected {expected}"
        raise SceneError(name, [problem]) from None
    text = io.StringIO()
    csv.writer(text, delimiter=MARKS[0], lineterminator="\n").writerows(
        [int(cell) if isinstance(cell, float) and cell.is_integer() else cell for cell in row]
        for row in rows
    )
    sheet, *ignored_sheets = map(repr, workbook.sheet_names)
    ignored = f", ignored {', '.join(ignored_sheets)}" if ignored_sheets else ""
    return text.getvalue(), (one_line(f"read sheet {sheet}{ignored}"),)


def _utf16(content: bytes) -> str:
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    sample = content[:_SAMPLE_BYTES]
    half = len(sample) // 2
    if half < 2:
        return ""
    odd, even = sample[1::2].count(0) / half, sample[0::2].count(0) / half
    if odd > _UTF16_SHARE and even < _UTF16_SHARE / 10:
        return "utf-16-le"
    return "utf-16-be" if even > _UTF16_SHARE and odd < _UTF16_SHARE / 10 else ""


def read_bytes(path: Path, limit_bytes: int, source: str | None = None) -> bytes:
    """Read a file of limited size; devices and pipes are refused before opening."""
    source = source or str(path)
    check_file(path, limit_bytes, source)
    try:
        size = path.stat().st_size or limit_bytes  # `read` allocates all that it may return
        with path.open("rb") as file:
            content = file.read(min(size, limit_bytes) + 1)
    except OSError as error:
        raise SceneError(source, [f"cannot be read: {error.strerror or error}"]) from None
    if len(content) > limit_bytes:  # some system files report a size of zero
        raise SceneError(source, [f"is too long; expected at most {limit_bytes:,} bytes"])
    return content


def check_file(path: Path, limit_bytes: int, source: str) -> None:
    """Raise an error for anything but a file of limited size; a device may never end."""
    try:
        if path.is_dir():
            raise SceneError(source, ["is a folder; expected a file"])
        if not path.exists():
            raise SceneError(source, ["no such file"])
        if not path.is_file():
            raise SceneError(source, ["is no regular file; expected a file, no device or pipe"])
        size = path.stat().st_size
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SceneError(source, [f"cannot be read: {reason}"]) from None
    if size > limit_bytes:
        raise SceneError(
            source, [f"is {size:,} bytes long; expected at most {limit_bytes:,} bytes"]
        )


@contextmanager
def lock_file(path: Path) -> Generator[None]:
    """Lock a file while it is read, changed and replaced; the lock ends with the process.

    Where there are no locks (Windows, some network drives), pass the content read to
    `warpspace.outputs.file_output.write_atomically`, which refuses a file that has changed.
    """
    check_file(path, limits.MAX_SCENE_BYTES, str(path))
    last_s = clock.monotonic() + LOCK_WAIT_S
    with ExitStack() as opened:
        while sys.platform != "win32":
            try:
                file = opened.enter_context(path.open("rb"))
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if os.path.samestat(os.fstat(file.fileno()), path.stat()):
                    break  # otherwise it was replaced meanwhile
            except BlockingIOError:
                pass
            except OSError:
                break
            opened.close()
            if clock.monotonic() > last_s:
                text = f"{path}: locked by another process for {LOCK_WAIT_S:g} s; try again"
                raise OutputError(text)
            clock.sleep(0.02)
        yield


def parse_toml(text: str, source: str) -> dict[str, object]:
    check_outline(text, source)
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise SceneError(source, ["is not valid TOML: nested too deeply"]) from None
    except ValueError as error:  # a syntax error, or a whole number Python refuses to read
        reason = str(error).partition(";")[0]
        raise SceneError(source, [f"is not valid TOML: {reason}"]) from None


MAX_VALUE_LENGTH = 60  # characters of a value or a key in a message
_DEPTH = 6
_ENTRIES = 8
_HUGE_BITS = 512
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+", re.ASCII)
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r"}


def list_repeated(names: Iterable[T]) -> list[T]:
    """List what occurs more than once, in order."""
    return [name for name, count in Counter(names).items() if count > 1]


def one_line(text: str) -> str:
    """Replace all characters that are not printable by spaces."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def spell_value(value: object) -> str:
    """Write a value in TOML, in at most one line."""
    return _shorten(_spell(value, _DEPTH))


def spell_key(name: str) -> str:
    """Write a key in TOML, with quotes where needed."""
    return _shorten(name if _BARE_KEY.fullmatch(name) else _quoted(name))


def location(key: str, parts: Iterable[int | str]) -> str:
    """Write the path of a finding as in the file."""
    text = key
    for part in parts:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += f".{spell_key(part)}" if text else spell_key(part)
    return text


def _shorten(text: str) -> str:
    return text if len(text) <= MAX_VALUE_LENGTH else text[: MAX_VALUE_LENGTH - 1] + "…"


def _quoted(text: str) -> str:
    letters = text[: MAX_VALUE_LENGTH + 1]
    spelling = [_ESCAPES.get(c, c if c.isprintable() else f"\\u{ord(c):04x}") for c in letters]
    return f'"{"".join(spelling)}"'


def _spell(value: object, depth: int) -> str:
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and value.bit_length() > _HUGE_BITS:
        return f"a whole number of {value.bit_length()} bits"
    if isinstance(value, date | time):
        return value.isoformat()
    if not isinstance(value, list | tuple | dict):
        return repr(value)
    opening, closing = "{}" if isinstance(value, dict) else "[]"
    if not value:
        return opening + closing
    if depth == 0:
        return f"{opening}…{closing}"
    if isinstance(value, dict):
        pairs = list(value.items())[:_ENTRIES]
        entries = [f"{spell_key(str(name))} = {_spell(entry, depth - 1)}" for name, entry in pairs]
    else:
        entries = [_spell(entry, depth - 1) for entry in value[:_ENTRIES]]
    inside = ", ".join([*entries, "…"] if len(value) > _ENTRIES else entries)
    return f"{{ {inside} }}" if isinstance(value, dict) else f"[{inside}]"


# A line ``sep=;`` defines the separator; otherwise it is the first of semicolon, tab and comma in
# the header. Lines that begin with # are remarks; empty rows and separators behind the last column
# are ignored. A file has one decimal sign: the point, or, with semicolons or tabs, the comma.

MARKS = (";", "\t", ",")  # separators of columns by priority
FORMULA = ("=", "+", "-", "@", "\t", "\r", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""Beginnings of a text that spreadsheets interpret as a formula; full-width ones too."""
_MOST_PROBLEMS = 10_000
_TURN_RAD = 1.001 * math.tau
_WHOLE_DEG = 0.02
_MAX_LINES_OF_ROW = 20  # lines of one row, with line breaks in texts
_NUMBER = re.compile(r"[+-]?(?:\d++\.?\d*+|\.\d++)(?:[eE][+-]?\d++)?", re.ASCII)
_BLANKS = re.compile(r"\s+(?![\[(])")
"""Blanks between headings, not those before a unit."""
_SEP = re.compile(r'"?sep=(.)"?\s*', re.IGNORECASE)
UNIT_SPELLING = str.maketrans({"µ": "u", "μ": "u", "°": "deg", **dict.fromkeys('"″', "arcsec")})
Row = tuple[int, list[str]]
"""Number of the last line of a row, and its cells without surrounding blanks."""


def parse_number(text: str) -> float:
    """Read a finite decimal number: no underscore, word or digit of other scripts."""
    bare = text.strip().replace("−", "-")
    value = float(bare) if _NUMBER.fullmatch(bare) else math.nan
    if not math.isfinite(value):
        raise ValueError(f"{text!r} is no number")
    return value


def parse_whole(text: str) -> int:
    """Read a whole number; unlike `int` no underscore or digit of other scripts."""
    value = parse_number(text)
    if not value.is_integer():
        raise ValueError(f"{text!r} is no whole number")
    return int(value)


LENGTH_UM: Mapping[str, float] = {
    "um": 1.0,
    "mm": 1e3,
    "nm": 1e-3,
    "m": 1e6,
    **dict.fromkeys(("in", "inch"), 25_400.0),
    "thou": 25.4,
}
"""Micrometres per unit of length."""
ANGLE_URAD: Mapping[str, float] = {
    "urad": 1.0,
    "mrad": 1e3,
    "rad": 1e6,
    "arcsec": math.pi / 180.0 / 3600.0 * 1e6,
    "deg": math.pi / 180.0 * 1e6,
    "um/m": 1.0,
    "mm/m": 1e3,
}
"""Microradians per unit of angle."""
POSITION_UNITS = {"mm", "m", "in", "inch", "deg", "rad"}
"""Units of positions; a short heading such as x_mm is no deviation x_um."""
DIRECTIONS: Mapping[str, int] = {
    **dict.fromkeys(("+", "1", "+1", "↑", "forward", "forwards", "fwd", "positive", "vorwärts"), 1),
    **dict.fromkeys(
        ("-", "−", "-1", "↓", "backward", "backwards", "reverse", "rev", "rückwärts"), -1
    ),
    "negative": -1,
}
"""Directions of travel in tables, in lower case."""


def unit_factor(unit: str, target: str) -> float | None:
    """Return the factor from one unit to another; None for units of other quantities."""
    for sizes in (LENGTH_UM, ANGLE_URAD):
        if unit in sizes and target in sizes:
            return sizes[unit] / sizes[target]
    return None


def match_column(name: str, headings: Sequence[str]) -> tuple[int, float] | None:
    """Find a column such as ``deviation_um`` in any unit and case: its index and factor."""
    if name in headings:
        return headings.index(name), 1.0
    stem, _, target = name.lower().rpartition("_")
    for index, heading in enumerate(headings):
        other, _, unit = heading.lower().rpartition("_")
        factor = unit_factor(unit, target) if stem and other == stem else None
        is_same_quantity = (
            len(stem) > 1
            or {unit, target} <= POSITION_UNITS
            or not ({unit, target} & POSITION_UNITS)
        )
        if heading.lower() == name.lower() or (factor is not None and is_same_quantity):
            return index, factor or 1.0
    return None


def heading_unit(heading: str) -> str:
    """Return the unit in a heading such as ``EXX [um]`` or ``EXX_um``; empty without one."""
    stem, _, unit = plain_heading(heading).rpartition("_")
    return unit if stem and unit_factor(unit, unit) else ""


def _has_units(cells: Sequence[str]) -> bool:
    """Return true for the headings of a table: units, and no number."""
    return any(map(heading_unit, cells)) and not any(map(_is_number, cells))


def _is_number(text: str) -> bool:
    try:
        parse_number(text.replace(",", "."))
    except ValueError:
        return False
    return True


def plain_heading(text: str) -> str:
    """Write a heading with its unit after an underscore: ``angle (°)`` is ``angle_deg``."""
    bare = text.strip()
    for opening, closing in ("[]", "()"):
        name, _, unit = bare[:-1].rpartition(opening)
        if bare.endswith(closing) and name.strip() and unit.strip() and not {*"[]()"} & {*unit}:
            return f"{name.rstrip()}_{unit.strip().translate(UNIT_SPELLING)}"
    return bare


GERMAN = {
    "abweichung": "deviation",
    **dict.fromkeys(("sollposition", "zielposition"), "target"),
    "richtung": "direction",
    "lauf": "run",
}
"""Headings by their German spelling."""


def translate_heading(heading: str) -> str:
    """Translate a German heading of a table of readings, with or without a unit."""
    name = re.split(r"[\[(_]", heading, maxsplit=1)[0]
    return GERMAN.get(name.strip().lower(), name) + heading[len(name) :]


def radian_notes(columns: Mapping[str, Sequence[float]]) -> tuple[str, ...]:
    """List columns ``…_deg`` that look like radians: a full turn, or whole degrees, of them."""
    notes: list[str] = []
    for name, values in columns.items():
        low, high = min(values), max(values)
        if not name.endswith("_deg") or not 0.0 < max(-low, high) < _TURN_RAD:
            continue
        is_whole = all(abs(deg - round(deg)) < _WHOLE_DEG for deg in map(math.degrees, values))
        if is_whole or high - low > 0.9 * _TURN_RAD:
            turned = f"{math.degrees(low):.4g} … {math.degrees(high):.4g}°"
            notes.append(
                f"{name} runs {low:.4g} … {high:.4g}: in radians that would be {turned}; taken as"
                " degrees"
            )
    return tuple(notes)


def guard_cell(text: str) -> str:
    """Put ' before a text that spreadsheets interpret as a formula; see `unguard_cell`."""
    return f"'{text}" if text.lstrip("'").startswith(FORMULA) else text


def unguard_cell(text: str) -> str:
    return text[1:] if text[:1] == "'" and guard_cell(text[1:]) == text else text


def spell_row(cells: Iterable[object]) -> str:
    """Write a row of a table: texts guarded, None empty, with a line feed."""
    return ",".join(map(_spell_cell, cells)) + "\n"


def _spell_cell(value: object) -> str:
    if not isinstance(value, str):
        return "" if value is None else str(value)
    text = guard_cell(value)
    # the csv module quotes no carriage return where rows end with a line feed
    quoted = any(mark in text for mark in ',;"\r\n')
    return '"' + text.replace('"', '""') + '"' if quoted else text


MAX_PREAMBLE = 40  # lines above the header
MIN_RUN_COLUMNS = 2
DEVIATION = "deviation"
"""Heading of readings in columns of runs that state no unit."""
_RUN_HEADING = re.compile(
    r"(?:(?:run|lauf)\s*)?(\d+)\s*([^\d\s\[(]+)\s*(\[.*\]|\(.*\))?", re.IGNORECASE
)


def _mark(line: str) -> str:
    bare = re.sub(r'"[^"]*("|$)', "", line)
    headings = _BLANKS.split(line.strip())
    has_blanks = len(headings) > 1 and all(
        heading_unit(name) or name.lower() in ("run", "direction") for name in headings
    )
    return next((mark for mark in MARKS if mark in bare), " " if has_blanks else ",")


def _cells(line: str, mark: str) -> list[str]:
    cells = _BLANKS.split(line.strip()) if mark == " " else line.split(mark)
    return [cell.strip().strip('"') for cell in cells]


def _run(text: str) -> tuple[str, str, str] | None:
    """Return run, direction and unit of a heading such as ``2 ↑ [µm]`` or ``run 2 backward``."""
    match = _RUN_HEADING.fullmatch(text)
    if match is None or match[2].strip().lower() not in DIRECTIONS:
        return None
    return match[1], match[2].strip(), (match[3] or "").strip("[]() ")


class CsvRows:
    """The rows of a table, in bounded memory."""

    def __init__(self, file: TextIO, source: str, max_rows: int, *, unique: bool = False) -> None:
        self.source, self.problems = source, list[str]()
        self._file, self._max_rows, self._unique = file, max_rows, unique
        self._number = self._since_row = self._width = 0
        self._has_run_rows = False
        self._signs: dict[str, str] = {}
        self._repeated: list[str] = []
        self._remarks: list[str] = []
        lines = self._lines()
        first = self._first(lines)
        named = _SEP.fullmatch(first)
        if named:
            self._since_row = 0
            first = self._first(lines)
        first, lines = self._below_preamble(first, lines, named[1] if named else "")
        self.mark = named[1] if named else _mark(first)
        self._rows = self._split(lines)
        self.line, self.header = next(self._rows, (0, list[str]()))
        width = len(self.header)
        while self.header and not self.header[-1]:
            self.header.pop()
        self._trails = width > len(self.header) or self.mark != ","
        self._merge_units()
        self.runs = self._runs_in_columns() or self._runs_in_rows()

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on identical rows, a preamble, and runs in columns."""
        if not self._repeated:
            return tuple(self._remarks)
        count, rows = len(self._repeated), "rows" if len(self._repeated) > 1 else "row"
        repeated = f"{count} {rows} identical to an earlier one, counted once: {self._repeated[0]}"
        return (repeated, *self._remarks)

    def _below_preamble(
        self, first: str, lines: Iterator[str], mark: str
    ) -> tuple[str, Iterator[str]]:
        """Find the first line of headings with units; without one, the first line is the header."""
        number, ahead = self._number, list[tuple[int, str]]()
        candidate = first
        while candidate and len(ahead) < MAX_PREAMBLE:
            if _has_units(_cells(candidate, mark or _mark(candidate))):
                if ahead:
                    self._remarks.append(f"ignored lines {number} … {self._number - 1}: a preamble")
                return candidate, chain([candidate], lines)
            ahead.append((self._number, candidate))
            self._since_row = 0
            candidate = next(lines, "")
        ahead.append((self._number, candidate))
        self._since_row = 0
        return first, chain(self._replay(ahead), lines)

    def _replay(self, ahead: Sequence[tuple[int, str]]) -> Iterator[str]:
        for self._number, line in ahead:
            self._count_row_line()
            yield line

    def _merge_units(self) -> None:
        """Append the units of a row below the header to its headings."""
        if _has_units(self.header) or not self.header:
            return
        row = next(self._rows, None)
        if row is None:
            return
        units = [cell.strip("[]()").translate(UNIT_SPELLING) for cell in row[1]]
        if len(units) == len(self.header) and all(
            unit_factor(unit, unit) for unit in units if unit
        ):
            pairs = zip(self.header, units, strict=True)
            self.header = [f"{name} [{unit}]" if unit else name for name, unit in pairs]
        else:
            self._rows = chain([row], self._rows)

    def _runs_in_columns(self) -> dict[int, tuple[str, ...]]:
        """Return run and direction of each column of readings; such columns become rows."""
        pairs = {index: _run(heading) for index, heading in enumerate(self.header)}
        runs: dict[int, tuple[str, ...]] = {at: run[:2] for at, run in pairs.items() if run}
        units = {run[2] for run in pairs.values() if run}
        if len(runs) < MIN_RUN_COLUMNS or len(units) > 1:
            return {}
        self._remarks.append(f"{len(runs)} runs in columns")
        self._width = len(self.header)
        headings = [name for index, name in enumerate(self.header) if index not in runs]
        unit = units.pop()
        self.header = [*headings, "run", "direction", f"deviation [{unit}]" if unit else DEVIATION]
        return runs

    def _runs_in_rows(self) -> dict[int, tuple[str, ...]]:
        """Return the position of each column of readings where each row is a run."""
        positions = {index: (cell,) for index, cell in enumerate(self.header) if index}
        is_run = positions and all(_is_number(cell) for (cell,) in positions.values())
        if not is_run or not heading_unit(self.header[0]):
            return {}
        self._remarks.append("runs in rows")
        self._width, self._has_run_rows = len(self.header), True
        self.header = [self.header[0], "run", "direction", DEVIATION]
        return positions

    def __iter__(self) -> Iterator[Row]:
        """Return the rows below the header that have as many cells."""
        width = self._width or len(self.header)
        first_lines: dict[tuple[str, ...], int] = {}
        for count, (line, cells) in enumerate(self._rows):
            if count >= self._max_rows:
                problem = f"line {line}: more than {self._max_rows:,} rows below the header"
                raise SceneError(self.source, [f"{problem}; expected at most so many"])
            while self._trails and len(cells) > width and not cells[-1]:
                cells.pop()
            if len(cells) != width:
                commas = self.mark == "," and len(cells) > width
                hint = " (decimal commas? then semicolons or tabs must part the columns)"
                problem = f"{len(cells)} fields; expected {width} as in the header"
                self.note(f"line {line}: {problem}{hint if commas else ''}")
            elif self._unique and first_lines.setdefault(tuple(cells), line) != line:
                self._repeated.append(f"line {line} is line {first_lines[tuple(cells)]} again")
            elif self.runs:
                yield from self._readings_of_row(line, cells)
            else:
                yield line, cells

    def _readings_of_row(self, line: int, cells: Sequence[str]) -> Iterator[Row]:
        before: Sequence[str] = [cell for at, cell in enumerate(cells) if at not in self.runs]
        run = _run(before[0]) if self._has_run_rows else None
        if self._has_run_rows and (run is None or run[2]):
            self.note(f"line {line}: {spell_value(before[0])}; expected a run such as 2 ↑")
            return
        for index, condition in self.runs.items():
            labels = [*condition, *run[:2]] if run else [*before, *condition]
            if cells[index]:
                yield line, [*labels, cells[index]]

    def number(
        self, text: str, line: int, what: str = "", limit: float = math.inf, hint: str = ""
    ) -> float:
        """Read a finite number within ± the limit; note a problem for anything else."""
        place = f"line {line}, {what}" if what else f"line {line}"
        sign = next((mark for mark in ",." if mark in text), "")
        try:
            value = parse_number(text.replace(",", "."))
        except ValueError:
            self.note(f"{place}: {spell_value(text)}; expected a finite number")
            return math.nan
        if sign == "," == self.mark:
            expected = "expected a decimal point (a comma only where semicolons or tabs part)"
            self.note(f"{place}: {spell_value(text)} has a decimal comma; {expected}")
        elif sign and sign not in self._signs:
            self._signs[sign] = f"line {line} has {spell_value(text)}"
            if len(self._signs) > 1:
                self.note(f"{', '.join(self._signs.values())}; expected one decimal sign in a file")
        if abs(value) > limit:
            self.note(f"{place}: {value:g}; expected at most ±{limit:g}{hint}")
        return value

    def note(self, problem: str) -> None:
        if len(self.problems) < _MOST_PROBLEMS:
            self.problems.append(problem)

    def check(self) -> None:
        if self.problems:
            raise SceneError(self.source, self.problems)

    def _lines(self) -> Iterator[str]:
        for line in iter(lambda: self._file.readline(limits.MAX_CSV_LINE + 1), ""):
            self._number += 1
            if len(line) > limits.MAX_CSV_LINE:
                problem = (
                    f"is longer than {limits.MAX_CSV_LINE:,} characters; expected at most so many"
                )
                raise SceneError(self.source, [f"line {self._number} {problem}"])
            if self._number > limits.MAX_CSV_LINES:
                problem = f"has more than {limits.MAX_CSV_LINES:,} lines; expected at most so many"
                raise SceneError(self.source, [problem])
            if not self._since_row and line.lstrip().startswith("#"):
                continue
            self._count_row_line()
            yield line

    def _count_row_line(self) -> None:
        self._since_row += 1
        if self._since_row > _MAX_LINES_OF_ROW:
            raise csv.Error("a quoted text does not end")

    def _first(self, lines: Iterator[str]) -> str:
        for line in lines:
            if line.strip(" \t\r\n,;"):
                return line
            self._since_row = 0
        return ""

    def _split(self, lines: Iterator[str]) -> Iterator[Row]:
        if self.mark == " ":
            lines = (" ".join(re.sub(r"\s+(?=[\[(])", "", line).split()) for line in lines)
        try:
            for row in csv.reader(lines, delimiter=self.mark, strict=True):
                self._since_row = 0
                cells = [cell.strip() for cell in row]
                if len(cells) > limits.MAX_CSV_COLUMNS:
                    problem = f"has {len(cells)} fields; expected at most {limits.MAX_CSV_COLUMNS}"
                    raise SceneError(self.source, [f"line {self._number} {problem}"])
                if any(cells):
                    yield self._number, cells
        except csv.Error as error:
            problem = f"line {self._number}: is not valid CSV: {error}"
            raise SceneError(self.source, [problem]) from None
