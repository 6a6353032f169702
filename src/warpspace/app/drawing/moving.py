"""The layer around the box: surroundings, and the machine, which the player moves."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from viser import ClientHandle
from viser.transforms import SO3

from warpspace.app.browser.page import Page
from warpspace.app.drawing.around import GIZMO, draw_surroundings, program_point, turned_points
from warpspace.app.drawing.colours import colour
from warpspace.app.drawing.player import PROGRAM, Player
from warpspace.app.drawing.shapes import SCENE_PER_MM, UNLIT, Nodes, SceneNode, Shapes, ball, lines
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine_bodies import drawn_bodies, tool_point
from warpspace.app.evaluation.scene_overlays import moved_place
from warpspace.app.state.leaf import Identity
from warpspace.bodies.gltf import GltfNode, Material, build_gltf
from warpspace.bodies.placed import PlacedBody
from warpspace.bodies.shading import ShadedSurface
from warpspace.geometry.colour import srgb_to_linear
from warpspace.geometry.surfaces import triangulate
from warpspace.kinematics import transforms
from warpspace.units import Array

SLOT = (70, 78, 90)  # colour of the slots of tables
BALL = 0.010  # marker of the tool point, relative to the longest edge
SHADOW, SHADOW_REACH, SHADOW_INSET = 0.3, 0.16, 0.25
"""Shadow of a machine: opacity, width of its rim relative to the machine, share of it inside."""
SHADOW_STEPS = 6
FOOT = 0.15  # share of the height of a machine that stands on the floor
GIZMO_SIZE = 0.3  # relative to the longest edge


def machine(picture: LivePicture, turned: Mapping[str, float]) -> Shapes:
    """Draw the bodies at the positions of the machine, deformed by its errors.

    `turned` overrides positions, degrees or mm; a turned table is drawn also where the machine is
    hidden.
    """
    is_shown, shapes = picture.state.machine.shown, dict[str, SceneNode | None]()
    if is_shown or turned or picture.is_rotary:
        parts = drawn_bodies(picture, turned)
        for part in parts:
            shapes[f"/machine/{part.body.name}"] = _solid(part.surface, part.pose.tobytes())
            if part.body.lines_mm is not None:
                slots = transforms.apply(part.pose, part.body.lines_mm)
                shapes[f"/machine/{part.body.name}_lines"] = lines(slots, SLOT, 1.2)
        if is_shown and not picture.is_rotary:
            at, size = tool_point(picture)[0], BALL * picture.size_mm
            shapes["/machine/tool_point"] = ball(at, size, colour(picture, "edge"))
            shapes["/machine/shadow"] = _shadow_alone(_footprint(parts))
    return shapes


def draw_machine(picture: LivePicture) -> Shapes:
    """Draw the machine as selected, solid or as its ghost, for a page without animation."""
    return {**machine(picture, {}), **(ghost_machine(picture) if has_ghost(picture) else {})}


def has_ghost(picture: LivePicture) -> bool:
    of = picture.state.machine
    return of.ghost and not of.shown and not picture.is_rotary


def ghost_machine(picture: LivePicture) -> Shapes:
    """Draw the nominal machine as one node: `browser/mesh.js` shows it pale, behind everything."""
    parts = drawn_bodies(picture, nominal=True)
    nodes = [_surface_node(part.surface, part.pose, "ghost", opacity=0.0) for part in parts]
    return {"/ghost_machine": _glb(_shadow(_footprint(parts)), *nodes)}


def _glb(*nodes: GltfNode) -> SceneNode:
    return SceneNode("add_glb", UNLIT, {"glb_data": build_gltf(nodes)})


@lru_cache(maxsize=128)
def _solid(surface: ShadedSurface, pose: bytes) -> SceneNode:
    return _glb(_surface_node(surface, np.frombuffer(pose).reshape(4, 4), "body"))


def _surface_node(surface: ShadedSurface, pose: Array, name: str, opacity: float = 1.0) -> GltfNode:
    points = transforms.apply(pose, surface.vertices_mm)
    attributes: dict[str, Array] = {}
    if surface.normals is not None:  # rounded, which halves their bytes; viser needs floats
        attributes["NORMAL"] = np.rint(127.0 * surface.normals @ pose[:3, :3].T) / 127.0
    linear = np.insert(srgb_to_linear(surface.colours), 3, 1.0, axis=1)
    colours = np.rint(255.0 * linear).astype(np.uint8)
    material = Material(name, opacity=opacity, lit=True)
    return GltfNode(name, points, surface.triangles, material, colours, attributes)


def _footprint(parts: Sequence[PlacedBody]) -> tuple[float, ...]:
    """Return the rectangle on which a machine stands, [x, y, z] to [x, y, z], mm."""
    points = np.concatenate([part.nominal_mm for part in parts])
    low, high = points.min(axis=0), points.max(axis=0)
    standing = points[points[:, 2] < low[2] + FOOT * (high - low)[2]]
    return tuple(np.round([*standing.min(axis=0), *standing.max(axis=0)], 1).tolist())


@lru_cache(maxsize=8)
def _shadow_alone(rectangle: tuple[float, ...]) -> SceneNode:
    return _glb(_shadow(rectangle))


def _shadow(rectangle: tuple[float, ...]) -> GltfNode:
    """Build the soft shadow of a machine on its floor: a rectangle with a round, fading rim."""
    low, high = np.reshape(rectangle, (2, 3))
    reach = SHADOW_REACH * float((high - low)[:2].max())
    steps = reach * np.linspace(-SHADOW_INSET, 1.0, SHADOW_STEPS)
    sides = [np.concatenate([low[k] - steps[::-1], high[k] + steps]) for k in (0, 1)]
    points = np.stack(np.meshgrid(*sides, low[2]), axis=-1)[:, :, 0]  # [n, n, 3]
    outside = np.maximum(low - points, points - high)[..., :2] / reach + SHADOW_INSET
    distance = np.linalg.norm(np.maximum(outside, 0.0), axis=-1) / (1.0 + SHADOW_INSET)
    opacity = SHADOW * np.maximum(1.0 - distance, 0.0) ** 2
    colours = np.zeros((opacity.size, 4), np.uint8)
    colours[:, 3] = np.rint(255.0 * opacity.ravel())
    triangles = triangulate([np.arange(opacity.size).reshape(opacity.shape)]).triangles
    material = Material("shadow", opacity=0.99)  # blended
    return GltfNode("shadow", points.reshape(-1, 3), triangles, material, colours)


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
        on = has_ghost(picture)
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
