"""Orthographic projection: from machine coordinates to pixels and back."""

from dataclasses import dataclass, replace

import numpy as np

from warpspace.picture.views import UPWARDS, VIEWS
from warpspace.units import Array

Rect = tuple[float, float, float, float]
"""Left, bottom, right, top, px."""


@dataclass(frozen=True, slots=True)
class Projection:
    """A parallel projection onto the pixels of a figure.

    Attributes
    ----------
    right, up, towards : ndarray, [3]
        Unit vectors in R: to the right and upwards in the picture, and towards the viewer.
    px_per_mm : float
    centre_mm : ndarray, [3], mm
        Point of R ...
    centre_px : ndarray, [2], px
        ... and where it is drawn, origin bottom left.
    """

    right: Array
    up: Array
    towards: Array
    px_per_mm: float
    centre_mm: Array
    centre_px: Array

    def project(self, points_mm: Array) -> Array:
        """Project points.

        Parameters
        ----------
        points_mm : ndarray, [..., 3], mm

        Returns
        -------
        ndarray, [..., 2], px
        """
        relative = points_mm - self.centre_mm
        plane = np.stack([relative @ self.right, relative @ self.up], -1)
        return self.centre_px + self.px_per_mm * plane

    def depth_mm(self, points_mm: Array) -> Array:
        """Distance behind the plane through the centre, [...], mm; larger is farther away."""
        return -((points_mm - self.centre_mm) @ self.towards)

    def moved(self, shift_px: Array) -> "Projection":
        """Give the same projection elsewhere in the figure."""
        return replace(self, centre_px=self.centre_px + shift_px)


def view_axes(view: str) -> tuple[Array, Array, Array]:
    """Give the unit vectors right, up and towards of a named view."""
    towards = np.array(VIEWS[view])
    upwards = np.array(UPWARDS.get(view, (0.0, 0.0, 1.0)))
    towards /= np.linalg.norm(towards)
    right = np.cross(upwards, towards)
    right /= np.linalg.norm(right)
    return right, np.cross(towards, right), towards


def fit_projection(view: str, points_mm: Array, rect: Rect) -> Projection:
    """Choose the projection that makes points fill a box of the figure.

    Parameters
    ----------
    view : str
        A name out of `VIEWS`.
    points_mm : ndarray, [..., 3], mm
    rect : tuple of float, (4,), px
        Left, bottom, right, top.

    Returns
    -------
    Projection
    """
    right, up, towards = view_axes(view)
    flat = points_mm.reshape(-1, 3)
    centre = (flat.min(axis=0) + flat.max(axis=0)) / 2.0
    plane = np.stack([(flat - centre) @ right, (flat - centre) @ up], -1)
    low, high = plane.min(axis=0), plane.max(axis=0)
    room = np.array([rect[2] - rect[0], rect[3] - rect[1]])
    spans = np.maximum(high - low, 1e-9)
    px_per_mm = float(np.min(room / spans)) if (high - low).max() > 1e-9 else 1.0
    middle = np.array([(rect[0] + rect[2]) / 2.0, (rect[1] + rect[3]) / 2.0])
    return Projection(
        right, up, towards, px_per_mm, centre, middle - px_per_mm * (low + high) / 2.0
    )
