"""The exact chain beside general libraries for rigid-body transformations: the same numbers.

The libraries know no error parameters. What they are given are the same steps: offset, constant
errors, motion and component errors of each axis as transformations (pytransform3d), or as joints of
their own, three translations and a quaternion before and behind each axis (pinocchio).
"""

from collections.abc import Callable

import numpy as np
import pinocchio as pin
from pytransform3d import batch_rotations
from pytransform3d.trajectories import concat_dynamic, invert_transforms
from scipy.spatial.transform import Rotation
from table import Growth, Row, Section
from timing import best, in_turns

from warpspace import load_scene
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import jacobian, loop_error, nominal_point
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.axes import DIRECTIONS
from warpspace.machine.definition import Axis

POINTS = 10_000
GROWING = (1_000, 10_000, 100_000)
AGREE_UM = 1e-5
Steps = dict[str, list[np.ndarray]]


def configurations(model: Model, count: int) -> tuple[dict, dict]:
    """Random axis positions, and a value of every error at each."""
    rng = np.random.default_rng(0)
    coordinates = {name: rng.uniform(-200.0, 200.0, count) for name in model.machine.axes}
    values = {key: rng.uniform(-30.0, 30.0, count) for key in model.machine.allowed_keys}
    return coordinates, values


def shift_and_turn(axis: str, values: dict, middle: str) -> tuple[np.ndarray, np.ndarray]:
    """The errors of an axis: shift in mm and rotation vector in rad, [n, 3] each."""
    zero = np.zeros_like(next(iter(values.values())))
    vectors = np.stack([values.get(f"E{letter}{middle}{axis}", zero) for letter in DIRECTIONS], -1)
    return vectors[:, :3] * 1e-3, vectors[:, 3:] * 1e-6


