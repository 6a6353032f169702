"""Names of axes, and the table of all error parameters.

An axis is a letter and, where there is more than one, a digit: X Y Z and U V W translate along x,
y, z; A B C rotate about them (ISO 841); ``C2`` is a second axis about z.

Keys of parameters are ISO 230-1 names in ASCII: ``E`` + direction + axis for a component error that
varies along the axis (``EAX``: rotation about x of the X axis), ``E`` + direction + ``0`` + axis
for a constant (``EC0Y``: the squareness of Y to X). Directions X Y Z are translations, A B C
rotations about them.
"""

from collections.abc import Iterable
from enum import StrEnum
from functools import cache
from typing import NamedTuple

from warpspace.exceptions import UnknownNameError
from warpspace.units import MICROMETRE, MICRORADIAN

DIRECTIONS = "XYZABC"  # letters of the six errors of a rigid body: along x, y, z and about x, y, z
LINEAR_LETTERS = "XYZUVW"
ROTARY_LETTERS = "ABC"
AXIS_LETTERS = LINEAR_LETTERS + ROTARY_LETTERS
MAX_AXES = 8  # of a chain
AXIS_NAMES = tuple(letter + digit for letter in AXIS_LETTERS for digit in ("", *"0123456789"))
"""All names of axes, in the order of lists."""

_ORDER = {name: number for number, name in enumerate(AXIS_NAMES)}
_WITHIN = {letter: number % 3 for number, letter in enumerate(AXIS_LETTERS)}


def is_axis_name(name: str) -> bool:
    return name in _ORDER


def is_linear(name: str) -> bool:
    """Check whether an axis translates; a rotary one rotates."""
    return name[0] in LINEAR_LETTERS


def is_rotary(name: str) -> bool:
    return not is_linear(name)


def direction_index(name: str) -> int:
    """Return the index 0, 1 or 2 of the direction along or about which an axis moves."""
    return _WITHIN[name[0]]


def sort_axes(names: Iterable[str]) -> tuple[str, ...]:
    """Sort axes: X Y Z U V W A B C, then by their digit."""
    axes = list(names)
    for name in axes:
        if name not in _ORDER:
            raise UnknownNameError("axis", name, AXIS_NAMES)
    return tuple(sorted(axes, key=_ORDER.__getitem__))


def axis_order(name: str) -> int:
    """Return the rank of an axis in the order of `sort_axes`."""
    return _ORDER[name]


