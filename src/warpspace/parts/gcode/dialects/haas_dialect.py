"""Haas."""

from warpspace.parts.gcode.cycles import Cycles
from warpspace.parts.gcode.dialects.dialect import Dialect, read_table

HAAS = Dialect(
    "haas",
    r"G187|G154\s*P|G234|G25[45](?!\d)|G150|M97\s*P",
    read_table(
        """
        M21 M22 M23 M24 M25 M26 M27 M28 M82 M104 M105:
        G103: P!
        G187: PE!
        """
    ),
    {
        "G234": Cycles.compensate,
        "G154": Cycles.select_system,
        **dict.fromkeys(("G101", "G100"), Cycles.mirror),
        **dict.fromkeys(("G254", "G255"), Cycles.follow_table),
    },
    once={"G101": "G101", "G100": "G100"},
    comment=r"\(HAAS",
)
