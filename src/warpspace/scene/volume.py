"""Reading the working volume of a scene: which axes span it, and where the others stand."""

from collections.abc import Mapping

from warpspace.exceptions import OptionError
from warpspace.field.grid import Workspace, find_volume_axes
from warpspace.machine.axes import direction_index, is_linear, sort_axes
from warpspace.machine.description import Machine, Range
from warpspace.scene.sections import Problems


def read_workspace(raw: Mapping[str, object], machine: Machine, problems: Problems) -> Workspace:
    """Read the working volume.

    Parameters
    ----------
    raw : mapping of str to object
        The table of the scene: a range or one position per axis.
    machine : Machine
    problems : Problems

    Returns
    -------
    Workspace
        A linear axis that is not given has its travel where no other axis of its direction has a
        range, else it stands at zero or as near as its travel allows; a rotary axis likewise.
    """
    given: dict[str, Range] = {}
    for name, value in raw.items():
        if name not in machine.axes:
            problems.unknown("workspace", name, machine.axes, "axis of this machine")
        elif (valid := problems.validate("range", f"workspace.{name}", value)) is not None:
            given[name] = valid if isinstance(valid, tuple) else (valid, valid)
    ranges = _complete(given, machine)
    try:
        find_volume_axes(ranges)
    except OptionError as error:
        return Workspace(_without_ranges(error, given, ranges, raw, problems))
    return Workspace(ranges)


def _complete(given: Mapping[str, Range], machine: Machine) -> dict[str, Range]:
    """Give every axis a range or a position."""
    spanned = {direction_index(name) for name in given if is_linear(name) and _moves(given[name])}
    found: dict[str, Range] = {}
    for name, axis in machine.axes.items():
        own = axis.index
        if name in given:
            found[name] = given[name]
        elif axis.is_linear and own not in spanned:
            found[name] = axis.travel
            spanned.add(own)
        else:
            low, high = axis.travel
            at = min(max(0.0, low), high) if axis.is_linear else 0.0
            found[name] = (at, at)
    return found


def _moves(span: Range) -> bool:
    """Tell whether a range is more than one position."""
    return span[0] < span[1]


def _without_ranges(
    error: OptionError,
    given: Mapping[str, Range],
    ranges: Mapping[str, Range],
    raw: Mapping[str, object],
    problems: Problems,
) -> dict[str, Range]:
    """Note which ranges are too many, and let those axes stand still."""
    still = dict(ranges)
    for name in reversed(sort_axes(given)):
        if not _moves(given[name]):
            continue
        middle = sum(still[name]) / 2.0
        still[name] = (middle, middle)
        expected = (
            f"{error}"
            if is_linear(name)
            else "expected one position in degrees for a rotary axis of a machine whose linear"
            " axes span the volume"
        )
        problems.add(f"workspace.{name}", expected, raw[name])
        try:
            find_volume_axes(still)
        except OptionError:
            continue
        break
    return still
