"""Where the camera stands: seen from the operator's side, so that what is drawn fills its room."""

from dataclasses import dataclass

import numpy as np

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


def fit_camera(
    points: Array,
    aspect: float,
    direction: Direction = VIEWS["iso"],
    fov_deg: float = FOV_DEG,
    margin: float = MARGIN,
    top: float = 0.0,
    bottom: float = 0.0,
) -> CameraPose:
    """Place a camera so that points fill the picture."""
    flat = points.reshape(-1, 3)
    back = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    right = np.cross((0.0, 0.0, 1.0), back)
    right = right / np.linalg.norm(right)
    up = np.cross(back, right)
    half = float(np.tan(np.deg2rad(fov_deg) / 2.0))
    side = half * max(aspect, 0.1) / margin
    # middle and half height of what is to be filled
    middle, free = (bottom - top) * half, (1.0 - top - bottom) * half / margin
    target, distance = (flat.min(axis=0) + flat.max(axis=0)) / 2.0, 1.0
    offset = 0.0
    for _ in range(_ROUNDS):
        x, y, towards = ((flat - target) @ np.stack([right, up, back], axis=1)).T
        from_middle = np.abs(y - offset + middle * towards)
        distance = float((np.maximum(np.abs(x) / side, from_middle / free) + towards).max())
        seen_x, seen_y = x / (distance - towards), y / (distance - towards)
        shift_x = (seen_x.min() + seen_x.max()) / 2.0
        shift_y = (seen_y.min() + seen_y.max()) / 2.0 - middle
        offset = middle * distance
        target = target + distance * (shift_x * right + shift_y * up)
    return CameraPose(target + distance * back, target, float(np.deg2rad(fov_deg)))
