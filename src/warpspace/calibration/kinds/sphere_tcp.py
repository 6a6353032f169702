"""Sphere centres with TCP correction on: the centre should stay where it is."""

from typing import ClassVar

import numpy as np

from warpspace.calibration.kinds.kind import Placed, head_keys
from warpspace.calibration.kinds.points import nominal_tip
from warpspace.calibration.readings import (
    Readings,
    axis_columns,
    check_poses,
    check_spread,
    sessions,
    uncertainties_mm,
)
from warpspace.calibration.table import ReadingTable
from warpspace.exceptions import SceneError
from warpspace.machine.axes import direction_index
from warpspace.scene.model import Scene
from warpspace.units import Array

READ = ("x_mm", "y_mm", "z_mm")
SPREAD_MM = 20.0
"""Centres that wander further than this were not measured with TCP correction."""


class SphereTcp(Placed):
    """The tool point that the controller believes in, each time it stands at the sphere.

    The controller moves the linear axes so that its nominal tool point stays; the errors of the
    machine move the true one off, and the reading by the same amount the other way.
    """

    name: ClassVar[str] = "sphere-tcp"
    words: ClassVar[str] = "centres of one sphere, TCP correction on (R-test, ISO 10791-6)"
    columns: ClassVar[str] = "rotary positions (b_deg, c_deg), x_mm, y_mm, z_mm; u_um, session"
    place: ClassVar[str] = "sphere"
    sign: ClassVar[float] = -1.0

    def fits(self, table: ReadingTable, scene: Scene) -> bool:
        """Look for centres that stay within a few millimetres."""
        return has_centres(table, scene) and spread_mm(table) <= SPREAD_MM

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        """Take the centres, and find where the linear axes stood."""
        observed = table.need(READ)
        rotary = rotary_axes(scene)
        coordinates, notes = axis_columns(table, scene, rotary, rotary)
        check_poses({name: coordinates[name] for name in rotary}, table.source)
        hint = "Were they measured with TCP correction off (--kind sphere), or in another unit?"
        check_spread(spread_mm(table), SPREAD_MM, table.source, hint)
        coordinates = solve_linear(scene, coordinates, places(observed, table), table.source)
        return Readings(
            self.name,
            coordinates,
            nominal_tip(scene, coordinates),
            observed,
            uncertainties_mm(table),
            sessions(table),
            table.lines,
            table.source,
            notes,
        )

    def automatic_keys(self, readings: Readings, scene: Scene) -> tuple[str, ...]:
        """Look for rigid errors of the rotary axes that move."""
        return head_keys(readings, scene)


def rotary_axes(scene: Scene) -> tuple[str, ...]:
    """Name the rotary axes of a machine."""
    return tuple(name for name, axis in scene.machine.axes.items() if not axis.is_linear)


def has_centres(table: ReadingTable, scene: Scene) -> bool:
    """Tell whether a file has centres at positions of rotary axes."""
    rotary = {f"{name.lower()}_deg" for name in rotary_axes(scene)}
    return set(READ) <= set(table.columns) and bool(rotary & set(table.columns))


def spread_mm(table: ReadingTable) -> float:
    """Give how far the centres of one session wander, mm."""
    observed, labels = table.need(READ), table.session or ("",) * len(table)
    groups = [np.array(labels) == name for name in dict.fromkeys(labels)]
    return max(float(np.ptp(observed[group], axis=0).max()) for group in groups)


def places(observed_mm: Array, table: ReadingTable) -> Array:
    """Give the mean centre of the session of each reading, [n, 3], mm.

    Errors are evaluated where the axes stand nominally. Positions that held the reading itself
    would let an error of scale explain any reading.
    """
    labels = np.array(sessions(table))
    means = {name: observed_mm[labels == name].mean(axis=0) for name in dict.fromkeys(labels)}
    return np.stack([means[name] for name in labels])


def solve_linear(
    scene: Scene, coordinates: dict[str, Array], target_mm: Array, source: str
) -> dict[str, Array]:
    """Find the positions of the linear axes that nominally bring the tool point to a target.

    Parameters
    ----------
    scene : Scene
    coordinates : dict of str to ndarray, [n], mm or degrees
        All axes; those of linear axes are replaced.
    target_mm : ndarray, [n, 3], mm
        In the workpiece frame.
    source : str
        File, for messages.

    Returns
    -------
    dict of str to ndarray, [n], mm or degrees

    Raises
    ------
    SceneError
        If the machine does not reach a target.

    Notes
    -----
    The nominal tool point is an affine function of them at given rotary positions.
    """
    one_per_direction: dict[int, str] = {}
    for name, axis in scene.machine.axes.items():
        if axis.is_linear:
            one_per_direction.setdefault(direction_index(name), name)
    linear = list(one_per_direction.values())
    zero = {**coordinates, **{name: np.zeros(len(target_mm)) for name in linear}}
    start = nominal_tip(scene, zero)
    columns = [
        nominal_tip(scene, {**zero, name: np.ones(len(target_mm))}) - start for name in linear
    ]
    system = np.stack(columns, -1) if columns else np.zeros((len(target_mm), 3, 0))
    solved = np.linalg.pinv(system) @ (target_mm - start)[..., None]
    missed = float(np.abs(system @ solved - (target_mm - start)[..., None]).max())
    if missed > 1e-6:
        names = ", ".join(linear) or "none"
        found = f"lies up to {missed:.3g} mm from where linear axes ({names}) can bring the tool"
        raise SceneError(source, [f"{found}; expected a machine that reaches the sphere"])
    return {**zero, **{name: solved[:, at, 0] for at, name in enumerate(linear)}}
