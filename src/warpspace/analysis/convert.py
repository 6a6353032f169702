"""The errors of a scene in another convention, with the same field."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any

from warpspace.analysis.blocks import Block, Column, Table, number_columns
from warpspace.analysis.description import Analysis, Result, Watch
from warpspace.analysis.options import Grammar, option
from warpspace.analysis.typed import typed_word
from warpspace.exceptions import OptionError, near_miss
from warpspace.machine.axes import parameter
from warpspace.machine.limits import MAX_LENGTH_MM
from warpspace.scene.files import parse_number

if TYPE_CHECKING:
    from warpspace.scene.conversion import Converted, Target
    from warpspace.scene.model import Scene

FORMS = {
    "component_errors": "after_motion or before_motion, or by axis: rotary:before_motion,X:…",
    "straightness": "end_point, least_squares or minimum_zone, or by axis: X:least_squares,…",
    "zero_at": "positions of axes: X:0,Y:-225",
    "reference": "constants, or the point that is held: X:0,Y:0,Z:-280",
    "measuring_line": "points in the frames of axes in mm, x/y/z: X:0/150/-80,…",
    "squareness": "right_hand, over_90 or under_90",
}
"""What each convention takes."""
MAX_SHOWN = 40


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

    def run(self, scene: "Scene", _watch: Watch, /) -> "ConvertResult":
        """Convert and compare."""
        from warpspace.scene.conversion import convert_scene

        found = convert_scene(scene, _target(scene, self.wishes))
        return ConvertResult(asked=self, scene=scene, found=found)


@dataclass(frozen=True, kw_only=True)
class ConvertResult(Result):
    """A scene in another convention."""

    asked: Convert
    scene: "Scene"
    found: "Converted"

    def texts(self) -> Mapping[str, str]:
        """Give the scene file."""
        wishes = "; ".join(self.asked.wishes)
        head = f"# Converted from {self.scene.name} by warpspace convert: {wishes}\n"
        return {"": head + self.found.text}

    def as_json(self) -> dict[str, Any]:
        """Spell it."""
        changed = self.found.changed
        return {
            "largest_um": self.found.largest_um,
            "largest_urad": self.found.largest_urad,
            "changed": {key: {"from": a, "to": b} for key, (a, b) in changed.items()},
            "notes": list(self.found.notes),
        }

    def blocks(self) -> Iterator[Block]:
        """Say what has changed, and that the field has not."""
        found, count = self.found, len(self.found.changed)
        yield f"{self.scene.title}: {count} error{'' if count == 1 else 's'} written otherwise"
        columns = (
            Column("error", leads=True),
            Column("unit"),
            *number_columns(("was", "is written"), ".4g", "largest"),
        )
        shown = list(found.changed.items())[:MAX_SHOWN]
        yield Table(columns, [(key, parameter(key).unit, a, b) for key, (a, b) in shown])
        if count > MAX_SHOWN:
            yield f"  and {count - MAX_SHOWN} more; --json lists them all"
        yield from (f"  {note}" for note in found.notes)
        yield (
            f"  exact fields differ by at most {found.largest_um:.1e} µm and"
            f" {found.largest_urad:.1e} µrad (500 places of the travel, read again from the file)"
        )


def _target(scene: "Scene", wishes: Sequence[str]) -> "Target":
    """Read what is asked for."""
    from warpspace.scene.conversion import Target

    target = Target()
    for wish in wishes:
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


def _with(target: "Target", scene: "Scene", name: str, text: str) -> "Target":
    """Add one wish; a `ValueError` where it cannot be read."""
    from warpspace.kinematics.conversion import ReferenceLine, SquarenessSign
    from warpspace.kinematics.model import ComponentErrors
    from warpspace.scene.conversion import choose_axes

    def by_axis(read: Callable[[str], object], kinds: str = "all") -> dict[str, Any]:
        """Read values by axis, or one for all."""
        found: dict[str, object] = {}
        for part in text.split(","):
            axis, colon, value = (word.strip() for word in part.rpartition(":"))
            found |= choose_axes(scene, axis if colon else "all", read(value), kinds)
        return found

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
    found = tuple(parse_number(part) for part in text.split("/"))
    if len(found) != count or not all(abs(value) <= MAX_LENGTH_MM for value in found):
        raise ValueError(text)
    return found
