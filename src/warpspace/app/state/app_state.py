"""What a session shows, as one frozen value. Every change of it is a pure function.

Whatever comes from a browser passes through `warpspace.app.state.tree.put`: it brings numbers into
their range, keeps the old value in place of what is none, and notes in `AppState.notes` what it
changed.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpspace.app.state.leaf import Span, described, error_names, leaf_metadata
from warpspace.app.state.look import (
    Look,
    MachineLook,
    RotaryLook,
    clamped,
    linear_spans,
    position_spans,
    slice_spans,
)
from warpspace.exceptions import WarpspaceError
from warpspace.field.evaluate import View
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.machine.definition import Vector
from warpspace.machine.errors import Constant, ErrorFunction, ErrorSet, ToleranceSet
from warpspace.machine.limits import EXAGGERATION as FACTORS
from warpspace.machine.limits import LIVE_NODES, MAX_ERROR, MAX_LENGTH_MM, PROBABILITY
from warpspace.parts.interpreter import program_lines
from warpspace.parts.workpiece import PartMesh, load_part
from warpspace.scene.model import Scene
from warpspace.scene.notes import KINDS, Note, NoteAnchor

if TYPE_CHECKING:
    from warpspace.formats.compensation.controller import Controller

AMPLITUDE = Span(-MAX_ERROR, MAX_ERROR, 0.1)
NODES = Span(*LIVE_NODES, 2.0)  # grid nodes per axis: odd numbers
EXAGGERATION = Span(*FACTORS, 1.0)
PLACE = Span(-MAX_LENGTH_MM, MAX_LENGTH_MM, 1.0)  # mm and degrees
LIMIT_UM = Span(1.0, 300.0, 0.5)
PERCENT = Span(100.0 * PROBABILITY[0], 100.0 * PROBABILITY[1], 0.1)
START_NODES, START_UM = 21, 50.0
TASKS = {word.lower(): word for word in ("Understand", "Measure", "Improve", "Design", "Machine")}
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
"""What the components are called, for each quantity that can be coloured."""
LOOP_NAMES = {
    Loop.TOOL.value: "tool point",
    Loop.WORKPIECE.value: "workpiece point",
    Loop.RELATIVE.value: "tool relative to workpiece",
}
KEPT_FIELDS = ("component", "nodes", "shown", "look", "machine", "part", "forms", "page")
"""What stays when another scene is shown."""
COMPARISON_VIEWS = {"a": "A", "b": "B", "difference": "B − A"}
"""What can be drawn of a comparison; the difference is the change from A to B."""
PRESENT, NOBODY = "present errors", "nothing"
"""Names of what is steered, and of no other side."""
_load_part = lru_cache(maxsize=4)(load_part)


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
class Exclusions:
    """Parameters that do not take part, and those that alone do."""

    excluded: frozenset[str] = described(
        frozenset[str](),
        "Excluded errors",
        entry_label="Exclusion of {}",
        choices=error_names,
        linked="excluded",
    )
    # where there are any, all others are left out, and so are excluded ones among them
    only: frozenset[str] = described(
        frozenset[str](),
        "Errors drawn alone",
        entry_label="Only {}",
        choices=error_names,
        linked="only",
    )

    def __bool__(self) -> bool:
        return bool(self.excluded or self.only)

    def active(self, key: str) -> bool:
        """Tell whether a parameter takes part."""
        return key not in self.excluded and (not self.only or key in self.only)

    def within(self, keys: Collection[str]) -> "Exclusions":
        return Exclusions(self.excluded & frozenset(keys), self.only & frozenset(keys))


@dataclass(frozen=True, slots=True)
class Specification:
    """What a design is held against: a limit, where it holds, how tolerances are filled, traded."""

    limit_um: float = described(START_UM, "|E| allowed", span=LIMIT_UM, unit="µm")
    # one random point of each machine (as in the thesis), or its worst point, which is the rule
    over: str = described(
        "max",
        "Evaluated at",
        choices={"max": "everywhere", "sampled": "a random point"},
        hint="Where each sampled machine has to stay within the limit: everywhere in the volume, or"
        " at one random point (as in the thesis).",
    )
    distribution: str = described(
        "uniform",
        "Errors in their tolerance",
        choices={"uniform": "uniform", "normal": "normal, 3σ at the limits"},
        hint="How the errors of the machines are spread over their tolerances.",
    )
    # share of the machines that is to stay within the limit once tolerances are allocated
    percent: float = described(95.0, "Probability wanted", span=PERCENT, unit="%")
    # tolerances that are neither allocated nor scaled
    fixed: frozenset[str] = described(
        frozenset[str](),
        "Fixed tolerances",
        entry_label="Fixed tolerance of {}",
        choices=error_names,
    )
    costs: str = described(
        "",
        "Costs of tolerances",
        hint="Cost of a tolerance where it is not 1, for instance EA0Z=4, EXX=0.5.",
    )


@dataclass(frozen=True, slots=True)
class Picked:
    """A point somebody asks about; it stays where the axes stand while errors change."""

    # mm or degrees; axis positions: those of the linear axes for a point of the surface (the rotary
    # ones stand where the state has them), those of all axes for a point of a trace
    at: Mapping[str, float]
    # loop of a trace; None for a point of the surface, which follows the loop of the view
    loop: Loop | None = None
    # or None; the traced point in the workpiece (or tool) frame; None for the surface
    point_mm: Vector | None = None

    @classmethod
    def of_note(cls, note: Note) -> "Picked | None":
        """Give the point that a note is pinned to; none for the whole or a body."""
        mark = note.on or NoteAnchor()
        if not note.at or mark.body:
            return None
        is_traced = mark.loop and mark.point_mm
        return cls(note.at, Loop(mark.loop), mark.point_mm) if is_traced else cls(note.at)


@dataclass(frozen=True, slots=True)
class PartLook:
    """The part that stands in the box, in place of the scene's own."""

    # mesh and text of the program are never saved or linked
    mesh: PartMesh | None = field(default=None, metadata=leaf_metadata("Mesh of the part"))
    name: str = described("", "Part", linked="part")
    place: tuple[float, ...] | None = described(
        None,
        "Place",
        kind="point",
        span=PLACE,
        linked="place",
        hint="Where the part is clamped, in the workpiece frame: x, y, z in mm, and turns in"
        " degrees about the fixed x, y and z, in that order; empty for the usual place.",
    )
    program: str | None = field(default=None, metadata=leaf_metadata("Program"))
    program_name: str = field(default="", metadata=leaf_metadata("Program"))
    shown: bool = described(
        True, "Part in the box", hint="As this machine cuts it, and lines of the nominal part."
    )
    normal: bool = described(
        False, "Coloured along its normal", hint="Material too much above zero, too little below."
    )
    moved: bool = described(
        False, "Move in the drawing", hint="Arrows and arcs at the part.", linked=""
    )

    @classmethod
    def of_scene(cls, scene: Scene) -> tuple["PartLook", tuple[str, ...]]:
        """Return what a scene names, and why some files cannot be read: only their names."""
        part, mesh, text, notes = scene.part, None, None, list[str]()
        try:
            if path := part.path("program"):
                text = "".join(program_lines(path))
            if path := part.path("file"):
                mesh = _load_part(path, part.unit or None)
        except WarpspaceError as error:
            notes.append(str(error))
        except Exception as error:  # noqa: BLE001 - whatever a file holds, the scene opens
            notes.append(f"part of the scene: {error!r}")
        look = cls(mesh, Path(part.file).name, part.place, text, Path(part.program).name)
        return look, tuple(notes)

    @property
    def is_empty(self) -> bool:
        """Whether nothing of it stands in the box."""
        return (self.mesh is None or not self.shown) and self.program is None


