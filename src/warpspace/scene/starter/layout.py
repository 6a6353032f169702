"""Sizes of a machine that is only a chain so far: where its frames stand, how far axes move."""

from collections.abc import Mapping
from dataclasses import dataclass

from warpspace.machine.axes import direction_index, is_linear
from warpspace.machine.description import ORIGIN, Chain, Range, Vector

TRAVEL: Mapping[int, Range] = {0: (-300.0, 300.0), 1: (-250.0, 250.0), 2: (-400.0, 0.0)}
"""Of the first linear axis along x, y and z, mm: the tool touches the table at the end of z."""
SECOND_TRAVEL = (-100.0, 100.0)
"""Of a further linear axis along a direction, mm."""
TILT_TRAVEL, TURN_TRAVEL, ARM_TRAVEL = (-90.0, 90.0), (0.0, 360.0), (-150.0, 150.0)
"""Of A and B, of C, and of arms that turn about z one behind the other, degrees."""
ARM_RANGES = ((-60.0, 60.0), (20.0, 140.0))
"""Where such arms reach the working volume, degrees."""
ARMS_AT = ((-350.0, -200.0), (-50.0, -200.0))
ARM_END = (200.0, -200.0)
"""In a plan view with all arms at zero, mm."""
TOOL_LENGTH, PIVOT, TURNING_HEAD = 150.0, 250.0, 400.0
"""From the tool point up to the spindle nose, to a tilting and to a turning head, mm."""
ABOVE_TABLE = 100.0
"""Height of the tool point where no axis moves along z, mm."""
TILTS_AT = 50.0
"""Height of a tilting axis above the table, mm."""
WORKPIECE_HEIGHT, WORKPIECE_SHARE = 200.0, 0.8


@dataclass(frozen=True, slots=True)
class Layout:
    """Sizes of a machine, all frames at zero of their axes.

    Attributes
    ----------
    offset_mm : mapping of str to tuple of float, (3,), mm
        Origin of each frame in the frame before it; R stands in the middle of the table.
    travel : mapping of str to tuple of float, (2,), mm or degrees
    direction : mapping of str to int
        −1 for linear axes that carry the workpiece: the tool then moves with the name over it.
    workspace : mapping of str to tuple of float, (2,), mm or degrees
        Ranges of the axes that span the volume, and the positions of the others.
    workpiece_mm : tuple of float, (3,), mm
        A point of the top rim of the largest workpiece.
    """

    offset_mm: Mapping[str, Vector]
    travel: Mapping[str, Range]
    direction: Mapping[str, int]
    workspace: Mapping[str, Range]
    workpiece_mm: Vector


def layout(chain: Chain) -> Layout:
    """Choose sizes for a chain.

    Parameters
    ----------
    chain : Chain

    Returns
    -------
    Layout
        Tool and table meet: with the linear axes in the middle of their ranges the tool point is
        above the middle of the table, at the lower end of z it touches it.
    """
    spanning = _spanning(chain)
    arms = _arms(chain)
    travel = {axis: _travel(axis, axis in spanning, axis in arms) for axis in chain.axes}
    ranges = {axis: travel[axis] if axis in spanning else (0.0, 0.0) for axis in chain.axes}
    ranges |= dict(zip(arms, ARM_RANGES, strict=False))
    half = [min(map(abs, travel[axis])) for axis in spanning if direction_index(axis) != 2]
    radius = WORKPIECE_SHARE * min(half, default=TRAVEL[1][1])
    return Layout(
        {**_tool_offsets(chain, arms), **_workpiece_offsets(chain)},
        travel,
        {axis: -1 for axis in chain.workpiece if is_linear(axis)},
        ranges,
        (0.0, radius, WORKPIECE_HEIGHT),
    )


def _spanning(chain: Chain) -> tuple[str, ...]:
    """List the first linear axis along each direction."""
    found: dict[int, str] = {}
    for axis in chain.axes:
        if is_linear(axis):
            found.setdefault(direction_index(axis), axis)
    return tuple(found.values())


def _arms(chain: Chain) -> tuple[str, ...]:
    """List the axes about z that carry the tool over a plane where no linear axis does."""
    if any(direction_index(axis) != 2 for axis in _spanning(chain)):
        return ()
    turning = [axis for axis in chain.tool if not is_linear(axis) and direction_index(axis) == 2]
    return tuple(turning[: len(ARM_RANGES)])


def _travel(axis: str, spans: bool, is_arm: bool) -> Range:
    """Choose the travel of an axis, mm or degrees."""
    if is_linear(axis):
        return TRAVEL[direction_index(axis)] if spans else SECOND_TRAVEL
    if is_arm:
        return ARM_TRAVEL
    return TURN_TRAVEL if direction_index(axis) == 2 else TILT_TRAVEL


def _tool_offsets(chain: Chain, arms: tuple[str, ...]) -> dict[str, Vector]:
    """Place the frames of the tool branch, each in the one before it, mm."""
    has_z = any(direction_index(axis) == 2 for axis in _spanning(chain))
    tip = -TRAVEL[2][0] if has_z else ABOVE_TABLE
    linear = [axis for axis in chain.tool if is_linear(axis)]
    over = ARM_END if len(arms) == len(ARMS_AT) else ARMS_AT[1] if arms else (0.0, 0.0)
    places: dict[str, Vector] = {}
    for axis in chain.tool:
        if axis in arms:
            x, y = ARMS_AT[arms.index(axis)]
            places[axis] = (x, y, tip + TURNING_HEAD)
        elif is_linear(axis):
            # guides stand behind the tool, each nearer to it than the one that carries it
            nearer = (linear.index(axis) + 1) / (len(linear) + 1)
            y = over[1] if arms else round(600.0 * (1.0 - nearer), -1)
            places[axis] = (over[0], y, tip + 250.0 + round(200.0 * nearer, -1))
        else:
            up = TURNING_HEAD if direction_index(axis) == 2 else PIVOT
            places[axis] = (*over, tip + up)
    places |= {"S": (*over, tip + TOOL_LENGTH), "t": (*over, tip)}
    return _steps(places)


def _workpiece_offsets(chain: Chain) -> dict[str, Vector]:
    """Place the frames of the workpiece branch, each in the one before it, mm."""
    places: dict[str, Vector] = {}
    for axis in chain.workpiece:
        if is_linear(axis):
            places[axis] = (0.0, 0.0, -400.0 + 100.0 * len(places))
        else:
            places[axis] = (0.0, 0.0, 0.0 if direction_index(axis) == 2 else TILTS_AT)
    return _steps({**places, "w": ORIGIN})


def _steps(places: Mapping[str, Vector]) -> dict[str, Vector]:
    """Turn places in R, along a branch, into the offset of each frame in the one before it."""
    before: Vector = ORIGIN
    found: dict[str, Vector] = {}
    for frame, (x, y, z) in places.items():
        found[frame] = (x - before[0], y - before[1], z - before[2])
        before = (x, y, z)
    return found
