"""Batched kernels on homogeneous transformations.

Leading dimensions of all arrays are any batch shape; a transformation is [..., 4, 4] and acts on
column vectors: ``T_parent_child`` transforms child to parent coordinates.
"""

import warnings

import numpy as np
from numpy.typing import ArrayLike

from warpspace.units import Array

_SMALL = 1e-9


def translation(vector: ArrayLike) -> Array:
    """Build pure translations, [..., 4, 4], by vectors, [..., 3], mm."""
    return rigid(np.eye(3), vector)


def axis_rotation(index: int, angle_rad: ArrayLike) -> Array:
    """Build right-handed rotations about x, y or z (0 to 2), [..., 3, 3], by angles [...], rad."""
    angle = np.asarray(angle_rad, dtype=float)
    j, k = (index + 1) % 3, (index + 2) % 3
    out = np.zeros((*angle.shape, 3, 3))
    out[..., index, index] = 1.0
    cosine, sine = np.cos(angle), np.sin(angle)
    out[..., j, j] = cosine
    out[..., k, k] = cosine
    out[..., k, j] = sine
    out[..., j, k] = -sine
    return out


def skew(vector: ArrayLike) -> Array:
    """Build the cross-product matrices of vectors, [..., 3, 3]: ``skew(a) @ b == a × b``."""
    x, y, z = np.moveaxis(np.asarray(vector, dtype=float), -1, 0)
    zero = np.zeros_like(x)
    rows = [np.stack(row, -1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))]
    return np.stack(rows, -2)


def vector_rotation(rotation_rad: ArrayLike) -> Array:
    """Build full rotations, [..., 3, 3], from rotation vectors, [..., 3], rad (Rodrigues)."""
    values = np.asarray(rotation_rad, dtype=float)
    angle = np.linalg.norm(values, axis=-1)[..., None, None]
    safe = np.where(angle < _SMALL, 1.0, angle)
    first = np.where(angle < _SMALL, 1.0, np.sin(safe) / safe)
    second = np.where(angle < _SMALL, 0.5, 2.0 * (np.sin(safe / 2.0) / safe) ** 2)
    cross = skew(values)
    return np.eye(3) + first * cross + second * (cross @ cross)


def rigid(rotation: Array, position_mm: ArrayLike) -> Array:
    """Join rotations, [..., 3, 3], and positions, [..., 3], mm, to transformations."""
    position = np.asarray(position_mm, dtype=float)
    batch = np.broadcast_shapes(rotation.shape[:-2], position.shape[:-1])
    out = np.zeros((*batch, 4, 4))
    out[..., :3, :3] = rotation
    out[..., :3, 3] = position
    out[..., 3, 3] = 1.0
    return out


def placed(offset_mm: ArrayLike, rotation_deg: ArrayLike) -> Array:
    """Build the fixed placement of a frame, [4, 4]: ``Trans(offset) · Rz · Ry · Rx``.

    The offset, [3], is in mm; the rotation, [3], in degrees, is about the fixed x, y and z axes in
    that order, as the roll, pitch and yaw of URDF.
    """
    x, y, z = np.deg2rad(np.asarray(rotation_deg, dtype=float))
    if x == y == z == 0.0:
        return translation(offset_mm)
    turned = axis_rotation(2, z) @ axis_rotation(1, y) @ axis_rotation(0, x)
    return rigid(turned, offset_mm)


def inverse(transform: Array) -> Array:
    """Invert rigid transformations, [..., 4, 4], without solving."""
    turned = np.swapaxes(transform[..., :3, :3], -1, -2)
    return rigid(turned, -rotate(turned, transform[..., :3, 3]))


def apply(transform: Array, point_mm: ArrayLike) -> Array:
    """Transform points, [..., 3], mm, from child to parent coordinates."""
    return rotate(transform[..., :3, :3], point_mm) + transform[..., :3, 3]


def rotate(rotation: Array, vector: ArrayLike) -> Array:
    """Rotate vectors, [..., 3], by matrices, [..., 3, 3]."""
    return np.einsum("...ij,...j->...i", rotation, np.asarray(vector, dtype=float))


def roll_pitch_yaw_deg(rotation: Array) -> Array:
    """Compute roll, pitch and yaw (fixed x, y, z axes), [3], degrees, of a rotation, [3, 3]."""
    from scipy.spatial.transform import Rotation

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of a pitch of 90°, where roll is set to 0
        return Rotation.from_matrix(rotation).as_euler("xyz", degrees=True)
