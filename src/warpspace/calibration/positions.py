"""Positions of a reflector on the tool, in the frame of an instrument whose place nobody knows."""

from dataclasses import replace

import numpy as np

from warpspace.calibration.kinds import MeasurementKind, Prediction
from warpspace.calibration.readings import (
    Readings,
    ReadingTable,
    axis_column,
    axis_columns,
    check_poses,
    check_spread,
    take_readings,
)
from warpspace.field.evaluate import error_values
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.machine.errors import ErrorSet
from warpspace.scene.model import Scene
from warpspace.units import Array

READ = ("x_mm", "y_mm", "z_mm")
UNKNOWNS = ("tracker", "tracker turn", "reflector")  # mm, mrad, mm
ROUNDS = 50  # of the first fit
SPREAD_MM = 100.0  # that a first fit may leave
STEP = 1e-3  # mm or mrad, for differences


class Positions(MeasurementKind):
    """Positions R(turn)·T·(tool point + reflector) + place, T being the pose of the tool frame.

    The pose is the actual one in the workpiece frame. The turn is a whole rotation vector. An
    instrument stands elsewhere in each session; the reflector stays.
    """

    name = "positions"
    words = (
        "positions of a reflector on the tool in the frame of a tracker; place, turn (mrad) and"
        " offset of the reflector are unknown (also as points)"
    )
    columns = (
        "an axis position each (c1_deg, …), x_mm, y_mm, z_mm, which are no axes; u_um, session"
    )

    blind = 2e-3  # positions of a robot are noisy, and a reflector stands near to its last axis

    def fits(self, table: ReadingTable, scene: Scene) -> bool:
        axes = {axis_column(scene, name) for name in scene.machine.axes}
        return set(READ) <= set(table.columns) and not axes & set(READ)

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        observed = table.need(READ)
        coordinates, notes = axis_columns(table, scene, tuple(scene.machine.axes))
        check_poses(coordinates, table.source)
        readings = take_readings(self.name, scene, table, coordinates, observed, notes)
        readings = replace(readings, first_fit=_first_fit(scene, readings))
        guess = Prediction(scene.errors, self.unknowns(readings), np.array(readings.first_fit))
        missed = observed - self.observe(scene, readings, guess)
        hint = "Are they in mm, angles in degrees, and is the machine that of the scene?"
        check_spread(float(np.abs(missed).max()), SPREAD_MM, table.source, hint)
        return readings

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        heads = [
            f"{what} {name}".strip()
            for name in dict.fromkeys(readings.session)
            for what in UNKNOWNS[:2]
        ]
        return tuple(f"{head} {x}" for head in (*heads, UNKNOWNS[2]) for x in "xyz")

    def start(self, readings: Readings) -> Array:
        return np.array(readings.first_fit)

    def observe(self, scene: Scene, readings: Readings, guess: Prediction) -> Array:
        return _seen(scene, readings, guess, _poses(scene, readings, guess.errors))

    def slopes(
        self, scene: Scene, readings: Readings, guess: Prediction, keys: tuple[str, ...]
    ) -> tuple[Array, Array]:
        """Differentiate by differences: errors of a robot are too large for the first order."""
        pose = _poses(scene, readings, guess.errors)
        here = _seen(scene, readings, guess, pose)

        def grown(key: str) -> Array:
            curve = guess.errors.functions[key]
            more = {**guess.errors.functions, key: curve.with_amplitude(curve.amplitude + 1.0)}
            return self.observe(scene, readings, replace(guess, errors=ErrorSet(more))) - here

        def moved(at: int) -> Array:
            values = guess.values + STEP * (np.arange(len(guess.values)) == at)
            return (_seen(scene, readings, replace(guess, values=values), pose) - here) / STEP

        none = np.zeros((*here.shape, 0))
        gains = [grown(key)[..., None] for key in keys]
        own = [moved(at)[..., None] for at in range(len(guess.unknowns))]
        return np.concatenate([none, *gains], -1), np.concatenate([none, *own], -1)


def _poses(scene: Scene, readings: Readings, errors: ErrorSet) -> Array:
    """Give the actual poses of the tool frame in that of the workpiece, [n, 4, 4]."""
    values = error_values(scene.model, errors, readings.coordinates)
    tool, workpiece = (
        branch_pose(scene.model, side, readings.coordinates, values)
        for side in ("tool", "workpiece")
    )
    return transforms.inverse(workpiece) @ tool


def _seen(scene: Scene, readings: Readings, guess: Prediction, pose: Array) -> Array:
    known = dict(zip(guess.unknowns, guess.values, strict=True))
    sessions, row = np.unique(readings.session, return_inverse=True)

    def vectors(what: str) -> Array:
        heads = [f"{what} {name}".strip() for name in sessions]
        return np.array([[known[f"{head} {x}"] for x in "xyz"] for head in heads])

    place, turn = (vectors(what) for what in UNKNOWNS[:2])
    tip = np.array(scene.model.tool_point_mm) + [known[f"{UNKNOWNS[2]} {x}"] for x in "xyz"]
    turned = transforms.vector_rotation(1e-3 * turn)[row]
    return transforms.rotate(turned, transforms.apply(pose, tip)) + place[row]


def _first_fit(scene: Scene, readings: Readings) -> tuple[float, ...]:
    """Fit place and turn of each session (Kabsch) and the offset of the reflector in turn."""
    from scipy.spatial.transform import Rotation

    pose = _poses(scene, readings, scene.errors)
    turn, tip = pose[:, :3, :3], np.array(scene.model.tool_point_mm)
    sessions = np.array(readings.session)
    members = [sessions == name for name in dict.fromkeys(readings.session)]
    back, known = np.empty_like(readings.observed_mm), list[Array]()
    for _ in range(ROUNDS):
        here, known = transforms.apply(pose, tip), []
        for one in members:
            read, middle = readings.observed_mm[one], here[one].mean(axis=0)
            laid = Rotation.align_vectors(read - read.mean(axis=0), here[one] - middle)[0]
            place = read.mean(axis=0) - laid.apply(middle)
            back[one] = laid.inv().apply(read - place)
            known += [place, 1e3 * laid.as_rotvec()]
        rest = back - pose[:, :3, 3]
        tip, *_ = np.linalg.lstsq(turn.reshape(-1, 3), rest.ravel(), rcond=None)
    offset = tip - np.array(scene.model.tool_point_mm)
    return tuple(float(value) for value in np.concatenate([*known, offset]))
