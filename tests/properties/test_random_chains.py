"""Two hundred random machines against a product of matrices written apart from the model."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpspace.kinematics.chain import loop_error, nominal_point
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.definition import build_machine

MACHINES = 200
LETTERS = "XYZUVWABC"
OWN = {"tool": "tool_point_mm", "workpiece": "workpiece_point_mm"}


def random_machine(rng):
    names = [letter + digit for letter in LETTERS for digit in ("", "1", "2")]
    count = int(rng.integers(1, 9))
    chosen = [str(name) for name in rng.choice(names, count, replace=False)]
    split = int(rng.integers(0, count + 1))
    chain = f"w{''.join(reversed(chosen[:split]))}F{''.join(chosen[split:])}t"
    frames = [*chosen, "S", "t", "w"]
    orders = ("after_motion", "before_motion")
    machine = build_machine(
        chain,
        offset_mm={frame: tuple(rng.uniform(-500.0, 500.0, 3)) for frame in frames},
        rotation_deg={
            frame: tuple(rng.uniform(-180, 180, 3)) for frame in frames if rng.random() < 0.5
        },
        direction={name: int(rng.choice((1, -1))) for name in chosen},
    )
    return Model(
        machine,
        str(rng.choice(orders)),
        tuple(rng.uniform(-200.0, 200.0, 3)),
        tuple(rng.uniform(-200.0, 200.0, 3)),
        tuple((name, str(rng.choice(orders))) for name in chosen if rng.random() < 0.3),
    )


def rigid(rotation, shift):
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.as_matrix()
    matrix[:3, 3] = shift
    return matrix


def product(machine, model, side, at, errors):
    """Multiply out a branch with nothing of the model's own kinematics."""
    result = np.eye(4)
    for name in machine.chain.tool if side == "tool" else machine.chain.workpiece:
        axis = machine.axes[name]
        result = result @ rigid(
            Rotation.from_euler("xyz", axis.rotation_deg, degrees=True), axis.offset_mm
        )
        steps = axis.direction * at[name] * np.eye(3)[LETTERS.index(name[0]) % 3]
        move = (
            rigid(Rotation.from_rotvec(steps, degrees=True), np.zeros(3))
            if name[0] in "ABC"
            else rigid(Rotation.identity(), steps)
        )
        constant, component = (
            rigid(
                Rotation.from_rotvec([1e-6 * errors.get(f"E{k}{zero}{name}", 0.0) for k in "ABC"]),
                [1e-3 * errors.get(f"E{k}{zero}{name}", 0.0) for k in "XYZ"],
            )
            for zero in ("0", "")
        )
        order = dict(model.own_component_errors).get(name, model.component_errors)
        result = result @ constant
        result = result @ (move @ component if order == "after_motion" else component @ move)
    for name in ("S", "t") if side == "tool" else ("w",):
        turn = Rotation.from_euler("xyz", machine.fixed_deg.get(name, (0, 0, 0)), degrees=True)
        result = result @ rigid(turn, machine.fixed_mm[name])
    return result


def error_apart(model, loop, at, errors):
    """Give the error of the functional point of a loop, µm, and of the tool axis, µrad."""
    nominal = {side: product(model.machine, model, side, at, {}) for side in OWN}
    moved = {
        side: product(model.machine, model, side, at, errors) @ np.linalg.inv(pose)
        for side, pose in nominal.items()
    }
    side = "workpiece" if loop is Loop.WORKPIECE else "tool"
    point = nominal[side] @ (*getattr(model, OWN[side]), 1.0)
    axis = nominal["tool"] @ (0.0, 0.0, 1.0, 0.0)
    seen_from = moved["workpiece"] if loop is Loop.RELATIVE else np.eye(4)
    tilt = np.cross((seen_from @ axis)[:3], (moved[side] @ axis)[:3])  # of a milliradian: its sine
    return 1e3 * ((moved[side] - seen_from) @ point)[:3], 1e6 * tilt


@pytest.mark.parametrize("seed", range(MACHINES))
def test_a_random_machine_is_as_its_product_says(seed):
    rng = np.random.default_rng(seed)
    model = random_machine(rng)
    keys = [key for key in model.machine.allowed_keys if rng.random() < 0.6]
    errors = {key: float(rng.uniform(-30.0, 30.0)) for key in keys}
    at = {
        name: float(rng.uniform(-300.0, 300.0) if axis.is_linear else rng.uniform(-180.0, 180.0))
        for name, axis in model.machine.axes.items()
    }
    coordinates = {name: np.asarray(value) for name, value in at.items()}
    for loop in Loop:
        point = nominal_point(model, loop, coordinates)
        values = {key: np.asarray(value) for key, value in errors.items()}
        found = loop_error(model, loop, coordinates, values, point)
        np.testing.assert_allclose(found, error_apart(model, loop, at, errors), rtol=0, atol=1e-3)
