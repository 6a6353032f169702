"""Okuma OSP."""

from warpspace.parts.gcode.cycles import CYCLES, Cycles
from warpspace.parts.gcode.dialects.dialect import Dialect

OKUMA = Dialect(
    "okuma",
    r"^\$[^%\s]+%|G0*15\s*H\d|G116|G0*56\s*H\d",
    {"G116": "T", "M53": "", "M54": ""},
    {
        "G56": Cycles.compensate,
        "G53": Cycles.compensate,
        "G15": Cycles.select_system,
        **dict.fromkeys(("G54", "G55", "G57", "G58", "G59", "G28", "G43", *CYCLES)),
    },
    once={"G53": ""},
)
