"""Placement and shape of a part in an inspection: what deviations of its points determine."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpspace.parts.inspection_report import InspectionReport
from warpspace.units import MM_PER_UM, Array

LARGE_TURN_RAD = 1e-3  # rotations beyond are taken out in full; below, to first order
RANK_TOLERANCE = 1e-6  # share of its effect by which a number of the shape must be determined


@dataclass(frozen=True, eq=False)
class PartShape:
    """Linear effects on the deviations of points, [n·d], of a placement and of the shape.

    Placement: shifts in mm, and turns in mrad about z, in space about x, y, z. Shape: scales in
    mm/m, and squareness in mrad: the change of the angle between the lines of the part along two
    axes, actual − nominal, positive above 90°. It displaces points along the first axis by −q
    times the second coordinate.
    """

    nominal_mm: Array  # [n, 3]
    size: int  # d: 2 in the plane, else 3

    @property
    def names(self) -> tuple[str, ...]:
        scales = [f"scale {letter}" for letter in "xyz"[: self.size]]
        pairs = [""] if self.size == 2 else [" xy", " xz", " yz"]
        return (*scales, *(f"squareness{pair}" for pair in pairs))

    @property
    def units(self) -> tuple[str, ...]:
        return ("µm/m",) * self.size + ("µrad",) * (len(self.names) - self.size)

    @property
    def keys(self) -> tuple[str, ...]:
        """Names with units, as in JSON."""
        words = {"µm/m": "um_per_m", "µrad": "urad"}
        pairs = zip(self.names, self.units, strict=True)
        return tuple(f"{name}_{words[unit]}".replace(" ", "_") for name, unit in pairs)

    @cached_property
    def columns(self) -> tuple[Array, Array]:
        """Effects of placement and of shape, [n·d, m] each, mm per mm, mrad or mm/m."""
        arm_m, unit, size = self.nominal_mm * MM_PER_UM, np.eye(3), self.size
        shifts = [np.broadcast_to(unit[at], arm_m.shape) for at in range(size)]
        turns = [np.cross(unit[at], arm_m) for at in ((2,) if size == 2 else (0, 1, 2))]
        scales = [arm_m[:, [at]] * unit[at] for at in range(size)]
        pairs = ((0, 1),) if size == 2 else ((0, 1), (0, 2), (1, 2))
        shears = [-arm_m[:, [second]] * unit[first] for first, second in pairs]
        groups = [*shifts, *turns], [*scales, *shears]
        rows = [np.stack(group, axis=-1)[:, :size] for group in groups]
        placement, shape = (row.reshape(len(arm_m) * size, -1) for row in rows)
        return placement, shape

    @cached_property
    def inverses(self) -> tuple[Array, Array]:
        """Least squares of the placement alone, [p, n·d], and of the shape with it, [s, n·d]."""
        placement, _ = self.columns
        columns = np.hstack(self.columns)
        scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
        inverse: Any = np.linalg.pinv(columns / scale, rcond=RANK_TOLERANCE) / scale[:, None]
        placing: Any = np.linalg.pinv(placement, rcond=1e-12)
        return placing, inverse[placement.shape[1] :]

    @cached_property
    def is_estimable(self) -> NDArray[np.bool_]:
        """Numbers of the shape that the points determine, [s]."""
        count = len(self.names)
        resolution = (self.inverses[1] @ np.hstack(self.columns))[:, -count:]
        return np.abs(np.diagonal(resolution) - 1.0) < RANK_TOLERANCE

    def place(self, deviations: Array) -> Array:
        """Remove the best-fit placement from deviations, [..., n·d]."""
        return deviations - deviations @ self.inverses[0].T @ self.columns[0].T

    def placed_variance(self, variances: Array) -> Array:
        """Compute the variances of placed deviations from those of independent ones, [n·d]."""
        columns, inverse = self.columns[0], self.inverses[0]
        leverage = np.sum(columns * inverse.T, axis=1)
        shared = columns @ ((inverse * variances) @ inverse.T)
        return variances * (1.0 - 2.0 * leverage) + np.sum(shared * columns, axis=1)


def align(report: InspectionReport) -> tuple[Array, Array]:
    """Remove a large rotation of the measured points: deviations, [n, d], mm, and it, [4, 4].

    A turn below `LARGE_TURN_RAD` stays, as in a linear affine fit: its second order, below
    0.5 µm/m, is part of the scales.
    """
    size, nominal, placement = report.dimension, report.nominal_mm, np.eye(4)
    deviation = np.zeros((len(nominal), 3))
    deviation[:, :size] = 0.0 if report.deviation_mm is None else report.deviation_mm
    flat = np.diag([1.0, 1.0, float(size == 3)])
    nominal = nominal @ flat
    middle, moved = nominal.mean(axis=0), (nominal + deviation).mean(axis=0)
    arms, measured = nominal - middle, nominal + deviation - moved
    first, _, second = np.linalg.svd(measured.T @ arms)
    turn = first @ np.diag([1.0, 1.0, np.linalg.det(first @ second)]) @ second
    if np.linalg.norm(turn - np.eye(3)) > np.sqrt(2.0) * LARGE_TURN_RAD:
        placement[:3, :3], placement[:3, 3] = turn, moved - turn @ middle
        deviation = measured @ turn - arms
    return deviation[:, :size], placement
