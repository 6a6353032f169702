"""FANUC."""

from warpspace.parts.gcode.dialects.dialect import Dialect

FANUC = Dialect(
    "fanuc",
    r"G0*5\.1\s*Q|G0*8\s*P\d|G54\.1\s*P|G43\.4(?!\d)|G0*5\s*P10000|G68\.2|G53\.1",
)
