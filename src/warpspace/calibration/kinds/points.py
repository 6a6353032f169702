"""Error vectors at points of the working volume, as a laser tracker or an artefact gives them."""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from warpspace.calibration.kinds.kind import Placed
from warpspace.calibration.readings import (
    FRAMES,
    Readings,
    ReadingTable,
    axis_columns,
    check_poses,
    check_spread,
    take_readings,
)
from warpspace.exceptions import SceneError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.machine.limits import MAX_ERROR
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, Array

_COLUMN = re.compile(
    r"(?:e(?P<short>[xyz])|error_(?P<loop>(?:tool|workpiece|relative)(?:_placed|_referenced)?))"
    r"(?:_(?P<frame>[rw]))?(?:_(?P<long>[xyz]))?_(?P<unit>um|mm)"
)


class Points(Placed):
    """Errors actual − nominal at axis positions; a session that is named has its own shift.

    Readings are kept in the workpiece frame, whichever they were taken in.
    """

    name = "points"
    words = "error vectors at points, tool relative to workpiece"
    columns = (
        "an axis position each (x_mm, b_deg, …), ex_um, ey_um, ez_um (or _mm; ex_R_um in the"
        " machine frame R, ex_w_um in that of the workpiece); u_um, session"
    )
    loops: ClassVar[tuple[str, ...]] = ("relative",)
    place = "shift"
    sign = 1.0

    def fits(self, table: ReadingTable, scene: Scene) -> bool:
        """Look for the error vectors."""
        del scene
        return _vectors(table) is not None

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        """Take positions of any axes, and the three components of the error."""
        columns, loop, told = _vectors(table) or (("ex_um", "ey_um", "ez_um"), None, None)
        observed = table.need(columns) * (1.0 if columns[0].endswith("_mm") else 1e-3)
        if loop not in (None, *self.loops) and (
            loop != "tool" or scene.machine.branch("workpiece")
        ):
            found = (
                f"has column {columns[0]}; expected errors of field --loop relative, no reference"
            )
            raise SceneError(table.source, [f"{found} held (with --placed: --kind tracker)"])
        if told and table.frame and told != table.frame:
            found = f"has column {columns[0]}, so its vectors are in the {told} frame"
            raise SceneError(table.source, [f"{found}; expected no --frame {table.frame}"])
        axes = tuple(scene.machine.axes)
        coordinates, notes = axis_columns(table, scene, axes)
        frame = told or table.frame or "workpiece"
        if frame == "machine":
            observed = transforms.rotate(_from_machine(scene, coordinates), observed)
        check_poses(coordinates, table.source)
        hint = "Are the errors in the unit that their columns name?"
        check_spread(float(np.abs(observed).max()), MAX_ERROR * 1e-3, table.source, hint)
        readings = take_readings(self.name, scene, table, coordinates, observed, notes)
        readings = replace(readings, frame=frame)
        if told or table.frame or in_other_frame(scene, readings) is None:
            return readings
        note = f"{Path(table.source).name}: vectors are taken in the workpiece frame"
        return replace(readings, notes=(*notes, note))

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        """Name a shift per session where the file names sessions."""
        return super().unknowns(readings) if any(readings.session) else ()


class Tracker(Points):
    """Error vectors in the coordinates of an instrument whose place nobody knows: six numbers."""

    name = "tracker"
    words = (
        "error vectors of a tracker whose place and turn are unknown in each session; turns in mrad"
    )
    loops = ("relative", "relative_placed")
    place = "tracker"

    def fits(self, table: ReadingTable, scene: Scene) -> bool:
        """Say no: its columns are those of points."""
        del table, scene
        return False

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        """Name a shift and a turn per session."""
        names = dict.fromkeys(name[:-2] for name in Placed.unknowns(self, readings))
        return tuple(f"{name} {at}{x}" for name in names for at in ("", "turn ") for x in "xyz")

    def start(self, readings: Readings, unknowns: tuple[str, ...]) -> Array:
        """Begin with none."""
        del readings
        return np.zeros(len(unknowns))

    def _members(self, readings: Readings, unknowns: tuple[str, ...]) -> Array:
        """Tell what a unit of each unknown adds to each component, [n, 3, m]."""
        member = super()._members(readings, unknowns)
        heads = np.array([self._head(session) for session in readings.session])
        for at, name in enumerate(unknowns):
            head, turn, letter = name.partition(" turn ")
            if turn:
                lever_m = readings.nominal_mm * MM_PER_UM
                turned = np.cross(np.eye(3)["xyz".index(letter)], lever_m)
                member[:, :, at] = np.where((heads == head)[:, None], turned, 0.0)
        return member


def _vectors(table: ReadingTable) -> tuple[tuple[str, ...], str | None, str | None] | None:
    found: dict[tuple[str | None, ...], dict[str, str]] = {}
    for column in table.columns:
        told = _COLUMN.fullmatch(column)
        if told and bool(told["short"]) != bool(told["long"]):
            group = told["loop"], told["frame"], told["unit"]
            found.setdefault(group, {})[told["short"] or told["long"]] = column
    for (loop, frame, _), columns in found.items():
        if len(columns) == 3:
            names = tuple(columns[letter] for letter in "xyz")
            return names, loop, next((word for word in FRAMES if FRAMES[word] == frame), None)
    return None


def _from_machine(scene: Scene, coordinates: Mapping[str, Array]) -> Array:
    """Give the rotations that turn vectors from R into the workpiece frame, [n, 3, 3]."""
    return np.swapaxes(branch_pose(scene.model, "workpiece", coordinates)[..., :3, :3], -1, -2)


def in_other_frame(scene: Scene, readings: Readings) -> Readings | None:
    """Take vectors as if they were read in the other frame; None where that is the same."""
    turn, was_machine = _from_machine(scene, readings.coordinates), readings.frame == "machine"
    if not readings.frame or np.abs(turn - np.eye(3)).max() < 1e-9:
        return None
    turn = np.swapaxes(turn, -1, -2) if was_machine else turn
    observed = transforms.rotate(turn, readings.observed_mm)
    return replace(readings, observed_mm=observed, frame="workpiece" if was_machine else "machine")