class TravelDirection(StrEnum):
    """Direction of travel in the evaluation of errors that depend on it.

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


_GREEK = {"X": "δ_x", "Y": "δ_y", "Z": "δ_z", "A": "ε_x", "B": "ε_y", "C": "ε_z"}
_CONSTANT_GREEK = {"X": "δx", "Y": "δy", "Z": "δz", "A": "α", "B": "β", "C": "γ"}
# Thesis symbols of the constants of the reference machine (table 4-2 and eqs. 4-18, 4-25).
_THESIS_CONSTANTS = {
    "EC0Y": "γ_XY",
    "EA0Z": "α_YZ",
    "EB0Z": "β_XZ",
    "EA0B": "α_ZB",
    "EC0B": "γ_XB",
    "EX0B": "δx_YB",
    "EZ0B": "δz_YB",
    "EA0C": "α_YC",
    "EB0C": "β_XC",
    "EX0C": "δx_ZC",
    "EY0C": "δy_ZC",
}


class ErrorKind(StrEnum):
    """Kind of an error parameter, in the terms of ISO 230-1."""

    TRANSLATION = "component translation"
    ROTATION = "component rotation"
    SQUARENESS = "squareness"
    ORIENTATION = "orientation error"
    LOCATION = "location error"


class Parameter(NamedTuple):
    """One error parameter."""

    key: str  # ISO 230-1 name in ASCII
    symbol: str  # that of the thesis, or one formed alike for other axes
    name: str  # plain name, for instance "roll of X"
    axis: str  # name of its axis
    kind: ErrorKind
    source: str  # of its definition

    @property
    def letter(self) -> str:
        """Direction letter: X Y Z for translations, A B C for rotations about them."""
        return self.key[1]

    @property
    def direction(self) -> int:
        """Index 0, 1 or 2 of the frame axis along or about which the error acts."""
        return direction_index(self.letter)

    @property
    def is_rotation(self) -> bool:
        """True for an angle."""
        return self.letter in ROTARY_LETTERS

    @property
    def is_constant(self) -> bool:
        """True for a property of the assembly, constant along the axis."""
        return self.key[2] == "0"

    @property
    def unit(self) -> str:
        return MICRORADIAN if self.is_rotation else MICROMETRE

    @property
    def tolerance_class(self) -> str:
        """Class of its default tolerance: translation, rotation or squareness.

        In the thesis (table 4-6) the orientation errors of rotary axes have the tolerance of a
        squareness.
        """
        if not self.is_rotation:
            return "translation"
        return "squareness" if self.is_constant else "rotation"

    @property
    def cause(self) -> str:
        """The error as a reason, to follow "because": ``Z is not square to Y``."""
        what, _, axis = self.name.partition(" of ")
        if self.kind is ErrorKind.SQUARENESS and " to " in axis:
            return axis.replace(" to ", " is not square to ")
        if what == "straightness":
            return axis.replace(" in ", " is not straight in ")
        return f"{axis} {_TURN_VERBS[what]}" if what in _TURN_VERBS else f"of the {self.name}"

    @property
    def label(self) -> str:
        """Label for a control: key, symbol, plain name and unit."""
        return f"{self.key} · {self.symbol} · {self.name} [{self.unit}]"


_TURN_VERBS = {"roll": "rolls", "pitch": "pitches", "yaw": "yaws"}
# By kind and whether the axis is linear: names of an error along or about its axis, and across it.
_NAMES = {
    (ErrorKind.TRANSLATION, True): ("positioning of {axis}", "straightness of {axis} in {low}"),
    (ErrorKind.TRANSLATION, False): ("axial error of {axis}", "radial error of {axis} in {low}"),
    (ErrorKind.ROTATION, True): ("{turn} of {axis}", "{turn} of {axis}"),
    (ErrorKind.ROTATION, False): ("angular positioning of {axis}", "tilt of {axis} about {low}"),
    (ErrorKind.SQUARENESS, True): (
        "rotation of {axis} about itself",
        "squareness of {axis} to {third}",
    ),
    (ErrorKind.ORIENTATION, False): ("orientation of {axis} about {low}",) * 2,
}
# Of axes along x, y, z, about x, y, z: roll about the motion, pitch about the horizontal normal.
_LINEAR_ROTATIONS = (("roll", "pitch", "yaw"), ("pitch", "roll", "yaw"), ("pitch", "yaw", "roll"))


def _parameter(letter: str, axis: str, *, constant: bool) -> Parameter:
    key = f"E{letter}{'0' * constant}{axis}"
    about, along = direction_index(letter), direction_index(axis)
    kinds = (ErrorKind.TRANSLATION, ErrorKind.ROTATION)
    if constant:
        angle = ErrorKind.SQUARENESS if is_linear(axis) else ErrorKind.ORIENTATION
        kinds = (ErrorKind.LOCATION, angle)
    kind = kinds[letter in ROTARY_LETTERS]
    names = _NAMES.get((kind, is_linear(axis)), ("location of {axis} in {low}",) * 2)
    turn, third = _LINEAR_ROTATIONS[along][about], "XYZ"[(3 - about - along) % 3]
    name = names[about != along].format(axis=axis, low="xyz"[about], turn=turn, third=third)
    symbol = f"{_CONSTANT_GREEK[letter]}_0{axis}" if constant else f"{_GREEK[letter]}{axis}"
    if key not in _THESIS_CONSTANTS if constant else axis not in "XYZBC":
        source = f"ISO 230-1, 3.{5 if constant else 4} (not in the thesis)"
    elif kind is ErrorKind.LOCATION:
        source = "ISO 230-1; thesis equations (left out of its table 4-2)"
    else:
        source = "ISO 230-1; thesis table 4-2"
    return Parameter(key, _THESIS_CONSTANTS.get(key, symbol), name, axis, kind, source)


@cache
def axis_parameters(axis: str) -> tuple[Parameter, ...]:
    return tuple(
        _parameter(letter, axis, constant=constant)
        for constant in (False, True)
        for letter in DIRECTIONS
    )


PARAMETERS = {row.key: row for axis in AXIS_NAMES for row in axis_parameters(axis)}
"""Table of all parameters by key, for every axis that a machine may have."""


def parameter(key: str) -> Parameter:
    if key not in PARAMETERS:
        classic = [row.key for axis in "XYZABC" for row in axis_parameters(axis)]
        raise UnknownNameError("error parameter", key, classic)
    return PARAMETERS[key]
