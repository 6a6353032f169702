"""Kinds of measurement: columns, readings, and their prediction by the model."""

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
    axis_column,
    axis_columns,
    build_readings,
    check_spread,
)
from warpspace.field.evaluate import View, build_basis, error_values, evaluate_exact
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop
from warpspace.machine.errors import ErrorSet
from warpspace.machine.limits import MAX_ERROR
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, Array

VIEW = View(Loop.RELATIVE, "workpiece")
"""View of all predictions: tool point relative to the workpiece, in its nominal frame."""


@dataclass(frozen=True, slots=True)
class Prediction:
    """Errors and unknowns of the set-ups from which readings are predicted."""

    errors: ErrorSet
    unknowns: tuple[str, ...]  # (m,)
    values: Array  # [m], mm


RANK_TOLERANCE = 2e-4
"""Share of its effect that a parameter must add to those before it, to be independent.

Below it, noise of a thousandth leads to values that no machine has.
"""


class MeasurementKind(ABC):
    """A kind of measurement.

    A reading is a function of the errors of the machine and of a few unknowns of the set-up: the
    position of a sphere or a station, the shift of a session.
    """

    name: ClassVar[str]  # as in options
    description: ClassVar[str]  # for lists and help
    columns: ClassVar[str]  # of its file
    # true where it parses the text of the file itself, for instance with columns of text
    reads_text: ClassVar[bool] = False
    rank_tolerance: ClassVar[float] = RANK_TOLERANCE

    def matches(self, table: ReadingTable, scene: Scene) -> bool:  # noqa: ARG002 - for overrides
        """Check for the columns of this kind, and of no other."""
        return False

    @abstractmethod
    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        """Build the readings of a file; raise SceneError for missing columns or invalid numbers."""

    @abstractmethod
    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        """List the unknowns of the set-up, each in mm, for instance ``sphere x``."""

    def start(self, readings: Readings) -> Array:
        """Return start values of the unknowns, [m], mm."""
        return np.zeros(len(self.unknowns(readings)))

    @abstractmethod
    def observe(self, scene: Scene, readings: Readings, prediction: Prediction) -> Array:
        """Predict the readings with the exact model, [n, d], mm."""

    @abstractmethod
    def slopes(
        self, scene: Scene, readings: Readings, prediction: Prediction, keys: tuple[str, ...]
    ) -> tuple[Array, Array]:
        """Differentiate the readings, [n, d, K], mm per µm or µrad, and by unknowns, [n, d, m]."""

    def automatic_keys(self, readings: Readings, scene: Scene) -> tuple[str, ...]:
        """List the parameters that are fitted by default, the likelier first."""
        del readings
        return scene.parameter_keys


class FromVectors(MeasurementKind):
    """Kind whose readings follow from the error vectors at its poses."""

    @abstractmethod
    def predict(
        self, readings: Readings, error_mm: Array, prediction: Prediction
    ) -> tuple[Array, Array, Array]:
        """Predict the readings, [n, d], mm, from error vectors, [n, 3], mm.

        And their derivatives: by the error, [n, d, 3], and by unknowns, [n, d, m].
        """

    def observe(self, scene: Scene, readings: Readings, prediction: Prediction) -> Array:
        return self.predict(readings, _error_mm(scene, readings, prediction), prediction)[0]

    def slopes(
        self, scene: Scene, readings: Readings, prediction: Prediction, keys: tuple[str, ...]
    ) -> tuple[Array, Array]:
        error_mm = _error_mm(scene, readings, prediction)
        _, by_error, by_unknown = self.predict(readings, error_mm, prediction)
        basis = build_basis(scene.model, prediction.errors, keys, readings.coordinates, VIEW)
        gains = np.einsum("ndx,knx->ndk", by_error, basis.position) * MM_PER_UM
        return gains, by_unknown


def _error_mm(scene: Scene, readings: Readings, prediction: Prediction) -> Array:
    field = evaluate_exact(scene.model, prediction.errors, readings.coordinates, VIEW)
    return field.error_um * MM_PER_UM


