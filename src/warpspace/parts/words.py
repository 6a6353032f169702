"""Words of G-code programs: what stands on each line, what is refused, what is not understood."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from warpspace.exceptions import SceneError
from warpspace.formats.source import MAX_LINE, MAX_LINES
from warpspace.machine.limits import MAX_PROGRAM_BYTES
from warpspace.scene.files import check_file


def _codes(numbers: str) -> frozenset[str]:
    return frozenset(f"G{number}" for number in numbers.split())


WORD = re.compile(
    r"([A-Z])\s*([+-]?(?:\d+\.?\d*|\.\d+))(?![.\d#\[=])"  # a letter and its number
    r"|\([^()]*\)|;.*"  # comments
    r"|(\S[^\s(;]*)",  # anything else
    re.IGNORECASE,
)
_CONTROL_FLOW = re.compile(r".*[#\[<=]|GOTO|IF|WHILE|FOR|LOOP|REPEAT|CALL")
UNDERSTOOD = _codes(
    "0 1 2 3 4 9 15 17 18 19 20 21 28 40 43 43.4 49 50 53 54 55 56 57 58 59 61 61.1 64 67 69 80 81"
    " 82 83 90 90.1 91 91.1 93 94 95 96 97 98 99"
)
REFUSED = {"M96", "M97", "M98", "M99"} | _codes(
    "2.1 2.2 2.3 2.4 3.1 3.2 3.3 3.4 5.2 5.3 6.2 7 10 12 12.1 13 16 30 33 33.1 38.2 38.3 38.4 38.5"
    " 41 41.1 42 42.1 43.1 43.2 43.5 51 51.1 52 54.1 54.2 54.4 59.1 59.2 59.3 65 66 68 68.2 68.3 72"
    " 73 74 76 84 85 86 87 88 89 92"
)
"""Codes that move the path in ways that are not followed: corrections, turns, calls, cycles."""
MOST_SAID = 1000  # refused and unknown words that are listed
MOST_DIGITS = 30  # characters of a number
SHOWN = 40  # characters of a word that a message shows


@dataclass(frozen=True, slots=True)
class Refused:
    """A word that no path is followed past."""

    line: int
    word: str


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
    check_file(Path(path), MAX_PROGRAM_BYTES, str(path))
    try:
        with Path(path).open(encoding="utf-8-sig", errors="replace") as file:
            yield from iter(lambda: file.readline(MAX_LINE + 1), "")
    except OSError as error:
        raise SceneError(str(path), [f"cannot be read: {error.strerror or error}"]) from None


@dataclass(frozen=True, slots=True)
class Reader:
    """Takes words apart, up to the first that is refused; from there on only lists what is."""

    program: str  # as messages call it
    refused: list[Refused] = field(default_factory=list[Refused])
    unknown: dict[str, int] = field(default_factory=dict[str, int])  # word to its first line

    def blocks(self, lines: Iterable[str]) -> Iterator[Block]:
        """Read the blocks; a line of its own may number the program (O0012) before the first."""
        begun = False
        for line, raw in enumerate(lines, start=1):
            block, text = Block(self.program, line), raw.strip().upper()
            if line > MAX_LINES or len(raw) > MAX_LINE or len(self.unknown) > MOST_SAID:
                most = f"{MAX_LINES:,} lines of {MAX_LINE:,} characters, {MOST_SAID:,} other words"
                block.refuse(f"is no program in G-code; expected at most {most}")
            if text.startswith("%") and begun:
                return
            if text.startswith("/"):
                self.unknown.setdefault("/", line)
                text = text.lstrip("/0123456789")
            for letter, number, other in WORD.findall(text.lstrip("%")):
                if letter == "O" and not begun and text.split("(")[0].strip() == "O" + number:
                    continue
                if letter:
                    self.take(block, letter, number)
                elif other:
                    self.take_other(block, other)
            if {"G5", "G5.1"} & {*block.codes} and {"X", "Y", "Z"} & block.numbers.keys():
                self.refused.append(Refused(line, "G5"))  # a spline; without a place a look-ahead
            begun = begun or bool(block.codes or block.numbers)
            if not self.refused:
                yield block
            if "M30" in block.codes or "M2" in block.codes or len(self.refused) > MOST_SAID:
                return

    def take(self, block: Block, letter: str, number: str) -> None:
        code = f"{letter}{float(number):g}"
        if letter == "O" or code in REFUSED:
            self.refused.append(Refused(block.line, letter + number if letter == "O" else code))
        elif letter in {"G", "M"}:
            block.codes.append(code)
            if letter == "G" and code not in UNDERSTOOD:
                self.unknown.setdefault(code, block.line)
        elif letter in block.numbers and not self.refused:
            block.refuse(f"{letter}{number}; expected {letter} once in a line")
        elif len(number) > MOST_DIGITS:
            block.refuse(f"{letter}{number[:SHOWN]}…; expected at most {MOST_DIGITS} characters")
        else:
            block.numbers[letter] = float(number)
            if letter in {"E", "L"}:
                self.unknown.setdefault(letter + number, block.line)

    def take_other(self, block: Block, word: str) -> None:
        if _CONTROL_FLOW.match(word):
            self.refused.append(Refused(block.line, word[:SHOWN]))
        elif word[:2].isalpha() and len(word) > 1:
            self.unknown.setdefault(word[:SHOWN], block.line)
        elif not self.refused:  # what stands behind that is of a language that is not read
            end = "the end of the comment" if word.startswith("(") else "a letter and a number"
            block.refuse(f"{word[:SHOWN]!r}; expected {end}")
