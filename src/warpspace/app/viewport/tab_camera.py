"""The camera of one tab: put where all of the box is seen, remembered, put back."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from viser import ClientHandle

from warpspace.app.browser.room import PHONE_PX, PHONE_SHARE, TOP_PX, Room, column_widths
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine import machine_room_mm
from warpspace.app.state.app_state import AppState
from warpspace.app.viewport.camera import FOV_DEG, CameraMemory, CameraPose, fit_camera
from warpspace.app.viewport.layers import SCENE_PER_MM
from warpspace.app.viewport.layers.axes import axes_room_mm
from warpspace.picture import model
from warpspace.picture.model import Direction
from warpspace.units import Array

TELEPHOTO_DEG = 3.0  # stands in for an orthographic camera, which viser has not
NEAR, FAR = 0.01, 1000.0
"""Clipping planes of the usual camera, scene units."""
STEEPEST = 1e-3
"""How far the view from above leans to the front: exactly above, an orbiting camera has no up."""
VIEWS: Mapping[str, Direction] = {**model.VIEWS, "top": (0.0, -STEEPEST, 1.0)}
"""From what is looked at towards the camera."""


@dataclass(frozen=True, slots=True)
class CameraSetup:
    """How the camera is set up."""

    view: str = "iso"  # A key of `VIEWS`
    orthographic: bool = False  # whether it is the telephoto

    @property
    def fov_deg(self) -> float:
        """Vertical field of view, degrees."""
        return TELEPHOTO_DEG if self.orthographic else FOV_DEG


def view_pose(points: Array, room: Room, stand: CameraSetup) -> CameraPose:
    """Place a camera for a named view so that points fill the room of the drawing."""
    return fit_camera(points, room.aspect, VIEWS[stand.view], stand.fov_deg, margins=room.margins)


def change_lens(position: Array, look_at: Array, fov_rad: float, new_fov_rad: float) -> Array:
    """Move a camera along its line of sight so that what it looks at keeps its size."""
    ratio = float(np.tan(fov_rad / 2.0) / np.tan(new_fov_rad / 2.0))
    return look_at + ratio * (position - look_at)


def clipping(position: Array, points: Array, *, orthographic: bool) -> tuple[float, float]:
    """Choose near and far planes, as distances from a camera."""
    distance = float(np.linalg.norm(position - points.reshape(-1, 3), axis=-1).max())
    return (0.02 * distance if orthographic else NEAR), max(FAR, 5.0 * distance)


# --- The camera of a tab --------------------------------------------------------------------------

LEAST_SIZE = 120  # CSS pixels of a picture that is taken to be one
MOVED = 1e-3
"""How far from where it was put, as a part of its distance, a camera has been moved by hand."""


def focus(state: AppState) -> tuple[object, ...]:
    """Tell what the camera is set up for: the scene, its axes, whether its machine is shown."""
    return Identity(state.origin), state.scene.machine.chain, state.machine.shown


class TabCamera:
    """The camera of a tab."""

    def __init__(self, client: ClientHandle) -> None:
        self._camera = client.camera
        self.wanted: CameraMemory | None = None
        self.page_width: float | None = None
        self._stand = CameraSetup()
        self._told: Room | None = None
        self._put: CameraMemory | None = None

    @property
    def stand(self) -> CameraSetup:
        """Named view and lens that were chosen last."""
        return self._stand

    def choose(
        self, picture: LivePicture, view: str | None = None, lens: bool | None = None
    ) -> None:
        """Take a named view, or another lens from where the camera stands."""
        if view is not None and view not in VIEWS:
            return
        stand = self._stand
        orthographic = stand.orthographic if lens is None else lens
        self._stand = CameraSetup(view or stand.view, orthographic)
        if view is not None or lens is None:
            self.fit(picture)
        elif orthographic != stand.orthographic:
            self._change_lens(picture)

    def _change_lens(self, picture: LivePicture) -> None:
        camera, fov = self._camera, float(np.deg2rad(self._stand.fov_deg))
        look_at = camera.look_at.copy()
        position = change_lens(camera.position, look_at, camera.fov, fov)
        self._clip(position, self._room_mm(picture))
        camera.fov = fov
        camera.position = position
        camera.look_at = look_at  # the former takes it along

    def _clip(self, position: Array, points_mm: Array) -> None:
        near, far = clipping(
            position, points_mm * SCENE_PER_MM, orthographic=self._stand.orthographic
        )
        self._camera.near, self._camera.far = near, far

    def _room_mm(self, picture: LivePicture) -> Array:
        """Give points around all that is to be seen, mm."""
        shown = picture.state.machine.shown
        room = machine_room_mm(picture) if shown else axes_room_mm(picture)
        return np.concatenate([room, picture.drawn_mm.reshape(-1, 3)])

    @property
    def room(self) -> Room:
        """The room of the drawing: as the page has said, until then as its panels will leave it."""
        if self._told is not None:
            return self._told
        camera = self._camera
        width = self.page_width or camera.image_width
        high = camera.image_height * (PHONE_SHARE if width <= PHONE_PX else 1.0) - TOP_PX
        return Room(max(width - sum(column_widths(width)), LEAST_SIZE), max(high, LEAST_SIZE))

    def take_room(self, room: Room, picture: LivePicture) -> bool:
        """Take note of the drawing's room; a camera that nobody has moved fills it again."""
        self._told = room
        if self._put is None or not _near(self._put, self.remember()):
            return False
        self.fit(picture)
        return True

    def place(self, picture: LivePicture) -> None:
        """Put it where it is wanted, else where all of the box is seen."""
        memory, self.wanted = self.wanted, None
        if memory is not None:
            self.restore(memory)
        else:
            self.fit(picture)

    def fit(self, picture: LivePicture) -> None:
        """Fill the room between the panels with the box, its traces and axes."""
        points = self._room_mm(picture)
        self._stand_at(view_pose(points, self.room, self._stand).drawn, points)
        self._put = self.remember()

    def px_per_mm(self, picture: LivePicture, height: float) -> float | None:
        """Give how long a millimetre across the line of sight is, in the middle of the volume."""
        camera = self._camera
        sight = camera.look_at - camera.position
        away = picture.grid.bounds_mm.mean(axis=0) * SCENE_PER_MM - camera.position
        depth = float(away @ sight) / float(np.linalg.norm(sight))
        if depth <= 0.0 or not picture.state.look.bars:
            return None
        return height / (2.0 * float(np.tan(camera.fov / 2.0)) * depth) * SCENE_PER_MM

    def remember(self) -> CameraMemory:
        """Give where it stands."""
        camera = self._camera
        return CameraMemory(
            tuple(camera.position.tolist()),
            tuple(camera.look_at.tolist()),
            tuple(camera.up_direction.tolist()),
            camera.fov,
        )

    def restore(self, memory: CameraMemory) -> None:
        """Put it where it stood."""
        telephoto = memory.fov_rad < np.deg2rad(2.0 * TELEPHOTO_DEG)
        self._stand, self._put = CameraSetup(self._stand.view, bool(telephoto)), None
        self._stand_at(memory, np.array([memory.look_at]) / SCENE_PER_MM)

    def _stand_at(self, place: CameraMemory, points_mm: Array) -> None:
        camera = self._camera
        self._clip(np.array(place.position), points_mm)
        camera.up_direction, camera.fov = place.up, place.fov_rad
        camera.position = place.position
        camera.look_at = place.look_at


def _near(a: CameraMemory, b: CameraMemory) -> bool:
    least = MOVED * float(np.linalg.norm(np.subtract(a.position, a.look_at)))
    moved = np.linalg.norm(np.subtract(a.position, b.position))
    turned = np.linalg.norm(np.subtract(a.look_at, b.look_at))
    return bool(moved <= least and turned <= least and abs(a.fov_rad - b.fov_rad) < MOVED)
