"""Settings of a control before a program runs, and the spelling of words."""

import re
from dataclasses import dataclass
from typing import Annotated, Literal, TypeAlias

from warpspace.analysis.options import Grammar, option, read_numbers
from warpspace.machine.limits import MAX_TYPED_NUMBER
from warpspace.scene.model import Scene

DialectName: TypeAlias = Literal[
    "auto", "fanuc", "haas", "sinumerik", "okuma", "linuxcnc", "printer"
]
MAX_TOOL_MM = 1e4  # of lengths, and of offsets
MAX_SHOWN = MAX_TYPED_NUMBER  # characters of a word that a message shows
NUMBER = r"[+-]?(?:[0-9]++\.?[0-9]*+|\.[0-9]++)"


def shorten(word: str) -> str:
    return word if len(word) < MAX_SHOWN else f"{word[: MAX_SHOWN - 1]}…"


def _offsets(text: str, scene: Scene) -> tuple[tuple[str, float], ...]:
    offsets = read_numbers(text, "G54X=position and H1=length", "G54X=10,H1=85.5")
    systems = r"G5[4-9]|G54\.1P\d+|G15H\d+"
    for name, value in offsets.items():
        if abs(value) > MAX_TOOL_MM:
            raise ValueError(f"{name}={value:g}; expected at most ±{MAX_TOOL_MM:g}")
        if not re.fullmatch(rf"({systems})({'|'.join(scene.machine.axes)})|[HD]\d+", name):
            expected = "G54 to G59, G54.1P1 or G15H1 with an axis of the machine, H1 or D1"
            raise ValueError(f"{name}; expected {expected}")
    return tuple(offsets.items())


def spell(letter: str, number: str) -> str:
    """Return the spelling of a word that is compared: codes without leading zeros."""
    is_code = letter in {"G", "M"} and len(number) < MAX_SHOWN
    return f"{letter}{float(number):g}" if is_code else shorten(letter + number)


def _skipped_words(text: str, _scene: Scene) -> tuple[str, ...]:
    names = [part.strip().upper() for part in text.split(",") if part.strip()]
    matches = [(name, re.fullmatch(rf"([A-Z])({NUMBER})", name)) for name in names]
    return tuple(spell(match[1], match[2]) if match else name for name, match in matches)


@dataclass(frozen=True, kw_only=True)
class ControlSettings:
    """Settings of a control before a program runs."""

    tcp: Literal["program", "always", "never"] = option(
        "program", "Tool centre point: switched by G43.4 and G49, or on or off throughout"
    )
    tcp_frame: Literal["auto", "zero", "present"] = option(
        "auto",
        "Frame of the workpiece for G43.4 with a turned table: at rotary zero or at the"
        " present positions; auto: present for fanuc, else zero",
    )
    length_mm: float = option(
        0.0, "Length of the tool beyond the tool point of the scene", unit="mm",
        low=-MAX_TOOL_MM, high=MAX_TOOL_MM,
    )  # fmt: skip
    dialect: DialectName = option(
        "auto", "Dialect of the program, which determines the meaning of words; auto: by its words"
    )
    skip: Annotated[tuple[str, ...], Grammar("WORD,..", _skipped_words, many=True)] = option(
        (), "Words to ignore, each with the rest of its block up to the next G or M code;"
        " or letters", unset="none",
    )  # fmt: skip
    least_increment: float | None = option(
        None, "Value of the last digit of a number without a decimal point, mm or degrees; in"
        " inches a tenth of it", low=1e-5, high=1.0, unset="such numbers are mm or degrees",
    )  # fmt: skip
    offset: Annotated[
        tuple[tuple[str, float], ...], Grammar("G54X=..,H1=..", _offsets, many=True)
    ] = option(
        (), "Positions of axes where words of a work offset are zero, and lengths of tools by H",
        unset="at axes zero; one length for all tools",
    )  # fmt: skip
