"""Positions of a reflector on the tool, in the frame of an instrument of unknown position."""

from dataclasses import replace

import numpy as np

from warpspace.calibration.kinds import MeasurementKind, Prediction
from warpspace.calibration.readings import (
    Readings,
    ReadingTable,
    axis_column,
    axis_columns,
    build_readings,
    check_poses,
    check_spread,
)
from warpspace.field.evaluate import error_values
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.machine.errors import ErrorSet
from warpspace.scene.model import Scene
from warpspace.units import Array

READ = ("x_mm", "y_mm", "z_mm")
UNKNOWNS = ("tracker", "tracker turn", "reflector")  # mm, mrad, mm
ITERATIONS = 50  # of the initial fit
SPREAD_MM = 100.0  # limit of residuals after the initial fit
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

    rank_tolerance = (
        2e-3  # positions of a robot are noisy, and a reflector stands near to its last axis
    )

    def matches(self, table: ReadingTable, scene: Scene) -> bool:
        axes = {axis_column(scene, name) for name in scene.machine.axes}
        return set(READ) <= set(table.columns) and not axes & set(READ)

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        observed = table.require(READ)
        coordinates, notes = axis_columns(table, scene, tuple(scene.machine.axes))
        check_poses(coordinates, table.source)
        readings = build_readings(self.name, scene, table, coordinates, observed, notes)
        readings = replace(readings, first_fit=_first_fit(scene, readings))
        prediction = Prediction(scene.errors, self.unknowns(readings), np.array(readings.first_fit))
        residuals = observed - self.observe(scene, readings, prediction)
        hint = "Are they in mm, angles in degrees, and is the machine that of the scene?"
        check_spread(float(np.abs(residuals).max()), SPREAD_MM, table.source, hint)
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
        return _reflector_mm(
            scene, readings, prediction, _poses(scene, readings, prediction.errors)
        )

    def slopes(
        self, scene: Scene, readings: Readings, prediction: Prediction, keys: tuple[str, ...]
    ) -> tuple[Array, Array]:
        """Differentiate numerically: errors of a robot are too large for the first order."""
        pose = _poses(scene, readings, prediction.errors)
        present = _reflector_mm(scene, readings, prediction, pose)

        def by_parameter(key: str) -> Array:
            curve = prediction.errors.functions[key]
            curves = {
                **prediction.errors.functions,
                key: curve.with_amplitude(curve.amplitude + 1.0),
            }
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
            rotation = Rotation.align_vectors(read - read.mean(axis=0), predicted[member] - middle)[
                0
            ]
            place = read.mean(axis=0) - rotation.apply(middle)
            in_workpiece[member] = rotation.inv().apply(read - place)
            placements += [place, 1e3 * rotation.as_rotvec()]
        levers = in_workpiece - pose[:, :3, 3]
        tip, *_ = np.linalg.lstsq(turn.reshape(-1, 3), levers.ravel(), rcond=None)
    offset = tip - np.array(scene.model.tool_point_mm)
    return tuple(np.concatenate([*placements, offset]).tolist())
