"""What every kind of measurement is and can: columns, readings, and what the model predicts."""

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from warpspace.calibration.readings import (
    FRAMES,
    LABELS,
    Readings,
    ReadingTable,
    axis_columns,
    check_poses,
    check_spread,
    take_readings,
)
from warpspace.exceptions import SceneError
from warpspace.field.evaluate import View, build_basis, evaluate_exact
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop
from warpspace.machine.errors import ErrorSet
from warpspace.machine.limits import MAX_ERROR
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, Array

VIEW = View(Loop.RELATIVE, "workpiece")
"""How errors are looked at: the tool point relative to the workpiece, in its nominal frame."""


@dataclass(frozen=True, slots=True)
class Prediction:
    """What readings are predicted from: errors, and what the set-ups leave unknown."""

    errors: ErrorSet
    unknowns: tuple[str, ...]  # (m,)
    values: Array  # [m], mm


BLIND = 2e-4
"""Share of its own effect below which what is left of a parameter counts as nothing.

With less, noise of a thousandth makes values that no machine has.
"""


class MeasurementKind(ABC):
    """A kind of measurement.

    A reading is a function of the errors of the machine and of a few numbers that nobody knows:
    where a sphere or a station stands, by how much a session is shifted.
    """

    name: ClassVar[str]  # as an option takes it
    words: ClassVar[str]  # what it is, for lists and help
    columns: ClassVar[str]  # of its file
    # whether it takes the text of the file, columns of words among them, rather than its table
    own_columns: ClassVar[bool] = False
    blind: ClassVar[float] = BLIND

    def fits(self, table: ReadingTable, scene: Scene) -> bool:  # noqa: ARG002 - for others
        """Tell whether a file has the columns of this kind, and of no other."""
        return False

    @abstractmethod
    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        """Give the readings of a file; refuse one that lacks a column or holds what cannot be."""

    @abstractmethod
    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        """Name what the set-up leaves unknown, each in mm, for instance ``sphere x``."""

    def start(self, readings: Readings) -> Array:
        """Give values of the unknowns to begin with, [m], mm."""
        return np.zeros(len(self.unknowns(readings)))

    @abstractmethod
    def observe(self, scene: Scene, readings: Readings, guess: Prediction) -> Array:
        """Give the readings that errors would lead to, with the exact model, [n, d], mm."""

    @abstractmethod
    def slopes(
        self, scene: Scene, readings: Readings, guess: Prediction, keys: tuple[str, ...]
    ) -> tuple[Array, Array]:
        """Differentiate the readings, [n, d, K], mm per µm or µrad, and by unknowns, [n, d, m]."""

    def automatic_keys(self, readings: Readings, scene: Scene) -> tuple[str, ...]:
        """List the parameters that are looked for where none are named, the likelier first."""
        del readings
        return scene.parameter_keys


class FromVectors(MeasurementKind):
    """A kind whose readings follow from the error vectors at its poses."""

    @abstractmethod
    def predict(
        self, readings: Readings, error_mm: Array, guess: Prediction
    ) -> tuple[Array, Array, Array]:
        """Give the readings, [n, d], mm, that errors, [n, 3], mm, would lead to.

        Beside them their derivatives: by the error, [n, d, 3], and by unknowns, [n, d, m].
        """

    def observe(self, scene: Scene, readings: Readings, guess: Prediction) -> Array:
        return self.predict(readings, _error_mm(scene, readings, guess), guess)[0]

    def slopes(
        self, scene: Scene, readings: Readings, guess: Prediction, keys: tuple[str, ...]
    ) -> tuple[Array, Array]:
        error_mm = _error_mm(scene, readings, guess)
        _, by_error, by_unknown = self.predict(readings, error_mm, guess)
        basis = build_basis(scene.model, guess.errors, keys, readings.coordinates, VIEW)
        gains = np.einsum("ndx,knx->ndk", by_error, basis.position) * MM_PER_UM
        return gains, by_unknown


def _error_mm(scene: Scene, readings: Readings, guess: Prediction) -> Array:
    field = evaluate_exact(scene.model, guess.errors, readings.coordinates, VIEW)
    return field.error_um * MM_PER_UM


