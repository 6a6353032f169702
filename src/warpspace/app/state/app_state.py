"""What a session shows, as one frozen value. Every change of it is a pure function.

Whatever comes from a browser passes through the methods here: they bring numbers into their range,
keep the old value in place of what is none, and note in `AppState.notes` what they changed.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from warpspace.app.state.bench import BenchLook
from warpspace.app.state.comparison import Comparison
from warpspace.app.state.look import Look, MachineLook, RotaryLook
from warpspace.app.state.picked import Picked
from warpspace.app.state.ranges import Exclusions, Span, amplitude_spans, position_spans
from warpspace.app.state.specification import Specification
from warpspace.field.evaluate import View
from warpspace.geometry.colour import COMPONENTS
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.machine.errors import ErrorFunction, ErrorSet, ToleranceSet
from warpspace.machine.limits import EXAGGERATION as FACTORS
from warpspace.machine.limits import LIVE_NODES
from warpspace.scene.model import Scene

if TYPE_CHECKING:
    from warpspace.formats.compensation.controller import Controller

NODES = Span(*LIVE_NODES, 2.0)  # grid nodes per axis: odd numbers
EXAGGERATION = Span(*FACTORS, 1.0)
TRUE_SCALE = 1.0
START_NODES = 21


@dataclass(frozen=True, slots=True)
class Shown:
    """What is drawn beside the bent box."""

    traces: bool = True
    ghost: bool = True
    grid_lines: bool = True
    axes: bool = True
    dark: bool = False


@dataclass(frozen=True, slots=True)
class AppState:
    """All that a picture depends on."""

    # machine, curves of the errors, working volume; its amplitudes are where reset goes
    scene: Scene
    amplitudes: Mapping[str, float]  # µm or µrad; amplitude of every parameter of the scene
    positions: Mapping[str, float]  # degrees; where the rotary axes stand
    start: Mapping[str, float]  # µm or µrad; amplitudes that reset goes back to: the scene's
    spans: Mapping[str, Span]  # ranges of the amplitudes and of the positions
    position_spans: Mapping[str, Span]
    exaggeration: float | None = None  # display factor; None chooses a round one
    component: str = "norm"  # what is coloured: norm, x, y or z
    loop: Loop = Loop.TOOL
    # whether the placement of the workpiece is fitted out of the relative loop
    placed: bool = False
    nodes: int = START_NODES  # grid nodes per axis
    shown: Shown = field(default_factory=Shown)
    # parameters that do not take part, or alone do
    exclusions: Exclusions = field(default_factory=Exclusions)
    # what machines are sampled from: the scene's, as far as they have not been moved
    tolerances: ToleranceSet = field(default_factory=ToleranceSet)
    # what the tolerances are held against
    specification: Specification = field(default_factory=Specification)
    # the scene as it was opened, where curves of `scene` have been edited since
    loaded: Scene | None = None
    # title of the scene whose errors a machine chosen from the library left behind; empty for none,
    # and after the next change of scene
    left_behind: str = ""
    # MachineLook, RotaryLook, BenchLook; what is shown of the field and of the schematic machine,
    # traced, and run as a test
    look: Look = field(default_factory=Look)
    machine: MachineLook = field(default_factory=MachineLook)
    rotary: RotaryLook = field(default_factory=RotaryLook)
    bench: BenchLook = field(default_factory=BenchLook)
    picked: Picked | None = None  # the point whose error is explained
    lever: str = ""  # key of the contribution whose axis and lever are drawn; empty for none
    comparison: "Comparison[AppState]" = field(default_factory=Comparison[Any])  # what is compared
    # whose table corrects the machine that is drawn; never saved or linked
    controller: "Controller | None" = None
    # key of the error whose curve is shown: chosen, or the one moved last; empty for none yet. It
    # counts in no comparison of states, and undo leaves it.
    chosen_error: str = field(default="", compare=False)
    notes: tuple[str, ...] = ()  # what the latest change had to clamp

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
        """Set the amplitude of one parameter, µm or µrad, within its slider's range."""
        if key not in self.amplitudes:
            return self._noted(f"{key}: no parameter of this machine")
        row = parameter(key)
        span = self.spans[key]
        kept, noted = self._clamped(value, self.amplitudes[key], span, key, row.unit)
        return replace(noted, amplitudes={**self.amplitudes, key: kept})

    def with_position(self, axis: str, value: float) -> "AppState":
        """Set the position of one rotary axis, degrees, within its travel."""
        if axis not in self.positions:
            return self._noted(f"{axis}: no rotary axis of this machine")
        span = self.position_spans[axis]
        kept, noted = self._clamped(value, self.positions[axis], span, axis, "°")
        return replace(noted, positions={**self.positions, axis: kept})

    def with_exaggeration(self, value: float | None) -> "AppState":
        """Set the display factor; None chooses a round one."""
        if value is None:
            return replace(self, exaggeration=None)
        if math.isnan(value):
            return self._noted("exaggeration = nan; expected a number, it stays as it was")
        kept, noted = self._clamped(value, value, EXAGGERATION, "exaggeration", "")
        return replace(noted, exaggeration=kept)

    def with_nodes(self, value: float) -> "AppState":
        """Set the grid density: the odd number of nodes nearest to a value."""
        kept, noted = self._clamped(value, self.nodes, NODES, "grid", "nodes")
        return replace(noted, nodes=min(2 * int(kept // 2) + 1, int(NODES.high)))

    def with_component(self, component: str) -> "AppState":
        """Choose what is coloured."""
        if component not in COMPONENTS:
            return self._noted(f"component: expected one of {', '.join(COMPONENTS)}")
        return replace(self, component=component)

    def with_loop(self, loop: str) -> "AppState":
        """Choose the structural loop."""
        if loop not in [*Loop]:
            return self._noted(f"loop: expected one of {', '.join(Loop)}")
        return replace(self, loop=Loop(loop))

    def with_chosen_error(self, key: str) -> "AppState":
        """Choose the error whose curve is shown; what is no key of this machine changes nothing."""
        if key not in self.amplitudes or key == self.chosen_error:
            return self
        return replace(self, chosen_error=key)

    def with_shown(self, **changes: bool) -> "AppState":
        """Switch what is drawn beside the box."""
        return replace(self, shown=replace(self.shown, **changes))

    def with_scene(self, scene: Scene) -> "AppState":
        """Show another scene, in its own loop; component, density and switches stay."""
        fresh = start_state(scene)
        return replace(
            fresh,
            component=self.component,
            nodes=self.nodes,
            shown=self.shown,
            exaggeration=fresh.exaggeration,
            specification=self.specification,
            look=self.look,
            machine=self.machine,
            rotary=replace(self.rotary, off=frozenset()),
            bench=self.bench,
            chosen_error=self.chosen_error,
        )

    def reset(self, axis: str | None = None) -> "AppState":
        """Give the errors of one axis, or of all, the scene's values and curves again."""
        chosen = {k: v for k, v in self.start.items() if axis is None or parameter(k).axis == axis}
        own, present = self.own_curves, self.scene.errors.functions
        curves = {key: function for key, function in present.items() if key not in chosen}
        curves |= {key: function for key, function in own.items() if key in chosen}
        scene = self.scene
        if curves != scene.errors.functions:
            scene = replace(scene, errors=ErrorSet(curves))
        if scene == self.origin:
            scene = self.origin
        loaded = None if scene is self.origin else self.loaded
        return replace(self, amplitudes={**self.amplitudes, **chosen}, scene=scene, loaded=loaded)

    def zeroed(self, axis: str | None = None) -> "AppState":
        """Set the errors of one axis, or of all, to zero."""
        chosen = {k: 0.0 for k in self.amplitudes if axis is None or parameter(k).axis == axis}
        return replace(self, amplitudes={**self.amplitudes, **chosen})

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
        given = f"{value:g}" if math.isfinite(value) else str(value)
        allowed = f"{span.low:g} to {span.high:g} {unit}".rstrip()
        shown = f"{kept:g} {unit}".rstrip()
        return kept, self._noted(f"{what} = {given} is outside {allowed}; clamped to {shown}")


def start_state(scene: Scene, **changes: Any) -> AppState:
    """Build the state a scene is first shown in."""
    start = {key: scene.errors.amplitude(key) for key in scene.parameter_keys}
    at = scene.workspace.positions
    ranges = position_spans(scene)
    positions = {axis: at.get(axis, 0.0) for axis in ranges}
    state = AppState(
        scene,
        start,
        positions,
        start,
        amplitude_spans(scene),
        ranges,
        scene.exaggeration,
        loop=start_loop(scene),
        placed=scene.placed,
        tolerances=scene.tolerances,
    )
    return replace(state, **changes)


def start_loop(scene: Scene) -> Loop:
    """Choose the loop a scene is first shown through.

    The tool loop; the relative one where only axes that carry the workpiece have errors, since the
    tool point then has none.
    """
    axes = {parameter(key).axis for key in scene.parameter_keys if scene.errors.amplitude(key)}
    return Loop.RELATIVE if axes and axes.isdisjoint(scene.machine.chain.tool) else Loop.TOOL
