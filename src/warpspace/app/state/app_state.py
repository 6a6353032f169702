"""The state of a session as one frozen value. Every change of it is a pure function.

Values from a browser pass through `warpspace.app.state.tree.put`: it clamps numbers to their range,
rejects invalid values and records both in `AppState.notes`.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpspace.app.state.leaf import Span, describe, described, error_names
from warpspace.app.state.look import (
    DisplayOptions,
    Look,
    MachineLook,
    PageLook,
    RotaryLook,
    clamped,
    linear_spans,
    position_spans,
    slice_spans,
)
from warpspace.exceptions import WarpspaceError
from warpspace.field.evaluate import View
from warpspace.field.grid import DEFAULT_NODES, RESIDUAL_NODES
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import is_linear, parameter
from warpspace.machine.definition import Vector
from warpspace.machine.errors import Constant, ErrorFunction, ErrorSet, ToleranceSet
from warpspace.machine.limits import EXAGGERATION as FACTORS
from warpspace.machine.limits import LIVE_NODES, MAX_ERROR, MAX_LENGTH_MM, PROBABILITY
from warpspace.parts.gcode.interpreter import program_lines
from warpspace.parts.workpiece import Workpiece, load_workpiece
from warpspace.scene.model import Scene
from warpspace.scene.notes import Note, NoteAnchor

if TYPE_CHECKING:
    from warpspace.formats.compensation.controller import Controller

AMPLITUDE = Span(-MAX_ERROR, MAX_ERROR, 0.1)
NODES = Span(*LIVE_NODES, 2.0)  # grid nodes per axis: odd numbers
EXAGGERATION = Span(*FACTORS, 1.0)
PLACE = Span(-MAX_LENGTH_MM, MAX_LENGTH_MM, 1.0)  # mm and degrees
LIMIT_UM = Span(1.0, 300.0, 0.5)
PERCENT = Span(100.0 * PROBABILITY[0], 100.0 * PROBABILITY[1], 0.1)
START_NODES = DEFAULT_NODES
COMPONENT_NAMES = {
    "position": {"norm": "|E| length", "x": "E_x", "y": "E_y", "z": "E_z"},
    "orientation": {
        "norm": "|φ| tilt of the tool axis",
        "x": "φ_x tilt about x",
        "y": "φ_y tilt about y",
        "z": "φ_z tilt about z",
    },
    "uncertainty": {"norm": "U95 |E|", "x": "U95 E_x", "y": "U95 E_y", "z": "U95 E_z"},
}
"""Labels of the components, for each quantity of the colours."""
LOOP_NAMES = {
    Loop.TOOL.value: "tool point",
    Loop.WORKPIECE.value: "workpiece point",
    Loop.RELATIVE.value: "tool relative to workpiece",
}
KEPT_FIELDS = ("component", "nodes", "shown", "page")
"""Fields that stay when another scene is opened."""
COMPARISON_VIEWS = {"a": "A", "b": "B", "difference": "B − A"}
"""Views of a comparison; the difference is the change from A to B."""
PRESENT, NOBODY = "present errors", "nothing"
"""Labels of the present state, and of no second side."""
_load_workpiece = lru_cache(maxsize=4)(load_workpiece)


@dataclass(frozen=True, slots=True)
class Exclusions:
    """Parameters that are excluded, and those that exclude all others."""

    excluded: frozenset[str] = described(
        frozenset[str](),
        "Excluded errors",
        item_label="Exclusion of {}",
        choices=error_names,
        linked="excluded",
    )
    # where there are any, all others are excluded, too
    only: frozenset[str] = described(
        frozenset[str](),
        "Errors drawn alone",
        item_label="Only {}",
        choices=error_names,
        linked="only",
    )

    def __bool__(self) -> bool:
        return bool(self.excluded or self.only)

    def active(self, key: str) -> bool:
        return key not in self.excluded and (not self.only or key in self.only)

    def within(self, keys: Collection[str]) -> "Exclusions":
        return Exclusions(self.excluded & frozenset(keys), self.only & frozenset(keys))


@dataclass(frozen=True, slots=True)
class Specification:
    limit_um: float | None = described(  # None where no limit is set
        None, "|E| allowed", choices={"": "not set"}, kind="number", span=LIMIT_UM, unit="µm"
    )
    # at one random point of each machine (as in the thesis), or at its worst point (the default)
    over: str = described(
        "max",
        "Evaluated at",
        choices={"max": "everywhere", "sampled": "a random point"},
        hint="Where each sampled machine must stay within the limit: everywhere in the volume, or"
        " at one random point (as in the thesis).",
    )
    distribution: str = described(
        "uniform",
        "Errors in their tolerance",
        choices={"uniform": "uniform", "normal": "normal, 3σ at the limits"},
        hint="Distribution of the errors of the machines within their tolerances.",
    )
    # required share of machines within the limit, for the allocation of tolerances
    percent: float = described(95.0, "Probability wanted", span=PERCENT, unit="%")
    # tolerances that allocation and scaling leave unchanged
    fixed: frozenset[str] = described(
        frozenset[str](),
        "Fixed tolerances",
        item_label="Fixed tolerance of {}",
        choices=error_names,
    )
    costs: str = described(
        "",
        "Costs of tolerances",
        hint="Cost of a tolerance where it is not 1, for instance EA0Z=4, EXX=0.5.",
    )


@dataclass(frozen=True, slots=True)
class Picked:
    """A picked point; its axis positions stay while errors change."""

    # mm or degrees; positions of the linear axes for a point of the surface (those of the rotary
    # axes are in the state), of all axes for a point of a trace
    at: Mapping[str, float]
    # loop of a trace; None for a point of the surface, which follows the loop of the view
    loop: Loop | None = None
    # or None; the traced point in the workpiece (or tool) frame; None for the surface
    point_mm: Vector | None = None

    @classmethod
    def of_note(cls, note: Note) -> "Picked | None":
        """Return the point of a note; None for a note on the scene or on a body."""
        mark = note.on or NoteAnchor()
        if not note.at or mark.body:
            return None
        is_traced = mark.loop and mark.point_mm
        return cls(note.at, Loop(mark.loop), mark.point_mm) if is_traced else cls(note.at)


@dataclass(frozen=True, slots=True)
class PartLook:
    """The workpiece in the box, in place of the scene's own."""

    # mesh and text of the program are never stored in files or links
    mesh: Workpiece | None = field(default=None, metadata=describe("Mesh of the part"))
    name: str = described("", "Part", linked="part")
    place: tuple[float, ...] | None = described(
        None,
        "Place",
        kind="point",
        span=PLACE,
        linked="place",
        hint="Fixture position of the part in the workpiece frame: x, y, z in mm, and rotations in"
        " degrees about the fixed x, y and z, in that order; empty for the default.",
    )
    program: str | None = field(default=None, metadata=describe("Program"))
    program_name: str = field(default="", metadata=describe("Program"))
    shown: bool = described(
        True,
        "Part in the box",
        hint="The part as cut by this machine, with edges of the nominal part.",
    )
    normal: bool = described(
        False, "Coloured along its normal", hint="Material too much above zero, too little below."
    )
    moved: bool = described(
        False, "Move in the drawing", hint="Arrows and arcs at the part.", linked=""
    )

    @classmethod
    def of_scene(cls, scene: Scene) -> tuple["PartLook", tuple[str, ...]]:
        """Read the files of a scene's part; return errors for files that cannot be read."""
        part, mesh, text, notes = scene.part, None, None, list[str]()
        try:
            if path := part.path("program"):
                text = "".join(program_lines(path))
            if path := part.path("file"):
                mesh = _load_workpiece(path, part.unit or None)
        except WarpspaceError as error:
            notes.append(str(error))
        except Exception as error:  # noqa: BLE001 - a damaged file must not prevent opening
            notes.append(f"part of the scene: {error!r}")
        look = cls(mesh, Path(part.file).name, part.place, text, Path(part.program).name)
        return look, tuple(notes)

    @property
    def is_empty(self) -> bool:
        return (self.mesh is None or not self.shown) and self.program is None


