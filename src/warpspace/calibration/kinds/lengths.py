"""Lengths from stations whose places nobody knows (multilateration)."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warpspace.calibration.kinds.kind import FromVectors, Guess
from warpspace.calibration.readings import (
    Readings,
    ReadingTable,
    axis_columns,
    check_poses,
    take_readings,
)
from warpspace.exceptions import SceneError
from warpspace.scene.model import Scene
from warpspace.units import Array

Indices = NDArray[np.intp]
LEAST = 5
"""Readings that a station needs: its place, its dead path, and one to check."""


class Lengths(FromVectors):
    """Distances between the tool point and stations, each with an unknown place and dead path."""

    name = "lengths"
    words = "lengths from unknown stations to the tool point (tracking laser)"
    columns = "an axis position each (x_mm, b_deg, …), length_mm; session names the station; u_um"

    def fits(self, table: ReadingTable, scene: Scene) -> bool:
        """Look for lengths."""
        del scene
        return "length_mm" in table.columns

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        """Take positions of any axes, and one length."""
        observed = table.need(("length_mm",))
        coordinates, notes = axis_columns(table, scene, tuple(scene.machine.axes))
        check_poses(coordinates, table.source)
        labels = table.session or ("1",) * len(table)
        for name in dict.fromkeys(labels):
            count = labels.count(name)
            if count < LEAST:
                found = f"station {name!r} has {count} lengths"
                raise SceneError(table.source, [f"{found}; expected at least {LEAST}"])
        found = take_readings(self.name, scene, table, coordinates, observed, notes)
        return replace(found, session=labels)

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        """Name place and dead path of each station."""
        return tuple(
            f"station {name} {what}"
            for name in dict.fromkeys(readings.session)
            for what in ("x", "y", "z", "dead path")
        )

    def start(self, readings: Readings, unknowns: tuple[str, ...]) -> Array:
        """Find each station from the nominal points, from several beginnings."""
        values = np.zeros(len(unknowns))
        stations = self._stations(readings, unknowns)
        for name in dict.fromkeys(readings.session):
            at = unknowns.index(f"station {name} x")
            mine = stations == at
            values[at : at + 4] = _locate(readings.nominal_mm[mine], readings.observed_mm[mine, 0])
        return values

    def predict(self, readings: Readings, error_mm: Array, guess: Guess) -> Array:
        """Take the distance, less the dead path."""
        at, away = self._beams(readings, error_mm, guess)
        return (np.linalg.norm(away, axis=-1) - guess.values[at + 3])[:, None]

    def derivatives(self, readings: Readings, error_mm: Array, guess: Guess) -> tuple[Array, Array]:
        """Give the direction of the beam."""
        at, away = self._beams(readings, error_mm, guess)
        beam = away / np.linalg.norm(away, axis=-1, keepdims=True)
        by_unknown = np.zeros((len(readings), 1, len(guess.unknowns)))
        rows = np.arange(len(readings))
        for component in range(3):
            by_unknown[rows, 0, at + component] = -beam[:, component]
        by_unknown[rows, 0, at + 3] = -1.0
        return beam[:, None, :], by_unknown

    def _beams(self, readings: Readings, error_mm: Array, guess: Guess) -> tuple[Indices, Array]:
        """Give where the unknowns of stations begin, [n], and the way from there, [n, 3], mm."""
        at = self._stations(readings, guess.unknowns)
        places = np.stack([guess.values[at + component] for component in range(3)], -1)
        return at, readings.nominal_mm + error_mm - places

    def _stations(self, readings: Readings, unknowns: tuple[str, ...]) -> Indices:
        """Give where the unknowns of each reading's station begin, [n]."""
        index = {name: at for at, name in enumerate(unknowns)}
        return np.array([index[f"station {name} x"] for name in readings.session], np.intp)


def _locate(points_mm: Array, length_mm: Array) -> Array:
    """Find a station that has given lengths to points: place and dead path, [4], mm."""
    from scipy.optimize import least_squares

    middle = points_mm.mean(axis=0)
    reach = max(float(np.ptp(points_mm, axis=0).max()), float(np.ptp(length_mm)), 1.0)

    def missed(values: Array) -> Array:
        return np.linalg.norm(points_mm - values[:3], axis=-1) - values[3] - length_mm

    corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), -1).reshape(-1, 3)
    found = (
        least_squares(missed, [*(middle + reach * corner), 0.0], x_scale=reach)
        for corner in corners
    )
    return min(found, key=lambda one: one.cost).x
