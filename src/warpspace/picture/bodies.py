"""The bodies of a machine where they are drawn, moved by its axes and bent by its errors."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property

from warpspace.bodies.placed import Body, load_bodies, place_points, view_motions
from warpspace.field.evaluate import View
from warpspace.kinematics.bodies import BodyMotion
from warpspace.scene.model import Scene
from warpspace.units import Array


@dataclass(frozen=True)
class PlacedBody:
    """One body of a machine.

    Attributes
    ----------
    body : Body
        Its mesh in the frame it rides on.
    motion : BodyMotion
        Nominal place of that frame, and its small motion.
    exaggeration : float
        Display factor of the small motion.
    """

    body: Body
    motion: BodyMotion
    exaggeration: float

    @property
    def label(self) -> str:
        """Name for people, for instance ``X saddle``."""
        frame, _, what = self.body.name.partition("_")
        name = what if frame in ("R", "S", "t") else f"{frame} {what}"
        return name.replace("_", " ")

    @cached_property
    def vertices_mm(self) -> Array:
        """Vertices where they are drawn, [V, 3], mm in R."""
        return place_points(self.motion, self.body.vertices_mm, self.exaggeration)

    @cached_property
    def nominal_mm(self) -> Array:
        """Vertices where they nominally are, [V, 3], mm in R."""
        return place_points(self.motion, self.body.vertices_mm, 0.0)

    @cached_property
    def edges_mm(self) -> Array:
        """Edges where they are drawn, [E, 2, 3], mm in R."""
        return place_points(self.motion, self.body.edges_mm, self.exaggeration)

    @cached_property
    def nominal_edges_mm(self) -> Array:
        """Edges where they nominally are, [E, 2, 3], mm in R."""
        return place_points(self.motion, self.body.edges_mm, 0.0)


def scene_motions(
    scene: Scene,
    view: View,
    *,
    amplitudes: Mapping[str, float] | None = None,
    positions: Mapping[str, float] | None = None,
) -> dict[str, BodyMotion]:
    """Find place and small motion of every frame of a scene's machine.

    Parameters
    ----------
    scene : Scene
    view : View
        Loop and reference; the bodies then agree with its deformed grid.
    amplitudes : mapping of str to float, µm or µrad, optional
        Instead of the scene's own.
    positions : mapping of str to float, mm or degrees, optional
        Where axes stand; those not given as in the scene's workspace.

    Returns
    -------
    dict of str to BodyMotion
        By frame.
    """
    if amplitudes is None:
        amplitudes = {key: scene.errors.amplitude(key) for key in scene.errors}
    known = {**scene.workspace.positions, **(positions or {})}
    stands = {name: known.get(name, 0.0) for name in scene.machine.axes}
    return view_motions(scene.model, scene.errors, amplitudes, stands, view)


def place_bodies(
    scene: Scene,
    motions: Mapping[str, BodyMotion],
    exaggeration: float,
    only: Collection[str] | None = None,
) -> tuple[PlacedBody, ...]:
    """Place the bodies of a scene's machine.

    Parameters
    ----------
    scene : Scene
    motions : mapping of str to BodyMotion
        As `scene_motions` gives them.
    exaggeration : float
        Display factor of the small motions.
    only : collection of str, optional
        Frames to take; all by default.

    Returns
    -------
    tuple of PlacedBody
        Empty where the machine has none.
    """
    return tuple(
        PlacedBody(body, motions[body.frame], exaggeration)
        for body in load_bodies(scene.machine)
        if only is None or body.frame in only
    )