@dataclass(frozen=True)
class Side:
    title: str = PRESENT  # label on the page
    state: "AppState | None" = None  # None for the present state
    # a scene as opened, shown with rotary positions and loop of the present state; a pinned state
    # has its own
    is_scene: bool = False


@dataclass(frozen=True)
class Comparison:
    a: Side = field(default_factory=Side)
    b: Side | None = None  # None without a comparison
    shown: str = described(
        "a", "Side that is drawn", choices=COMPARISON_VIEWS, linked="compare.shown"
    )
    ghost: bool = described(True, "Other side as a wireframe", linked="compare.ghost")
    pinned: Side | None = None  # pinned last: the state before, or a proposal

    @property
    def sides(self) -> tuple[Side | None, ...]:
        return self.a, self.b, self.pinned

    def off(self) -> "Comparison":
        return Comparison(pinned=self.pinned, ghost=self.ghost)


@dataclass(frozen=True, slots=True)
class AppState:
    """Everything that a picture depends on."""

    # machine, curves of the errors, working volume
    scene: Scene = field(metadata=describe("Scene"))
    # µm or µrad; amplitude of every parameter of the scene
    amplitudes: Mapping[str, float] = field(
        metadata=describe(
            "Errors",
            kind="number",
            each=lambda state: dict.fromkeys(state.amplitudes, AMPLITUDE),
            linked="{key}",
        )
    )
    # degrees; of the rotary axes
    positions: Mapping[str, float] = field(
        metadata=describe(
            "Rotary positions",
            kind="number",
            item_label="Position of {}",
            each=lambda state: state.position_spans,
            linked="{key}",
            hint="Position while the working volume is evaluated.",
        )
    )
    start: Mapping[str, float]  # µm or µrad; amplitudes after a reset: those of the scene
    # display factor of displacements; None selects a round number
    exaggeration: float | None = described(
        None, "Exaggeration", choices={"auto": "auto"}, kind="number", span=EXAGGERATION
    )
    component: str = described(
        "norm", "Component", choices=lambda state: COMPONENT_NAMES[state.look.quantity]
    )
    loop: Loop = described(
        Loop.TOOL,
        "Structural loop",
        choices=LOOP_NAMES,
        hint="The error that deforms the box: of the tool, of the workpiece, or relative.",
    )
    placed: bool = described(
        False,
        "Best-fit placement removed",
        hint="Remove the placement of the workpiece, which has no effect on a part: three"
        " translations and three small rotations, fitted over the working volume.",
    )
    nodes: int = described(
        START_NODES,
        "Grid density",
        span=NODES,
        unit="nodes",
        hint="Nodes along X, Y and Z at which the error is computed.",
    )
    shown: DisplayOptions = field(default_factory=DisplayOptions)
    exclusions: Exclusions = field(default_factory=Exclusions)
    # of sampled machines: the scene's, unless changed
    tolerances: ToleranceSet = field(
        default_factory=ToleranceSet,
        metadata=describe(
            "Tolerances",
            kind="number",
            item_label="Tolerance of {}",
            each=lambda state: dict.fromkeys(state.amplitudes),
            linked="",
        ),
    )
    specification: Specification = field(default_factory=Specification)
    # the scene as opened, where `scene` has been edited since
    loaded: Scene | None = field(default=None, metadata=describe("Scene"))
    # title of the scene whose errors were dropped with its machine; empty for none, and after the
    # next change of scene
    left_behind: str = field(default="", metadata=describe("Scene"))
    # names of the files from which errors were imported, with the imported curve, by key
    imported: Mapping[str, tuple[str, ErrorFunction]] = field(
        default_factory=dict[str, tuple[str, ErrorFunction]], metadata=describe("Scene")
    )
    look: Look = field(default_factory=Look)
    machine: MachineLook = field(default_factory=MachineLook)
    rotary: RotaryLook = field(default_factory=RotaryLook)
    part: PartLook = field(default_factory=PartLook)
    # the picked point, and the error with axis and lever drawn
    picked: Picked | None = field(default=None, metadata=describe("Point"))
    lever: str = described("", "Lever", choices=lambda state: {"": "none", **error_names(state)})
    comparison: Comparison = field(default_factory=Comparison, metadata=describe("Comparison"))
    # with the applied compensation table; never stored in files or links
    controller: "Controller | None" = field(default=None, metadata=describe("Compensation table"))
    # notes of reviewers; not in the scene, which is a key of caches
    review: tuple[Note, ...] = field(default=(), metadata=describe("Notes"))
    # open sections of the page, and texts of its forms (`form_values.py`); undo changes neither
    page: PageLook = field(default_factory=PageLook, compare=False)
    forms: Mapping[str, str] = field(default_factory=dict[str, str], compare=False)
    notes: tuple[str, ...] = ()  # values that the latest change clamped or rejected

    @property
    def position_spans(self) -> Mapping[str, Span]:
        return position_spans(self.scene)

    @property
    def shows_rotary(self) -> bool:
        """True where the rotary axes are drawn, not the volume."""
        return self.look.drawing == "rotary" and not all(map(is_linear, self.scene.machine.axes))

    @property
    def origin(self) -> Scene:
        """The scene as opened, which reset returns to."""
        return self.loaded or self.scene

    @property
    def own_curves(self) -> Mapping[str, ErrorFunction]:
        """The curves of the scene as opened, over the present working volume."""
        original, present = self.origin, self.scene
        same_axes = original.machine.axes == present.machine.axes
        if same_axes and original.workspace == present.workspace:
            return original.errors.functions
        curves: dict[str, ErrorFunction] = {}
        for key, function in original.errors.functions.items():
            if parameter(key).axis in present.machine.axes:
                span = present.axis_span(parameter(key).axis)
                curves[key] = replace(function.for_span(span), span=span)
        return curves

    @property
    def active(self) -> Mapping[str, float]:
        """Amplitudes, µm or µrad; those of excluded errors are zero."""
        if not self.exclusions:
            return self.amplitudes
        takes_part = self.exclusions.active
        return {key: at if takes_part(key) else 0.0 for key, at in self.amplitudes.items()}

    @property
    def changed_keys(self) -> tuple[str, ...]:
        return tuple(key for key, value in self.amplitudes.items() if value != self.start[key])

    @property
    def grid_nodes(self) -> int:
        """Nodes per axis of the drawn grid: unless set, those of residual errors with a table."""
        is_residual = self.controller is not None and self.nodes == START_NODES
        return RESIDUAL_NODES if is_residual else self.nodes

    @property
    def view_key(self) -> tuple[Loop, bool]:
        """The loop, and whether the best-fit placement is removed: a key of caches."""
        return self.loop, self.placed and self.loop is Loop.RELATIVE

    def axis_span(self, key: str) -> tuple[float, float]:
        return self.scene.axis_span(parameter(key).axis)

    def curve(self, key: str) -> ErrorFunction:
        function = self.scene.errors.functions.get(key) or Constant(self.axis_span(key))
        return function.with_amplitude(self.amplitudes[key])

    def resulting_scene(self) -> Scene:
        scene = self.scene
        keys = [k for k, at in self.amplitudes.items() if at or k in scene.errors.functions]
        scene_positions = scene.workspace.positions
        moved = {axis: at for axis, at in self.positions.items() if at != scene_positions.get(axis)}
        return replace(
            scene,
            errors=ErrorSet({key: self.curve(key) for key in keys}),
            workspace=scene.workspace.moved(moved) if moved else scene.workspace,
            tolerances=self.tolerances,
            exaggeration=self.exaggeration,
            placed=self.placed,
            review=self.review,
            limit_um=self.specification.limit_um,
        )

    def active_scene(self) -> Scene:
        """Build the scene as drawn, without excluded errors."""
        return replace(self, amplitudes=self.active).resulting_scene()

    @property
    def standing(self) -> Scene:
        """The scene with the rotary positions and the placement of the state."""
        workspace = self.scene.workspace.moved(self.positions)
        return replace(self.scene, placed=self.placed, workspace=workspace)

    def view(self, loop: Loop | None = None) -> View:
        """Return the view of a loop, by default the present one, at the present positions."""
        return self.standing.view(loop or self.loop)

    def noted(self, *notes: str) -> "AppState":
        """Add notes on clamped or rejected values; empty ones are dropped."""
        texts = tuple(filter(None, notes))
        return replace(self, notes=(*self.notes, *texts)) if texts else self

    def without_notes(self) -> "AppState":
        return replace(self, notes=()) if self.notes else self

    def with_amplitude(self, key: str, value: float) -> "AppState":
        return replace(self, amplitudes={**self.amplitudes, key: value})

    def with_scene(self, scene: Scene) -> "AppState":
        """Open another scene; component, density and switches stay, its part and drawing do not."""
        fresh, unchanged = start_state(scene), {name: getattr(self, name) for name in KEPT_FIELDS}
        of_part = ("part.", "program.")
        forms = {k: v for k, v in self.forms.items() if not k.startswith(of_part)}
        return replace(fresh, forms={**forms, **fresh.forms}, **unchanged).within_reach()

    def within_reach(self) -> "AppState":
        """Clamp slices, axes and held angles to the scene's ranges; drop those without an axis."""
        spans, slices = linear_spans(self.scene), slice_spans(self.scene)
        held_at = {
            axis: tuple(at for at in self.rotary.held.get(axis, ()) if span.low <= at <= span.high)
            for axis, span in self.position_spans.items()
        }
        return replace(
            self,
            look=replace(self.look, slices_mm=clamped(slices, self.look.slices_mm)),
            machine=replace(self.machine, linear_mm=clamped(spans, self.machine.linear_mm)),
            rotary=replace(self.rotary, held={axis: at for axis, at in held_at.items() if at}),
        )

    def with_edited(self, scene: Scene) -> "AppState":
        """Replace the scene by an edited one; equal scenes keep their identity."""
        same = next((known for known in (self.origin, self.scene) if known == scene), scene)
        return replace(self, scene=same, loaded=None if same is self.origin else self.origin)

    def reset(self) -> "AppState":
        changed = replace(self.scene, errors=ErrorSet(self.own_curves))
        return replace(self.with_edited(changed), amplitudes=self.start)

    def at_rest(self) -> "AppState":
        """Return the reference for the view of a note: without settings stored in the scene."""
        at_zero = dict.fromkeys(self.positions, 0.0)
        limit = replace(self.specification, limit_um=None)
        return replace(self.zeroed(), positions=at_zero, exaggeration=None, loop=Loop.TOOL,
                       placed=False, specification=limit)  # fmt: skip

    def zeroed(self) -> "AppState":
        return replace(self, amplitudes=dict.fromkeys(self.amplitudes, 0.0))


def start_state(scene: Scene, **changes: Any) -> AppState:
    start = {key: scene.errors.amplitude(key) for key in scene.parameter_keys}
    at = scene.workspace.positions
    positions = {axis: at.get(axis, 0.0) for axis in position_spans(scene)}
    part, notes = PartLook.of_scene(scene)
    # an arm stands within the volume that its joints span
    is_within = not part.is_empty or not any(is_linear(axis) for axis in scene.workspace.ranges)
    state = AppState(
        scene,
        start,
        positions,
        start,
        scene.exaggeration,
        loop=scene.default_loop,
        placed=scene.placed,
        specification=Specification(scene.limit_um),
        tolerances=scene.tolerances,
        review=scene.review,
        part=part,
        look=Look(surface="grid") if is_within else Look(),
        forms={"program.tcp": scene.part.tcp} if scene.part.tcp else {},
        notes=notes,
    )
    return replace(state, **changes)
