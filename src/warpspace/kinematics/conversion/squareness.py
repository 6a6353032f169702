"""The sign of squareness: by the right-hand rule, or by the angle between two axes."""

from enum import StrEnum

from warpspace.machine.axes import direction_index, is_linear
from warpspace.machine.description import Machine
from warpspace.machine.errors import ErrorSet
from warpspace.machine.parameters import parameter


class SquarenessSign(StrEnum):
    """What a positive squareness means."""

    RIGHT_HAND = "right_hand"
    OVER_90 = "over_90"
    UNDER_90 = "under_90"


def angle_sign(key: str) -> int:
    """Tell what a positive squareness by the right-hand rule does to the angle between the axes.

    Parameters
    ----------
    key : str
        A constant rotation of a linear axis, not about itself.

    Returns
    -------
    int
        +1 where the angle between the positive directions of both axes becomes larger than 90°
        (EC0Y: Y turns away from X), −1 where it becomes smaller (EB0Z: Z turns towards X).

    Notes
    -----
    The axis along eᵢ turned about eₖ moves by eₖ × eᵢ, which is +eⱼ where k, i, j follow each other
    like x, y, z: towards the other axis.
    """
    row = parameter(key)
    own, about = direction_index(row.axis), row.direction
    return -1 if (own - about) % 3 == 1 else 1


def squareness_keys(machine: Machine) -> tuple[str, ...]:
    """List the constants of a machine that are angles between two of its linear axes."""
    directions = {direction_index(axis) for axis in machine.axes if is_linear(axis)}
    found: list[str] = []
    for axis in machine.axes:
        own = direction_index(axis)
        for letter in "ABC":
            other = 3 - own - direction_index(letter)
            if is_linear(axis) and direction_index(letter) != own and other in directions:
                found.append(f"E{letter}0{axis}")
    return tuple(found)


def convert_squareness(machine: Machine, errors: ErrorSet, sign: SquarenessSign | str) -> ErrorSet:
    """Write squareness errors with another sign, or read them; both are the same step.

    Parameters
    ----------
    machine : Machine
    errors : ErrorSet
        By the right-hand rule, or with the sign.
    sign : SquarenessSign or str

    Returns
    -------
    ErrorSet
        With the sign, or by the right-hand rule. A sign changes nothing but the numbers written.
    """
    sign = SquarenessSign(sign)
    if sign is SquarenessSign.RIGHT_HAND:
        return errors
    turned = 1 if sign is SquarenessSign.OVER_90 else -1
    functions = dict(errors.functions)
    for key in squareness_keys(machine):
        if key in functions and angle_sign(key) != turned:
            functions[key] = functions[key].scaled(-1.0)
    return ErrorSet(functions)
