"""Circles about rotary axes, through sphere centres that were measured with TCP correction off."""

from dataclasses import dataclass

import numpy as np

from warpspace.analysis.circles import fit_flat_circle
from warpspace.calibration.table import ReadingTable
from warpspace.machine.axes import direction_index
from warpspace.scene.model import Scene
from warpspace.units import Array

PLANES = {0: (1, 2), 1: (0, 2), 2: (0, 1)}
LEAST = 3


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle that the linear axes read while one rotary axis turned.

    Attributes
    ----------
    axis : str
        The rotary axis.
    sessions : tuple of str
        The runs it was fitted to; each closes on the same circle.
    plane : str
        For instance "XZ".
    centre_mm : tuple of float, (2,), mm
        In the plane, axis positions.
    radius_mm : float, mm
    rms_mm : float, mm
        Of the distances of the centres from the circle.
    count : int
        Readings.
    against : bool
        Whether the axis turned against the machine of the scene.
    """

    axis: str
    sessions: tuple[str, ...]
    plane: str
    centre_mm: tuple[float, float]
    radius_mm: float
    rms_mm: float
    count: int
    against: bool


def circles_of(table: ReadingTable, scene: Scene) -> tuple[Circle, ...]:
    """Fit a circle per run in which one rotary axis turns, and one per axis to all such runs.

    Parameters
    ----------
    table : ReadingTable
        With x_mm, y_mm, z_mm and rotary positions.
    scene : Scene
        Names the rotary axes and the sense they turn in.

    Returns
    -------
    tuple of Circle
        Runs with fewer than three different positions are left out.

    Notes
    -----
    As `warpspace.analysis.circles.fit_flat_circle` has it, in the plane of the two linear axes
    across the rotary one.
    """
    read = table.need(("x_mm", "y_mm", "z_mm"))
    labels = np.array(table.session or ("",) * len(table))
    rotary = [name for name, axis in scene.machine.axes.items() if not axis.is_linear]
    turned = {name: table.columns.get(f"{name.lower()}_deg") for name in rotary}
    runs: dict[str, list[str]] = {}
    for session in dict.fromkeys(labels.tolist()):
        mine = labels == session
        moving = [
            name
            for name, values in turned.items()
            if values is not None and len(np.unique(values[mine])) >= LEAST
        ]
        still = [
            name
            for name, values in turned.items()
            if values is not None and np.ptp(values[mine]) > 0.0 and name not in moving
        ]
        if len(moving) == 1 and not still:
            runs.setdefault(moving[0], []).append(session)
    found: list[Circle] = []
    for axis, sessions in runs.items():
        groups = [(one,) for one in sessions] + ([tuple(sessions)] if len(sessions) > 1 else [])
        for group in groups:
            mine = np.isin(labels, group)
            values = turned[axis]
            assert values is not None  # noqa: S101 - runs hold axes with a column only
            found.append(_fit(axis, group, read[mine], values[mine], scene))
    return tuple(found)


def _fit(
    axis: str, sessions: tuple[str, ...], read_mm: Array, position_deg: Array, scene: Scene
) -> Circle:
    """Fit one circle."""
    first, second = PLANES[direction_index(axis)]
    flat = read_mm[:, (first, second)]
    centre, radius = fit_flat_circle(flat)
    away = np.linalg.norm(flat - centre, axis=-1) - radius
    angle = np.deg2rad(position_deg) * scene.machine.axes[axis].direction
    across = -1.0 if direction_index(axis) == 1 else 1.0  # from z to x about y, not from x to z
    turn = np.exp(1j * across * angle)
    complex_mm = (flat - centre) @ np.array([1.0, 1j])
    along = abs(np.vdot(turn, complex_mm))
    against = abs(np.vdot(np.conj(turn), complex_mm))
    return Circle(
        axis,
        sessions,
        "XYZ"[first] + "XYZ"[second],
        (float(centre[0]), float(centre[1])),
        radius,
        float(np.sqrt(np.mean(away**2))),
        len(flat),
        bool(against > along),
    )
