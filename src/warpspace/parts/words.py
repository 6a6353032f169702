"""Words of G-code programs: what stands on each line, what is refused, what is not understood."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import NoReturn

from warpspace.exceptions import SceneError
from warpspace.machine.limits import MAX_PROGRAM_BYTES, MAX_PROGRAM_LINE, MAX_PROGRAM_LINES
from warpspace.scene.files import check_file


def _codes(numbers: str) -> frozenset[str]:
    return frozenset(f"G{number}" for number in numbers.split())


_WORD = re.compile(
    r"([A-Z])\s*([+-]?(?:\d+\.?\d*|\.\d+))(?![.\d#\[=])"  # a letter and its number
    r"|\([^()]*\)|;.*"  # comments
    r"|(\S[^\s(;]*)"  # anything else
)
_CONTROL_FLOW = re.compile(r".*[#\[<=]|GOTO|IF|WHILE|FOR|LOOP|REPEAT|CALL")
UNDERSTOOD = _codes(
    "0 1 2 3 4 17 18 19 20 21 28 40 43 43.4 49 53 54 55 56 57 58 59 61 61.1 64 80 81 82 83 90 90.1"
    " 91 91.1 93 94 95 96 97 98 99"
)
REFUSED = {"M96", "M97", "M98", "M99"} | _codes(
    "2.1 2.2 2.3 2.4 3.1 3.2 3.3 3.4 5 5.1 5.2 5.3 6.2 7 10 12 12.1 13 16 30 33 33.1 38.2 38.3 38.4"
    " 38.5 41 41.1 42 42.1 43.1 43.2 43.5 51 51.1 52 54.1 54.2 54.4 59.1 59.2 59.3 65 66 68 68.2"
    " 68.3 72 73 74 76 84 85 86 87 88 89 92"
)
"""Codes that move the path in ways that are not followed: corrections, turns, calls, cycles."""
_LETTERS = frozenset("ABCDFHIJKLNPQRSTUVWXYZ")
MOST_SAID = 1000  # refused and unknown words that are listed
SHOWN = 40  # characters of a word that a message shows


@dataclass(frozen=True, slots=True)
class Refused:
    """A word that no path is followed past."""

    line: int
    word: str


@dataclass(frozen=True, slots=True)
class Remarks:
    """What was found beside the words that are understood."""

    refused: list[Refused] = field(default_factory=list[Refused])
    unknown: dict[str, int] = field(default_factory=dict[str, int])  # word to its first line

    def refuse(self, line: int, word: str) -> None:
        if len(self.refused) < MOST_SAID:
            self.refused.append(Refused(line, word))

    def note(self, line: int, word: str) -> None:
        if len(self.unknown) < MOST_SAID:
            self.unknown.setdefault(word, line)


@dataclass(frozen=True, slots=True)
class Block:
    """The words of one line."""

    program: str  # as messages call it
    line: int  # of the file, from 1
    codes: list[str] = field(default_factory=list[str])  # G and M words, "G43.4"
    numbers: dict[str, float] = field(default_factory=dict[str, float])  # other words, by letter

    def refuse(self, problem: str) -> NoReturn:
        raise SceneError(self.program, [f"line {self.line}: {problem}"])


def program_lines(path: str | Path) -> Iterator[str]:
    """Read the lines of a program one by one; bytes that are no UTF-8 stand in comments."""
    source, path = str(path), Path(path)
    check_file(path, MAX_PROGRAM_BYTES, source)
    try:
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            for line in range(1, MAX_PROGRAM_LINES + 2):
                text = file.readline(MAX_PROGRAM_LINE + 1)
                if not text:
                    return
                if len(text) > MAX_PROGRAM_LINE or line > MAX_PROGRAM_LINES:
                    most = f"{MAX_PROGRAM_LINES:,} lines of {MAX_PROGRAM_LINE:,} characters"
                    raise SceneError(source, [f"line {line}: expected at most {most}"])
                yield text
    except OSError as error:
        raise SceneError(source, [f"cannot be read: {error.strerror or error}"]) from None


@lru_cache(4096)
def _code(letter: str, number: str) -> str:
    return f"{letter}{float(number):g}"


def read_blocks(lines: Iterable[str], program: str, remarks: Remarks) -> Iterator[Block]:
    """Read the blocks up to the first refused word; from there on only list what is refused.

    A line of its own may number the program (O0012) before its first block.
    """
    begun = False
    for line, raw in enumerate(lines, start=1):
        text = raw.strip().upper()
        if text.startswith("%"):
            if begun:
                return
            continue
        if text.startswith("/"):
            remarks.note(line, "/")
            text = text.lstrip("/0123456789")
        block = Block(program, line)
        for letter, number, other in _WORD.findall(text):
            if letter in {"G", "M"}:
                code = _code(letter, number)
                block.codes.append(code)
                if code in REFUSED:
                    remarks.refuse(line, code)
                elif letter == "G" and code not in UNDERSTOOD:
                    remarks.note(line, code)
            elif letter == "O":
                if begun or text.split("(")[0].strip() != letter + number:
                    remarks.refuse(line, letter + number)
            elif letter:
                if letter in block.numbers and not remarks.refused:
                    block.refuse(f"{letter}{number}; expected {letter} once in a line")
                block.numbers[letter] = float(number)
                if letter not in _LETTERS:
                    remarks.note(line, letter + number)
            elif other:
                _take_other(block, other, remarks)
        begun = begun or bool(block.codes or block.numbers)
        if not remarks.refused:
            yield block
        if "M30" in block.codes or "M2" in block.codes:
            return


def _take_other(block: Block, word: str, remarks: Remarks) -> None:
    if _CONTROL_FLOW.match(word):
        remarks.refuse(block.line, word[:SHOWN])
    elif remarks.refused:  # what stands behind is of a language that is not read
        return
    elif word[:2].isalpha() and len(word) > 1:
        remarks.note(block.line, word[:SHOWN])
    else:
        end = "the end of the comment" if word.startswith("(") else "a letter and a number"
        block.refuse(f"{word[:SHOWN]!r}; expected {end}")