@dataclass(frozen=True, slots=True)
class PageLook:
    task: str = described("understand", "Task", choices=TASKS, linked="")
    open: frozenset[str] = described(
        frozenset({"worst", "compensate", "adjust", "concepts", "allocate", "import"}),
        "Open sections",
        linked="",
    )
    # error whose row is unfolded: chosen, or the one moved last; empty for none yet
    row: str = described(
        "", "Unfolded error", choices=lambda state: {"": "none", **error_names(state)}, linked=""
    )
    query: str = described("", "Search of errors", linked="")
    command: str = described("", "Search of commands", linked="")
    window: str = described("", "Open window", linked="")
    # "list", "new", or the note that is edited; empty where the tasks stand there
    notes: str = described("", "Notes", linked="")
    figure: str = described("", "Figure", linked="")
    # what has been typed of a note that is not kept yet
    note_kind: str = described("note", "Kind", choices={k: k for k in KINDS}, linked="")
    note_place: str = described("point", "About", choices=lambda state: {
        "point": "clicked or worst point", "whole": "the whole",
        **{axis: f"body {axis}" for axis in state.scene.machine.axes},
    }, linked="")  # fmt: skip
    note_text: str = described("", "Text", kind="lines", hint="What is to be seen here?", linked="")
    author: str = described("", "Your name", hint="Kept in this browser", linked="")
    questions: str = described("", "Open questions", kind="lines", hint="One per line", linked="")