class FreePlacementKind(FromVectors):
    """Kind whose readings are ± the error plus an unknown position per session."""

    place: ClassVar[str]
    sign: ClassVar[float]

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        sessions = dict.fromkeys(readings.session)
        return tuple(f"{self._head(session)} {x}" for session in sessions for x in "xyz")

    def start(self, readings: Readings) -> Array:
        member = self._members(readings, self.unknowns(readings))
        total = np.einsum("ndm,nd->m", member, readings.observed_mm)
        return total / np.maximum(member.sum(axis=(0, 1)), 1.0)

    def predict(
        self, readings: Readings, error_mm: Array, prediction: Prediction
    ) -> tuple[Array, Array, Array]:
        member = self._members(readings, prediction.unknowns)
        by_error = np.broadcast_to(self.sign * np.eye(3), (*error_mm.shape, 3))
        return self.sign * error_mm + member @ prediction.values, by_error, member

    def _head(self, session: str) -> str:
        return f"{self.place} {session}".strip()

    def _members(self, readings: Readings, unknowns: tuple[str, ...]) -> Array:
        """Build the derivative of the readings by the unknowns, [n, 3, m]."""
        sessions, row = np.unique(readings.session, return_inverse=True)
        names = np.array([[f"{self._head(session)} {x}" for x in "xyz"] for session in sessions])
        return (names[..., None] == np.array(unknowns, dtype=str)).astype(float)[row]


_COLUMN = re.compile(
    r"(?:e(?P<short>[xyz])|error_(?P<loop>(?:tool|workpiece|relative)(?:_placed|_referenced)?))"
    r"(?:_(?P<frame>[rw]))?(?:_(?P<long>[xyz]))?_(?P<unit>um|mm)"
)


class Points(FreePlacementKind):
    """Errors actual − nominal at axis positions; each named session has its own shift.

    Readings are stored in the workpiece frame, whatever their frame in the file.
    """

    name = "points"
    description = "error vectors at points, tool relative to workpiece"
    columns = (
        "an axis position each (x_mm, b_deg, …), ex_um, ey_um, ez_um (or _mm; ex_R_um in the"
        " machine frame R, ex_w_um in that of the workpiece); u_um, session"
    )
    loops: ClassVar[tuple[str, ...]] = ("relative",)
    place = "shift"
    sign = 1.0

    def matches(self, table: ReadingTable, scene: Scene) -> bool:
        del scene
        return _vectors(table) is not None

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        columns, loop, frame = _vectors(table) or (("ex_um", "ey_um", "ez_um"), None, None)
        observed = table.require(columns) * (1.0 if columns[0].endswith("_mm") else 1e-3)
        if loop not in (None, *self.loops) and (
            loop != "tool" or scene.machine.branch("workpiece")
        ):
            raise table.refuse(
                f"has column {columns[0]}; expected errors in the relative loop without"
                " reference (with placement: kind tracker)"
            )
        if frame and table.frame and frame != table.frame:
            problem = f"has column {columns[0]}, so its vectors are in the {frame} frame"
            raise table.refuse(f"{problem}; expected no other frame")
        is_assumed = not (frame or table.frame)
        coordinates, notes = axis_columns(table, scene)
        frame = frame or table.frame or "workpiece"
        if frame == "machine":
            observed = transforms.rotate(_from_machine(scene, coordinates), observed)
        hint = "Do the column names state the right unit?"
        check_spread(float(np.abs(observed).max()), MAX_ERROR * 1e-3, table.source, hint)
        readings = build_readings(self.name, scene, table, coordinates, observed, notes)
        readings = replace(readings, frame=frame)
        if not is_assumed or in_other_frame(scene, readings) is None:
            return readings
        note = f"{Path(table.source).name}: vectors are taken in the workpiece frame"
        return replace(readings, notes=(*notes, note))

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        return super().unknowns(readings) if any(readings.session) else ()


