"""Diagonals of a volume: their names, what readings along them come to (ISO 230-6)."""

from collections.abc import Sequence

import numpy as np

from warpspace.bench.paths.planes import PLANES
from warpspace.bench.plan import Plan
from warpspace.units import Array

BODY = ("PPP", "NPP", "PNP", "PPN")
"""Which way x, y and z run: P upwards, N downwards."""
KINDS = ("body", "face", "step")


def diagonal_names(kind: str) -> tuple[str, ...]:
    """List the diagonals of a kind: ``NPP``, or ``XY:NP`` for those of a face."""
    if kind == "face":
        return tuple(f"{plane}:{way}" for plane in PLANES for way in ("PP", "NP"))
    return BODY


def diagonal_signs(name: str) -> Array:
    """Give which way x, y and z run along a diagonal, [3]: +1, −1, or 0 where one stands."""
    plane, colon, ways = name.partition(":")
    if not colon:
        return np.array([1.0 if way == "P" else -1.0 for way in plane])
    signs = np.zeros(3)
    for axis, way in zip(plane, ways, strict=True):
        signs["XYZ".index(axis)] = 1.0 if way == "P" else -1.0
    return signs


def means_along(position: Array, way: Array, readings: Array) -> dict[str, Array]:
    """Take the mean at each position: of each direction, of both, and their difference."""
    places, index = np.unique(np.round(position, 3), return_inverse=True)
    sums = np.zeros((2, len(places)))
    counts = np.zeros((2, len(places)))
    for row, sign in enumerate((1.0, -1.0)):
        np.add.at(sums[row], index.reshape(-1)[way == sign], readings[way == sign])
        np.add.at(counts[row], index.reshape(-1)[way == sign], 1.0)
    ways = [sums[row] / counts[row] for row in (0, 1) if (counts[row] > 0.0).all()]
    if not ways:
        ways = [sums.sum(axis=0) / counts.sum(axis=0)]
    found = {"all": np.concatenate(ways), "mean": np.mean(ways, axis=0)}
    if len(ways) == 2:
        found["reversal"] = ways[0] - ways[1]
    return found


def steps_by_axis(axis: Array, readings: Array) -> dict[str, float]:
    """Add up what the steps of each axis contribute along a step diagonal, µm."""
    steps = np.diff(readings, prepend=readings[:1])
    return {name: float(steps[axis == index].sum()) for index, name in enumerate("XYZ")}


def squareness_of_diagonals(plan: Plan, names: Sequence[str], lengths: Array) -> dict[str, float]:
    """Squareness errors that the lengths of diagonals look like, µrad.

    A squareness of γ between axes of lengths a and b changes a diagonal of length L by ±γ·a·b/L;
    what all diagonals have in common is scale.
    """
    start = {name: np.flatnonzero(plan.marks["diagonal"] == i) for i, name in enumerate(names)}
    if any(len(rows) == 0 for rows in start.values()):
        return {}
    size = np.array([np.ptp(plan.marks["position_mm"][rows]) for rows in start.values()])
    first = [rows[0] for rows in start.values()]
    keys = [key for _, _, key in PLANES.values()]
    columns = [plan.marks[key][first] * size for key in keys]
    if len(names) == len(BODY):
        design = np.stack([np.ones(len(names)), *columns], -1)
    else:
        faces = np.kron(np.eye(3), np.ones((2, 1)))
        design = np.concatenate([faces, np.stack(columns, -1)], axis=-1)
    solution = np.linalg.lstsq(design, lengths, rcond=None)[0]
    return dict(zip(keys, solution[-3:].tolist(), strict=True))
