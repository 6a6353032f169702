"""The convention that the numbers of a scene file are written in, and the program's own numbers."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from warpspace.exceptions import OptionError, SceneError
from warpspace.field.grid import Workspace
from warpspace.kinematics.conversion.measuring_line import move_measuring_line
from warpspace.kinematics.conversion.squareness import SquarenessSign, convert_squareness
from warpspace.kinematics.model import Model
from warpspace.machine.curves.curve import Span
from warpspace.machine.description import Vector
from warpspace.machine.errors import ErrorSet
from warpspace.machine.parameters import parameter
from warpspace.scene.model import Scene


@dataclass(frozen=True, slots=True)
class Notation:
    """How numbers are written that mean the same errors.

    Attributes
    ----------
    squareness : str
        What a positive squareness means, one of `SquarenessSign`.
    measuring_line_mm : mapping of str to tuple of float, (3,), mm
        Per axis the point of its moving body, in the frame of the axis, whose displacement its
        translations are; axes left out have the origin of their frame.
    """

    squareness: str = SquarenessSign.RIGHT_HAND
    measuring_line_mm: Mapping[str, Vector] = field(default_factory=dict[str, Vector])

    def to_toml(self) -> dict[str, object]:
        """Give the keys of `[convention]` that are not the program's own."""
        found: dict[str, object] = {}
        if self.squareness != SquarenessSign.RIGHT_HAND:
            found["squareness"] = str(self.squareness)
        if self.measuring_line_mm:
            lines = {axis: list(place) for axis, place in self.measuring_line_mm.items()}
            found["measuring_line_mm"] = lines
        return found


def covered_spans(model: Model, workspace: Workspace) -> dict[str, Span]:
    """Give the range of each axis, mm or degrees, that numbers must hold in: travel and volume."""
    found: dict[str, Span] = {}
    for name, axis in model.machine.axes.items():
        low, high = workspace.ranges.get(name, axis.travel)
        found[name] = (min(low, axis.travel[0]), max(high, axis.travel[1]))
    return found


def over_ranges(errors: ErrorSet, model: Model, workspace: Workspace) -> ErrorSet:
    """Give every curve the range that it has in a scene; its values stay."""
    chosen = dict(errors.functions)
    for key, function in errors.functions.items():
        axis = parameter(key).axis
        low, high = workspace.ranges[axis]
        span = (low, high) if low < high else model.machine.axes[axis].travel
        if function.span != span:
            chosen[key] = replace(function.for_span(span), span=span)
    return ErrorSet(chosen)


def read_errors(
    model: Model, errors: ErrorSet, workspace: Workspace, notation: Notation, source: str
) -> ErrorSet:
    """Read errors that are written in a notation.

    Raises
    ------
    SceneError
        If one cannot be read exactly.
    """
    errors = convert_squareness(model.machine, errors, notation.squareness)
    lines = notation.measuring_line_mm
    if not lines:
        return errors
    spans = covered_spans(model, workspace)
    try:
        moved = move_measuring_line(model, errors, spans, lines, to_origin=True)
        return over_ranges(moved, model, workspace)
    except OptionError as error:
        raise SceneError(source, [f"convention.measuring_line_mm: {error}"]) from None


def write_errors(scene: Scene, notation: Notation) -> ErrorSet:
    """Write the errors of a scene in a notation.

    Raises
    ------
    OptionError
        If one cannot be written exactly.
    """
    spans = covered_spans(scene.model, scene.workspace)
    lines, errors = notation.measuring_line_mm, scene.errors
    if lines:
        moved = move_measuring_line(scene.model, errors, spans, lines, to_origin=False)
        errors = over_ranges(moved, scene.model, scene.workspace)
    return convert_squareness(scene.machine, errors, notation.squareness)
