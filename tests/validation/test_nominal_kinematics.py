"""Nominal rotary kinematics against numbers from outside, with a machine that is only a table."""

import numpy as np
import pytest

from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, nominal_point
from warpspace.kinematics.model import Loop, Model, complete_coordinates
from warpspace.machine.definition import build_machine

TABLE = Model(build_machine("wCBFt"))


def table_pose(b_deg, c_deg):
    coordinates = complete_coordinates(TABLE.machine, {"B": b_deg, "C": c_deg})
    return branch_pose(TABLE, "workpiece", coordinates)


def test_machine_point_at_b_30_c_45_lies_where_the_table_has_turned_to():
    on_table = transforms.apply(transforms.inverse(table_pose(30.0, 45.0)), [100.0, 50.0, -30.0])
    assert on_table == pytest.approx((107.199184, -36.488506, 24.019238), abs=5e-7)


def test_table_point_comes_back_to_the_machine_point():
    model = Model(TABLE.machine, workpiece_point_mm=(107.199184, -36.488506, 24.019238))
    coordinates = complete_coordinates(model.machine, {"B": 30.0, "C": 45.0})
    found = nominal_point(model, Loop.WORKPIECE, coordinates)
    assert found == pytest.approx((100.0, 50.0, -30.0), abs=1e-6)


def test_b_45_c_minus_30_takes_the_printed_vector_to_minus_x():
    pose = table_pose(45.0, -30.0)
    turned = transforms.rotate(pose[:3, :3], [-0.6123720, -0.3535532, -0.7071072])
    assert turned == pytest.approx((-1.0, 0.0, 0.0), abs=1e-6)


def test_direction_minus_one_turns_the_table_the_other_way():
    turned = Model(build_machine("wCBFt", direction={"B": -1, "C": -1}))
    coordinates = complete_coordinates(turned.machine, {"B": -30.0, "C": -45.0})
    np.testing.assert_allclose(
        branch_pose(turned, "workpiece", coordinates), table_pose(30.0, 45.0), atol=1e-15
    )
