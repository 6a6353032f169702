"""Scenes to start from: any chain opens, tool and table meet, and the examples show."""

import numpy as np
import pytest
from hypothesis import given, settings

from chains import chains
from warpspace import evaluate
from warpspace.exceptions import ChainError, SceneError
from warpspace.kinematics.chain import nominal_point
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.machine.description import Chain
from warpspace.picture.scene_picture import evaluate_picture
from warpspace.scene.library import parse_scene
from warpspace.scene.save import scene_to_toml
from warpspace.scene.starter import starter_scene, starter_text
from warpspace.scene.verbs import montecarlo

CLASSIC = [
    "wFXYZt",
    "wXYFZt",
    "wCBFXYZt",
    "wBCFXYZt",
    "wCFXYZBt",
    "wFXYZCAt",
    "wXYZCAFt",
    "wYFXZWt",
]


@settings(max_examples=60)
@given(chains())
def test_every_chain_gives_a_scene_that_bends(chain: Chain) -> None:
    scene = starter_scene(chain)
    assert scene.machine.chain == chain
    assert scene.errors
    assert not [note for note in scene.notes if "travel" in note]
    field = evaluate(scene, grid=3, loop="relative")
    assert np.isfinite(field.error_um).all()
    moved = max(field.norm_um.max(), np.abs(field.orientation_urad).max())
    assert moved > 0.0
    assert parse_scene(scene_to_toml(scene), scene.name) == scene


@pytest.mark.parametrize("chain", CLASSIC)
def test_tool_and_table_meet(chain: str) -> None:
    scene = starter_scene(chain)
    machine = scene.machine
    at = complete_coordinates(machine, {}, scene.workspace.positions)
    tool = nominal_point(scene.model, Loop.TOOL, at)
    table = nominal_point(
        type(scene.model)(machine, workpiece_point_mm=(0.0, 0.0, 0.0)), Loop.WORKPIECE, at
    )
    assert tool[:2] == pytest.approx(table[:2])
    assert tool[2] - table[2] == pytest.approx(200.0)  # middle of z, 400 mm long
    z = next(axis for axis in machine.axes if axis[0] == "Z")
    at = complete_coordinates(machine, {z: machine.axes[z].travel[0]}, scene.workspace.positions)
    tool = nominal_point(scene.model, Loop.TOOL, at)
    table = nominal_point(
        type(scene.model)(machine, workpiece_point_mm=(0.0, 0.0, 0.0)), Loop.WORKPIECE, at
    )
    assert tool - table == pytest.approx([0.0, 0.0, 0.0])


def test_a_robot_with_two_arms_has_a_volume() -> None:
    picture = evaluate_picture(starter_scene("wFC1C2Zt"), grid=5)
    assert picture.grid.shape == (5, 5, 5)
    assert (picture.grid.extent_mm > 100.0).all()


@pytest.mark.parametrize("chain", ["wXYFZt", "wCBFXYZt", "wFC1C2Zt"])
def test_tolerances_and_first_picture_are_there(chain: str) -> None:
    scene = starter_scene(chain)
    assert montecarlo(scene, samples=2000, loop="relative").mean_um > 1.0
    assert evaluate_picture(scene, grid=3).statistics.max_um > 1.0


def test_the_text_explains_itself() -> None:
    text = starter_text("wBCFXYZt", title='my "mill"')
    scene = parse_scene(text, "mine")
    assert scene.title == scene.machine.title == 'my "mill"'
    explained = [line for line in text.splitlines() if "#" in line]
    assert len(explained) > 0.5 * len(text.splitlines())
    switched_on = text.replace("# EYX = ", "EYX = ")
    assert parse_scene(switched_on, "mine").errors.amplitude("EYX") == 5.0


def test_what_is_no_chain_or_title_is_said() -> None:
    with pytest.raises(ChainError, match="wHFXt"):
        starter_scene("wHFXt")
    with pytest.raises(SceneError, match="4000 characters"):
        starter_scene("wFXt", title="x" * 5000)
