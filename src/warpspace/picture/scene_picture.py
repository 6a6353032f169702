"""The picture of a scene as figures, exports and reports draw it, with what it says of itself."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from warpspace.analysis.concepts import Concept, expected_um, zero_field
from warpspace.analysis.statistics import Statistics, volume_statistics
from warpspace.field.evaluate import View, placed_words, second_order_words
from warpspace.field.grid import DEFAULT_NODES, build_grid
from warpspace.geometry.colour import ColourScale
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.picture.model import (
    Exaggeration,
    Picture,
    choose_exaggeration,
    coloured_values,
    picture_size_mm,
)
from warpspace.picture.traces import TraceLines, evaluate_traces
from warpspace.picture.words import direction_words
from warpspace.resources import __version__
from warpspace.scene.model import Scene, choose_view, evaluate, second_order
from warpspace.scene.save import scene_to_toml
from warpspace.units import Array


@dataclass(frozen=True, kw_only=True)
class ScenePicture(Picture):
    """A scene evaluated over its grid."""

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
    placement = {} if view.placed_over is None else {"placement": "fitted out"}
    return {
        "scene": scene.name,
        "loop": str(view.loop),
        **placement,
        "reference": "absolute"
        if held is None
        else " ".join(f"{axis}={at:g}" for axis, at in held.items()),
        "component_errors": _one_text(scene.model.convention_value),
        "model": "exact chain" if exact else "first order",
        "program": f"warpspace {__version__}",
    }


def _one_text(value: str | dict[str, str]) -> str:
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
    """Evaluate all that a picture of a scene is drawn from."""
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
        conditions=(
            *direction_words(scene),
            *placed_words(view),
            *second_order_words(second_order(scene, loop)),
            *conditions,
        ),
        scene=scene,
    )


@dataclass(frozen=True, kw_only=True)
class ConceptPicture(ScenePicture):
    """A nominal volume with the RMS of |E| of machines within tolerance."""

    concept: Concept
    expected_um: Array  # [nx, ny, nz]

    @cached_property
    def values(self) -> Array:
        """What is coloured at each node, [nx, ny, nz], µm."""
        return self.expected_um

    @cached_property
    def statistics(self) -> Statistics:
        """Statistics of the RMS of |E| of machines within tolerance over the volume."""
        along = np.stack([self.expected_um, *[np.zeros_like(self.expected_um)] * 2], axis=-1)
        return volume_statistics(replace(self.field, error_um=along), self.grid)


def picture_concept(concept: Concept, nodes: int) -> ConceptPicture:
    """Evaluate the expected error of a concept over its working volume."""
    scene = concept.scene
    grid = build_grid(scene.model, scene.workspace, nodes)
    return ConceptPicture(
        view=concept.sampled.view,
        grid=grid,
        field=zero_field(grid),
        exaggeration=1.0,
        scene=scene,
        concept=concept,
        expected_um=expected_um(concept, grid),
    )
