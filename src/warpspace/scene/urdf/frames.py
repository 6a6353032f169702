"""Frames of axes in R, and the places of frames in the ones before them."""

import warnings

import numpy as np
from scipy.spatial.transform import Rotation

from warpspace.kinematics.transforms import inverse
from warpspace.machine.description import Chain, Vector
from warpspace.units import Array

PARALLEL = 1e-9
"""Deviation of a direction from x, y or z below which the frame is not turned."""


def axis_frame(origin_mm: Array, direction: Array) -> tuple[Array, int]:
    """Give the frame of an axis in R, [4, 4], mm, and whether it moves with or against its name."""
    index = int(np.argmax(np.abs(direction)))
    sign = 1 if direction[index] > 0.0 else -1
    own = np.zeros(3)
    own[index] = sign
    pose = np.eye(4)
    pose[:3, 3] = origin_mm
    if np.abs(direction - own).max() > PARALLEL:
        about = np.cross(own, direction)
        angle = np.arctan2(np.linalg.norm(about), own @ direction)
        pose[:3, :3] = Rotation.from_rotvec(about / np.linalg.norm(about) * angle).as_matrix()
    return pose, sign


def relative_places(
    poses: dict[str, Array], chain: Chain
) -> tuple[dict[str, Vector], dict[str, Vector]]:
    """Turn frames in R into offsets and rotations of each in the frame before it."""
    offsets: dict[str, Vector] = {}
    rotations: dict[str, Vector] = {}
    for branch, end in ((chain.tool, "t"), (chain.workpiece, "w")):
        before = "R"
        for frame in (*branch, end):
            step = inverse(poses[before]) @ poses[frame]
            offsets[frame] = _rounded(step[:3, 3], 10)
            rotations[frame] = _rounded(roll_pitch_yaw_deg(step[:3, :3]), 12)
            before = frame
    return offsets, {frame: turn for frame, turn in rotations.items() if any(turn)}


def _rounded(values: Array, digits: int) -> Vector:
    """Round away what is left of sums."""
    x, y, z = (round(float(value), digits) + 0.0 for value in values)
    return x, y, z


def roll_pitch_yaw_deg(rotation: Array) -> Array:
    """Give the rotations about the fixed x, y and z axes, [3], degrees, of a rotation, [3, 3]."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of a pitch of 90°, where roll is set to 0
        return Rotation.from_matrix(rotation).as_euler("xyz", degrees=True)