class Tracker(Points):
    """Error vectors in the frame of an instrument with unknown position and orientation."""

    name = "tracker"
    description = (
        "error vectors of a tracker, its position and rotation unknown in each session; rotation in"
        " mrad"
    )
    loops = ("relative", "relative_placed")
    place = "tracker"

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        names = dict.fromkeys(name[:-2] for name in FreePlacementKind.unknowns(self, readings))
        return tuple(f"{name} {at}{x}" for name in names for at in ("", "turn ") for x in "xyz")

    def start(self, readings: Readings) -> Array:
        return np.zeros(len(self.unknowns(readings)))

    def _members(self, readings: Readings, unknowns: tuple[str, ...]) -> Array:
        """Build the derivative of the readings by the unknowns, [n, 3, m]."""
        member = super()._members(readings, unknowns)
        lever_m = readings.nominal_mm * MM_PER_UM
        turns = super()._members(readings, tuple(name.replace(" turn ", " ") for name in unknowns))
        turned = np.cross(turns.swapaxes(1, 2), lever_m[:, None]).swapaxes(1, 2)
        return np.where([" turn " in name for name in unknowns], turned, member)


def _vectors(table: ReadingTable) -> tuple[tuple[str, ...], str | None, str | None] | None:
    """Find three columns of vectors: their names, loop and frame."""
    groups: dict[tuple[str | None, ...], dict[str, str]] = {}
    for column in table.columns:
        match = _COLUMN.fullmatch(column)
        if match and bool(match["short"]) != bool(match["long"]):
            group = match["loop"], match["frame"], match["unit"]
            groups.setdefault(group, {})[match["short"] or match["long"]] = column
    frames = {letter: frame for frame, letter in FRAMES.items()}
    for (loop, letter, _), columns in groups.items():
        if len(columns) == 3:
            return tuple(columns[x] for x in "xyz"), loop, frames.get(letter or "")
    return None


def _from_machine(scene: Scene, coordinates: Mapping[str, Array]) -> Array:
    """Compute the rotations of vectors from R to the workpiece frame, [n, 3, 3]."""
    return np.swapaxes(branch_pose(scene.model, "workpiece", coordinates)[..., :3, :3], -1, -2)


def in_other_frame(scene: Scene, readings: Readings) -> Readings | None:
    """Return readings as if taken in the other frame; None where both frames are parallel."""
    turn, was_machine = _from_machine(scene, readings.coordinates), readings.frame == "machine"
    if not readings.frame or np.abs(turn - np.eye(3)).max() < 1e-9:
        return None
    turn = np.swapaxes(turn, -1, -2) if was_machine else turn
    observed = transforms.rotate(turn, readings.observed_mm)
    return replace(readings, observed_mm=observed, frame="workpiece" if was_machine else "machine")


MIN_LENGTHS = 5  # per station: four for its position and dead path, and one redundant


class Lengths(FromVectors):
    """Distances from stations of unknown position and dead path to the tool point."""

    name = "lengths"
    description = "lengths from unknown stations to the tool point (tracking laser)"
    columns = "an axis position each (x_mm, b_deg, …), length_mm; session names the station; u_um"

    def matches(self, table: ReadingTable, scene: Scene) -> bool:
        del scene
        return "length_mm" in table.columns

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        observed = table.require(("length_mm",))
        coordinates, notes = axis_columns(table, scene)
        labels = table.session if table.labels.keys() & {*LABELS} else ("1",) * len(table)
        for name in dict.fromkeys(labels):
            count = labels.count(name)
            if count < MIN_LENGTHS:
                problem = f"station {name!r} has {count} lengths"
                raise table.refuse(f"{problem}; expected at least {MIN_LENGTHS}")
        readings = build_readings(self.name, scene, table, coordinates, observed, notes)
        return replace(readings, session=labels)

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        return tuple(
            f"station {name} {quantity}"
            for name in dict.fromkeys(readings.session)
            for quantity in ("x", "y", "z", "dead path")
        )

    def start(self, readings: Readings) -> Array:
        sessions = np.array(readings.session)
        stations = (sessions == name for name in dict.fromkeys(readings.session))
        return np.concatenate(
            [_locate(readings.nominal_mm[at], readings.observed_mm[at, 0]) for at in stations]
        )

    def predict(
        self, readings: Readings, error_mm: Array, prediction: Prediction
    ) -> tuple[Array, Array, Array]:
        index = {name: at for at, name in enumerate(prediction.unknowns)}
        first = np.array([index[f"station {name} x"] for name in readings.session])
        station = first[:, None] + np.arange(4)  # position and dead path, of each reading
        values = prediction.values[station]
        away = readings.nominal_mm + error_mm - values[:, :3]
        length = np.linalg.norm(away, axis=-1)
        beam = away / length[:, None]
        by_unknown = np.zeros((len(readings), 1, len(prediction.unknowns)))
        slopes = np.column_stack([-beam, -np.ones(len(beam))])
        np.put_along_axis(by_unknown[:, 0], station, slopes, -1)
        return (length - values[:, 3])[:, None], beam[:, None, :], by_unknown


