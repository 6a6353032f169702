"""The volume of a machine as a linear function of its errors: what any amplitudes give."""

from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np

from warpspace.analysis.statistics import Statistics, volume_statistics
from warpspace.field.basis import ErrorBasis
from warpspace.field.grid import Grid
from warpspace.units import Array

NODES_AT_ONCE = 1000
"""Nodes whose rows are reduced at a time, so that memory stays small."""
SILENT = 1e-12
"""µm per µm or µrad: a response below it everywhere is none."""


@dataclass(frozen=True)
class Volume:
    """Response of all nodes of a volume, and the present errors.

    Attributes
    ----------
    basis : ErrorBasis
        First-order response of the nodes of `grid`.
    grid : Grid
    amplitudes : ndarray, [K], µm or µrad
        Present values in the order of `basis.keys`.
    """

    basis: ErrorBasis
    grid: Grid
    amplitudes: Array

    @cached_property
    def response(self) -> Array:
        """Response of every node, [K, N, 3], µm per µm or µrad."""
        return self.basis.position.reshape(len(self.basis.keys), -1, 3)

    @cached_property
    def error_um(self) -> Array:
        """Present error of every node, [N, 3], µm."""
        return np.tensordot(self.amplitudes, self.response, 1)

    @cached_property
    def acting(self) -> tuple[int, ...]:
        """Indices of the errors that move any node at all in this loop."""
        largest = np.abs(self.response).max(axis=(1, 2), initial=0.0)
        return tuple(int(index) for index in np.flatnonzero(largest > SILENT))

    @cached_property
    def triangle(self) -> tuple[Array, Array]:
        """What the RMS depends on: a matrix, [M, K], and the present error in it, [M].

        The RMS of a change d of the amplitudes is |matrix @ d + error|, in µm. It is the triangle
        of the QR decomposition of all weighted nodes, so that thousands of sets cost little.
        """
        nodes = self.error_um.shape[0]
        root = np.sqrt(self.grid.weights.reshape(-1))
        triangle = np.empty((0, len(self.basis.keys) + 1))
        for first in range(0, nodes, NODES_AT_ONCE):
            part = slice(first, first + NODES_AT_ONCE)
            columns = [*self.response[:, part], self.error_um[part]]
            rows = [(column * root[part, None]).reshape(-1) for column in columns]
            stacked = np.concatenate([triangle, np.array(rows).T])
            triangle = cast("Array", np.linalg.qr(stacked, mode="r"))
        return triangle[:, :-1], triangle[:, -1]

    def rms_um(self, indices: tuple[int, ...], change: Array) -> float:
        """Root mean square of the volume after a change of some amplitudes, µm."""
        matrix, error = self.triangle
        return float(np.linalg.norm(matrix[:, indices] @ change + error))

    def changed(self, indices: tuple[int, ...], values: Array) -> Array:
        """Give all amplitudes with some of them set to other values, [K], µm or µrad."""
        amplitudes = self.amplitudes.copy()
        amplitudes[list(indices)] = values
        return amplitudes

    def statistics(self, amplitudes: Array) -> Statistics:
        """Summarise the volume for any amplitudes, [K], µm or µrad."""
        return volume_statistics(self.basis.evaluate(amplitudes, orientation=False), self.grid)
