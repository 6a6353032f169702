"""A scene in another convention: the same field from other numbers, and what had to be said."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.kinematics.conversion.held_point import held_by_constants, held_by_view
from warpspace.kinematics.conversion.order import convert_order
from warpspace.kinematics.conversion.reference_line import convert_reference_line
from warpspace.kinematics.conversion.zero import zero_at
from warpspace.kinematics.model import complete_coordinates
from warpspace.machine.errors import ErrorSet
from warpspace.scene.library import parse_scene
from warpspace.scene.model import Scene
from warpspace.scene.notation import Notation, covered_spans, over_ranges, write_errors
from warpspace.scene.pipeline import evaluate
from warpspace.scene.save import scene_to_toml

SEED, PROOFS = 0, 500
"""Of the positions at which both fields are compared, and their number."""


@dataclass(frozen=True, slots=True)
class Target:
    """Conventions to write a scene in; what is left out stays as it is.

    Attributes
    ----------
    component_errors : mapping of str to str
        Axis to "after_motion" or "before_motion".
    straightness : mapping of str to str
        Linear axis to "end_point", "least_squares" or "minimum_zone".
    zero_at : mapping of str to float, mm or degrees
        Axis to the position at which its component errors are zero.
    reference : mapping of str to float, or "constants", or None
        The point whose error is zero: held by the view at these axis positions, or by location
        constants in place of the scene's view.
    notation : Notation
        Sign of squareness and measuring lines that the numbers are written with.
    """

    component_errors: Mapping[str, str] = field(default_factory=dict[str, str])
    straightness: Mapping[str, str] = field(default_factory=dict[str, str])
    zero_at: Mapping[str, float] = field(default_factory=dict[str, float])
    reference: Mapping[str, float] | str | None = None
    notation: Notation = field(default_factory=Notation)


@dataclass(frozen=True, slots=True)
class Converted:
    """A scene in another convention.

    Attributes
    ----------
    scene : Scene
        Equal to what a reader of the text gets.
    text : str
        The scene file.
    largest_um, largest_urad : float
        Largest difference of the exact fields, position in µm and orientation in µrad.
    changed : mapping of str to (float, float), µm or µrad
        Amplitude of each error as it was and as it is written, by key; zero where it is not there.
    notes : tuple of str
        What could not be taken along.
    """

    scene: Scene
    text: str
    largest_um: float
    largest_urad: float
    changed: Mapping[str, tuple[float, float]]
    notes: tuple[str, ...]


def convert_scene(scene: Scene, target: Target) -> Converted:
    """Write the errors of a scene in other conventions, in the order of the fields of `Target`.

    Parameters
    ----------
    scene : Scene
    target : Target

    Returns
    -------
    Converted

    Raises
    ------
    OptionError
        If something cannot be converted exactly, or names what there is not.
    SceneError
        If the converted errors are more than a scene file holds.

    Notes
    -----
    The numbers hold within the travel and the working volume of the scene. The fields are compared
    with the exact chain at 500 random places of them, through all loops.
    """
    _check_axes(scene, target)
    spans = covered_spans(scene.model, scene.workspace)
    model, errors = convert_order(scene.model, scene.errors, spans, target.component_errors)
    errors = convert_reference_line(model, errors, spans, target.straightness)
    errors = zero_at(model, errors, spans, target.zero_at)
    other = replace(scene, model=model, errors=over_ranges(errors, model, scene.workspace))
    if target.reference is not None:
        other = _with_reference(other, target.reference)
    changed = _changed_keys(scene.errors, other.errors)
    left = tuple(key for key in scene.measured if key in changed)
    measured = {key: one for key, one in scene.measured.items() if key not in left}
    other = replace(other, measured=measured)
    text = scene_to_toml(other, target.notation)
    read = parse_scene(text, scene.name, "the converted scene")
    gone = f"readings of {', '.join(left)} are left out: they are of other curves"
    notes = (gone,) if left else ()
    written = write_errors(other, target.notation)
    amplitudes = {
        key: (scene.errors.amplitude(key), written.amplitude(key))
        for key in dict.fromkeys((*scene.errors, *written))
        if scene.errors.functions.get(key) != written.functions.get(key)
    }
    return Converted(read, text, *field_difference(scene, read), amplitudes, notes)


def _check_axes(scene: Scene, target: Target) -> None:
    """Refuse axes that the machine does not have."""
    named = (target.component_errors, target.straightness, target.zero_at)
    for axis in dict.fromkeys(
        name for table in (*named, target.notation.measuring_line_mm) for name in table
    ):
        scene.machine.axis(axis)


def _with_reference(scene: Scene, reference: Mapping[str, float] | str) -> Scene:
    """Hold the reference point of zero by constants, or by the view."""
    if not isinstance(reference, str):
        at = {**scene.workspace.positions, **reference}
        place = complete_coordinates(scene.machine, at)
        return replace(
            scene, errors=held_by_view(scene.model, scene.errors, place), reference=dict(reference)
        )
    if reference != "constants":
        raise OptionError(f"reference {reference!r}; expected constants, or axis positions")
    if scene.reference is None:
        raise OptionError("the scene holds no point still; expected a reference in its [view]")
    place = complete_coordinates(scene.machine, {**scene.workspace.positions, **scene.reference})
    held = held_by_constants(scene.model, scene.errors, place)
    return replace(scene, errors=over_ranges(held, scene.model, scene.workspace), reference=None)


def _changed_keys(one: ErrorSet, other: ErrorSet) -> set[str]:
    """List the errors whose curves differ."""
    keys = {*one, *other}
    return {key for key in keys if one.functions.get(key) != other.functions.get(key)}


def field_difference(one: Scene, other: Scene) -> tuple[float, float]:
    """Compare the exact fields of two scenes of one machine.

    Returns
    -------
    largest_um, largest_urad : float
        Over 500 random places of travel and working volume and all loops that both see alike:
        where one holds a point still and the other does not, the tool loop.
    """
    random = np.random.default_rng(SEED)
    spans = covered_spans(one.model, one.workspace)
    at = {axis: random.uniform(*span, PROOFS) for axis, span in spans.items()}
    loops = ("tool", "workpiece", "relative") if one.reference == other.reference else ("tool",)
    position, tilt = 0.0, 0.0
    for loop in loops:
        found = [_exact(scene, at, loop) for scene in (one, other)]
        position = max(position, float(np.abs(found[0][0] - found[1][0]).max()))
        tilt = max(tilt, float(np.abs(found[0][1] - found[1][1]).max()))
    return position, tilt


def _exact(scene: Scene, at: Mapping[str, np.ndarray], loop: str) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate the exact field at places."""
    found = evaluate(scene, at=at, loop=loop, exact=True)
    return found.error_um, found.orientation_urad


def choose_axes(scene: Scene, text: str, value: object, kinds: str) -> dict[str, object]:
    """Give a value to one axis, to "linear" or "rotary" ones, or to "all".

    Raises
    ------
    OptionError
        If there is no such axis.
    """
    axes = scene.machine.axes
    groups = {
        "all": [name for name in axes if kinds == "all" or axes[name].is_linear],
        "linear": [name for name in axes if axes[name].is_linear],
        "rotary": [name for name in axes if not axes[name].is_linear],
    }
    if text not in groups and text not in axes:
        known = ", ".join((*axes, *groups))
        raise OptionError(f"--to {text!r}: no such axis; expected one of {known}")
    return dict.fromkeys(groups.get(text, [text]), value)