def _locate(points_mm: Array, length_mm: Array) -> Array:
    from scipy.optimize import least_squares

    middle = points_mm.mean(axis=0)
    reach = max(float(np.ptp(points_mm, axis=0).max()), float(np.ptp(length_mm)), 1.0)

    def deviations(values: Array) -> Array:
        return np.linalg.norm(points_mm - values[:3], axis=-1) - values[3] - length_mm

    corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), -1).reshape(-1, 3)
    solutions = (
        least_squares(deviations, [*(middle + reach * corner), 0.0], x_scale=reach)
        for corner in corners
    )
    return min(solutions, key=lambda solution: solution.cost).x


READ = ("x_mm", "y_mm", "z_mm")
UNKNOWNS = ("tracker", "tracker turn", "reflector")  # mm, mrad, mm
ITERATIONS = 50  # of the initial fit
FIT_SPREAD_MM = 100.0  # limit of residuals after the initial fit
STEP = 1e-3  # mm or mrad, for finite differences


class Positions(MeasurementKind):
    """Positions R(turn)·T·(tool point + reflector) + place, T being the pose of the tool frame.

    The pose is the actual one in the workpiece frame. The turn is a full rotation vector. The
    position of the instrument changes between sessions, the offset of the reflector does not.
    """

    name = "positions"
    description = (
        "positions of a reflector on the tool in the frame of a tracker; place, turn (mrad) and"
        " offset of the reflector are unknown (also as points)"
    )
    columns = (
        "an axis position each (c1_deg, …), x_mm, y_mm, z_mm, which are no axes; u_um, session"
    )

    # positions of a robot are noisy, and a reflector stands near to its last axis
    rank_tolerance = 2e-3

    def matches(self, table: ReadingTable, scene: Scene) -> bool:
        axes = {axis_column(scene, name) for name in scene.machine.axes}
        return set(READ) <= set(table.columns) and not axes & set(READ)

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        joints = [axis_column(scene, name) for name in scene.machine.columns]
        if joints and {*joints} <= {*table.columns} and not {*READ} & {*table.columns}:
            raise table.refuse(
                "has axis positions only; expected measured positions x_mm, y_mm, z_mm (a closed"
                " loop, where the tool stays at one point, is not supported)"
            )
        observed = table.require((*READ, *joints))[:, : len(READ)]
        coordinates, notes = axis_columns(table, scene)
        readings = build_readings(self.name, scene, table, coordinates, observed, notes)
        readings = replace(readings, first_fit=_first_fit(scene, readings))
        prediction = Prediction(scene.errors, self.unknowns(readings), np.array(readings.first_fit))
        residuals = observed - self.observe(scene, readings, prediction)
        hint = "Are they in mm, angles in degrees, and is the machine that of the scene?"
        check_spread(float(np.abs(residuals).max()), FIT_SPREAD_MM, table.source, hint)
        return readings

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        heads = [
            f"{unknown} {name}".strip()
            for name in dict.fromkeys(readings.session)
            for unknown in UNKNOWNS[:2]
        ]
        return tuple(f"{head} {x}" for head in (*heads, UNKNOWNS[2]) for x in "xyz")

    def start(self, readings: Readings) -> Array:
        return np.array(readings.first_fit)

    def observe(self, scene: Scene, readings: Readings, prediction: Prediction) -> Array:
        pose = _poses(scene, readings, prediction.errors)
        return _reflector_mm(scene, readings, prediction, pose)

    def slopes(
        self, scene: Scene, readings: Readings, prediction: Prediction, keys: tuple[str, ...]
    ) -> tuple[Array, Array]:
        """Differentiate numerically: errors of a robot are too large for the first order."""
        pose = _poses(scene, readings, prediction.errors)
        present = _reflector_mm(scene, readings, prediction, pose)

        def by_parameter(key: str) -> Array:
            curves = dict(prediction.errors.functions)
            curves[key] = curves[key].with_amplitude(curves[key].amplitude + 1.0)
            changed = replace(prediction, errors=ErrorSet(curves))
            return self.observe(scene, readings, changed) - present

        def by_unknown(at: int) -> Array:
            values = prediction.values + STEP * (np.arange(len(prediction.values)) == at)
            changed = replace(prediction, values=values)
            return (_reflector_mm(scene, readings, changed, pose) - present) / STEP

        none = np.zeros((*present.shape, 0))
        gains = [by_parameter(key)[..., None] for key in keys]
        slopes = [by_unknown(at)[..., None] for at in range(len(prediction.unknowns))]
        return np.concatenate([none, *gains], -1), np.concatenate([none, *slopes], -1)


