"""Scenes to start from: any chain opens, tool and table meet, and the examples show."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from chains import chains
from warpspace import evaluate
from warpspace.bodies.frame import generate_bodies
from warpspace.bodies.schematic import build_layout
from warpspace.kinematics.chain import nominal_point
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.scene.library import parse_scene
from warpspace.scene.scene_writer import scene_to_toml
from warpspace.scene.starter import starter_scene, starter_text

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
LYING = ["wBZFXYt", "wXBFZYt", "wBFXYZt", "wBYFXZt", "wBAFXYZt", "wBXYZFt", "wBZFXYAt"]
"""With a table B under the workpiece: horizontal machining centres, Y upright."""


@given(chains())
def test_every_chain_gives_a_scene_that_bends(chain):
    scene = starter_scene(chain)
    assert scene.machine.chain == chain
    assert scene.errors
    assert not [note for note in scene.notes if "travel" in note]
    field = evaluate(scene, grid=3, loop="relative")
    assert np.isfinite(field.error_um).all()
    moved = max(field.norm_um.max(), np.abs(field.orientation_urad).max())
    assert moved > 0.0
    assert parse_scene(scene_to_toml(scene), scene.name) == scene


@pytest.mark.parametrize("chain", [*CLASSIC, *LYING])
def test_tool_and_table_meet(chain):
    scene = starter_scene(chain)
    machine, bare = scene.machine, replace(scene.model, workpiece_point_mm=(0.0, 0.0, 0.0))
    up = next(axis for axis in machine.axes if axis[0] == ("Y" if chain in LYING else "Z"))
    # middle of the upright axis, 400 mm long, and its lower end
    for moved, height_mm in (({}, 200.0), ({up: machine.axes[up].travel[0]}, 0.0)):
        at = complete_coordinates(machine, moved, scene.workspace.positions)
        apart = nominal_point(bare, Loop.TOOL, at) - nominal_point(bare, Loop.WORKPIECE, at)
        assert apart == pytest.approx([0.0, 0.0, height_mm])


@pytest.mark.parametrize("chain", LYING)
def test_a_table_b_stands_upright_before_a_level_spindle(chain):
    machine = starter_scene(chain).machine
    bodies = {body.name for body in generate_bodies(machine)}
    layout = build_layout(machine)
    assert layout.poses["B"][:3, 1] == pytest.approx([0.0, 0.0, 1.0])
    assert layout.poses["t"][:3, 2] == pytest.approx([0.0, 1.0, 0.0])  # to the column, at the rear
    assert machine.axes["B"].travel == (0.0, 360.0)
    assert not {name for name in bodies if "chuck" in name or "cradle" in name} - {"A_cradle"}
    assert any(name.endswith("_column") for name in bodies)
    assert "-0" not in starter_text(chain).replace("-0.", "")


def test_the_text_explains_itself():
    text = starter_text("wBCFXYZt", title='my "mill"')
    scene = parse_scene(text, "mine")
    assert scene.title == scene.machine.title == 'my "mill"'
    explained = [line for line in text.splitlines() if "#" in line]
    assert len(explained) > 0.5 * len(text.splitlines())
    switched_on = text.replace("# EYX = ", "EYX = ")
    assert parse_scene(switched_on, "mine").errors.amplitude("EYX") == 5.0
