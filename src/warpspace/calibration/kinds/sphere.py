"""Sphere centres with TCP correction off: the linear axes read circles about the rotary ones."""

from typing import ClassVar

import numpy as np

from warpspace.calibration.circles import circles_of
from warpspace.calibration.kinds.kind import Placed, head_keys
from warpspace.calibration.kinds.points import nominal_tip
from warpspace.calibration.kinds.sphere_tcp import (
    READ,
    has_centres,
    places,
    rotary_axes,
    solve_linear,
    spread_mm,
)
from warpspace.calibration.kinds.sphere_tcp import SPREAD_MM as TCP_SPREAD_MM
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
from warpspace.scene.model import Scene

SPREAD_MM = 100.0


class Sphere(Placed):
    """Positions of the linear axes, each time the tool point stands at the sphere."""

    name: ClassVar[str] = "sphere"
    words: ClassVar[str] = "centres of one sphere, TCP correction off: circles about rotary axes"
    columns: ClassVar[str] = (
        "rotary positions (b_deg, c_deg), linear positions x_mm, y_mm, z_mm; u_um, session or run"
    )
    place: ClassVar[str] = "sphere"
    sign: ClassVar[float] = -1.0

    def fits(self, table: ReadingTable, scene: Scene) -> bool:
        """Look for centres that wander."""
        return has_centres(table, scene) and spread_mm(table) > TCP_SPREAD_MM

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        """Take the positions of the linear axes; an axis that turns against its name is noted."""
        table.need(READ)
        rotary = rotary_axes(scene)
        linear = tuple(name for name in ("X", "Y", "Z") if name in scene.machine.axes)
        if len(linear) < len(READ):
            found = "holds positions of X, Y and Z"
            raise SceneError(table.source, [f"{found}; expected a machine with these three axes"])
        coordinates, notes = axis_columns(table, scene, (*rotary, *linear), rotary)
        check_poses({name: coordinates[name] for name in rotary}, table.source)
        circles = circles_of(table, scene)
        for circle in circles:
            if circle.against:
                coordinates[circle.axis] = np.where(
                    np.isin(table.session or ("",) * len(table), circle.sessions),
                    -coordinates[circle.axis],
                    coordinates[circle.axis],
                )
                note = (
                    f"run {', '.join(circle.sessions)}: {circle.axis} turns against the machine of"
                    " the scene; its positions are taken with the other sign"
                )
                notes = (*notes, note)
        tip = nominal_tip(scene, coordinates)
        nominal = solve_linear(scene, coordinates, places(tip, table), table.source)
        readings = Readings(
            self.name,
            nominal,
            nominal_tip(scene, nominal),
            tip,
            uncertainties_mm(table),
            sessions(table),
            table.lines,
            table.source,
            notes,
            circles,
        )
        unknown = self.unknowns(readings)
        about = tip - self._members(readings, unknown) @ self.start(readings, unknown)
        hint = "Are they in mm, and are the offsets of the scene those of the machine?"
        check_spread(float(np.abs(about).max()), SPREAD_MM, table.source, hint)
        return readings

    def automatic_keys(self, readings: Readings, scene: Scene) -> tuple[str, ...]:
        """Look for rigid errors of the rotary axes that move."""
        return head_keys(readings, scene)
