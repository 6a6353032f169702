"""Codes that are executed on every control, unless its dialect has another meaning for them."""

from collections.abc import Callable, Mapping
from typing import TypeAlias

from warpspace.parts.gcode.control import MM_PER_INCH, SYSTEMS
from warpspace.parts.gcode.cycles import CYCLES, Cycles

CodeHandler: TypeAlias = Callable[[Cycles, str], None]


def modal(name: str, value: object) -> CodeHandler:
    return lambda control, _code: setattr(control, name, value)


def ignore(_control: Cycles, _code: str) -> None:
    """Leave the state as it is."""


COMPENSATING = ("G43", "G43.4", "G234", "G49")
WITH_H = {*COMPENSATING, "G15", "G56"}
ONCE = {
    **{code: code for code in ("G4", "G10", "G28", "G30", "G52", "G53", "G68", "G92", "G92.1")},
    **{code: code for code in ("G68.2", "G53.1", "G51.1", "G50.1")},
}  # fmt: skip
CODES: Mapping[str, CodeHandler] = {
    **{code: modal("motion", code) for code in ("G0", "G1", "G2", "G3", *CYCLES)},
    "G80": modal("motion", "G0"),
    "G17": modal("across", 2), "G18": modal("across", 1), "G19": modal("across", 0),
    "G20": modal("unit_mm", MM_PER_INCH), "G21": modal("unit_mm", 1.0),
    "G90": modal("absolute", value=True), "G91": modal("absolute", value=False),
    "G93": modal("inverse_time", value=True),
    **dict.fromkeys(("G94", "G95"), modal("inverse_time", value=False)),
    "G98": modal("to_initial", value=True), "G99": modal("to_initial", value=False),
    **dict.fromkeys((*SYSTEMS, "G54.1"), Cycles.select_system),
    **dict.fromkeys(("G43", "G43.4", "G49"), Cycles.compensate),
    **dict.fromkeys(("G41", "G42"), Cycles.compensate_radius),
    **dict.fromkeys(("G52", "G92", "G92.1"), Cycles.shift_by),
    **dict.fromkeys(("G68", "G69"), Cycles.rotate),
    **dict.fromkeys(("G51.1", "G50.1"), Cycles.mirror),
    "G68.2": Cycles.tilt_plane, "G53.1": Cycles.align,
    "G10": Cycles.set_offset,
    **dict.fromkeys(("G4", "G28", "G30", "G53", "M97", "M98", "M99"), ignore),
}  # fmt: skip
"""Effects of the supported codes."""
MOTIONS: Mapping[str, Callable[[Cycles], None]] = {
    **dict.fromkeys(("G0", "G1"), lambda control: control.line_to(control.target())),
    **dict.fromkeys(("G2", "G3"), Cycles.move_along_arc),
    **dict.fromkeys(CYCLES, Cycles.drill),
}
"""Motions of a block by its modal code."""
