"""The dialects, and their recognition."""

import re
from collections.abc import Sequence

from warpspace.parts.gcode.dialects.fanuc_dialect import FANUC
from warpspace.parts.gcode.dialects.haas_dialect import HAAS
from warpspace.parts.gcode.dialects.linuxcnc_dialect import LINUXCNC
from warpspace.parts.gcode.dialects.okuma_dialect import OKUMA
from warpspace.parts.gcode.dialects.printer_dialect import PRINTER
from warpspace.parts.gcode.dialects.sinumerik_dialect import SINUMERIK

DIALECTS = {dialect.name: dialect for dialect in (FANUC, HAAS, SINUMERIK, OKUMA, LINUXCNC, PRINTER)}
_SIGN, _COMMENT_SIGN = (
    re.compile("|".join(f"(?P<{name}>{sign})" for name, sign in signs), re.IGNORECASE)
    for signs in (
        [(dialect.name, dialect.sign) for dialect in DIALECTS.values()],
        [(dialect.name, dialect.comment) for dialect in DIALECTS.values()],
    )
)
_EXTRUSION = re.compile(r"G0*(?:[0-3]|92)(?!\d)[^;(]*E-?\.?\d|M20[1-5][^;(]*E\d", re.IGNORECASE)
_COMMENT = re.compile(r"\([^()]*+\)?+|;.*+")
_PLAIN = re.compile(  # without a sign; faster
    r"(?:N\d++\s*+)?+(?:G0?[0-3]\s*+)?+(?:[XYZABCEFIJKS]\s*+[+-]?[\d.]++\s*+)*+", re.IGNORECASE
)
KLARTEXT = re.compile(r"\s*+(?:\d+\s+)?BEGIN\s+PGM\b", re.IGNORECASE)


def detect_dialects(lines: Sequence[str]) -> dict[str, tuple[int, str]]:
    """Find the dialects whose signs a program contains: first line and sign of each."""
    signs: dict[str, tuple[int, str]] = {}
    for line, text in enumerate(lines, start=1):
        stripped = text.strip()
        if _PLAIN.fullmatch(stripped):
            continue
        for pattern, part in ((_COMMENT_SIGN, stripped), (_SIGN, _COMMENT.sub(" ", stripped))):
            for match in pattern.finditer(part):
                signs.setdefault(match.lastgroup or "", (line, match[0].strip()))
    # codes of printers occur on mills, extrusion does not
    if "printer" in signs and not any(map(_EXTRUSION.search, lines)):
        del signs["printer"]
    return signs
