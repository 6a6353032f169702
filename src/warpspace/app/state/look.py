"""Display settings of field, machine, traces and page, and ranges and positions of the axes."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from warpspace.analysis.act_planning import Act
from warpspace.app.state.leaf import Span, describe, described, error_names
from warpspace.field.grid import slice_ranges
from warpspace.machine import limits
from warpspace.machine.definition import Vector
from warpspace.scene.model import Scene
from warpspace.scene.notes import KINDS
from warpspace.units import spell_short

SURFACES = {
    "surface": "surface",
    "cut": "cut octant",
    "slices": "slices",
    "grid": "grid lines only",
}
DRAWINGS = {"volume": "volume", "rotary": "rotary axes"}
QUANTITIES = {
    "position": "position error [µm]",
    "orientation": "tool-orientation error [µrad]",
    "uncertainty": "uncertainty of the position error, U95 [µm]",
}
RANGES = {"auto": "auto", "fixed": "fixed", "shared": "shared"}
RANGE_TOP = Span(*limits.RANGE_TOP, 0.001)
START_TOP = 50.0
POINT_MM = Span(-2000.0, 2000.0, 1.0)
TASKS = {word.lower(): word for word in ("Understand", "Measure", "Improve", "Design", "Machine")}


@dataclass(frozen=True, slots=True)
class Look:
    drawing: str = described(
        "volume", "Drawing", choices=DRAWINGS, hint="The working volume, or the rotary axes."
    )
    surface: str = described("surface", "Surface", choices=SURFACES)
    quantity: str = described("position", "Quantity", choices=QUANTITIES)
    # round ends of the present values; `range_top`; or one range for all components of the present
    # errors and of those as opened
    range_mode: str = described("auto", "Colour range", choices=RANGES)
    range_top: float = described(
        START_TOP,
        "End of the colour range",
        span=RANGE_TOP,
        hint="End of a fixed range, µm or µrad; signed components use ± this value.",
    )
    isolines: bool = described(
        False, "Isolines", hint="Lines of equal value at the numbers of the colour bar."
    )
    arrows: bool = described(
        False, "Corner arrows", hint="Displacements of the eight corners, with their lengths."
    )
    worst: bool = described(True, "Worst point", hint="Point of the largest coloured value.")
    bars: bool = described(
        True, "Scale bars", hint="Two lengths in the picture: geometry in mm, error in µm."
    )
    significant: bool = described(
        False,
        "Significant only",
        hint="Colours fade to grey where the error is not above its uncertainty U95.",
    )
    ellipsoids: bool = described(
        False,
        "Uncertainty at the corners",
        hint="Ellipsoids of U95 at the eight corners and the clicked point, exaggerated as the box"
        " is: their extent along a direction is U95 of the error along it.",
    )
    unmeasured: bool = described(
        True, "Never measured", hint="Dots at axis positions that no measurement covers."
    )
    # colours by compliance with the limit
    pass_fail: bool = described(False, "Pass or fail")
    # an axis without entry is in the middle of its range
    slices_mm: Mapping[str, float] = described(
        dict[str, float](),
        "Slices",
        item_label="Slice across {}",
        each=lambda state: slice_spans(state.scene),
    )
    follow: bool = described(
        False,
        "Slices through the tool point",
        hint="The slices follow the positions of X, Y and Z.",
    )

    @property
    def tilts(self) -> bool:
        """True where the orientation error of the tool axis is coloured, not the position error."""
        return self.quantity == "orientation"


@dataclass(frozen=True, slots=True)
class MachineLook:
    shown: bool = described(False, "Machine bodies")
    bent: bool = described(
        True,
        "Bodies deformed by the errors",
        hint="Each body is displaced by the errors before it in the chain, exaggerated as the"
        " box is. Off: nominal.",
    )
    ghost: bool = described(True, "Ghost of the machine")
    # an axis without entry is in the middle of its workspace
    linear_mm: Mapping[str, float] = described(
        dict[str, float](),
        "Positions of the machine",
        item_label="Machine {}",
        each=lambda state: linear_spans(state.scene),
        hint="Position of the axis; moves the bodies and the tool point.",
    )


@dataclass(frozen=True, slots=True)
class RotaryLook:
    # indices into the trace points of the scene
    off: frozenset[str] = described(
        frozenset[str](),
        "Points without trace",
        choices=lambda state: {
            str(number): f"({', '.join(map(spell_short, point))}) mm"
            for number, point in enumerate(state.scene.trace_points_mm)
        },
    )
    own_mm: Vector | None = described(
        None,
        "Custom traced point",
        kind="point",
        span=POINT_MM,
        unit="mm",
        linked="rotary.own",
        hint="x, y and z in the workpiece frame; empty for none.",
    )
    # degrees; the default is set by `warpspace.picture.traces`
    held: Mapping[str, tuple[float, ...]] = described(
        dict[str, tuple[float, ...]](),
        "Positions of held rotary axes",
        kind="numbers",
        item_label="{} held at",
        each=lambda state: state.position_spans,
        hint="Positions while the other rotary axis rotates, separated by commas; empty for a few"
        " around the present one.",
    )
    # coloured trace (`picture.traces.name_trace`); for other names the app selects one
    chosen: str = described("", "Trace")

    def points_mm(self, scene: Scene) -> tuple[Vector, ...]:
        points = [p for n, p in enumerate(scene.trace_points_mm) if str(n) not in self.off]
        return (*points, *(() if self.own_mm is None else (self.own_mm,)))


@dataclass(frozen=True, slots=True)
class DisplayOptions:
    traces: bool = described(
        True, "Rotary traces", hint="Circles and arcs of the table: nominal light, actual dark."
    )
    ghost: bool = described(True, "Nominal box", hint="The working volume without errors, dashed.")
    grid_lines: bool = described(True, "Grid lines", hint="Lines of the grid on the deformed box.")
    axes: bool = described(True, "Axes", hint="Coordinates of the machine in mm.")
    dark: bool = described(
        False, "Dark mode", hint="Light lines on a dark ground; the colours of the map stay."
    )


@dataclass(frozen=True, slots=True)
class DiagnosedElement:
    """The machine element of the likeliest cause."""

    text: str
    axes: tuple[str, ...]  # whose guides are drawn


@dataclass(frozen=True, slots=True)
class PageLook:
    task: str = described("understand", "Task", choices=TASKS, linked="")
    open: frozenset[str] = described(
        frozenset({"worst", "compensate", "adjust", "concepts", "allocate", "import"}),
        "Open sections",
        linked="",
    )
    # error with the unfolded row: selected, or changed last; empty for none
    row: str = described(
        "", "Unfolded error", choices=lambda state: {"": "none", **error_names(state)}, linked=""
    )
    query: str = described("", "Search of errors", linked="")
    command: str = described("", "Search of commands", linked="")
    window: str = described("", "Open window", linked="")
    # "list", "new", or the edited note; empty where the tasks are shown
    notes: str = described("", "Notes", linked="")
    figure: str = described("", "Figure", linked="")
    # draft of a note
    note_kind: str = described("note", "Kind", choices={k: k for k in KINDS}, linked="")
    note_place: str = described("point", "About", choices=lambda state: {
        "point": "clicked or worst point", "whole": "the whole",
        **{axis: f"body {axis}" for axis in state.scene.machine.axes},
    }, linked="")  # fmt: skip
    note_text: str = described("", "Text", kind="lines", hint="What is to be seen here?", linked="")
    author: str = described("", "Your name", hint="Kept in this browser", linked="")
    questions: str = described("", "Open questions", kind="lines", hint="One per line", linked="")
    acts: tuple[Act, ...] = field(default=(), metadata=describe("Acts drawn on adjusters"))
    element: DiagnosedElement | None = field(default=None, metadata=describe("Highlighted element"))


# --- Ranges and positions of the axes -------------------------------------------------------------


def position_spans(scene: Scene) -> dict[str, Span]:
    """Return the ranges of the rotary axes that do not span the volume, degrees, by axis."""
    return _spans(scene, within=False)


def slice_spans(scene: Scene) -> dict[str, Span]:
    ranges = slice_ranges(scene.model, scene.workspace)
    return {axis: Span(low, high, 1.0) for axis, (low, high) in ranges.items()}


def linear_spans(scene: Scene) -> dict[str, Span]:
    """Return the ranges of linear axes and of rotary axes that span the volume, mm or degrees."""
    return _spans(scene, within=True)


def _spans(scene: Scene, *, within: bool) -> dict[str, Span]:
    spans: dict[str, Span] = {}
    for name, axis in scene.machine.axes.items():
        if (axis.is_linear or name in scene.workspace.volume_axes) is within:
            low, high = axis.travel
            first, last = scene.workspace.ranges.get(name, (low, high))
            spans[name] = Span(min(low, first), max(high, last), 1.0)
    return spans


def clamped(spans: Mapping[str, Span], positions: Mapping[str, float]) -> dict[str, float]:
    return {axis: spans[axis].clamp(at, at) for axis, at in positions.items() if axis in spans}


def linear_positions(scene: Scene, look: MachineLook) -> dict[str, float]:
    """Return the positions of the linear axes, mm, clamped to their ranges."""
    at = {**scene.workspace.positions, **look.linear_mm}
    return {axis: span.clamp(at.get(axis, 0.0), 0.0) for axis, span in linear_spans(scene).items()}


def slice_positions(scene: Scene, look: Look, machine: MachineLook) -> dict[str, float]:
    chosen = linear_positions(scene, machine) if look.follow else look.slices_mm
    return {
        axis: span.clamp(chosen.get(axis, (span.low + span.high) / 2.0), span.low)
        for axis, span in slice_spans(scene).items()
    }