def _poses(scene: Scene, readings: Readings, errors: ErrorSet) -> Array:
    """Compute the actual poses of the tool frame in the workpiece frame, [n, 4, 4]."""
    values = error_values(scene.model, errors, readings.coordinates)
    tool, workpiece = (
        branch_pose(scene.model, side, readings.coordinates, values)
        for side in ("tool", "workpiece")
    )
    return transforms.inverse(workpiece) @ tool


def _reflector_mm(scene: Scene, readings: Readings, prediction: Prediction, pose: Array) -> Array:
    unknowns = dict(zip(prediction.unknowns, prediction.values, strict=True))
    sessions, row = np.unique(readings.session, return_inverse=True)

    def vectors(unknown: str) -> Array:
        heads = [f"{unknown} {name}".strip() for name in sessions]
        return np.array([[unknowns[f"{head} {x}"] for x in "xyz"] for head in heads])

    place, turn = (vectors(unknown) for unknown in UNKNOWNS[:2])
    tip = np.array(scene.model.tool_point_mm) + [unknowns[f"{UNKNOWNS[2]} {x}"] for x in "xyz"]
    turned = transforms.vector_rotation(1e-3 * turn)[row]
    return transforms.rotate(turned, transforms.apply(pose, tip)) + place[row]


def _first_fit(scene: Scene, readings: Readings) -> tuple[float, ...]:
    """Fit alternately position and rotation of each session (Kabsch), and the reflector offset."""
    from scipy.spatial.transform import Rotation

    pose = _poses(scene, readings, scene.errors)
    turn, tip = pose[:, :3, :3], np.array(scene.model.tool_point_mm)
    sessions = np.array(readings.session)
    members = [sessions == name for name in dict.fromkeys(readings.session)]
    in_workpiece, placements = np.empty_like(readings.observed_mm), list[Array]()
    for _ in range(ITERATIONS):
        predicted, placements = transforms.apply(pose, tip), []
        for member in members:
            read, middle = readings.observed_mm[member], predicted[member].mean(axis=0)
            centred = read - read.mean(axis=0)
            rotation, *_ = Rotation.align_vectors(centred, predicted[member] - middle)
            place = read.mean(axis=0) - rotation.apply(middle)
            in_workpiece[member] = rotation.inv().apply(read - place)
            placements += [place, 1e3 * rotation.as_rotvec()]
        levers = in_workpiece - pose[:, :3, 3]
        tip, *_ = np.linalg.lstsq(turn.reshape(-1, 3), levers.ravel(), rcond=None)
    offset = tip - np.array(scene.model.tool_point_mm)
    return tuple(np.concatenate([*placements, offset]).tolist())
