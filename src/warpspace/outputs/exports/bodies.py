"""The schematic bodies of a machine where they are drawn, bent by its errors."""

from collections.abc import Iterator

from warpspace.bodies.placed import Body, load_bodies, place_points, view_motions
from warpspace.field.evaluate import View
from warpspace.scene.model import Scene
from warpspace.units import Array


def drawn_bodies(
    scene: Scene, view: View, exaggeration: float
) -> Iterator[tuple[Body, Array, Array]]:
    """Place the bodies of a scene's machine, axes at their place in the scene.

    Parameters
    ----------
    scene : Scene
    view : View
    exaggeration : float
        Display factor of the small motions.

    Yields
    ------
    body : Body
    drawn_mm : ndarray, [V, 3], mm
        Vertices in R, where they are drawn.
    nominal_mm : ndarray, [V, 3], mm
    """
    amplitudes = {key: scene.errors.amplitude(key) for key in scene.errors}
    positions = {name: scene.workspace.positions.get(name, 0.0) for name in scene.machine.axes}
    motions = view_motions(scene.model, scene.errors, amplitudes, positions, view)
    for body in load_bodies(scene.machine):
        motion = motions[body.frame]
        yield (
            body,
            place_points(motion, body.vertices_mm, exaggeration),
            place_points(motion, body.vertices_mm, 0.0),
        )
