"""Where the camera stands: seen from the operator's side, so that what is drawn fills its room."""

from dataclasses import dataclass

import numpy as np

from warpspace.picture.views import VIEWS, Direction
from warpspace.units import Array

FOV_DEG = 22.0
"""Vertical field of view: long enough that parallel edges look parallel."""
MARGIN = 1.06
HEADING_HEIGHT = 130
"""Room kept free for the heading of the page, CSS pixels."""
_ROUNDS = 4
Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class CameraMemory:
    """Where a tab's camera stood, in units of the drawing.

    Attributes
    ----------
    position, look_at, up : tuple of float, (3,)
    fov_rad : float
    """

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


def heading_share(height: float) -> float:
    """Give the part of a picture's height, CSS pixels, that the heading takes at the top."""
    return min(HEADING_HEIGHT / height, 0.3)


def fit_camera(
    points: Array,
    aspect: float,
    direction: Direction = VIEWS["iso"],
    fov_deg: float = FOV_DEG,
    margin: float = MARGIN,
    top: float = 0.0,
) -> CameraPose:
    """Place a camera so that points fill the picture.

    Parameters
    ----------
    points : ndarray, [..., 3]
    aspect : float
        Width over height of the picture.
    direction : tuple of float, (3,), optional
        From the points towards the camera.
    fov_deg : float, optional
        Vertical field of view, degrees.
    margin : float, optional
        Room around the points, 1 for none.
    top : float, optional
        Part of the height at the top that is kept free, below a half.

    Returns
    -------
    CameraPose
    """
    flat = points.reshape(-1, 3)
    back = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    right = np.cross((0.0, 0.0, 1.0), back)
    right = right / np.linalg.norm(right)
    up = np.cross(back, right)
    half = float(np.tan(np.deg2rad(fov_deg) / 2.0))
    side, below, above = half * max(aspect, 0.1) / margin, half / margin, half / margin
    above -= 2.0 * top * half
    target = (flat.min(axis=0) + flat.max(axis=0)) / 2.0
    distance = 1.0
    for _ in range(_ROUNDS):
        x, y, towards = ((flat - target) @ np.stack([right, up, back], axis=1)).T
        least = np.maximum.reduce([np.abs(x) / side, -y / below, y / above]) + towards
        distance = float(least.max())
        seen_x, seen_y = x / (distance - towards), y / (distance - towards)
        shift_x = (seen_x.min() + seen_x.max()) / 2.0
        shift_y = (seen_y.min() + seen_y.max()) / 2.0 + (below - above) / 2.0
        target = target + distance * (shift_x * right + shift_y * up)
    return CameraPose(target + distance * back, target, float(np.deg2rad(fov_deg)))
