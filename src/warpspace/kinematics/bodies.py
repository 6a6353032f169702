"""Where the bodies of a machine stand, and how each of them moves because of the errors.

Every body takes the small motion of all errors between the frame and itself. To first order that is
one rotation vector and one displacement a body; drawn larger by a factor it is an affine map that
takes each point exactly where the deformed grid has it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_frames
from warpspace.kinematics.firstorder import column
from warpspace.kinematics.model import Coordinates, Model
from warpspace.machine.parameters import axis_parameters
from warpspace.units import MM_PER_UM, RAD_PER_URAD, Array

BASE = "R"


@dataclass(frozen=True, slots=True)
class BodyMotion:
    """Nominal place of a body and its small motion.

    Attributes
    ----------
    nominal : ndarray, [4, 4]
        Pose of the body's frame in R.
    rotation_rad : ndarray, [3], rad
        Small rotation vector in R.
    displacement_mm : ndarray, [3], mm
        Displacement of the point of the body at the origin of R.
    """

    nominal: Array
    rotation_rad: Array
    displacement_mm: Array

    def drawn(self, exaggeration: float) -> Array:
        """Give the affine map from the body's frame to where it is drawn in R.

        Parameters
        ----------
        exaggeration : float
            Display factor of the small motion.

        Returns
        -------
        ndarray, [4, 4]
        """
        bend = np.eye(4)
        bend[:3, :3] += exaggeration * transforms.skew(self.rotation_rad)
        bend[:3, 3] = exaggeration * self.displacement_mm
        return bend @ self.nominal


def body_motions(
    model: Model, values: Mapping[str, Array | float], coordinates: Coordinates
) -> dict[str, BodyMotion]:
    """Find the place and the small motion of every body of a machine.

    Parameters
    ----------
    model : Model
    values : mapping of str to float
        Errors at the coordinates, µm or µrad; absent is zero.
    coordinates : mapping of str to ndarray, [], mm or degrees
        One position of every axis.

    Returns
    -------
    dict of str to BodyMotion
        By frame: R, every axis, S and t (which ride on the last axis of the tool), w.
    """
    still = np.zeros(3)
    found = {BASE: BodyMotion(np.eye(4), still, still)}
    for side in ("tool", "workpiece"):
        pose, rotation, displacement = np.eye(4), still, still
        for frames in branch_frames(model, side, coordinates):
            pose = frames.after
            for row in axis_parameters(frames.axis.name):
                value = float(values.get(row.key, 0.0))
                if value == 0.0:
                    continue
                col = column(model, row, frames, np.zeros(3))
                displacement = displacement + col.position * value * MM_PER_UM
                if row.is_rotation:
                    rotation = rotation + col.direction * value * RAD_PER_URAD
            found[frames.axis.name] = BodyMotion(pose, rotation, displacement)
        for name, offset, turned in model.machine.end_frames(side):
            pose = pose @ transforms.placed(offset, turned)
            found[name] = BodyMotion(pose, rotation, displacement)
    return found