def moved_axis(axis: Axis, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The motion of an axis: shift in mm and rotation vector in rad, [n, 3] each."""
    along = np.eye(3)[axis.index] * (axis.direction * position)[:, None]
    return (along, 0.0 * along) if axis.is_linear else (0.0 * along, np.deg2rad(along))


def by_pytransform3d(
    model: Model, coordinates: dict, values: dict, point: np.ndarray
) -> np.ndarray:
    """Position error of the relative loop, [n, 3], µm, by batches of pytransform3d."""

    def built(shift: np.ndarray, turn: np.ndarray) -> np.ndarray:
        pose = np.tile(np.eye(4), (len(shift), 1, 1))
        pose[:, :3, :3] = batch_rotations.matrices_from_compact_axis_angles(turn)
        pose[:, :3, 3] = shift
        return pose

    error = 0.0
    for side, sign in (("tool", 1.0), ("workpiece", -1.0)):
        actual = nominal = np.tile(np.eye(4), (len(point), 1, 1))
        for axis in model.machine.branch(side):
            place = np.tile(
                transforms.placed(axis.offset_mm, axis.rotation_deg), (len(point), 1, 1)
            )
            move = built(*moved_axis(axis, coordinates[axis.name]))
            nominal = concat_dynamic(concat_dynamic(move, place), nominal)
            for step in (
                place,
                built(*shift_and_turn(axis.name, values, "0")),
                move,
                built(*shift_and_turn(axis.name, values, "")),
            ):
                actual = concat_dynamic(step, actual)
        pose = concat_dynamic(invert_transforms(nominal), actual)
        shifted = np.einsum("nij,nj->ni", pose[:, :3, :3], point) + pose[:, :3, 3] - point
        error = error + sign * shifted * 1e3
    return error


class Branch:
    """A branch as a model of pinocchio: every axis between two free joints for its errors."""

    def __init__(self, model: Model, side: str) -> None:
        self.model, self.axes, self.last = pin.Model(), model.machine.branch(side), 0
        for axis in self.axes:
            place = pin.SE3(transforms.placed(axis.offset_mm, axis.rotation_deg))
            kind = "P" if axis.is_linear else "R"
            moving = getattr(pin, f"JointModel{kind}{'XYZ'[axis.index]}")()
            for joint, at in (
                (pin.JointModelFreeFlyer(), place),
                (moving, pin.SE3.Identity()),
                (pin.JointModelFreeFlyer(), pin.SE3.Identity()),
            ):
                name = f"{axis.name}{self.model.njoints}"
                self.last = self.model.addJoint(self.last, joint, at, name)
        self.data = self.model.createData()

    def states(self, coordinates: dict, values: dict) -> np.ndarray:
        """Positions of all joints, [n, nq]."""
        parts = []
        for axis in self.axes:
            constant, component = (
                np.hstack([shift, Rotation.from_rotvec(turn).as_quat()])
                for shift, turn in (
                    shift_and_turn(axis.name, values, "0"),
                    shift_and_turn(axis.name, values, ""),
                )
            )
            at = axis.direction * coordinates[axis.name]
            moved = at if axis.is_linear else np.deg2rad(at)
            parts += [constant, moved[:, None], component]
        return np.hstack(parts)

    def pose(self, state: np.ndarray) -> pin.SE3:
        """Pose of the last joint."""
        pin.forwardKinematics(self.model, self.data, state)
        return self.data.oMi[self.last].copy()


def by_pinocchio(model: Model, coordinates: dict, values: dict, point: np.ndarray) -> np.ndarray:
    """Position error of the relative loop, [n, 3], µm, point by point with pinocchio."""
    error = np.zeros_like(point)
    none = {key: np.zeros(len(point)) for key in values}
    for side, sign in (("tool", 1.0), ("workpiece", -1.0)):
        branch = Branch(model, side)
        actual, nominal = branch.states(coordinates, values), branch.states(coordinates, none)
        for index, at in enumerate(point):
            moved = branch.pose(actual[index]) * branch.pose(nominal[index]).inverse()
            error[index] += sign * (moved.act(at) - at) * 1e3
    return error


def measure() -> Section:
    """Measure the same errors by each, and check that they are the same."""
    model = load_scene("dvf5000_first").model
    coordinates, values = configurations(model, POINTS)
    point = nominal_point(model, Loop.TOOL, coordinates)

    def ours() -> np.ndarray:
        return loop_error(model, Loop.RELATIVE, coordinates, values, point)[0]

    rows = []
    peers: tuple[tuple[str, Callable, int], ...] = (
        ("pytransform3d, whole batches", by_pytransform3d, 3),
        ("pinocchio, one point after the other", by_pinocchio, 1),
    )
    errors = len(values)
    for peer_name, peer, repeats in peers:
        run = lambda: peer(model, coordinates, values, point)  # noqa: B023, E731
        difference = float(np.abs(ours() - run()).max())
        if difference > AGREE_UM:
            raise RuntimeError(f"{peer_name}: {difference} µm from ours")
        took, other = in_turns(ours, run, repeats)
        label = f"exact errors at {POINTS:,} scattered points, {errors} errors each"
        rows.append(
            Row(label, took, f"{peer_name}, agrees to {difference:.0e} µm", other, max_ratio=1.0)
        )
    single_point = {name: at[:1] for name, at in coordinates.items()}
    only = {key: value[:1] for key, value in values.items()}
    branch = Branch(model, "tool")
    state = branch.states(single_point, only)[0]
    keys = model.machine.allowed_keys

    def joint_jacobians() -> None:
        for _ in range(100):
            pin.computeJointJacobians(branch.model, branch.data, state)
            pin.getJointJacobian(branch.model, branch.data, branch.last, pin.LOCAL_WORLD_ALIGNED)

    def ours_jacobian() -> object:
        return jacobian(model, Loop.TOOL, keys, coordinates, point)

    took, other = in_turns(ours_jacobian, joint_jacobians, 3)
    rows.append(
        Row(
            f"Jacobian, a point of {POINTS:,}",
            took / POINTS,
            "pinocchio's of the tool branch, a point of 100",
            other / 100,
        )
    )
    costs = []
    for count in GROWING:
        some, errors_there = configurations(model, count)
        at = nominal_point(model, Loop.TOOL, some)
        costs.append(
            best(lambda: loop_error(model, Loop.RELATIVE, some, errors_there, at), 2)  # noqa: B023
        )
    growth = [Growth("exact errors at scattered points", "points", [*map(float, GROWING)], costs)]
    text = (
        "Scattered points share no axis position, so nothing is separable: the hard case of the"
        " model, and the one that general libraries can do as well. Tool relative to workpiece,"
        " every error at every point another one. All give the same numbers."
    )
    return Section("The chain beside other libraries", text, rows, growth)
