"""A dialect of G-code: what it is recognised by, and the words that only it has.

A word is executed (`codes`), known to move no axis (`motionless`, with the letters that belong to
it), or unknown: then the path ends before its block.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from warpspace.parts.gcode.codes import CodeHandler

WHOLE_BLOCK = "*"  # the rest of the block belongs to the word
NO_AXES = "!"  # the word has another meaning in a block with axis words
MODAL_LETTERS = frozenset("NFSTDHO")  # letters that move no axis in any block


@dataclass(frozen=True)
class Dialect:
    """Words of a control that others do not have, or have with another meaning."""

    name: str
    sign: str  # expression for words that only this dialect has
    motionless: Mapping[str, str] = field(default_factory=dict[str, str])
    codes: Mapping[str, CodeHandler | None] = field(  # None: another meaning, not executed
        default_factory=dict[str, CodeHandler | None]
    )
    # codes whose block has another motion, or none, by the motion; "" if not with this dialect
    once: Mapping[str, str] = field(default_factory=dict[str, str])
    comment: str = r"(?!)"  # expression for its comments


def read_table(text: str) -> dict[str, str]:
    """Parse lines of words, a colon, and the letters that belong to each."""
    table: dict[str, str] = {}
    for line in filter(None, map(str.strip, text.splitlines())):
        codes, _, letters = line.partition(":")
        table |= dict.fromkeys(codes.split(), letters.strip())
    return table


COMMON = read_table(
    """
    M0 M1 M2 M30 M60: P
    M3 M4 M5 M13 M14 M19: SPR
    M6 M61: TQ
    M7 M8 M9 M10 M11 M12 M16 M17 M18:
    M29: S
    M31 M33 M34 M35 M36 M39 M40 M41 M42 M43 M44 M45 M48 M49 M50 M51 M52 M53 M54 M55 M56: P
    M57 M58 M59 M78 M79 M80 M81 M83 M84 M85 M86 M88 M89: P
    G9 G61 G61.1 G40 G67 G91.1 G93 G94 G95 G97:
    G96: S
    G64: PQ
    G15 G50: !
    G8: P!
    G5: P!
    G5.1: QR!
    """
)
