"""A scene in another convention: the same field from other numbers, and what had to be said."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.kinematics.conversion import (
    convert_order,
    convert_reference_line,
    held_by_constants,
    held_by_view,
    zero_at,
)
from warpspace.kinematics.model import complete_coordinates
from warpspace.scene.library import parse_scene
from warpspace.scene.model import Scene, evaluate
from warpspace.scene.save import Notation, covered_spans, over_ranges, scene_to_toml, write_errors

SEED, PROOFS = 0, 500
"""Of the positions at which both fields are compared, and their number."""


@dataclass(frozen=True, slots=True)
class Target:
    """Conventions to write a scene in; what is left out stays as it is."""

    # axis to "after_motion" or "before_motion"
    component_errors: Mapping[str, str] = field(default_factory=dict[str, str])
    # linear axis to "end_point", "least_squares" or "minimum_zone"
    straightness: Mapping[str, str] = field(default_factory=dict[str, str])
    # mm or degrees; axis to the position at which its component errors are zero
    zero_at: Mapping[str, float] = field(default_factory=dict[str, float])
    # or "constants", or None; the point whose error is zero: held by the view at these axis
    # positions, or by location constants in place of the scene's view
    reference: Mapping[str, float] | str | None = None
    # sign of squareness and measuring lines that the numbers are written with
    notation: Notation = field(default_factory=Notation)


@dataclass(frozen=True, slots=True)
class Converted:
    """A scene in another convention."""

    scene: Scene  # equal to what a reader of the text gets
    text: str  # the scene file
    # largest difference of the exact fields, position in µm and orientation in µrad
    largest_um: float
    largest_urad: float
    # µm or µrad; amplitude of each error as it was and as it is written, by key; zero where it is
    # not there
    changed: Mapping[str, tuple[float, float]]
    notes: tuple[str, ...]  # what could not be taken along


def convert_scene(scene: Scene, target: Target) -> Converted:
    """Write the errors of a scene in other conventions, in the order of the fields of `Target`.

    Notes
    -----
    The numbers hold within the travel and the working volume of the scene. The fields are compared
    with the exact chain at 500 random places of them, through all loops.
    """
    named = (target.component_errors, target.straightness, target.zero_at)
    for table in (*named, target.notation.measuring_line_mm):
        for axis in table:
            scene.machine.axis(axis)
    spans = covered_spans(scene.model, scene.workspace)
    model, errors = convert_order(scene.model, scene.errors, spans, target.component_errors)
    errors = convert_reference_line(model, errors, spans, target.straightness)
    errors = zero_at(model, errors, spans, target.zero_at)
    other = replace(scene, model=model, errors=over_ranges(errors, model, scene.workspace))
    if target.reference is not None:
        other = _with_reference(other, target.reference)
    left = tuple(
        key
        for key in scene.measured
        if scene.errors.functions.get(key) != other.errors.functions.get(key)
    )
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


def _with_reference(scene: Scene, reference: Mapping[str, float] | str) -> Scene:
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


def field_difference(one: Scene, other: Scene) -> tuple[float, float]:
    """Compare the exact fields of two scenes of one machine."""
    random = np.random.default_rng(SEED)
    spans = covered_spans(one.model, one.workspace)
    at = {axis: random.uniform(*span, PROOFS) for axis, span in spans.items()}
    loops = ("tool", "workpiece", "relative") if one.reference == other.reference else ("tool",)
    position, tilt = 0.0, 0.0
    for loop in loops:
        here, there = (evaluate(scene, at=at, loop=loop, exact=True) for scene in (one, other))
        position = max(position, float(np.abs(here.error_um - there.error_um).max()))
        difference = here.orientation_urad - there.orientation_urad
        tilt = max(tilt, float(np.abs(difference).max()))
    return position, tilt


def choose_axes(scene: Scene, text: str, value: object, kinds: str) -> dict[str, object]:
    """Give a value to one axis, to "linear" or "rotary" ones, or to "all"."""
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
