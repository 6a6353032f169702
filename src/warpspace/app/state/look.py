"""How the field, the machine and its traces are looked at: three frozen values, and pure updates.

Numbers from a browser pass through `Span.clamp` here; names that are none keep the old value.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from warpspace.app.state.ranges import Span
from warpspace.field.grid import slice_ranges
from warpspace.geometry.traces import TILT_STEP_DEG
from warpspace.machine import limits
from warpspace.machine.axes import is_linear
from warpspace.machine.description import Vector
from warpspace.scene.files import parse_number
from warpspace.scene.model import Scene

SURFACES = {
    "surface": "surface",
    "cut": "cut octant",
    "slices": "slices",
    "grid": "grid lines only",
}
QUANTITIES = ("position", "orientation")
RANGES = {"auto": "auto", "fixed": "fixed", "shared": "shared"}
RANGE_TOP = Span(*limits.RANGE_TOP, 0.001)
START_TOP = 50.0
POINT_MM = Span(-2000.0, 2000.0, 1.0)
MOST_TYPED = 200
MOST_HELD = 8  # positions that one axis can be held at while another one is turned


@dataclass(frozen=True, slots=True)
class Look:
    """What is shown of the field, and how."""

    surface: str = "surface"  # A key of `SURFACES`
    # "position" or "orientation": the position error in µm or the tool-axis tilt in µrad
    quantity: str = "position"
    # auto: round ends for what is shown; fixed: `range_top`; shared: one range for all components,
    # for now and for the scene as it was opened
    range_mode: str = "auto"
    range_top: float = START_TOP  # end of a fixed range, µm or µrad
    # lines of equal value, corner arrows, marker of the worst point, scale bars in the picture
    isolines: bool = False
    arrows: bool = False
    worst: bool = True
    bars: bool = True
    # where slices lie; an axis not given in the middle of its range
    slices_mm: Mapping[str, float] = field(default_factory=dict[str, float])
    follow: bool = False  # whether the slices pass through the tool point instead

    @property
    def tilts(self) -> bool:
        """Whether the orientation error of the tool axis is coloured, not the position error."""
        return self.quantity == "orientation"

    def with_choice(self, **names: str) -> "Look":
        """Choose surface, quantity or range_mode; unknown names change nothing."""
        allowed: Mapping[str, Iterable[str]] = {
            "surface": SURFACES,
            "quantity": QUANTITIES,
            "range_mode": RANGES,
        }
        return replace(self, **{k: v for k, v in names.items() if v in allowed.get(k, ())})

    def with_top(self, value: float) -> "Look":
        """Set the end of a fixed range, and make the range fixed."""
        return replace(self, range_top=RANGE_TOP.clamp(value, self.range_top), range_mode="fixed")

    def with_slice(self, axis: str, value: float, span: Span) -> "Look":
        """Move the slice across an axis, mm."""
        kept = span.clamp(value, self.slices_mm.get(axis, (span.low + span.high) / 2.0))
        return replace(self, slices_mm={**self.slices_mm, axis: kept})

    def switched(self, **on: bool) -> "Look":
        """Switch what is drawn."""
        return replace(self, **on)


@dataclass(frozen=True, slots=True)
class MachineLook:
    """The schematic machine."""

    shown: bool = False  # whether its bodies are drawn
    bent: bool = True  # whether they are bent by the exaggerated errors
    # whether, where they are not drawn, a ghost of them lies around the working volume
    ghost: bool = True
    # positions of the linear axes; an axis not given in the middle of its workspace
    linear_mm: Mapping[str, float] = field(default_factory=dict[str, float])

    def with_linear(self, axis: str, value: float, span: Span) -> "MachineLook":
        """Move a linear axis, mm."""
        kept = span.clamp(value, self.linear_mm.get(axis, (span.low + span.high) / 2.0))
        return replace(self, linear_mm={**self.linear_mm, axis: kept})

    def switched(self, **on: bool) -> "MachineLook":
        """Switch what is drawn."""
        return replace(self, **on)


@dataclass(frozen=True, slots=True)
class RotaryLook:
    """Which points are traced, and where the axes stand that do not turn."""

    off: frozenset[int] = frozenset()  # numbers of the scene's trace points that are not traced
    own_mm: Vector | None = None  # or None; A point of the user's own in the workpiece frame
    # degrees; positions an axis is held at while another one turns; an axis not given where
    # `warpspace.geometry.traces` puts it
    held: tuple[tuple[str, tuple[float, ...]], ...] = ()
    # name of the trace that is looked at (`picture.traces.name_trace`); a name of none of
    # them, for instance an empty one, lets the app choose
    chosen: str = ""

    def with_chosen(self, name: str) -> "RotaryLook":
        """Look at the trace of a name; anything, since it comes from a browser."""
        return replace(self, chosen=name[:MOST_TYPED])

    def with_point(self, number: int, *, on: bool) -> "RotaryLook":
        """Trace one of the scene's points, or do not."""
        return replace(self, off=self.off - {number} if on else self.off | {number})

    def with_own(self, point_mm: Vector | None) -> "RotaryLook":
        """Trace a point of the user's own; None for none."""
        if point_mm is None:
            return replace(self, own_mm=None)
        before = self.own_mm or (0.0, 0.0, 0.0)
        x, y, z = (POINT_MM.clamp(v, old) for v, old in zip(point_mm, before, strict=True))
        return replace(self, own_mm=(x, y, z))

    def with_held(self, axis: str, positions: tuple[float, ...]) -> "RotaryLook":
        """Hold an axis at other positions, degrees; none for those by default."""
        rest = tuple((name, at) for name, at in self.held if name != axis)
        return replace(self, held=(*rest, (axis, positions)) if positions else rest)

    def points_mm(self, scene: Scene) -> tuple[Vector, ...]:
        """List the points that are traced, mm in the workpiece frame."""
        own = () if self.own_mm is None else (self.own_mm,)
        return (
            *(p for number, p in enumerate(scene.trace_points_mm) if number not in self.off),
            *own,
        )


