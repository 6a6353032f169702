"""How the field, the machine and its traces are looked at: three frozen values, and pure updates.

Numbers from a browser pass through `Span.clamp` here; names that are none keep the old value.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from warpspace.app.state.leaf import MOST_TYPED, described
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
QUANTITIES = {
    "position": "position error [µm]",
    "orientation": "tool-orientation error [µrad]",
}
RANGES = {"auto": "auto", "fixed": "fixed", "shared": "shared"}
RANGE_TOP = Span(*limits.RANGE_TOP, 0.001)
START_TOP = 50.0
POINT_MM = Span(-2000.0, 2000.0, 1.0)
MOST_HELD = 8  # positions that one axis can be held at while another one is turned


@dataclass(frozen=True, slots=True)
class Look:
    """What is shown of the field, and how."""

    surface: str = described(
        "surface", "Surface", choices=SURFACES, hint="How the volume is drawn."
    )
    quantity: str = described(
        "position", "Quantity", choices=QUANTITIES, hint="Which error the colours mean."
    )
    range_mode: str = described(
        "auto",
        "Colour range",
        choices=RANGES,
        hint="auto: round ends for what is shown. fixed: the number below. shared: one range for"
        " all components, for now and for the scene as opened.",
    )
    range_top: float = described(
        START_TOP,
        "End of the colour range",
        span=RANGE_TOP,
        hint="End of a fixed range, µm or µrad; signed components run from minus to plus.",
    )
    isolines: bool = described(
        False, "Isolines", hint="Lines of equal value at the numbers of the colour bar."
    )
    arrows: bool = described(
        False, "Corner arrows", hint="Displacement of the eight corners, with its length."
    )
    worst: bool = described(True, "Worst point", hint="Where the coloured value is largest.")
    bars: bool = described(
        True, "Scale bars", hint="Two lengths in the picture: geometry in mm, error in µm."
    )
    pass_fail: bool = described(
        False, "Pass or fail", hint="Which part of the volume keeps the limit, and which does not."
    )
    # an axis not given in the middle of its range
    slices_mm: Mapping[str, float] = described(
        dict[str, float](),
        "Slices",
        one="Slice across {}",
        each=lambda state: slice_spans(state.scene),
        hint="Where the volume is cut.",
    )
    follow: bool = described(
        False,
        "Slices through the tool point",
        hint="The slices follow the positions of X, Y and Z.",
    )

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


@dataclass(frozen=True, slots=True)
class MachineLook:
    """The schematic machine."""

    shown: bool = described(
        False,
        "Machine bodies",
        hint="A schematic of the machine around the working volume, in true proportions.",
    )
    bent: bool = described(
        True,
        "Bodies deformed by the errors",
        hint="Each body is displaced by the errors before it in the chain, exaggerated as the"
        " box is. Off: nominal.",
    )
    ghost: bool = described(
        True,
        "Ghost of the machine",
        hint="The bodies, nearly transparent, around the working volume.",
    )
    # an axis not given in the middle of its workspace
    linear_mm: Mapping[str, float] = described(
        dict[str, float](),
        "Positions of the machine",
        one="Machine {}",
        each=lambda state: linear_spans(state.scene),
        hint="Position of the axis; moves the bodies and the tool point.",
    )


@dataclass(frozen=True, slots=True)
class RotaryLook:
    """Which points are traced, and where the axes stand that do not turn."""

    # by their numbers among the scene's trace points
    off: frozenset[int] = described(
        frozenset[int](),
        "Points that are not traced",
        choices=lambda state: trace_point_words(state.scene),
        hint="Points of the scene, in the workpiece frame.",
    )
    own_mm: Vector | None = described(
        None,
        "Traced point of one's own",
        kind="point",
        span=POINT_MM,
        unit="mm",
        linked="rotary.own",
        hint="x, y and z in the workpiece frame; empty for none.",
    )
    # an axis not given where `warpspace.geometry.traces` puts it
    held: tuple[tuple[str, tuple[float, ...]], ...] = described(
        (),
        "Positions that rotary axes are held at",
        kind="numbers",
        one="{} held at",
        each=lambda state: state.position_spans,
        hint="Positions while the other rotary axis turns, separated by commas; empty for a few"
        " around the present one.",
    )
    # a name of none of them (`picture.traces.name_trace`) lets the app choose
    chosen: str = described(
        "", "Trace", hint="The trace in colour, with its name; the others are faint."
    )

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


def trace_point_words(scene: Scene) -> dict[str, str]:
    """Spell the trace points of a scene by their numbers."""
    return {
        str(number): "(" + ", ".join(f"{value:g}" for value in point) + ") mm"
        for number, point in enumerate(scene.trace_points_mm)
    }


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