@dataclass(frozen=True)
class Side:
    title: str = PRESENT  # what it is called on the page
    state: "AppState | None" = None  # what it is; None for what is steered
    # whether it is a scene as opened, which is looked at as what is steered (rotary positions,
    # loop), rather than what was pinned, which keeps its own
    is_scene: bool = False


@dataclass(frozen=True)
class Comparison:
    a: Side = field(default_factory=Side)
    b: Side | None = None  # none while nothing is compared
    shown: str = described(
        "a", "Side that is drawn", choices=COMPARISON_VIEWS, linked="compare.shown"
    )
    # whether the other side is drawn too, as a wireframe
    ghost: bool = described(True, "Other side as a wireframe", linked="compare.ghost")
    pinned: Side | None = None  # what was pinned last: the state before, or a proposal

    def off(self) -> "Comparison":
        """End it; what was pinned stays."""
        return Comparison(pinned=self.pinned, ghost=self.ghost)


@dataclass(frozen=True, slots=True)
class AppState:
    """All that a picture depends on."""

    # machine, curves of the errors, working volume; its amplitudes are where reset goes
    scene: Scene = field(metadata=leaf_metadata("Scene"))
    # µm or µrad; amplitude of every parameter of the scene
    amplitudes: Mapping[str, float] = field(
        metadata=leaf_metadata(
            "Errors",
            kind="number",
            each=lambda state: dict.fromkeys(state.amplitudes, AMPLITUDE),
            linked="{key}",
        )
    )
    # degrees; where the rotary axes stand
    positions: Mapping[str, float] = field(
        metadata=leaf_metadata(
            "Rotary positions",
            kind="number",
            entry_label="Position of {}",
            each=lambda state: state.position_spans,
            linked="{key}",
            hint="Position while the working volume is evaluated.",
        )
    )
    start: Mapping[str, float]  # µm or µrad; amplitudes that reset goes back to: the scene's
    # how much larger than true the errors are drawn; None chooses a round number
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
        hint="Whose error deforms the box: tool, workpiece, or one against the other.",
    )
    placed: bool = described(
        False,
        "Placement of the workpiece fitted out",
        hint="Remove the position of the workpiece, which does not show on a part: three shifts"
        " and three small rotations, fitted over the working volume.",
    )
    nodes: int = described(
        START_NODES,
        "Grid density",
        span=NODES,
        unit="nodes",
        hint="Nodes along X, Y and Z at which the error is computed.",
    )
    shown: DisplayOptions = field(default_factory=DisplayOptions)
    # parameters that do not take part, or alone do
    exclusions: Exclusions = field(default_factory=Exclusions)
    # what machines are sampled from: the scene's, as far as they have not been moved
    tolerances: ToleranceSet = field(
        default_factory=ToleranceSet,
        metadata=leaf_metadata(
            "Tolerances",
            kind="number",
            entry_label="Tolerance of {}",
            each=lambda state: dict.fromkeys(state.amplitudes),
            linked="",
        ),
    )
    # what the tolerances are held against
    specification: Specification = field(default_factory=Specification)
    # the scene as it was opened, where curves of `scene` have been edited since
    loaded: Scene | None = field(default=None, metadata=leaf_metadata("Scene"))
    # title of the scene whose errors a machine chosen from the library left behind; empty for none,
    # and after the next change of scene
    left_behind: str = field(default="", metadata=leaf_metadata("Scene"))
    # what is shown of the field and of the schematic machine, and traced
    look: Look = field(default_factory=Look)
    machine: MachineLook = field(default_factory=MachineLook)
    rotary: RotaryLook = field(default_factory=RotaryLook)
    part: PartLook = field(default_factory=PartLook)
    # the point whose error is explained, and the error whose axis and lever are drawn
    picked: Picked | None = field(default=None, metadata=leaf_metadata("Point"))
    lever: str = described("", "Lever", choices=lambda state: {"": "none", **error_names(state)})
    comparison: Comparison = field(default_factory=Comparison, metadata=leaf_metadata("Comparison"))
    # whose table corrects the machine that is drawn; never saved or linked
    controller: "Controller | None" = field(
        default=None, metadata=leaf_metadata("Table of compensation")
    )
    # notes of reviewers; beside the scene, which is a key of what has been computed of it
    review: tuple[Note, ...] = field(default=(), metadata=leaf_metadata("Notes"))
    # what of the page is open, and what its forms were told (`state/forms.py`); undo leaves both
    page: PageLook = field(default_factory=PageLook, compare=False)
    forms: Mapping[str, str] = field(default_factory=dict[str, str], compare=False)
    notes: tuple[str, ...] = ()  # what the latest change had to clamp

    @property
    def position_spans(self) -> Mapping[str, Span]:
        return position_spans(self.scene)

    @property
    def origin(self) -> Scene:
        """The scene as it was opened: where reset goes, and what it is known by."""
        return self.loaded or self.scene

    @property
    def own_curves(self) -> Mapping[str, ErrorFunction]:
        """The curves of the scene as it was opened, over the present working volume."""
        original, present = self.origin, self.scene
        if (
            original.workspace == present.workspace
            and original.machine.axes == present.machine.axes
        ):
            return original.errors.functions
        curves: dict[str, ErrorFunction] = {}
        for key, function in original.errors.functions.items():
            if parameter(key).axis in present.machine.axes:
                span = present.axis_span(parameter(key).axis)
                curves[key] = replace(function.for_span(span), span=span)
        return curves

    @property
    def active(self) -> Mapping[str, float]:
        """Amplitudes that count, µm or µrad: those that are excluded are zero."""
        if not self.exclusions:
            return self.amplitudes
        takes_part = self.exclusions.active
        return {key: at if takes_part(key) else 0.0 for key, at in self.amplitudes.items()}

    @property
    def changed_keys(self) -> tuple[str, ...]:
        return tuple(key for key, value in self.amplitudes.items() if value != self.start[key])

    @property
    def view_key(self) -> tuple[Loop, bool]:
        """The loop, and whether the placement of the workpiece is left out: a key to keep by."""
        return self.loop, self.placed and self.loop is Loop.RELATIVE

    def axis_span(self, key: str) -> tuple[float, float]:
        return self.scene.axis_span(parameter(key).axis)

    def curve(self, key: str) -> ErrorFunction:
        function = self.scene.errors.functions.get(key) or Constant(self.axis_span(key))
        return function.with_amplitude(self.amplitudes[key])

    def resulting_scene(self) -> Scene:
        """Give the scene that the state amounts to: what is saved, drawn and exported."""
        scene, limit = self.scene, self.specification.limit_um
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
            limit_um=None if scene.limit_um is None and limit == START_UM else limit,
        )

    def active_scene(self) -> Scene:
        """Give the scene as it is drawn: what is excluded is left out."""
        return replace(self, amplitudes=self.active).resulting_scene()

    @property
    def standing(self) -> Scene:
        """The scene with its rotary axes where they stand, the workpiece placed or not."""
        workspace = self.scene.workspace.moved(self.positions)
        return replace(self.scene, placed=self.placed, workspace=workspace)

    def view(self, loop: Loop | None = None) -> View:
        """Give the view through a loop, the present one by default, at the present positions."""
        return self.standing.view(loop or self.loop)

    def noted(self, *notes: str) -> "AppState":
        """Say what could not be taken as it was given; an empty note is none."""
        texts = tuple(filter(None, notes))
        return replace(self, notes=(*self.notes, *texts)) if texts else self

    def without_notes(self) -> "AppState":
        return replace(self, notes=()) if self.notes else self

    def with_amplitude(self, key: str, value: float) -> "AppState":
        """Give one parameter an amplitude that the program has worked out, µm or µrad."""
        return replace(self, amplitudes={**self.amplitudes, key: value})

    def with_scene(self, scene: Scene) -> "AppState":
        """Show another scene, in its own loop; component, density and switches stay."""
        fresh, unchanged = start_state(scene), {name: getattr(self, name) for name in KEPT_FIELDS}
        if not fresh.part.is_empty:
            unchanged["part"], unchanged["look"] = fresh.part, replace(self.look, surface="grid")
            unchanged["forms"] = {**self.forms, **fresh.forms}
        changed = replace(
            fresh,
            specification=self.specification if scene.limit_um is None else fresh.specification,
            rotary=replace(self.rotary, off=frozenset()),
            **unchanged,
        )
        return changed.within_reach()

    def within_reach(self) -> "AppState":
        """Bring slices, axes and held angles into the scene's ranges; those without axis go."""
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
        """Show the scene with something edited; the same object where it is the same scene."""
        same = next((one for one in (self.origin, self.scene) if one == scene), scene)
        return replace(self, scene=same, loaded=None if same is self.origin else self.origin)

    def reset(self) -> "AppState":
        """Give all errors the scene's values and curves again."""
        changed = replace(self.scene, errors=ErrorSet(self.own_curves))
        return replace(self.with_edited(changed), amplitudes=self.start)

    def at_rest(self) -> "AppState":
        """Give what the view of a note is spelled from: nothing that is saved with the scene."""
        at_zero = dict.fromkeys(self.positions, 0.0)
        limit = replace(self.specification, limit_um=START_UM)
        return replace(self.zeroed(), positions=at_zero, exaggeration=None, loop=Loop.TOOL,
                       placed=False, specification=limit)  # fmt: skip

    def zeroed(self) -> "AppState":
        return replace(self, amplitudes=dict.fromkeys(self.amplitudes, 0.0))


def start_state(scene: Scene, **changes: Any) -> AppState:
    start = {key: scene.errors.amplitude(key) for key in scene.parameter_keys}
    at = scene.workspace.positions
    positions = {axis: at.get(axis, 0.0) for axis in position_spans(scene)}
    part, notes = PartLook.of_scene(scene)
    state = AppState(
        scene,
        start,
        positions,
        start,
        scene.exaggeration,
        loop=start_loop(scene),
        placed=scene.placed,
        specification=Specification(START_UM if scene.limit_um is None else scene.limit_um),
        tolerances=scene.tolerances,
        review=scene.review,
        part=part,
        look=Look() if part.is_empty else Look(surface="grid"),
        forms={"program.tcp": scene.part.tcp} if scene.part.tcp else {},
        notes=notes,
    )
    return replace(state, **changes)


def start_loop(scene: Scene) -> Loop:
    """Choose the loop a scene is first shown through.

    The tool loop; the relative one where only axes that carry the workpiece have errors, since the
    tool point then has none.
    """
    axes = {parameter(key).axis for key in scene.parameter_keys if scene.errors.amplitude(key)}
    return Loop.RELATIVE if axes and axes.isdisjoint(scene.machine.chain.tool) else Loop.TOOL
