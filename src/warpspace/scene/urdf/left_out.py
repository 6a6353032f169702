"""What of a robot has no place in a machine: named, so that nothing is lost unsaid."""

from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Any

SHOWN = 6
"""Names that a remark lists."""

_OF_LINKS: tuple[tuple[str, Callable[[Any], object]], ...] = (
    ("masses and inertias", lambda link: link.inertial is not None),
    ("collision shapes", lambda link: bool(link.collisions)),
    ("materials", lambda link: any(visual.material is not None for visual in link.visuals)),
)
_OF_JOINTS: tuple[tuple[str, Callable[[Any], object]], ...] = (
    (
        "largest efforts and velocities",
        lambda joint: (
            joint.limit is not None and (joint.limit.effort or joint.limit.velocity) is not None
        ),
    ),
    ("damping and friction", lambda joint: joint.dynamics is not None),
    ("safety controllers", lambda joint: joint.safety_controller is not None),
    ("calibrations", lambda joint: joint.calibration is not None),
)


def left_out(robot: Any, others: Sequence[str], kept: Collection[str]) -> list[str]:
    """Name the parts of a robot that a machine does not hold.

    Parameters
    ----------
    robot : yourdfpy.urdf.Robot
    others : sequence of str
        Names of the further elements of the file.
    kept : collection of str
        Links that ride on a frame of the machine.

    Returns
    -------
    list of str
        One remark for each kind of part.
    """
    notes: list[str] = []
    gone = [link.name for link in robot.links if link.name not in kept]
    if gone:
        notes.append(f"not between workpiece and tool, left out: links {_listed(gone)}")
    moving = [joint for joint in robot.joints if joint.child in gone]
    mimics = [joint.name for joint in moving if joint.mimic is not None]
    if mimics:
        notes.append(f"mimic joints, left out: {_listed(mimics)}")
    for what, has in _OF_LINKS:
        if names := [link.name for link in robot.links if has(link)]:
            notes.append(f"{what} have no place: links {_listed(names)}")
    for what, has in _OF_JOINTS:
        if names := [joint.name for joint in robot.joints if has(joint)]:
            notes.append(f"{what} have no place: joints {_listed(names)}")
    if others:
        notes.append(f"have no place: {_listed(list(dict.fromkeys(others)))}")
    return notes


def _listed(names: Iterable[str]) -> str:
    """List a few names."""
    found = [repr(name) for name in names]
    more = len(found) - SHOWN
    return ", ".join(found[:SHOWN]) + (f" and {more} more" if more > 0 else "")
