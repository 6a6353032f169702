"""Names of axes: a letter of X Y Z U V W A B C and, where there is more than one, a digit.

X Y Z and U V W translate along x, y, z; A B C turn about them (ISO 841). ``C2`` is a second
axis that turns about z.
"""

import re
from collections.abc import Iterable
from enum import StrEnum

from warpspace.exceptions import UnknownNameError

DIRECTIONS = "XYZABC"
"""Letters of the six errors of a rigid body: along x, y, z and about x, y, z."""
LINEAR_LETTERS = "XYZUVW"
ROTARY_LETTERS = "ABC"
AXIS_LETTERS = LINEAR_LETTERS + ROTARY_LETTERS
MAX_AXES = 8
"""Of a chain."""
AXIS_NAMES = tuple(letter + digit for letter in AXIS_LETTERS for digit in ("", *"0123456789"))
"""Every name that an axis can have, in the order that axes are listed in."""

_NAME = re.compile(rf"[{AXIS_LETTERS}][0-9]?")
_ORDER = {name: number for number, name in enumerate(AXIS_NAMES)}
_WITHIN = {letter: number % 3 for number, letter in enumerate(AXIS_LETTERS)}


def is_axis_name(name: str) -> bool:
    """Tell whether a text is the name of an axis."""
    return _NAME.fullmatch(name) is not None


def is_linear(name: str) -> bool:
    """Tell whether an axis translates; if not, it turns."""
    return name[0] in LINEAR_LETTERS


def is_rotary(name: str) -> bool:
    """Tell whether an axis turns."""
    return not is_linear(name)


def direction_index(name: str) -> int:
    """Give the index 0, 1 or 2 of the direction along or about which an axis moves."""
    return _WITHIN[name[0]]


def sort_axes(names: Iterable[str]) -> tuple[str, ...]:
    """Sort axes: X Y Z U V W A B C, then by their digit."""
    found = list(names)
    for name in found:
        if name not in _ORDER:
            raise UnknownNameError("axis", name, AXIS_NAMES)
    return tuple(sorted(found, key=_ORDER.__getitem__))


def axis_order(name: str) -> int:
    """Give the place of an axis in the order of `sort_axes`."""
    return _ORDER[name]


# --- Direction of travel --------------------------------------------------------------------------


class TravelDirection(StrEnum):
    """What counts of errors that depend on the direction of travel.

    Forward is towards growing positions of the axis, as commanded. Errors that do not depend on the
    direction are the same in the first three and zero in the difference.
    """

    MEAN = "mean"
    FORWARD = "forward"
    BACKWARD = "backward"
    DIFFERENCE = "difference"


DIRECTION_WORDS = {
    TravelDirection.MEAN: "mean of both directions of travel",
    TravelDirection.FORWARD: "travelling forward",
    TravelDirection.BACKWARD: "travelling backward",
    TravelDirection.DIFFERENCE: "reversal: forward − backward",
}
"""How each is called on figures and pages."""
