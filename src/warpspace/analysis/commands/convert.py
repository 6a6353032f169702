"""Conversion of the errors of a scene to another convention; the field stays the same."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import numpy as np

from warpspace.analysis.blocks import Block, Column, Table, number_columns
from warpspace.analysis.description import Analysis, ProgressCallback, Result
from warpspace.analysis.options import Grammar, option, typed_word
from warpspace.exceptions import OptionError, near_miss
from warpspace.kinematics.conversion import (
    ReferenceLine,
    SquarenessSign,
    convert_order,
    convert_reference_line,
    held_by_constants,
    held_by_view,
    zero_at,
)
from warpspace.kinematics.model import ComponentErrors, complete_coordinates
from warpspace.machine.axes import parameter
from warpspace.machine.limits import MAX_LENGTH_MM
from warpspace.scene.library import parse_scene
from warpspace.scene.model import Scene, evaluate
from warpspace.scene.scene_writer import (
    Notation,
    covered_spans,
    extend_to_ranges,
    scene_to_toml,
    write_errors,
)
from warpspace.scene.text_files import one_line, parse_number

FORMS = {
    "component_errors": "after_motion or before_motion, or by axis: rotary:before_motion,X:…",
    "straightness": "end_point, least_squares or minimum_zone, or by axis: X:least_squares,…",
    "zero_at": "positions of axes: X:0,Y:-225",
    "reference": "constants, or the point that is held: X:0,Y:0,Z:-280",
    "measuring_line": "points in the frames of axes in mm, x/y/z: X:0/150/-80,…",
    "squareness": "right_hand, over_90 or under_90",
}
MAX_SHOWN = 40
SEED, PROOFS = 0, 500  # of the positions at which both fields are compared, and their number


@dataclass(frozen=True, kw_only=True)
class Convert(Analysis):
    """Write the errors of SCENE in another convention.

    The field stays the same: the file is read again, and the exact fields of both are compared at
    500 places of the travel, whose largest difference is printed. What cannot be converted exactly
    is refused.
    """

    name = "convert"
    task = "measure"
    doing = "converting"
    file_help = "Scene file to write: .toml."
    file_endings = (".toml",)
    needs_file = True
    wishes: Annotated[tuple[str, ...], Grammar("CONVENTION=VALUE", typed_word, each=True)] = option(
        (), "; ".join(f"{name}={form}" for name, form in FORMS.items()), flag="--to", required=True
    )

    def run(self, scene: Scene, _watch: ProgressCallback, /) -> "ConvertResult":
        return convert_scene(scene, self.target(scene), self.wishes)

    def target(self, scene: Scene) -> "Target":
        target = Target()
        for wish in self.wishes:
            name, equals, text = (part.strip() for part in wish.partition("="))
            if not equals or name not in FORMS:
                hint = near_miss(name, FORMS) or f"; expected one of {', '.join(FORMS)}"
                raise OptionError(f"{{wishes}} {wish!r}: unknown convention {name!r}{hint}")
            try:
                target = _with(target, scene, name, text)
            except ValueError:
                expected = f"expected {FORMS[name]}"
                raise OptionError(f"{{wishes}} {wish!r} cannot be read; {expected}") from None
        return target


@dataclass(frozen=True, slots=True)
class Target:
    """Conventions to convert a scene to; None leaves a convention unchanged."""

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


@dataclass(frozen=True, kw_only=True)
class ConvertResult(Result):
    """A scene in another convention."""

    json_keys = ("largest_um", "largest_urad", "changed", "notes")
    wishes: tuple[str, ...]
    before: Scene
    scene: Scene  # equal to what a reader of the text gets
    text: str  # the scene file
    # largest difference of the exact fields, position in µm and orientation in µrad
    largest_um: float
    largest_urad: float
    # µm or µrad; amplitude of each error as it was and as it is written, by key; zero where it is
    # not there
    changed: Mapping[str, tuple[float, float]]
    notes: tuple[str, ...]  # what could not be taken along

    def output_files(self, _ending: str = "", /) -> Mapping[str, str]:
        wishes = "; ".join(self.wishes)
        head = one_line(f"# Converted from {self.before.name} by warpspace convert: {wishes}")
        return {"": f"{head}\n{self.text}"}

    def json_fields(self) -> dict[str, Any]:
        return {
            "largest_um": self.largest_um,
            "largest_urad": self.largest_urad,
            "changed": {key: {"from": a, "to": b} for key, (a, b) in self.changed.items()},
            "notes": list(self.notes),
        }

    def blocks(self) -> Iterator[Block]:
        count = len(self.changed)
        yield f"{self.before.title}: {count} error{'' if count == 1 else 's'} converted"
        columns = (
            Column("error", leads=True),
            Column("unit"),
            *number_columns(("was", "is written"), ".4g", "largest"),
        )
        listed = list(self.changed.items())[:MAX_SHOWN]
        yield Table(columns, [(key, parameter(key).unit, a, b) for key, (a, b) in listed])
        if count > MAX_SHOWN:
            yield f"  and {count - MAX_SHOWN} more, all in the JSON output"
        yield from (f"  {note}" for note in self.notes)
        yield (
            f"  exact fields differ by at most {self.largest_um:.1e} µm and"
            f" {self.largest_urad:.1e} µrad (500 places of the travel, read again from the file)"
        )


def convert_scene(scene: Scene, target: Target, wishes: tuple[str, ...] = ()) -> ConvertResult:
    """Convert the errors of a scene, in the order of the fields of `Target`."""
    named = (target.component_errors, target.straightness, target.zero_at)
    for table in (*named, target.notation.measuring_line_mm):
        for axis in table:
            scene.machine.axis(axis)
    spans = covered_spans(scene.model, scene.workspace)
    model, errors = convert_order(scene.model, scene.errors, spans, target.component_errors)
    errors = convert_reference_line(model, errors, spans, target.straightness)
    errors = zero_at(model, errors, spans, target.zero_at)
    other = replace(scene, model=model, errors=extend_to_ranges(errors, model, scene.workspace))
    if target.reference is not None:
        other = _with_reference(other, target.reference)
    dropped = tuple(
        key
        for key in scene.measured
        if scene.errors.functions.get(key) != other.errors.functions.get(key)
    )
    measured = {key: run for key, run in scene.measured.items() if key not in dropped}
    other = replace(other, measured=measured)
    text = scene_to_toml(other, target.notation)
    read = parse_scene(text, scene.name, "the converted scene")
    gone = f"readings of {', '.join(dropped)} are omitted: they belong to other curves"
    notes = (gone,) if dropped else ()
    converted = write_errors(other, target.notation)
    amplitudes = {
        key: (scene.errors.amplitude(key), converted.amplitude(key))
        for key in dict.fromkeys((*scene.errors, *converted))
        if scene.errors.functions.get(key) != converted.functions.get(key)
    }
    largest_um, largest_urad = field_difference(scene, read)
    return ConvertResult(
        wishes=wishes,
        before=scene,
        scene=read,
        text=text,
        largest_um=largest_um,
        largest_urad=largest_urad,
        changed=amplitudes,
        notes=notes,
    )


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
    constants = held_by_constants(scene.model, scene.errors, place)
    return replace(
        scene, errors=extend_to_ranges(constants, scene.model, scene.workspace), reference=None
    )


def field_difference(first: Scene, second: Scene) -> tuple[float, float]:
    random = np.random.default_rng(SEED)
    spans = covered_spans(first.model, first.workspace)
    at = {axis: random.uniform(*span, PROOFS) for axis, span in spans.items()}
    loops = ("tool", "workpiece", "relative") if first.reference == second.reference else ("tool",)
    position, tilt = 0.0, 0.0
    for loop in loops:
        before, after = (evaluate(scene, at=at, loop=loop, exact=True) for scene in (first, second))
        change = before - after
        position = max(position, float(np.abs(change.error_um).max()))
        tilt = max(tilt, float(np.abs(change.orientation_urad).max()))
    return position, tilt


def _with(target: Target, scene: Scene, name: str, text: str) -> Target:

    def by_axis(read: Callable[[str], object], kinds: str = "all") -> dict[str, Any]:
        orders: dict[str, object] = {}
        for part in text.split(","):
            axis, colon, value = (word.strip() for word in part.rpartition(":"))
            orders |= _choose_axes(scene, axis if colon else "all", read(value), kinds)
        return orders

    if name == "component_errors":
        return replace(target, component_errors=by_axis(ComponentErrors))
    if name == "straightness":
        return replace(target, straightness=by_axis(ReferenceLine, "linear"))
    if name == "squareness":
        return replace(target, notation=replace(target.notation, squareness=SquarenessSign(text)))
    if name == "reference" and text == "constants":
        return replace(target, reference=text)
    if ":" not in text:
        raise ValueError(text)
    if name == "zero_at":
        return replace(target, zero_at=by_axis(lambda value: _numbers(value, 1)[0]))
    if name == "reference":
        return replace(target, reference=by_axis(lambda value: _numbers(value, 1)[0]))
    places = by_axis(lambda value: _numbers(value, 3))
    return replace(target, notation=replace(target.notation, measuring_line_mm=places))


def _numbers(text: str, count: int) -> tuple[float, ...]:
    numbers = tuple(parse_number(part) for part in text.split("/"))
    if len(numbers) != count or not all(abs(value) <= MAX_LENGTH_MM for value in numbers):
        raise ValueError(text)
    return numbers


def _choose_axes(scene: Scene, text: str, value: object, kinds: str) -> dict[str, object]:
    axes = scene.machine.axes
    groups = {
        "all": [name for name in axes if kinds == "all" or axes[name].is_linear],
        "linear": [name for name in axes if axes[name].is_linear],
        "rotary": [name for name in axes if not axes[name].is_linear],
    }
    if text not in groups and text not in axes:
        expected = ", ".join((*axes, *groups))
        raise OptionError(f"{{to}} {text!r}: no such axis; expected one of {expected}")
    return dict.fromkeys(groups.get(text, [text]), value)
