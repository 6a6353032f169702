"""The camera of a tab: from the operator's side, so that the drawing fills its space."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from viser import ClientHandle

from warpspace.app.drawing.labels import axes_room_mm
from warpspace.app.drawing.shapes import SCENE_PER_MM
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine_bodies import diagnosed_guides, drawn_bodies
from warpspace.app.state.app_state import AppState
from warpspace.app.state.leaf import Identity
from warpspace.picture import model
from warpspace.picture.model import Direction
from warpspace.units import Array

TOP_PX = 46  # height of the bar at the top; the style sheet has it too
PHONE_PX, COLUMNS_PX = 700, 558  # width of a phone at most, and of both columns elsewhere
PHONE_SHARE = 0.52  # of the drawing, of a phone's height
LEAST_PX = 120
HEADING_PX, FOOT_PX, LEGEND_PX = 66, 80, 134
"""Sizes of heading, controls and colour bar, until the page reports them."""
WORDS_PX, PHONE_WORDS_PX = 46, 22
"""Margins for the labels at axes and corners."""
MOST_SHARE, LEAST_SHARE = 0.4, 0.3
"""Largest share of a margin, and smallest share of the drawing."""


@dataclass(frozen=True, slots=True)
class Room:
    """Size of the drawing, CSS pixels; sent by the page (`overlay.js`) whenever it changes."""

    width: float
    height: float
    top: float = HEADING_PX
    bottom: float = FOOT_PX
    right: float = LEGEND_PX

    @property
    def aspect(self) -> float:
        return self.width / self.height

    @property
    def margins(self) -> tuple[float, float, float, float]:
        """Margins relative to width and height: left, right, top, bottom."""
        label_px = WORDS_PX if self.width > PHONE_PX else PHONE_WORDS_PX
        right = min((self.right + label_px / 2.0) / self.width, MOST_SHARE)
        top = min((self.top + label_px / 2.0) / self.height, MOST_SHARE)
        bottom = min((self.bottom + label_px / 2.0) / self.height, 1.0 - LEAST_SHARE - top)
        return min(label_px / self.width, MOST_SHARE), right, top, bottom


def first_room(page_width: float, page_height: float) -> Room:
    columns, share = (0, PHONE_SHARE) if page_width <= PHONE_PX else (COLUMNS_PX, 1.0)
    width, height = page_width - columns, page_height * share - TOP_PX
    return Room(max(width, LEAST_PX), max(height, LEAST_PX))


# --- The camera -----------------------------------------------------------------------------------

FOV_DEG = 22.0  # vertical field of view: small enough that parallel edges look parallel
TELEPHOTO_DEG = 3.0  # approximates an orthographic camera, which viser lacks
MARGIN = 1.06
NEAR, FAR = 0.01, 1000.0
"""Clipping planes of the default camera, scene units."""
STEEPEST = 1e-3
"""Tilt of the view from above: exactly vertical, an orbiting camera has no up direction."""
VIEWS: Mapping[str, Direction] = {**model.VIEWS, "top": (0.0, -STEEPEST, 1.0)}
"""Directions from the target towards the camera."""
MOVED = 1e-3
"""Smallest movement of a camera by hand, relative to its distance."""
PLACEMENTS = 12
"""Placements by the program that are not mistaken for movements by hand."""
_ROUNDS = 8
Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class CameraMemory:
    """Pose of a camera, in units of the drawing."""

    position: Vector
    look_at: Vector
    up: Vector
    fov_rad: float

    def is_near(self, other: "CameraMemory") -> bool:
        least = MOVED * float(np.linalg.norm(np.subtract(self.position, self.look_at)))
        first, second = ((*at.position, *at.look_at, at.fov_rad) for at in (self, other))
        return np.allclose(first, second, rtol=0.0, atol=least)


def fit_camera(
    points_mm: Array,
    aspect: float,
    direction: Direction = VIEWS["iso"],
    fov_deg: float = FOV_DEG,
    margins: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
) -> CameraMemory:
    """Place a camera so that points fill the picture inside margins: left, right, top, bottom."""
    flat, axes = points_mm.reshape(-1, 3) * SCENE_PER_MM, view_axes(direction, (0.0, 0.0, 1.0))
    right, up, backward = axes.T
    half = np.tan(np.deg2rad(fov_deg) / 2.0) * np.array([max(aspect, 0.1), 1.0])
    before, after = np.array([margins[0], margins[3]]), np.array([margins[1], margins[2]])
    # middle and half size of the area to fill
    middle, free = (before - after) * half, (1.0 - before - after) * half / MARGIN
    target, distance = (flat.min(axis=0) + flat.max(axis=0)) / 2.0, 1.0
    offset = np.zeros(2)
    for _ in range(_ROUNDS):
        in_view = (flat - target) @ axes
        across, towards = in_view[:, :2], in_view[:, 2]
        from_middle = np.abs(across - offset + towards[:, None] * middle)
        distance = float(((from_middle / free).max(axis=1) + towards).max())
        at = across / (distance - towards)[:, None]
        shift = (at.min(axis=0) + at.max(axis=0)) / 2.0 - middle
        offset = middle * distance
        target = target + distance * (shift[0] * right + shift[1] * up)
    position, look_at = (target + distance * backward).tolist(), target.tolist()
    return CameraMemory(tuple(position), tuple(look_at), (0.0, 0.0, 1.0), np.deg2rad(fov_deg))


def is_in_view(place: CameraMemory, points_mm: Array, aspect: float) -> bool:
    """Check if all points are in the picture of a camera."""
    axes = view_axes(np.subtract(place.position, place.look_at), place.up)
    seen = (points_mm.reshape(-1, 3) * SCENE_PER_MM - np.array(place.position)) @ axes
    depth = -seen[:, 2]
    half = np.tan(place.fov_rad / 2.0) * np.array([aspect, 1.0]) * depth[:, None]
    return bool((depth > 0.0).all() and (np.abs(seen[:, :2]) <= half).all())


def view_axes(direction: ArrayLike, up: ArrayLike) -> Array:
    """Return right, up and backward of a camera as columns, [3, 3]; `direction` is backward."""
    backward, upward = np.asarray(direction, dtype=float), np.asarray(up, dtype=float)
    backward = backward / np.linalg.norm(backward)
    right = np.cross(upward, backward)
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(backward, right), backward], axis=1)


def clipping(position: Array, points: Array, *, orthographic: bool) -> tuple[float, float]:
    distance = float(np.linalg.norm(position - points.reshape(-1, 3), axis=-1).max())
    return (0.02 * distance if orthographic else NEAR), max(FAR, 5.0 * distance)


def focus(state: AppState) -> tuple[object, ...]:
    """Return the properties that require a new camera: scene, chain, display of the machine."""
    chain, machine = state.scene.machine.chain, state.machine
    return Identity(state.origin), chain, machine.shown, state.shows_rotary


def _drawn_mm(picture: LivePicture) -> Array:
    if not picture.is_rotary:
        points = (picture.drawn_mm, diagnosed_guides(picture))
        return np.concatenate([at.reshape(-1, 3) for at in points])
    traces = (of.actual_mm.reshape(-1, 3) for of in picture.traces)
    return np.concatenate([np.zeros((0, 3)), *traces])


class TabCamera:
    """The camera of a tab, which shows the whole box or a stored view."""

    def __init__(self, client: ClientHandle) -> None:
        self._camera = client.camera
        self.wanted: CameraMemory | None = None
        self.view, self.orthographic = "iso", False  # a key of `VIEWS`, the telephoto lens
        self.reported_room: Room | None = None
        # several, since a slow page reports earlier ones late
        self._placements: tuple[CameraMemory, ...] = ()
        self.has_followed = False  # whether it moved by itself for a larger box

    def choose(
        self, picture: LivePicture, view: str | None = None, lens: bool | None = None
    ) -> None:
        """Select a named view, or another lens at the present position."""
        before, self.view = self.orthographic, view or self.view
        self.orthographic = before if lens is None else lens
        if view is not None or lens is None:
            self.fit(picture)
        elif self.orthographic != before:
            self._change_lens(picture)

    @property
    def _fov_deg(self) -> float:
        return TELEPHOTO_DEG if self.orthographic else FOV_DEG

    def _change_lens(self, picture: LivePicture) -> None:
        now, fov = self.remember(), float(np.deg2rad(self._fov_deg))
        ratio = float(np.tan(now.fov_rad / 2.0) / np.tan(fov / 2.0))
        look_at = np.array(now.look_at)
        x, y, z = (look_at + ratio * (now.position - look_at)).tolist()
        place = CameraMemory((x, y, z), now.look_at, now.up, fov)
        self._clip(place, self._room_mm(picture))
        self._stand_at(place)

    def _room_mm(self, picture: LivePicture) -> Array:
        room = [axes_room_mm(picture)]
        if picture.is_rotary:
            bodies = drawn_bodies(picture)
            traced = (at for of in picture.traces for at in (of.nominal_mm, of.actual_mm))
            points = [*(part.vertices_mm for part in bodies), *(at.reshape(-1, 3) for at in traced)]
            return np.concatenate(points)
        if picture.state.machine.shown:
            bodies = drawn_bodies(picture, nominal=True)
            room = [picture.grid.bounds_mm, *(part.vertices_mm for part in bodies)]
        return np.concatenate([*room, _drawn_mm(picture)])

    @property
    def room(self) -> Room:
        camera = self._camera
        return self.reported_room or first_room(camera.image_width, camera.image_height)

    def take_room(self, room: Room, picture: LivePicture | None) -> None:
        """Record the size of the drawing; a camera that was not moved by hand fits it again."""
        self.reported_room = room
        if picture is not None and not self.is_moved:
            self.fit(picture)

    def loses(self, before: LivePicture, picture: LivePicture) -> bool:
        """Check if what is drawn has left the view with a change."""
        now, aspect = self.remember(), self.room.aspect
        before_mm, drawn_mm = _drawn_mm(before), _drawn_mm(picture)
        return is_in_view(now, before_mm, aspect) and not is_in_view(now, drawn_mm, aspect)

    @property
    def is_moved(self) -> bool:
        """True if it was moved by hand, or to a stored view."""
        now = self.remember()
        return not any(put.is_near(now) for put in self._placements)

    def follow(self, picture: LivePicture) -> CameraMemory:
        """Return the view of the whole box, for the page to move there."""
        now, fitted = self.remember(), self._fitted(picture)
        self._placements, self.has_followed = (*self._placements[-PLACEMENTS:], now, fitted), True
        return fitted

    def approach(self, picture: LivePicture) -> tuple[CameraMemory, CameraMemory]:
        """Return the views of the whole machine and of the box, for the page to move there."""
        bodies = [of.vertices_mm for of in drawn_bodies(picture, nominal=True)]
        points, room = np.concatenate([picture.drawn_mm.reshape(-1, 3), *bodies]), self.room
        machine = fit_camera(points, room.aspect, VIEWS[self.view], self._fov_deg, room.margins)
        box = self._fitted(picture)
        self._placements = (*self._placements[-PLACEMENTS:], machine, box)
        return machine, box

    def place(self, picture: LivePicture) -> None:
        """Move to the wanted view, else to one of the whole box."""
        memory, self.wanted = self.wanted, None
        if memory is None:
            self.fit(picture)
        else:
            self.expect(memory)
            self._stand_at(memory)

    def expect(self, memory: CameraMemory) -> None:
        """Prepare for a view that the page itself moves to."""
        telephoto = memory.fov_rad < np.deg2rad(2.0 * TELEPHOTO_DEG)
        self.orthographic, self._placements = bool(telephoto), ()
        self._clip(memory, np.array([memory.look_at]) / SCENE_PER_MM)

    def _fitted(self, picture: LivePicture) -> CameraMemory:
        points, room, view = self._room_mm(picture), self.room, VIEWS[self.view]
        fitted = fit_camera(points, room.aspect, view, self._fov_deg, margins=room.margins)
        self._clip(fitted, points)
        return fitted

    def fit(self, picture: LivePicture) -> None:
        before, self.has_followed = self.remember(), False
        self._stand_at(self._fitted(picture))
        self._placements = (*self._placements[-PLACEMENTS:], before, self.remember())

    def remember(self) -> CameraMemory:
        camera = self._camera
        return CameraMemory(
            tuple(camera.position.tolist()),
            tuple(camera.look_at.tolist()),
            tuple(camera.up_direction.tolist()),
            camera.fov,
        )

    def _clip(self, place: CameraMemory, points_mm: Array) -> None:
        self._camera.near, self._camera.far = clipping(
            np.array(place.position), points_mm * SCENE_PER_MM, orthographic=self.orthographic
        )

    def _stand_at(self, place: CameraMemory) -> None:
        camera = self._camera
        camera.up_direction, camera.fov = place.up, place.fov_rad
        camera.position = place.position
        camera.look_at = place.look_at  # changed by the assignment of the position