class FreePlacementKind(FromVectors):
    """A kind whose readings are ± the error plus the place of something, one place per session."""

    place: ClassVar[str]
    sign: ClassVar[float]

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        return tuple(
            f"{self._head(session)} {letter}"
            for session in dict.fromkeys(readings.session)
            for letter in "xyz"
        )

    def start(self, readings: Readings) -> Array:
        member = self._members(readings, self.unknowns(readings))
        total = np.einsum("ndm,nd->m", member, readings.observed_mm)
        return total / np.maximum(member.sum(axis=(0, 1)), 1.0)

    def predict(
        self, readings: Readings, error_mm: Array, guess: Prediction
    ) -> tuple[Array, Array, Array]:
        member = self._members(readings, guess.unknowns)
        by_error = np.broadcast_to(self.sign * np.eye(3), (*error_mm.shape, 3))
        return self.sign * error_mm + member @ guess.values, by_error, member

    def _head(self, session: str) -> str:
        return f"{self.place} {session}".strip()

    def _members(self, readings: Readings, unknowns: tuple[str, ...]) -> Array:
        """Tell which unknown each component of each reading has, [n, 3, m]."""
        member = np.zeros((len(readings), 3, len(unknowns)))
        index = {name: at for at, name in enumerate(unknowns)}
        for row, session in enumerate(readings.session):
            for component, letter in enumerate("xyz"):
                at = index.get(f"{self._head(session)} {letter}")
                if at is not None:
                    member[row, component, at] = 1.0
        return member


_COLUMN = re.compile(
    r"(?:e(?P<short>[xyz])|error_(?P<loop>(?:tool|workpiece|relative)(?:_placed|_referenced)?))"
    r"(?:_(?P<frame>[rw]))?(?:_(?P<long>[xyz]))?_(?P<unit>um|mm)"
)


class Points(FreePlacementKind):
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
        del scene
        return _vectors(table) is not None

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
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
        return super().unknowns(readings) if any(readings.session) else ()


class Tracker(Points):
    """Error vectors in the coordinates of an instrument whose place nobody knows: six numbers."""

    name = "tracker"
    words = (
        "error vectors of a tracker whose place and turn are unknown in each session; turns in mrad"
    )
    loops = ("relative", "relative_placed")
    place = "tracker"

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        names = dict.fromkeys(name[:-2] for name in FreePlacementKind.unknowns(self, readings))
        return tuple(f"{name} {at}{x}" for name in names for at in ("", "turn ") for x in "xyz")

    def start(self, readings: Readings) -> Array:
        return np.zeros(len(self.unknowns(readings)))

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


LEAST = 5  # readings that a station needs: its place, its dead path, and one to check


class Lengths(FromVectors):
    """Distances between the tool point and stations, each with an unknown place and dead path."""

    name = "lengths"
    words = "lengths from unknown stations to the tool point (tracking laser)"
    columns = "an axis position each (x_mm, b_deg, …), length_mm; session names the station; u_um"

    def fits(self, table: ReadingTable, scene: Scene) -> bool:
        del scene
        return "length_mm" in table.columns

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        observed = table.need(("length_mm",))
        coordinates, notes = axis_columns(table, scene, tuple(scene.machine.axes))
        check_poses(coordinates, table.source)
        labels = table.session if table.labels.keys() & {*LABELS} else ("1",) * len(table)
        for name in dict.fromkeys(labels):
            count = labels.count(name)
            if count < LEAST:
                found = f"station {name!r} has {count} lengths"
                raise SceneError(table.source, [f"{found}; expected at least {LEAST}"])
        found = take_readings(self.name, scene, table, coordinates, observed, notes)
        return replace(found, session=labels)

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        return tuple(
            f"station {name} {what}"
            for name in dict.fromkeys(readings.session)
            for what in ("x", "y", "z", "dead path")
        )

    def start(self, readings: Readings) -> Array:
        sessions = np.array(readings.session)
        stations = (sessions == name for name in dict.fromkeys(readings.session))
        return np.concatenate(
            [_locate(readings.nominal_mm[own], readings.observed_mm[own, 0]) for own in stations]
        )

    def predict(
        self, readings: Readings, error_mm: Array, guess: Prediction
    ) -> tuple[Array, Array, Array]:
        index = {name: at for at, name in enumerate(guess.unknowns)}
        first = np.array([index[f"station {name} x"] for name in readings.session])
        own = first[:, None] + np.arange(4)  # place and dead path of the station of each reading
        values = guess.values[own]
        away = readings.nominal_mm + error_mm - values[:, :3]
        length = np.linalg.norm(away, axis=-1)
        beam = away / length[:, None]
        by_unknown = np.zeros((len(readings), 1, len(guess.unknowns)))
        np.put_along_axis(by_unknown[:, 0], own, np.column_stack([-beam, -np.ones(len(own))]), -1)
        return (length - values[:, 3])[:, None], beam[:, None, :], by_unknown


def _locate(points_mm: Array, length_mm: Array) -> Array:
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
