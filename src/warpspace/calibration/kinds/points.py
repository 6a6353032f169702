"""Error vectors at points of the working volume, as a laser tracker or an artefact gives them."""

from typing import ClassVar

import numpy as np

from warpspace.calibration.kinds.kind import Placed
from warpspace.calibration.readings import (
    Readings,
    axis_columns,
    check_poses,
    check_spread,
    sessions,
    uncertainties_mm,
)
from warpspace.calibration.table import ReadingTable
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, nominal_point
from warpspace.kinematics.model import Loop
from warpspace.machine.limits import MAX_ERROR
from warpspace.scene.model import Scene
from warpspace.units import Array

VECTORS = (("ex_um", "ey_um", "ez_um"), ("ex_mm", "ey_mm", "ez_mm"))


class Points(Placed):
    """Errors actual − nominal at axis positions; a session that is named has its own shift."""

    name: ClassVar[str] = "points"
    words: ClassVar[str] = "error vectors at points, tool relative to workpiece"
    columns: ClassVar[str] = (
        "an axis position each (x_mm, b_deg, …), ex_um, ey_um, ez_um (or _mm); u_um, session"
    )
    place: ClassVar[str] = "shift"
    sign: ClassVar[float] = 1.0

    def fits(self, table: ReadingTable, scene: Scene) -> bool:
        """Look for the error vectors."""
        del scene
        return any(set(names) <= set(table.columns) for names in VECTORS)

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        """Take positions of any axes, and the three components of the error."""
        in_mm = "ex_mm" in table.columns
        observed = table.need(VECTORS[in_mm]) * (1.0 if in_mm else 1e-3)
        axes = tuple(scene.machine.axes)
        coordinates, notes = axis_columns(table, scene, axes)
        check_poses(coordinates, table.source)
        hint = "Are the errors in the unit that their columns name?"
        check_spread(float(np.abs(observed).max()), MAX_ERROR * 1e-3, table.source, hint)
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

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        """Name a shift per session where the file names sessions."""
        return super().unknowns(readings) if any(readings.session) else ()


def nominal_tip(scene: Scene, coordinates: dict[str, Array]) -> Array:
    """Give the nominal tool point in the workpiece frame, [n, 3], mm."""
    model = scene.model
    tip = nominal_point(model, Loop.TOOL, coordinates)
    return transforms.apply(transforms.inverse(branch_pose(model, "workpiece", coordinates)), tip)
