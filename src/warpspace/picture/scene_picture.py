"""The picture of a scene as figures, exports and reports draw it, with what it says of itself."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

from warpspace import __version__
from warpspace.field.evaluate import View
from warpspace.field.grid import DEFAULT_NODES, build_grid
from warpspace.geometry.colour import ColourScale
from warpspace.kinematics.model import Loop
from warpspace.machine.parameters import parameter
from warpspace.picture.exaggeration import Exaggeration, choose_exaggeration
from warpspace.picture.model import Picture, coloured_values
from warpspace.picture.size import picture_size_mm
from warpspace.picture.traces import TraceLines, evaluate_traces
from warpspace.picture.words import direction_words
from warpspace.scene.model import Scene
from warpspace.scene.pipeline import choose_view, evaluate
from warpspace.scene.save import scene_to_toml


@dataclass(frozen=True, kw_only=True)
class ScenePicture(Picture):
    """A scene evaluated over its grid.

    Attributes
    ----------
    scene : Scene
    """

    scene: Scene

    @cached_property
    def size_mm(self) -> float:
        """Length that marks are sized by, mm, for a single point too."""
        return picture_size_mm(self.scene, self.grid)

    @cached_property
    def traces(self) -> tuple[TraceLines, ...]:
        """Traces of the scene's points over the rotary axes."""
        return evaluate_traces(self.scene, self.exaggeration)

    @cached_property
    def settings(self) -> dict[str, Any]:
        """How the scene was looked at, fit for JSON."""
        reference = self.scene.reference
        return {
            "loop": str(self.view.loop),
            "reference": "absolute" if reference is None else dict(reference),
            "component_errors": self.scene.model.convention_value,
            "model": "first order",
            "nodes": list(self.grid.shape),
            "exaggeration": self.exaggeration,
            "component": self.component,
            "coloured": "tool-orientation error" if self.tilts else "position error",
            "conditions": list(self.conditions),
        }

    @property
    def remarks(self) -> dict[str, str]:
        """What a table says of every row: scene, loop, reference, convention and the like."""
        found = field_remarks(self.scene, self.view)
        program = found.pop("program")
        return {**found, "conditions": "; ".join(self.conditions), "program": program}

    @cached_property
    def provenance(self) -> dict[str, Any]:
        """Program, scene, settings, statistics and parameters, fit for JSON.

        The scene's own text is among it, so that a reader can rebuild the scene exactly.
        """
        scene = self.scene
        return {
            "program": f"warpspace {__version__}",
            "scene": scene.name,
            "title": scene.title,
            "machine": scene.machine.title,
            "chain": str(scene.machine.chain),
            "settings": self.settings,
            "statistics": asdict(self.statistics),
            "parameters": {
                key: {"amplitude": scene.errors.amplitude(key), "unit": parameter(key).unit}
                for key in scene.errors
                if scene.errors.amplitude(key) != 0.0
            },
            "scene_toml": scene_to_toml(scene),
        }


def field_remarks(scene: Scene, view: View, *, exact: bool = False) -> dict[str, str]:
    """Say what a field belongs to, in words: scene, loop, reference, convention, program."""
    held = view.reference
    return {
        "scene": scene.name,
        "loop": str(view.loop),
        "reference": "absolute"
        if held is None
        else " ".join(f"{axis}={at:g}" for axis, at in held.items()),
        "component_errors": _one_text(scene.model.convention_value),
        "model": "exact chain" if exact else "first order",
        "program": f"warpspace {__version__}",
    }


def _one_text(value: str | dict[str, str]) -> str:
    """Spell a value that may differ between axes in one text."""
    if isinstance(value, str):
        return value
    return " ".join(f"{axis}={name}" for axis, name in value.items())


def evaluate_picture(
    scene: Scene,
    *,
    grid: int = DEFAULT_NODES,
    loop: Loop | str = Loop.TOOL,
    exaggeration: Exaggeration = None,
    component: str = "norm",
    quantity: str = "position",
    colours: ColourScale | None = None,
    conditions: Sequence[str] = (),
) -> ScenePicture:
    """Evaluate all that a picture of a scene is drawn from.

    Parameters
    ----------
    scene : Scene
    grid : int, optional
        Nodes per axis.
    loop : Loop or str, optional
    exaggeration : float, "auto" or None, optional
        Display factor; by default what the scene says.
    component : str, optional
        What the colours show: "norm", "x", "y" or "z" ...
    quantity : str, optional
        ... of the "position" or the "orientation" error.
    colours : ColourScale, optional
        The colours where they are given.
    conditions : sequence of str, optional
        What every output must say of the picture beside its scene.

    Returns
    -------
    ScenePicture

    Raises
    ------
    OptionError
        If one of the choices does not exist or is out of range.
    """
    view = choose_view(scene, loop)
    nodes = build_grid(scene.model, scene.workspace, grid)
    field = evaluate(scene, grid=grid, loop=loop)
    coloured_values(field, component, quantity)  # refuses a component that does not exist
    largest = float(field.norm_um.max())
    return ScenePicture(
        view=view,
        grid=nodes,
        field=field,
        exaggeration=choose_exaggeration(
            exaggeration, scene.exaggeration, largest, picture_size_mm(scene, nodes)
        ),
        component=component,
        quantity=quantity,
        colours=colours,
        conditions=(*direction_words(scene), *conditions),
        scene=scene,
    )
