"""Numbers of a machine and of its working volume: clamped to their limits, refused if none."""

import math
from collections.abc import Sequence
from dataclasses import replace

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.field.grid import Workspace
from warpspace.machine.description import FIXED_FRAMES, ORIGIN, Axis, Machine
from warpspace.machine.limits import FULL_TURN_DEG, MAX_LENGTH_MM, MIN_NUMBER, MIN_SPAN
from warpspace.scene.editing.edited import Edited, checked
from warpspace.scene.model import Scene

ENDS = ("lower", "upper")
DIRECTIONS = "xyz"


def change_offset(scene: Scene, frame: str, index: int, value: float) -> Edited:
    """Set one coordinate of the origin of a frame in the frame before it.

    Parameters
    ----------
    scene : Scene
    frame : str
        An axis, S, t or w.
    index : int
        0, 1 or 2 for x, y or z.
    value : float, mm
        Clamped to what a file may hold.

    Raises
    ------
    UnknownNameError, OptionError
        If there is no such frame or direction, or the value is no number.
    """
    what = f"offset of {frame} along {_direction(index)}"
    kept, notes = _clamped(what, value, MAX_LENGTH_MM, "mm")
    machine = scene.machine
    if _is_axis(machine, frame):
        axis = machine.axes[frame]
        moved = _with_entry(axis.offset_mm, index, kept)
        return _with_axis(scene, replace(axis, offset_mm=moved), notes)
    offset = _with_entry(machine.fixed_mm.get(frame, ORIGIN), index, kept)
    return _with_machine(
        scene, replace(machine, fixed_mm={**machine.fixed_mm, frame: offset}), notes
    )


def change_rotation(scene: Scene, frame: str, index: int, value: float) -> Edited:
    """Set one angle of the fixed rotation of a frame against the frame before it.

    Parameters
    ----------
    scene : Scene
    frame : str
        An axis, S, t or w.
    index : int
        0, 1 or 2 for the angle about the fixed x, y or z axis.
    value : float, degrees
        Clamped to a full turn either way.

    Raises
    ------
    UnknownNameError, OptionError
        If there is no such frame or direction, or the value is no number.
    """
    what = f"rotation of {frame} about {_direction(index)}"
    kept, notes = _clamped(what, value, FULL_TURN_DEG, "°")
    machine = scene.machine
    if _is_axis(machine, frame):
        axis = machine.axes[frame]
        turned = _with_entry(axis.rotation_deg, index, kept)
        return _with_axis(scene, replace(axis, rotation_deg=turned), notes)
    rotation = _with_entry(machine.fixed_deg.get(frame, ORIGIN), index, kept)
    rest = {name: machine.fixed_deg[name] for name in machine.fixed_deg if name != frame}
    fixed = rest if rotation == ORIGIN else {**rest, frame: rotation}
    ordered = {name: fixed[name] for name in FIXED_FRAMES if name in fixed}
    return _with_machine(scene, replace(machine, fixed_deg=ordered), notes)


def change_travel(scene: Scene, axis: str, end: int, value: float) -> Edited:
    """Set one end of the travel of an axis.

    Parameters
    ----------
    scene : Scene
    axis : str
    end : int
        0 for the lower, 1 for the upper one.
    value : float, mm or degrees
        Clamped to what a file may hold.

    Raises
    ------
    UnknownNameError, OptionError
        If there is no such axis, the value is no number, or the travel would be empty.
    """
    present = scene.machine.axis(axis)
    unit = present.unit
    kept, notes = _clamped(f"{_end(end)} end of the travel of {axis}", value, MAX_LENGTH_MM, unit)
    low, high = _with_entry(present.travel, end, kept)
    if high - low < MIN_SPAN:
        raise OptionError(
            f"travel of {axis} {low:g} … {high:g} {unit}; expected the lower end below the upper"
        )
    return _with_axis(scene, replace(present, travel=(low, high)), notes)


def change_direction(scene: Scene, axis: str, direction: int) -> Edited:
    """Let an axis move with (+1) or against (−1) its name.

    Raises
    ------
    UnknownNameError, OptionError
        If there is no such axis or direction.
    """
    present = scene.machine.axis(axis)
    if direction not in (1, -1):
        raise OptionError(f"direction of {axis} {direction}; expected 1 or −1")
    return _with_axis(scene, replace(present, direction=direction))


