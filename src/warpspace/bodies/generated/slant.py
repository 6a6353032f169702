"""Machines whose slides are turned against the frame R, as on the slant bed of a lathe.

Such a machine is built upright along its own slides, turned as they are, and stands on a wedge.
"""

from collections.abc import Mapping
from itertools import permutations, product

import numpy as np

from warpspace.machine.description import Machine
from warpspace.units import Array

_ALIGNED, _SQUARE = 0.9994, 0.02
"""Cosines of two angles: 2 degrees to an axis of R, and one degree off a right angle."""


def find_slant(machine: Machine, poses: Mapping[str, Array]) -> Array:
    """Find how the slides of a machine are turned against the axes of R.

    Parameters
    ----------
    machine : Machine
    poses : mapping of str to ndarray, [4, 4]
        Every frame in R at home.

    Returns
    -------
    ndarray, [3, 3]
        The axes along which bodies are built, in R: the smallest rotation onto the linear axes, of
        equal ones that with most of them level. The unit matrix where they are aligned with R, or
        not square to each other, or where a rotary axis under the workpiece would stand askew.
    """
    linear = [poses[axis.name][:3, axis.index] for axis in machine.axes.values() if axis.is_linear]
    if all(np.abs(way).max() > _ALIGNED for way in linear):
        return np.eye(3)
    triad: list[Array] = []
    for way in linear:
        cosines = [abs(float(way @ known)) for known in triad]
        if any(_SQUARE < cosine < 1.0 - _SQUARE for cosine in cosines):
            return np.eye(3)
        if not any(cosine > 0.5 for cosine in cosines):
            triad.append(way)
    turned = _nearest(_completed(triad), np.array(linear))
    turning = [axis for axis in machine.branch("workpiece") if not axis.is_linear]
    about = [turned.T @ poses[axis.name][:3, axis.index] for axis in turning]
    return turned if all(np.abs(way).max() > _ALIGNED for way in about) else np.eye(3)


def _completed(triad: list[Array]) -> Array:
    """Complete one to three directions square to each other to three, [3, 3], as columns."""
    found = list(triad)
    for axis in np.eye(3)[np.argsort(np.abs(np.sum(np.square(triad), axis=0)))]:
        if len(found) < 3:
            rest = axis - sum((float(axis @ known) * known for known in found), np.zeros(3))
            if np.linalg.norm(rest) > 0.5:
                found.append(rest / np.linalg.norm(rest))
    left, _, right = np.linalg.svd(np.array(found).T)
    return left @ right


def _nearest(triad: Array, linear: Array) -> Array:
    """Order and point three directions so that they are turned least, [3, 3], as columns."""

    def rank(turned: Array) -> tuple[float, float]:
        level = np.abs(linear @ turned[:, 2]) < 0.5
        return round(float(np.trace(turned)), 6), float(level.sum())

    every = (
        triad[:, order] * signs
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    )
    return max((turned for turned in every if np.linalg.det(turned) > 0.0), key=rank)
