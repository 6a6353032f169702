"""What every export is written from: one evaluated scene, its display factor and its provenance."""

import math
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from warpspace import __version__
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import evaluate_first_order
from warpspace.field.grid import DEFAULT_NODES
from warpspace.geometry.colour import SYMBOLS, ColourScale, build_scale, component_values
from warpspace.geometry.deform import MAX_EXAGGERATION, auto_exaggeration, deform
from warpspace.geometry.traces import Trace, build_traces
from warpspace.kinematics.model import Loop
from warpspace.machine.parameters import parameter
from warpspace.scene.model import Scene
from warpspace.scene.pipeline import ScenePicture, evaluate_picture
from warpspace.scene.save import scene_to_toml
from warpspace.units import Array

Exaggeration = float | Literal["auto"] | None
"""A display factor, "auto" for a round one that suits the scene, None for what the scene says."""


@dataclass(frozen=True, slots=True)
class DrawnTrace:
    """One rotary trace, nominal and as displaced.

    Attributes
    ----------
    trace : Trace
        Which point is turned by which axis.
    loop : Loop
        Loop whose error displaces it.
    nominal_mm : ndarray, [n, 3], mm
    error_um : ndarray, [n, 3], µm
    """

    trace: Trace
    loop: Loop
    nominal_mm: Array
    error_um: Array


@dataclass(frozen=True)
class Drawing:
    """A scene evaluated for an export.

    Attributes
    ----------
    picture : ScenePicture
        Scene, grid, field, statistics and view.
    exaggeration : float
        Display factor of all displacements.
    component : str
        What the colours show: "norm", "x", "y" or "z".
    tilts : bool
        Whether that is of the tool-orientation error, not of the position error.
    colours : ColourScale or None
        The colours where they are given, for instance shared with other maps.
    """

    picture: ScenePicture
    exaggeration: float
    component: str = "norm"
    tilts: bool = False
    colours: ColourScale | None = None

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.picture.scene

    @property
    def deformed_mm(self) -> Array:
        """Where the nodes are drawn, [nx, ny, nz, 3], mm."""
        return deform(self.picture.grid.nominal_mm, self.picture.field.error_um, self.exaggeration)

    @cached_property
    def values(self) -> Array:
        """What the colours show at each node, [nx, ny, nz], µm or µrad."""
        field = self.picture.field
        return component_values(
            field.orientation_urad if self.tilts else field.error_um, self.component
        )

    @cached_property
    def scale(self) -> ColourScale:
        """Colour scale of the values."""
        if self.colours is not None:
            return self.colours
        symbol, unit = SYMBOLS["orientation" if self.tilts else "position"]
        largest = float(np.abs(self.values).max())
        return build_scale(largest, self.component, quantity=symbol, unit=unit)

    @cached_property
    def traces(self) -> tuple[DrawnTrace, ...]:
        """Traces of the scene's points over the rotary axes."""
        scene = self.scene
        drawn: list[DrawnTrace] = []
        groups = build_traces(scene.model, scene.trace_points_mm, scene.workspace.positions)
        for group in groups:
            view = scene.view(group.loop)
            error = evaluate_first_order(
                scene.model, scene.errors, group.coordinates, view, group.nominal_mm
            ).error_um
            drawn += [
                DrawnTrace(trace, group.loop, group.nominal_mm[index], error[index])
                for index, trace in enumerate(group.traces)
            ]
        return tuple(drawn)

    @cached_property
    def settings(self) -> dict[str, Any]:
        """How the scene was looked at, fit for JSON."""
        reference = self.scene.reference
        return {
            "loop": str(self.picture.view.loop),
            "reference": "absolute" if reference is None else dict(reference),
            "component_errors": str(self.scene.model.component_errors),
            "model": "first order",
            "nodes": list(self.picture.grid.shape),
            "exaggeration": self.exaggeration,
            "component": self.component,
            "coloured": "tool-orientation error" if self.tilts else "position error",
        }

    @property
    def remarks(self) -> dict[str, str]:
        """What a table says of every row: scene, loop, reference, convention, program."""
        held = self.scene.reference
        return {
            "scene": self.scene.name,
            "loop": str(self.picture.view.loop),
            "reference": "absolute"
            if held is None
            else " ".join(f"{axis}={at:g}" for axis, at in held.items()),
            "component_errors": str(self.scene.model.component_errors),
            "model": "first order",
            "program": f"warpspace {__version__}",
        }

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
            "statistics": asdict(self.picture.statistics),
            "parameters": {
                key: {"amplitude": scene.errors.amplitude(key), "unit": parameter(key).unit}
                for key in scene.errors
                if scene.errors.amplitude(key) != 0.0
            },
            "scene_toml": scene_to_toml(scene),
        }


def draw_scene(
    scene: Scene,
    *,
    exaggeration: Exaggeration = None,
    grid: int = DEFAULT_NODES,
    loop: Loop | str = Loop.TOOL,
    component: str = "norm",
) -> Drawing:
    """Evaluate a scene for an export.

    Parameters
    ----------
    scene : Scene
    exaggeration : float, "auto" or None, optional
        Display factor; by default what the scene says.
    grid : int, optional
        Nodes per axis.
    loop : Loop or str, optional
    component : str, optional
        What the colours show: "norm", "x", "y" or "z".

    Returns
    -------
    Drawing

    Raises
    ------
    OptionError
        If one of the choices does not exist or is out of range.
    """
    picture = evaluate_picture(scene, grid=grid, loop=loop)
    component_values(picture.field.error_um[:1, :1, :1], component)
    return Drawing(picture, choose_exaggeration(picture, exaggeration), component)


def choose_exaggeration(picture: ScenePicture, wanted: Exaggeration = None) -> float:
    """Choose the display factor of a picture.

    Parameters
    ----------
    picture : ScenePicture
    wanted : float, "auto" or None, optional
        None takes what the scene says.

    Returns
    -------
    float

    Raises
    ------
    OptionError
        If it is not a number above 0 and at most a million.
    """
    factor = picture.scene.exaggeration if wanted is None else wanted
    if factor is None or factor == "auto":
        return auto_exaggeration(picture.statistics.max_um, picture.grid.longest_edge_mm)
    if not math.isfinite(factor) or not 0.0 < factor <= MAX_EXAGGERATION:
        raise OptionError(
            f"exaggeration {factor:g}; expected auto or a number above 0, at most"
            f" {MAX_EXAGGERATION:,.0f}"
        )
    return float(factor)
