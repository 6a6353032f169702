"""What a session shows, as one frozen value. Every change of it is a pure function.

Whatever comes from a browser passes through the methods here: they bring numbers into their range,
keep the old value in place of what is none, and note in `AppState.notes` what they changed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from warpspace.app.state.comparison import Comparison
from warpspace.app.state.leaf import described, error_names, said
from warpspace.app.state.look import Look, MachineLook, RotaryLook
from warpspace.app.state.page_look import PageLook
from warpspace.app.state.picked import Picked
from warpspace.app.state.ranges import Exclusions, Span, position_spans
from warpspace.app.state.specification import Specification
from warpspace.field.evaluate import View
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.machine.errors import ErrorFunction, ErrorSet, ToleranceSet
from warpspace.machine.limits import EXAGGERATION as FACTORS
from warpspace.machine.limits import LIVE_NODES, MAX_ERROR
from warpspace.scene.model import Scene

if TYPE_CHECKING:
    from warpspace.formats.compensation.controller import Controller

AMPLITUDE = Span(-MAX_ERROR, MAX_ERROR, 0.1)
NODES = Span(*LIVE_NODES, 2.0)  # grid nodes per axis: odd numbers
EXAGGERATION = Span(*FACTORS, 1.0)
START_NODES = 21
COMPONENT_NAMES = {
    "position": {"norm": "|E| length", "x": "E_x", "y": "E_y", "z": "E_z"},
    "orientation": {
        "norm": "|φ| tilt of the tool axis",
        "x": "φ_x tilt about x",
        "y": "φ_y tilt about y",
        "z": "φ_z tilt about z",
    },
}
"""What the components are called, for each quantity that can be coloured."""
LOOP_NAMES = {
    Loop.TOOL.value: "tool point",
    Loop.WORKPIECE.value: "workpiece point",
    Loop.RELATIVE.value: "tool relative to workpiece",
}


@dataclass(frozen=True, slots=True)
class Shown:
    """What is drawn beside the bent box."""

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
class AppState:
    """All that a picture depends on."""

    # machine, curves of the errors, working volume; its amplitudes are where reset goes
    scene: Scene = field(metadata=said("Scene"))
    # µm or µrad; amplitude of every parameter of the scene
    amplitudes: Mapping[str, float] = field(
        metadata=said(
            "Errors",
            kind="number",
            each=lambda state: dict.fromkeys(state.amplitudes, AMPLITUDE),
            linked="{key}",
            path="errors",
        )
    )
    # degrees; where the rotary axes stand
    positions: Mapping[str, float] = field(
        metadata=said(
            "Rotary positions",
            kind="number",
            one="Position of {}",
            each=lambda state: state.position_spans,
            linked="{key}",
            hint="Position while the working volume is evaluated.",
        )
    )
    start: Mapping[str, float]  # µm or µrad; amplitudes that reset goes back to: the scene's
    # None chooses a round one
    exaggeration: float | None = described(
        None,
        "Exaggeration",
        choices={"auto": "auto"},
        kind="number",
        span=EXAGGERATION,
        hint="How much larger than true the errors are drawn.",
    )
    component: str = described(
        "norm",
        "Component",
        choices=lambda state: COMPONENT_NAMES[state.look.quantity],
        hint="What the colours mean: the length or one signed component of the quantity.",
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
    shown: Shown = field(default_factory=Shown)
    # parameters that do not take part, or alone do
    exclusions: Exclusions = field(default_factory=Exclusions)
    # what machines are sampled from: the scene's, as far as they have not been moved
    tolerances: ToleranceSet = field(
        default_factory=ToleranceSet,
        metadata=said(
            "Tolerances",
            kind="number",
            one="Tolerance of {}",
            each=lambda state: dict.fromkeys(state.amplitudes),
            linked="",
            hint="Half width of the tolerance; 0 holds the error at its centre.",
        ),
    )
    # what the tolerances are held against
    specification: Specification = field(default_factory=Specification)
    # the scene as it was opened, where curves of `scene` have been edited since
    loaded: Scene | None = field(default=None, metadata=said("Scene"))
    # title of the scene whose errors a machine chosen from the library left behind; empty for none,
    # and after the next change of scene
    left_behind: str = field(default="", metadata=said("Scene"))
    # MachineLook, RotaryLook; what is shown of the field and of the schematic machine, and traced
    look: Look = field(default_factory=Look)
    machine: MachineLook = field(default_factory=MachineLook)
    rotary: RotaryLook = field(default_factory=RotaryLook)
    # the point whose error is explained
    picked: Picked | None = field(default=None, metadata=said("Point"))
    lever: str = described(
        "",
        "Lever",
        choices=lambda state: {"": "none", **error_names(state)},
        hint="The error whose axis and lever are drawn.",
    )
    # what is compared
    comparison: "Comparison[AppState]" = field(
        default_factory=Comparison[Any], metadata=said("Comparison")
    )
    # whose table corrects the machine that is drawn; never saved or linked
    controller: "Controller | None" = field(default=None, metadata=said("Table of compensation"))
    # what of the page is open, and what its forms were told (`state/forms.py`); undo leaves both
    page: PageLook = field(default_factory=PageLook, compare=False)
    forms: Mapping[str, str] = field(default_factory=dict[str, str], compare=False)
    notes: tuple[str, ...] = ()  # what the latest change had to clamp

    @property
    def position_spans(self) -> Mapping[str, Span]:
        """Ranges of the positions of the rotary axes, degrees."""
        return position_spans(self.scene)

    @property
    def origin(self) -> Scene:
        """The scene as it was opened: where reset goes, and what it is known by."""
        return self.loaded or self.scene

    @property
    def own_curves(self) -> Mapping[str, ErrorFunction]:
        """The curves of the scene as it was opened, over the present working volume."""
        own, present = self.origin, self.scene
        if own.workspace == present.workspace and own.machine.axes == present.machine.axes:
            return own.errors.functions
        found: dict[str, ErrorFunction] = {}
        for key, function in own.errors.functions.items():
            if parameter(key).axis in present.machine.axes:
                span = present.axis_span(parameter(key).axis)
                found[key] = replace(function.for_span(span), span=span)
        return found

    @property
    def active(self) -> Mapping[str, float]:
        """Amplitudes that count, µm or µrad: those that are excluded are zero."""
        return self.exclusions.effective(self.amplitudes)

    @property
    def seen(self) -> tuple[Loop, bool]:
        """The loop, and whether the placement of the workpiece is left out: a key to keep by."""
        return self.loop, self.placed and self.loop is Loop.RELATIVE

    def view(self, loop: Loop | None = None) -> View:
        """Give the view through a loop, the present one by default, at the present positions."""
        workspace = self.scene.workspace.moved(self.positions)
        scene = replace(self.scene, placed=self.placed, workspace=workspace)
        return scene.view(loop or self.loop)

    def with_amplitude(self, key: str, value: float) -> "AppState":
        """Set the amplitude of one parameter, µm or µrad, as far as the model holds."""
        if key not in self.amplitudes:
            return self._noted(f"{key}: no parameter of this machine")
        row = parameter(key)
        kept, noted = self._clamped(value, self.amplitudes[key], AMPLITUDE, key, row.unit)
        return replace(noted, amplitudes={**self.amplitudes, key: kept})

    def with_position(self, axis: str, value: float) -> "AppState":
        """Set the position of one rotary axis, degrees, within its travel."""
        if axis not in self.positions:
            return self._noted(f"{axis}: no rotary axis of this machine")
        span = self.position_spans[axis]
        kept, noted = self._clamped(value, self.positions[axis], span, axis, "°")
        return replace(noted, positions={**self.positions, axis: kept})

    def with_scene(self, scene: Scene) -> "AppState":
        """Show another scene, in its own loop; component, density and switches stay."""
        fresh = start_state(scene)
        return replace(
            fresh,
            component=self.component,
            nodes=self.nodes,
            shown=self.shown,
            exaggeration=fresh.exaggeration,
            specification=self.specification if scene.limit_um is None else fresh.specification,
            look=self.look,
            machine=self.machine,
            rotary=replace(self.rotary, off=frozenset()),
            forms=self.forms,
            page=self.page,
        )

    def reset(self) -> "AppState":
        """Give all errors the scene's values and curves again."""
        changed = replace(self.scene, errors=ErrorSet(self.own_curves))
        # the same object where it is the same scene
        scene = next((one for one in (self.origin, self.scene) if one == changed), changed)
        loaded = None if scene is self.origin else self.loaded
        return replace(self, amplitudes=self.start, scene=scene, loaded=loaded)

    def zeroed(self) -> "AppState":
        """Set all errors to zero."""
        return replace(self, amplitudes=dict.fromkeys(self.amplitudes, 0.0))

    def without_notes(self) -> "AppState":
        """Forget what was clamped."""
        return replace(self, notes=()) if self.notes else self

    @property
    def changed_keys(self) -> tuple[str, ...]:
        """Parameters that differ from the scene's values."""
        return tuple(key for key, value in self.amplitudes.items() if value != self.start[key])

    def _noted(self, note: str) -> "AppState":
        return replace(self, notes=(*self.notes, note))

    def _clamped(
        self, value: float, fallback: float, span: Span, what: str, unit: str
    ) -> tuple[float, "AppState"]:
        kept = span.clamp(value, fallback)
        if kept == value:
            return kept, self
        return kept, self._noted(span.clamped_words(value, kept, what, unit))


def start_state(scene: Scene, **changes: Any) -> AppState:
    """Build the state a scene is first shown in."""
    start = {key: scene.errors.amplitude(key) for key in scene.parameter_keys}
    at = scene.workspace.positions
    positions = {axis: at.get(axis, 0.0) for axis in position_spans(scene)}
    state = AppState(
        scene,
        start,
        positions,
        start,
        scene.exaggeration,
        loop=start_loop(scene),
        placed=scene.placed,
        specification=start_specification(scene),
        tolerances=scene.tolerances,
    )
    return replace(state, **changes)


def start_specification(scene: Scene) -> Specification:
    """Give what a design is held against: the limit of the scene, where it has one."""
    return Specification() if scene.limit_um is None else Specification(scene.limit_um)


def start_loop(scene: Scene) -> Loop:
    """Choose the loop a scene is first shown through.

    The tool loop; the relative one where only axes that carry the workpiece have errors, since the
    tool point then has none.
    """
    axes = {parameter(key).axis for key in scene.parameter_keys if scene.errors.amplitude(key)}
    return Loop.RELATIVE if axes and axes.isdisjoint(scene.machine.chain.tool) else Loop.TOOL
