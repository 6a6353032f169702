"""The text of a file that somebody measured or a controller saved, with the places of its lines."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from warpspace.exceptions import SceneError, UnsaidError
from warpspace.scene.files import check_file

MAX_BYTES = 64 * 1024 * 1024
MAX_LINES = 2_000_000
MAX_LINE = 16_384
"""Characters of one line."""
HEAD_LINES = 60
"""Lines by which a format is recognised."""
SHOWN = 60
"""Characters of a line that a message shows."""
_UTF16_SHARE = 0.3
"""Share of zero bytes at every other place from which bytes without a mark count as UTF-16."""
_LINE_ENDS = re.compile(r"\r\n|\n|\r")


@dataclass(frozen=True)
class Source:
    """A text file in lines.

    Attributes
    ----------
    name : str
        As messages call it.
    lines : tuple of str
        Without their ends.
    notes : tuple of str
        What was assumed about its bytes.
    """

    name: str
    lines: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def head(self) -> str:
        """The first lines, by which a format is recognised."""
        return "\n".join(self.lines[:HEAD_LINES])

    def refuse(self, problem: str, line: int | None = None) -> NoReturn:
        """Refuse the file.

        Parameters
        ----------
        problem : str
            What was found and what was expected.
        line : int, optional
            Number of the line, from 1.

        Raises
        ------
        SceneError
        """
        raise self.problem(problem, line)

    def problem(self, problem: str, line: int | None = None) -> SceneError:
        """Give the exception that refuses the file, see `refuse`."""
        return SceneError(self.name, [_placed(problem, line)])

    def unsaid(self, problem: str, line: int | None = None) -> UnsaidError:
        """Give the exception that asks for what the file does not say, see `refuse`."""
        return UnsaidError(self.name, [_placed(problem, line)])

    def shown(self, line: int) -> str:
        """Give a line as a message shows it; its number counts from 1."""
        return shown(self.lines[line - 1])


def _placed(problem: str, line: int | None) -> str:
    """Put the number of a line before a problem."""
    return problem if line is None else f"line {line}: {problem}"


def shown(text: str) -> str:
    """Spell what a file says in at most a line, without control characters."""
    clean = "".join(letter if letter.isprintable() else " " for letter in text.strip())
    return repr(clean if len(clean) <= SHOWN else clean[: SHOWN - 1] + "…")


def read_source(path: Path) -> Source:
    """Read a file that a user named.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Source

    Raises
    ------
    SceneError
        If it is missing, no regular file, too large or no text.
    """
    name = str(path)
    check_file(path, MAX_BYTES, name)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise SceneError(name, [f"cannot be read: {error.strerror or error}"]) from None
    return source_of_bytes(content, name)


def source_of_bytes(content: bytes, name: str) -> Source:
    """Take the bytes of a file, for instance an upload, as text.

    Parameters
    ----------
    content : bytes
    name : str
        As messages call it.

    Returns
    -------
    Source

    Raises
    ------
    SceneError
        If it is too large, empty or no text.
    """
    if len(content) > MAX_BYTES:
        found = f"is {len(content):,} bytes long; expected at most {MAX_BYTES:,} bytes"
        raise SceneError(name, [found])
    text, notes = _decoded(content, name)
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise SceneError(name, [f"line {line}: holds bytes that are no text; expected a text file"])
    source = source_of_text(text, name, notes)
    if not any(line.strip() for line in source.lines):
        source.refuse("is empty; expected measured data or a table of a controller")
    return source


def source_of_text(text: str, name: str, notes: tuple[str, ...] = ()) -> Source:
    """Split a text into lines, whatever ends them.

    Raises
    ------
    SceneError
        If there are too many lines, or one is too long.
    """
    lines = _LINE_ENDS.split(text)
    if lines and not lines[-1]:
        lines.pop()
    if len(lines) > MAX_LINES:
        raise SceneError(name, [f"has {len(lines):,} lines; expected at most {MAX_LINES:,}"])
    for number, line in enumerate(lines, start=1):
        if len(line) > MAX_LINE:
            found = f"is longer than {MAX_LINE:,} characters; expected at most so many"
            raise SceneError(name, [f"line {number} {found}"])
    return Source(name, tuple(lines), notes)


def _decoded(content: bytes, name: str) -> tuple[str, tuple[str, ...]]:
    """Decode bytes: UTF-8, UTF-16 with or without its mark, else the Windows alphabet."""
    wide = _wide(content)
    if wide:
        try:
            return content.decode(wide), ("read as UTF-16",)
        except UnicodeDecodeError:
            raise SceneError(name, ["is no UTF-16 text though it begins so"]) from None
    try:
        return content.decode("utf-8-sig"), ()
    except UnicodeDecodeError as error:
        try:
            text = content.decode("cp1252")
        except UnicodeDecodeError:
            found = f"is no text in UTF-8, UTF-16 or Windows-1252 (byte {error.start})"
            raise SceneError(name, [f"{found}; expected a text file"]) from None
        return text, ("read as Windows-1252: it is no UTF-8",)


def _wide(content: bytes) -> str:
    """Name the UTF-16 alphabet that bytes are in; empty where they are in none."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    sample = content[:4096]
    half = len(sample) // 2
    if half < 2:
        return ""
    odd, even = sample[1::2].count(0) / half, sample[0::2].count(0) / half
    if odd > _UTF16_SHARE and even < _UTF16_SHARE / 10:
        return "utf-16-le"
    return "utf-16-be" if even > _UTF16_SHARE and odd < _UTF16_SHARE / 10 else ""
