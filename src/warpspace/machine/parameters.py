"""The one table of error parameters.

Keys are ISO 230-1 names in ASCII: ``E`` + direction + axis for a component error that varies along
the axis (``EAX``: rotation about x of the X axis), ``E`` + direction + ``0`` + axis for a constant
(``EC0Y``: the squareness of Y to X). Directions X Y Z are translations, A B C rotations about them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType

from warpspace.exceptions import UnknownNameError
from warpspace.units import MICROMETRE, MICRORADIAN

LINEAR_AXES = "XYZ"
ROTARY_AXES = "ABC"
AXES = LINEAR_AXES + ROTARY_AXES

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
_LINEAR_ROTATIONS = {  # roll about the motion, pitch about the horizontal normal, yaw the rest
    "AX": "roll",
    "BX": "pitch",
    "CX": "yaw",
    "AY": "pitch",
    "BY": "roll",
    "CY": "yaw",
    "AZ": "pitch",
    "BZ": "yaw",
    "CZ": "roll",
}


class ErrorKind(StrEnum):
    """What an error parameter describes, in the words of ISO 230-1."""

    TRANSLATION = "component translation"
    ROTATION = "component rotation"
    SQUARENESS = "squareness"
    ORIENTATION = "orientation error"
    LOCATION = "location error"


@dataclass(frozen=True, slots=True)
class Parameter:
    """One error parameter.

    Attributes
    ----------
    key : str
        ISO 230-1 name in ASCII.
    symbol : str
        The thesis's symbol, or one formed like it for axes the thesis does not have.
    name : str
        Plain name, for instance "roll of X".
    axis : str
        The axis it belongs to, one of X Y Z A B C.
    kind : ErrorKind
        What it describes.
    source : str
        Where it is defined.
    """

    key: str
    symbol: str
    name: str
    axis: str
    kind: ErrorKind
    source: str

    @property
    def letter(self) -> str:
        """Direction letter: X Y Z for translations, A B C for rotations about them."""
        return self.key[1]

    @property
    def direction(self) -> int:
        """Index 0, 1 or 2 of the frame axis along or about which the error acts."""
        return AXES.index(self.letter) % 3

    @property
    def is_rotation(self) -> bool:
        """Whether it is an angle."""
        return self.letter in ROTARY_AXES

    @property
    def is_constant(self) -> bool:
        """Whether it is a property of the assembly that does not vary along the axis."""
        return self.key[2] == "0"

    @property
    def unit(self) -> str:
        """Unit of its values: µm or µrad."""
        return MICRORADIAN if self.is_rotation else MICROMETRE

    @property
    def tolerance_class(self) -> str:
        """The default tolerance it takes: translation, rotation or squareness.

        The thesis (table 4-6) gives the orientation errors of rotary axes the tolerance of a
        squareness.
        """
        if not self.is_rotation:
            return "translation"
        return "squareness" if self.is_constant else "rotation"

    @property
    def label(self) -> str:
        """Label for a control: key, symbol, plain name and unit."""
        return f"{self.key} · {self.symbol} · {self.name} [{self.unit}]"


def _component(letter: str, axis: str) -> Parameter:
    """Build the row of one component error."""
    rotation = letter in ROTARY_AXES
    along = AXES.index(letter) % 3 == AXES.index(axis) % 3
    low = "xyz"[AXES.index(letter) % 3]
    if axis in LINEAR_AXES:
        if rotation:
            name = f"{_LINEAR_ROTATIONS[letter + axis]} of {axis}"
        else:
            name = f"positioning of {axis}" if along else f"straightness of {axis} in {low}"
    elif rotation:
        name = f"angular positioning of {axis}" if along else f"tilt of {axis} about {low}"
    else:
        name = f"axial error of {axis}" if along else f"radial error of {axis} in {low}"
    source = "ISO 230-1; thesis table 4-2" if axis != "A" else "ISO 230-1, 3.4 (not in the thesis)"
    kind = ErrorKind.ROTATION if rotation else ErrorKind.TRANSLATION
    return Parameter(f"E{letter}{axis}", f"{_GREEK[letter]}{axis}", name, axis, kind, source)


def _constant(letter: str, axis: str) -> Parameter:
    """Build the row of one constant error of an axis."""
    key = f"E{letter}0{axis}"
    low = "xyz"[AXES.index(letter) % 3]
    if letter in LINEAR_AXES:
        kind = ErrorKind.LOCATION
        name = f"location of {axis} in {low}"
    elif axis in ROTARY_AXES:
        kind = ErrorKind.ORIENTATION
        name = f"orientation of {axis} about {low}"
    else:
        kind = ErrorKind.SQUARENESS
        about, own = AXES.index(letter) % 3, AXES.index(axis) % 3
        if about == own:
            name = f"rotation of {axis} about itself"
        else:
            name = f"squareness of {axis} to {LINEAR_AXES[3 - about - own]}"
    symbol = _THESIS_CONSTANTS.get(key, f"{_CONSTANT_GREEK[letter]}_0{axis}")
    if kind is ErrorKind.LOCATION and key in _THESIS_CONSTANTS:
        source = "ISO 230-1; thesis equations (left out of its table 4-2)"
    elif key in _THESIS_CONSTANTS:
        source = "ISO 230-1; thesis table 4-2"
    else:
        source = "ISO 230-1, 3.5 (not in the thesis)"
    return Parameter(key, symbol, name, axis, kind, source)


def _build_table() -> dict[str, Parameter]:
    """Build all rows there can be: six component and six constant errors of six axes."""
    rows = [
        build(letter, axis) for axis in AXES for build in (_component, _constant) for letter in AXES
    ]
    return {row.key: row for row in rows}


PARAMETERS = MappingProxyType(_build_table())
"""Key to parameter, for every axis a machine may have. The only list of parameters there is."""


def parameter(key: str) -> Parameter:
    """Look up one parameter.

    Parameters
    ----------
    key : str
        ISO 230-1 name in ASCII.

    Returns
    -------
    Parameter

    Raises
    ------
    UnknownNameError
        If there is no such parameter; the message names the near misses.
    """
    try:
        return PARAMETERS[key]
    except KeyError:
        raise UnknownNameError("error parameter", key, PARAMETERS) from None


def default_keys(axes: Sequence[str]) -> tuple[str, ...]:
    """List the parameters that a machine with these axes has by default.

    Six component errors per axis; per rotary axis two orientation and two location errors; per
    linear axis the squareness not absorbed by the reference axis and the reference plane.

    Parameters
    ----------
    axes : sequence of str
        Axis letters, in any order.

    Returns
    -------
    tuple of str
        Keys: per axis its component errors, then its constants; linear axes first.

    Notes
    -----
    The reference axis is the first of X, Y, Z that the machine has, the reference plane that of the
    first two: the first linear axis has no squareness, the second one, the third two.
    """
    keys: list[str] = []
    linear = [axis for axis in LINEAR_AXES if axis in axes]
    for axis in (axis for axis in AXES if axis in axes):
        keys += [f"E{letter}{axis}" for letter in AXES]
        own = AXES.index(axis) % 3
        if axis in ROTARY_AXES:
            letters = [letter for letter in "ABCXYZ" if AXES.index(letter) % 3 != own]
        else:
            before = linear[: linear.index(axis)]
            letters = [letter for letter in "ABC" if _turns_into(letter, own, before)]
        keys += [f"E{letter}0{axis}" for letter in letters]
    return tuple(keys)


def _turns_into(letter: str, own: int, before: Sequence[str]) -> bool:
    """Tell whether turning direction `own` about `letter` changes its angle to an earlier axis."""
    about = AXES.index(letter) % 3
    return any({about, own, LINEAR_AXES.index(axis)} == {0, 1, 2} for axis in before)
