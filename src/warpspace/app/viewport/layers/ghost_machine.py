"""The machine as a ghost around its working volume: it tells what the box is a part of."""

from viser import SceneApi

from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine import nominal_bodies
from warpspace.app.viewport.layers.body_meshes import BodyMeshes, DrawnBody
from warpspace.app.viewport.tone_map import Rgb

OPACITY = 0.12
GHOST, DARK_GHOST = (120, 132, 150), (150, 160, 176)
EDGE: Rgb = (190, 196, 206)
DARK_EDGE: Rgb = (78, 85, 96)


class GhostMachineLayer:
    """Bodies of the nominal machine, nearly transparent; not beside the machine itself.

    Parameters
    ----------
    scene : viser.SceneApi
    picture : LivePicture
    """

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._bodies = BodyMeshes(scene, "/ghost_machine", edge_px=0.8, opacity=OPACITY)
        self._drawn_for: tuple[object, ...] = ()
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Follow the machine and its axes; errors do not move a ghost."""
        state = picture.state
        on = state.machine.ghost and not state.machine.shown
        drawn_for = (
            Identity(state.scene),
            state.loop,
            state.shown.dark,
            Identity(state.machine.linear_mm),
            Identity(state.positions),
        )
        if not on:
            self._bodies.draw((), EDGE)
            self._drawn_for = ()
        elif drawn_for != self._drawn_for:
            self._drawn_for = drawn_for
            dark = state.shown.dark
            colour = DARK_GHOST if dark else GHOST
            bodies = [
                DrawnBody(
                    part.body.name,
                    part.nominal_mm,
                    part.nominal_edges_mm,
                    part.body.triangles,
                    colour,
                )
                for part in nominal_bodies(picture)
            ]
            self._bodies.draw(bodies, DARK_EDGE if dark else EDGE)