def change_volume(scene: Scene, axis: str, end: int, value: float) -> Edited:
    """Set one end of the range of an axis in the working volume.

    Parameters
    ----------
    scene : Scene
    axis : str
    end : int
        0 for the lower, 1 for the upper one.
    value : float, mm or degrees
        Where both ends are equal the axis stands still.

    Returns
    -------
    Edited
        Error curves stay the same functions of the position.

    Raises
    ------
    UnknownNameError, OptionError
        If there is no such axis, the value is no number, or the ends are in the wrong order.
    SceneError
        If two axes span one direction of the volume.
    """
    unit = scene.machine.axis(axis).unit
    what = f"{_end(end)} end of {axis} in the working volume"
    kept, notes = _clamped(what, value, MAX_LENGTH_MM, unit)
    low, high = _with_entry(scene.workspace.ranges[axis], end, kept)
    if low > high or 0.0 < high - low < MIN_SPAN:
        raise OptionError(
            f"working volume of {axis} {low:g} … {high:g} {unit}; expected the lower end below the"
            " upper, or both equal where the axis stands still"
        )
    workspace = Workspace({**scene.workspace.ranges, axis: (low, high)})
    return _checked(scene, replace(scene, workspace=workspace), notes)


def hold_axis(scene: Scene, axis: str, value: float) -> Edited:
    """Let an axis stand still at one position of the working volume, mm or degrees.

    Raises
    ------
    UnknownNameError, OptionError
        If there is no such axis, or the value is no number.
    """
    unit = scene.machine.axis(axis).unit
    kept, notes = _clamped(f"position of {axis}", value, MAX_LENGTH_MM, unit)
    workspace = Workspace({**scene.workspace.ranges, axis: (kept, kept)})
    return _checked(scene, replace(scene, workspace=workspace), notes)


def _with_axis(scene: Scene, axis: Axis, notes: tuple[str, ...] = ()) -> Edited:
    """Give a scene a machine with one of its axes changed."""
    axes = {**scene.machine.axes, axis.name: axis}
    return _with_machine(scene, replace(scene.machine, axes=axes), notes)


def _with_machine(scene: Scene, machine: Machine, notes: tuple[str, ...] = ()) -> Edited:
    """Give a scene a machine with the same axes."""
    return _checked(scene, replace(scene, model=replace(scene.model, machine=machine)), notes)


def _checked(scene: Scene, changed: Scene, notes: tuple[str, ...]) -> Edited:
    """Check a scene, unless nothing has changed."""
    return Edited(scene, notes) if changed == scene else checked(scene, changed, notes)


def _is_axis(machine: Machine, frame: str) -> bool:
    """Tell an axis from a fixed frame; anything else is refused."""
    if frame in FIXED_FRAMES:
        return False
    if frame not in machine.axes:
        raise UnknownNameError("frame", frame, (*machine.axes, *FIXED_FRAMES))
    return True


def _direction(index: int) -> str:
    """Name a direction."""
    if index not in (0, 1, 2):
        raise OptionError(f"direction {index}; expected 0, 1 or 2 for x, y or z")
    return DIRECTIONS[index]


def _end(end: int) -> str:
    """Name an end of a range."""
    if end not in (0, 1):
        raise OptionError(f"end {end}; expected 0 for the lower or 1 for the upper one")
    return ENDS[end]


def _with_entry(entries: Sequence[float], index: int, value: float) -> tuple[float, ...]:
    """Give entries with one of them changed."""
    return tuple(value if at == index else entry for at, entry in enumerate(entries))


def _clamped(what: str, value: float, limit: float, unit: str) -> tuple[float, tuple[str, ...]]:
    """Bring a number within ± a limit; note that it was not."""
    if math.isnan(value):
        raise OptionError(f"{what}: nan; expected a number")
    kept = min(max(value, -limit), limit)
    kept = 0.0 if abs(kept) < MIN_NUMBER else kept
    if value in {kept, 0.0}:
        return kept, ()
    return kept, (f"{what} = {value:g} {unit} is beyond ±{limit:g} {unit}; clamped to {kept:g}",)
