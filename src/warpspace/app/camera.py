"""Where the camera stands: seen from the operator's side, so that what is drawn fills its room."""

from dataclasses import dataclass

import numpy as np

from warpspace.units import Array

FOV_DEG = 22.0
"""Vertical field of view: long enough that parallel edges look parallel."""
OPERATOR = (0.55, -1.0, 0.52)
"""Direction from the box to the camera: from the front (−Y), slightly from the right and above."""
MARGIN = 1.06
_ROUNDS = 4


@dataclass(frozen=True, slots=True)
class CameraPose:
    """Position and target of a camera, [3], in the unit of the points it was fitted to."""

    position: Array
    look_at: Array
    fov_rad: float


def fit_camera(
    points: Array,
    aspect: float,
    direction: tuple[float, float, float] = OPERATOR,
    fov_deg: float = FOV_DEG,
    margin: float = MARGIN,
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

    Returns
    -------
    CameraPose
    """
    flat = points.reshape(-1, 3)
    back = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    right = np.cross((0.0, 0.0, 1.0), back)
    right = right / np.linalg.norm(right)
    up = np.cross(back, right)
    tan_y = np.tan(np.deg2rad(fov_deg) / 2.0) / margin
    tan_x = tan_y * max(aspect, 0.1)
    target = (flat.min(axis=0) + flat.max(axis=0)) / 2.0
    distance = 1.0
    for _ in range(_ROUNDS):
        along = (flat - target) @ np.stack([right, up, back], axis=1)
        x, y, towards = along.T
        distance = float(
            max((np.abs(x) / tan_x + towards).max(), (np.abs(y) / tan_y + towards).max())
        )
        seen_x, seen_y = x / (distance - towards), y / (distance - towards)
        shift_x, shift_y = (seen_x.min() + seen_x.max()) / 2, (seen_y.min() + seen_y.max()) / 2
        target = target + distance * (shift_x * right + shift_y * up)
    return CameraPose(target + distance * back, target, float(np.deg2rad(fov_deg)))
