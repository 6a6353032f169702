"""The layer around the box: surroundings, and the machine, which the player moves."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from viser import ClientHandle
from viser.transforms import SO3

from warpspace.app.browser.page import Page
from warpspace.app.drawing.around import GIZMO, draw_surroundings, program_point, turned_points
from warpspace.app.drawing.colours import Rgb, colour
from warpspace.app.drawing.player import PROGRAM, Player
from warpspace.app.drawing.shapes import SCENE_PER_MM, Nodes, SceneNode, Shapes, ball, lines, mesh
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine_bodies import (
    drawn_bodies,
    tool_point,
)
from warpspace.app.evaluation.scene_overlays import moved_place
from warpspace.app.state.leaf import Identity
from warpspace.bodies.placed import PlacedBody
from warpspace.kinematics import transforms

BALL = 0.010  # marker of the tool point, relative to the longest edge
OPACITY = 0.045
GIZMO_SIZE = 0.3  # relative to the longest edge


def machine(picture: LivePicture, turned: Mapping[str, float]) -> Shapes:
    """Draw the bodies at the positions of the machine, deformed by its errors.

    `turned` overrides positions, degrees or mm; a turned table is drawn also where the machine is
    hidden.
    """
    is_shown, shapes = picture.state.machine.shown, dict[str, SceneNode | None]()
    if is_shown or turned or picture.is_rotary:
        edge = colour(picture, "body_edge")
        for part in drawn_bodies(picture, turned):
            shapes |= _body("/machine", part, part.body.colour, edge)
    if is_shown and not picture.is_rotary:
        at, size = tool_point(picture)[0], BALL * picture.size_mm
        shapes["/machine/tool_point"] = ball(at, size, colour(picture, "edge"))
    return shapes


def ghost_machine(picture: LivePicture) -> Shapes:
    rgb, edge = (colour(picture, name) for name in ("ghost_body", "ghost_body_edge"))
    shapes: dict[str, SceneNode | None] = {}
    for part in drawn_bodies(picture, nominal=True):
        shapes |= _body("/ghost_machine", part, rgb, edge, opacity=OPACITY)
    return shapes


def _body(root: str, part: PlacedBody, rgb: Rgb, edge: Rgb, **options: object) -> Shapes:
    name, triangles = f"{root}/{part.body.name}", part.body.triangles
    return {
        name: mesh(part.vertices_mm, triangles, rgb, flat_shading=True, **options),
        f"{name}_edges": lines(part.edges_mm, edge, 0.9),
    }


class MovingLayer:
    """Everything around the box, with the machine where the player moves it."""

    def __init__(
        self, client: ClientHandle, page: Page, picture: LivePicture, player: Player
    ) -> None:
        self._client, self._player = client, player
        self._picture = picture
        self._around = Nodes(client.scene, page)
        self._ghost, self._moved = Nodes(client.scene), Nodes(client.scene)
        self._ghost_of: object = None
        self.clamp: Callable[[str], None] = lambda _place: None  # called after a drag
        self._drawn_at: object = None  # positions of the player
        player.followers["machine"] = self._follow
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        self._picture = picture
        self._around.draw({**self._gizmo(picture), **draw_surroundings(picture)})
        self._draw_ghost(picture)
        self._draw_moved()

    def _gizmo(self, picture: LivePicture) -> Shapes:
        if picture.part is None or not picture.state.part.moved:
            return {}
        part, size = picture.part, GIZMO_SIZE * picture.size_mm * SCENE_PER_MM
        stays = {"scale": size, "depth_test": False, "disable_sliders": True}
        at = transforms.apply(part.pose, part.of.middle_mm) * SCENE_PER_MM
        follows = {"position": at, "wxyz": SO3.from_matrix(part.pose[:3, :3]).wxyz}
        return {GIZMO: SceneNode("add_transform_controls", stays, follows, self._drag)}

    def _drag(self, event: Any) -> None:
        """Place the part at the end of a drag; called by viser in a thread of its own."""
        if event.phase == "end" and self._picture.part is not None:
            part, turn = self._picture.part, np.asarray(SO3(event.target.wxyz).as_matrix(), float)
            at = transforms.rigid(turn, event.target.position / SCENE_PER_MM)
            place = moved_place(part.of, transforms.inverse(part.pose) @ at)
            self.clamp(",".join(map(repr, place)))

    def _draw_ghost(self, picture: LivePicture) -> None:
        state = picture.state
        on = state.machine.ghost and not state.machine.shown and not picture.is_rotary
        of = on and (
            Identity(state.scene), state.view_key, state.shown.dark, state.shows_rotary,
            Identity(state.machine.linear_mm), Identity(state.positions),
        )  # fmt: skip
        if of != self._ghost_of:
            self._ghost_of = of
            self._ghost.draw(ghost_machine(picture) if on else {})

    def _positions(self) -> tuple[dict[str, float], int | None]:
        """Return the positions that the player has moved, and its sample of the program."""
        path, sample = self._picture.path, self._player.step_of(PROGRAM)
        if path is None or sample is None:
            return self._player.angles_deg, None
        sample = min(sample, len(path.of.line) - 1)
        return path.of.axes_at(sample), sample

    def _follow(self) -> None:
        if self._drawn_at != self._positions():
            with self._client.atomic():
                self._draw_moved()

    def _draw_moved(self) -> None:
        picture, (positions, sample) = self._picture, self._positions()
        self._drawn_at = positions, sample
        if sample is None:
            shapes = turned_points(picture, positions)
        else:
            shapes = program_point(picture, sample)
        self._moved.draw({**shapes, **machine(picture, positions)})