def slice_spans(scene: Scene) -> dict[str, Span]:
    """Give the ranges of the slices of a scene, mm, by axis."""
    ranges = slice_ranges(scene.model, scene.workspace)
    return {axis: Span(low, high, 1.0) for axis, (low, high) in ranges.items()}


def linear_spans(scene: Scene) -> dict[str, Span]:
    """Give the ranges of the axes that move within the volume, mm or degrees.

    These are the linear axes, and rotary ones that span the volume; travels, widened by the
    workspace.
    """
    spanning = scene.workspace.volume_axes
    found: dict[str, Span] = {}
    for name in scene.machine.axes:
        if not is_linear(name) and name not in spanning:
            continue
        low, high = scene.machine.axes[name].travel
        first, last = scene.workspace.ranges.get(name, (low, high))
        found[name] = Span(min(low, first), max(high, last), 1.0)
    return found


def linear_positions(scene: Scene, look: MachineLook) -> dict[str, float]:
    """Give where the linear axes of a scene stand, mm, always within their ranges."""
    middle = scene.workspace.positions
    return {
        axis: span.clamp(look.linear_mm.get(axis, middle.get(axis, 0.0)), 0.0)
        for axis, span in linear_spans(scene).items()
    }


def slice_positions(scene: Scene, look: Look, machine: MachineLook) -> dict[str, float]:
    """Give where the slices of a scene lie, mm."""
    chosen: Mapping[str, Any] = linear_positions(scene, machine) if look.follow else look.slices_mm
    return {
        axis: span.clamp(chosen.get(axis, (span.low + span.high) / 2.0), span.low)
        for axis, span in slice_spans(scene).items()
    }


def quarters(scene: Scene, axis: str) -> tuple[float, ...]:
    """List the quarter turns within the travel of a rotary axis, degrees; a full turn once."""
    low, high = scene.machine.axes[axis].travel
    high = min(high, low + 359.0)
    first, last = math.ceil(low / 90.0), math.floor(high / 90.0)
    return tuple(90.0 * number for number in range(first, last + 1))[:MOST_HELD]


def parse_positions(text: str, span: Span) -> tuple[tuple[float, ...], str]:
    """Read a list of positions that a user has typed."""
    spaced = text[:MOST_TYPED].replace("−", "-").replace("°", " ").replace(",", " ")
    words = [word for word in spaced.replace(";", " ").split() if word not in {"-", "+", "."}]
    found: set[float] = set()
    wrong: list[str] = []
    for word in words:
        try:
            value = parse_number(word)
        except ValueError:
            value = math.nan
        if math.isfinite(value) and span.low <= value <= span.high:
            found.add(value)
        else:
            wrong.append(word[:20])
    kept = tuple(sorted(found)[:MOST_HELD])
    notes: list[str] = []
    if wrong:
        allowed = f"expected numbers from {span.low:g} to {span.high:g}"
        notes.append(f"{', '.join(wrong[:4])} left out; {allowed}")
    if len(found) > MOST_HELD:
        notes.append(f"{len(found)} positions; the first {MOST_HELD} are taken")
    return kept, "; ".join(notes)


def default_held(
    scene: Scene, rotary: RotaryLook, positions: Mapping[str, float]
) -> dict[str, tuple[float, ...]]:
    """Give the positions that axes are held at, degrees, where the user has chosen none.

    The axis next to the point stands where it is, the one before it where it is and 30 degrees to
    either side.
    """
    found: dict[str, tuple[float, ...]] = {}
    for side in ("workpiece", "tool"):
        turning = [axis for axis in scene.machine.branch(side) if not axis.is_linear]
        if len(turning) > 1:
            last = turning[-1]
            found[last.name] = (positions.get(last.name, 0.0),)
            tilting = turning[-2]
            low, high = tilting.travel
            middle = positions.get(tilting.name, 0.0)
            beside = {middle - TILT_STEP_DEG, middle + TILT_STEP_DEG}
            found[tilting.name] = (*sorted({middle, *(at for at in beside if low <= at <= high)}),)
    return {**found, **dict(rotary.held)}
