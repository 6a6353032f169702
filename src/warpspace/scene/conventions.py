"""Reading which convention each axis of a scene has for its component errors."""

from collections.abc import Mapping
from typing import Any, cast

from warpspace.kinematics.model import ComponentErrors
from warpspace.machine.description import Machine
from warpspace.scene.sections import Problems

KINDS = ("linear", "rotary")


def component_orders(
    convention: Any, machine: Machine, problems: Problems
) -> tuple[str, tuple[tuple[str, str], ...]]:
    """Give the convention of the scene, and the axes that have another one.

    Parameters
    ----------
    convention : ConventionSection or None
        Its `component_errors` is one name, or a table of names by "linear", "rotary" or axis, of
        which the more special one counts.
    machine : Machine
    problems : Problems

    Returns
    -------
    name : str
    own : tuple of (str, str)
        Name of the axis and of its convention.
    """
    asked = getattr(convention, "component_errors", ComponentErrors.AFTER_MOTION)
    if not isinstance(asked, Mapping):
        return str(asked), ()
    table = cast("Mapping[str, str]", asked)
    for key in table:
        if key not in (*KINDS, *machine.axes):
            known = (*KINDS, *machine.axes)
            problems.unknown("convention.component_errors", key, known, "kind or axis")
    default = str(ComponentErrors.AFTER_MOTION)
    found = {
        name: table.get(name, table.get(KINDS[0] if axis.is_linear else KINDS[1], default))
        for name, axis in machine.axes.items()
    }
    names = list(found.values())
    main = max(dict.fromkeys(names), key=names.count)
    return main, tuple((name, order) for name, order in found.items() if order != main)


def measuring_lines(
    convention: Any, machine: Machine, problems: Problems
) -> dict[str, tuple[float, float, float]]:
    """Give the measuring lines of a scene by axis, mm, and note axes that there are not."""
    found = dict(getattr(convention, "measuring_line_mm", {}))
    for axis in found:
        if axis not in machine.axes:
            where = "convention.measuring_line_mm"
            problems.unknown(where, axis, machine.axes, "axis of this machine")
    return found
