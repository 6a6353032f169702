"""LinuxCNC."""

from warpspace.parts.gcode.dialects.dialect import Dialect, read_table

LINUXCNC = Dialect(
    "linuxcnc",
    r"^O\s*(?:\d+|<[^>]+>)\s*(?:SUB|CALL|REPEAT|IF|WHILE)|#<|G91\.1|G64\s*P|M6[2-8](?!\d)|G43\.1",
    read_table("M62 M63 M64 M65 M66 M67 M68: PQEL"),
)
