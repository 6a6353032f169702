"""Named views, and the telephoto that stands in for an orthographic camera.

viser's camera is a perspective one; from far away with a field of view of three degrees parallel
edges stay parallel to within a pixel or two.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warpspace.app.viewport.camera import FOV_DEG, CameraPose, fit_camera
from warpspace.picture import model
from warpspace.picture.model import Direction
from warpspace.units import Array

TELEPHOTO_DEG = 3.0
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


def view_pose(
    points: Array, aspect: float, stand: CameraSetup, top: float = 0.0, bottom: float = 0.0
) -> CameraPose:
    """Place a camera for a named view so that points fill the picture."""
    return fit_camera(points, aspect, VIEWS[stand.view], stand.fov_deg, top=top, bottom=bottom)


def change_lens(position: Array, look_at: Array, fov_rad: float, new_fov_rad: float) -> Array:
    """Move a camera along its line of sight so that what it looks at keeps its size."""
    ratio = float(np.tan(fov_rad / 2.0) / np.tan(new_fov_rad / 2.0))
    return look_at + ratio * (position - look_at)


def clipping(position: Array, points: Array, *, orthographic: bool) -> tuple[float, float]:
    """Choose near and far planes, as distances from a camera."""
    distance = float(np.linalg.norm(position - points.reshape(-1, 3), axis=-1).max())
    return (0.02 * distance if orthographic else NEAR), max(FAR, 5.0 * distance)
