"""Which table of compensation is wanted: format, points, resolution, sign, loop, orientation."""

from dataclasses import dataclass
from typing import Any, cast

from warpspace.app.state.ranges import Span
from warpspace.exceptions import OptionError
from warpspace.formats.compensation.compensate import RESOLUTION, Compensate, read_points
from warpspace.formats.compensation.wanted import LOOPS
from warpspace.formats.registry import SIGNS, find_format, formats
from warpspace.machine.axes import is_linear
from warpspace.machine.description import Machine

LONGEST_POINTS = 100
MOST_POINTS = 101
"""Points per axis that a page may ask for; the command takes as many as the controller."""
RESOLUTIONS = Span(*RESOLUTION, 0.0001)
SUITS = "what suits"
MANUAL = "as the manual says"
SIGN_WORDS = {MANUAL: "", **{sign: sign for sign in SIGNS}}
LOOP_WORDS = {SUITS: "", **{str(loop): str(loop) for loop in LOOPS}}


@dataclass(frozen=True, slots=True)
class CompensationChoice:
    """A table that is wanted, as chosen on a page."""

    format: str = ""
    points: str = ""  # as typed; empty or 0 for what suits the format
    resolution: float = 0.0  # mm; 0 for that of the format
    sign: str = ""  # empty for what the manual says, and what suits the machine
    loop: str = ""
    orientation: bool = False

    def plan(self) -> Compensate:
        """Say what is to be computed."""
        find_format(self.format)
        points = None
        typed = self.points.strip()
        if len(typed) > LONGEST_POINTS:
            raise OptionError(f"points per axis: expected at most {LONGEST_POINTS} characters")
        if typed:
            try:
                points = read_points(typed)
            except ValueError as error:
                raise OptionError(f"{{points}} {typed!r}; {error}") from None
            asked = (points,) if isinstance(points, int) else dict(points).values()
            if max(asked, default=0) > MOST_POINTS:
                raise OptionError(
                    f"points per axis: {max(asked)}; expected at most {MOST_POINTS} here,"
                    " `warpspace compensate` takes as many as the control"
                )
        return Compensate(
            formats=(self.format,),
            points=points,
            resolution=self.resolution,
            sign=cast("Any", self.sign or None),
            loop=cast("Any", self.loop or None),
            orientation=self.orientation,
        )


def format_titles() -> dict[str, str]:
    """Give the names of the formats that can be written, by their titles."""
    return {one.title: one.name for one in formats() if one.can_write}


def is_table(name: str) -> bool:
    """Tell whether a format is a table of corrections, which has a resolution and a sign."""
    return find_format(name).tables is not None


def has_place_for_tilt(name: str, machine: Machine) -> bool:
    """Tell whether a format holds corrections of the rotary axes that a machine has."""
    return find_format(name).orientation and any(not is_linear(axis) for axis in machine.axes)
