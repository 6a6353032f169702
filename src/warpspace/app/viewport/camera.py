"""Where the camera stands: seen from the operator's side, so that what is drawn fills its room."""

from dataclasses import dataclass

import numpy as np

from warpspace.app.viewport.layers import SCENE_PER_MM
from warpspace.picture.model import VIEWS, Direction
from warpspace.units import Array

FOV_DEG = 22.0  # vertical field of view: long enough that parallel edges look parallel
MARGIN = 1.06
_ROUNDS = 8
Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class CameraMemory:
    """Where a tab's camera stood, in units of the drawing."""

    position: Vector
    look_at: Vector
    up: Vector
    fov_rad: float


@dataclass(frozen=True, slots=True)
class CameraPose:
    """Position and target of a camera, [3], in the unit of the points it was fitted to."""

    position: Array
    look_at: Array
    fov_rad: float

    @property
    def drawn(self) -> CameraMemory:
        """The same in units of the drawing, where it was fitted to millimetres."""
        (x, y, z), (a, b, c) = (SCENE_PER_MM * self.position, SCENE_PER_MM * self.look_at)
        return CameraMemory((x, y, z), (a, b, c), (0.0, 0.0, 1.0), self.fov_rad)


def fit_camera(
    points: Array,
    aspect: float,
    direction: Direction = VIEWS["iso"],
    fov_deg: float = FOV_DEG,
    margin: float = MARGIN,
    margins: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
) -> CameraPose:
    """Place a camera so that points fill the picture but its margins: left, right, top, bottom."""
    flat = points.reshape(-1, 3)
    back = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    right = np.cross((0.0, 0.0, 1.0), back)
    right = right / np.linalg.norm(right)
    up = np.cross(back, right)
    half = np.tan(np.deg2rad(fov_deg) / 2.0) * np.array([max(aspect, 0.1), 1.0])
    before, after = np.array([margins[0], margins[3]]), np.array([margins[1], margins[2]])
    # middle and half size of what is to be filled
    middle, free = (before - after) * half, (1.0 - before - after) * half / margin
    target, distance = (flat.min(axis=0) + flat.max(axis=0)) / 2.0, 1.0
    offset = np.zeros(2)
    for _ in range(_ROUNDS):
        seen = (flat - target) @ np.stack([right, up, back], axis=1)
        across, towards = seen[:, :2], seen[:, 2]
        from_middle = np.abs(across - offset + towards[:, None] * middle)
        distance = float(((from_middle / free).max(axis=1) + towards).max())
        at = across / (distance - towards)[:, None]
        shift = (at.min(axis=0) + at.max(axis=0)) / 2.0 - middle
        offset = middle * distance
        target = target + distance * (shift[0] * right + shift[1] * up)
    return CameraPose(target + distance * back, target, float(np.deg2rad(fov_deg)))
