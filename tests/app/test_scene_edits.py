"""Changing the machine of a scene: what stays, what goes, and that every outcome reads back."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from warpspace.app.evaluation.machine_edits import edited
from warpspace.exceptions import ChainError, OptionError, SceneError, WarpspaceError
from warpspace.kinematics.chain import nominal_point
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.machine.errors import Poly
from warpspace.scene.library import load_scene, parse_scene, scene_names
from warpspace.scene.save import scene_to_toml

PLAIN = parse_scene(
    """
title = "Plain"
[machine]
title = "Mine"
chain = "wBFXYZt"
[machine.offset_mm]
B = [0, 0, -100]
S = [0, 0, 300]
t = [0, 0, -80]
[machine.rotation_deg]
S = [0, 0, 5]
[machine.travel]
X = [-300, 300]
[convention.component_errors]
X = "after_motion"
Y = "after_motion"
Z = "before_motion"
B = "before_motion"
[workspace]
X = [-200, 200]
Y = [-100, 100]
Z = [-50, 50]
B = 10
[points_mm]
tool = [0, 0, -20]
[errors]
EXX = { ramp = 10.0 }
EAY = { poly = [1.0, 0.01] }
EXB = 3.0
EA0B = 20.0
[tolerances]
default = { translation = 5.0, rotation = 8.0, squareness = 20.0 }
EXB = 4.0
EYY = 2.0
[view]
reference = { X = 0, Y = 0, Z = 0, B = 0 }
""",
    "plain",
)


def edit(word, scene=PLAIN):
    """The changed scene, having made sure that its file reads back equal."""
    scene, _ = edited(scene, word)
    read = parse_scene(scene_to_toml(scene), scene.name)
    dressed = replace(read.machine, name=scene.machine.name, body_dir=scene.machine.body_dir)
    assert replace(read, model=replace(read.model, machine=dressed)) == scene
    return scene


def test_another_chain_keeps_what_belongs_to_axes_that_stay():
    scene = edit("chain w C F X Y Z t")
    assert str(scene.machine.chain) == "wCFXYZt"
    assert scene.machine.axes["X"] == PLAIN.machine.axes["X"]
    assert scene.machine.fixed_mm == PLAIN.machine.fixed_mm
    assert scene.machine.fixed_deg == {"S": (0.0, 0.0, 5.0)}
    assert scene.machine.axes["C"].travel == (0.0, 360.0)
    kept = {axis: PLAIN.workspace.ranges[axis] for axis in "XYZ"}
    assert scene.workspace.ranges == {**kept, "C": (0.0, 0.0)}
    assert set(scene.errors) == {"EXX", "EAY"}
    assert set(scene.tolerances.own) == {"EYY"}
    assert scene.tolerances.default == PLAIN.tolerances.default
    assert scene.reference == {"X": 0.0, "Y": 0.0, "Z": 0.0}
    assert scene.model.convention("Z").name == "before_motion"
    _, (note,) = edited(PLAIN, "chain wCFXYZt")
    assert note == (
        "axis B left out and with it its errors EXB, EA0B; its tolerances EXB; its position at the"
        " reference"
    )


def test_a_linear_axis_that_changes_sides_moves_the_tool_over_the_workpiece_as_before():
    there = edit("chain wYBFXZt")
    assert [there.machine.axes[axis].direction for axis in "XYZB"] == [1, -1, 1, 1]
    assert there.notes == ()
    back = edit("chain wBFXYZt", there)
    assert {axis.direction for axis in back.machine.axes.values()} == {1}
    assert edit("chain wUBFXYZt").machine.axes["U"].direction == -1


def test_a_chain_that_cannot_be_read_is_refused_with_the_message_of_the_reader():
    for text in ("wXXFt", "hello", "", "w" + "X" * 200, "wFt", "wA0A1A2A3A4A5A6A7A8Ft"):
        with pytest.raises(ChainError):
            edited(PLAIN, f"chain {text}")
    assert edit("chain w(B)F XYZ t") == PLAIN


def test_a_second_axis_stands_still_and_one_in_place_of_another_spans_the_volume():
    scene = edit("chain wBFXYZWt")
    assert scene.workspace.ranges["W"] == (0.0, 0.0)
    assert scene.workspace.volume_axes == ("X", "Y", "Z")
    scene = edit("chain wBFUYZt")
    assert scene.workspace.ranges["U"] == (-250.0, 250.0)
    assert scene.workspace.volume_axes == ("U", "Y", "Z")
    arms = load_scene("machine_scara")
    assert edit("chain wFC1C2ZXt", arms).workspace.ranges["X"] == (0.0, 0.0)


def test_an_axis_moves_along_the_chain_across_the_frame_and_away():
    names = []
    scene = PLAIN
    for way in ("right", "right", "left", "left", "left"):
        scene = edit(f"{way} B", scene)
        names.append(str(scene.machine.chain))
    assert names == ["wFBXYZt", "wFXBYZt", "wFBXYZt", "wBFXYZt", "wBFXYZt"]
    assert scene == replace(PLAIN, model=replace(PLAIN.model, machine=scene.machine))
    assert {*scene.errors} == {*PLAIN.errors}
    scene = edit("side Y")
    assert str(scene.machine.chain) == "wBYFXZt"
    assert str(edit("side Y", scene).machine.chain) == "wBFYXZt"
    for axis in ("B", "Y", "Z"):
        scene = edit(f"remove {axis}", scene)
    with pytest.raises(OptionError, match="at least one"):
        edit("remove X", scene)


def test_an_offset_moves_the_tool_point_by_as_much():
    scene = edit("offset Y 2 150")
    at = complete_coordinates(PLAIN.machine, {})
    moved = nominal_point(scene.model, Loop.TOOL, at) - nominal_point(PLAIN.model, Loop.TOOL, at)
    np.testing.assert_allclose(moved, [0.0, 0.0, 150.0], atol=1e-9)
    for frame in ("S", "t", "w", "B"):
        assert edit(f"offset {frame} 0 12.5") != PLAIN


def test_a_rotation_turns_what_stands_behind_it():
    scene = edit("rotation X 2 90")
    at = complete_coordinates(PLAIN.machine, {"X": 100.0})
    middle = complete_coordinates(PLAIN.machine, {"X": 0.0})
    along = nominal_point(scene.model, Loop.TOOL, at) - nominal_point(
        scene.model, Loop.TOOL, middle
    )
    np.testing.assert_allclose(along, [0.0, 100.0, 0.0], atol=1e-9)
    assert edit("rotation S 2 0").machine.fixed_deg == {}
    assert edit("rotation t 1 30°").machine.fixed_deg == {
        "S": (0.0, 0.0, 5.0),
        "t": (0.0, 30.0, 0.0),
    }


def test_a_travel_and_a_direction():
    scene = edit("travel X 1 150 mm")
    assert scene.machine.axes["X"].travel == (-300.0, 150.0)
    assert any("reaches beyond the travel" in note for note in scene.notes)
    assert scene.workspace == PLAIN.workspace
    with pytest.raises(SceneError, match=r"expected .lower, upper. with lower < upper"):
        edit("travel X 0 300")
    assert edit("turn B").machine.axes["B"].direction == -1


def test_the_working_volume_changes_and_the_curves_stay_the_same_functions():
    scene = edit("volume X 1 300")
    assert scene.workspace.ranges["X"] == (-200.0, 300.0)
    at = np.linspace(-200.0, 300.0, 7)
    for key in ("EXX", "EAY"):
        np.testing.assert_allclose(
            scene.errors.evaluate(key, at), PLAIN.errors.evaluate(key, at), atol=1e-12
        )
    assert isinstance(scene.errors.functions["EXX"], Poly)
    assert PLAIN.errors.amplitude("EXX") == 10.0
    # the ramp from 0 to 10 µm over 400 mm goes on to 12.5 µm over 500 mm
    assert scene.errors.amplitude("EXX") == pytest.approx(12.5)


def test_a_range_of_equal_ends_stands_still_and_a_reversed_one_is_refused():
    assert edit("volume Z 0 50").workspace.ranges["Z"] == (50.0, 50.0)
    with pytest.raises(SceneError, match=r"workspace\.Z"):
        edit("volume Z 0 51")
    with pytest.raises(SceneError, match=r"workspace\.B"):
        edit("volume B 1 20")


@pytest.mark.parametrize("value", ["1e9", "-1e300", "nan", "-inf"])
@pytest.mark.parametrize("what", ["offset", "rotation", "travel", "volume"])
def test_numbers_beyond_the_limits_of_a_file_are_refused(what, value):
    with pytest.raises(WarpspaceError, match=r"expected|finite"):
        edit(f"{what} X {int('-' not in value)} {value}")


@pytest.mark.parametrize(
    "word",
    [
        "offset A 0 1",
        "rotation R 0 1",
        "travel S 0 1",
        "travel X 2 1",
        "volume t 0 1",
        "right S",
        "side F",
        "turn S",
    ],
)
def test_what_is_no_frame_or_end_is_refused(word):
    with pytest.raises(WarpspaceError):
        edit(word)


def test_bodies_of_the_library_stay_as_long_as_the_frames_do():
    scene = load_scene("dvf5000_first")
    own = scene.machine.body_dir
    assert own
    assert edit("travel X 1 400", scene).machine.body_dir == own
    moved = edit("offset X 0 1", scene).machine
    assert moved.body_dir == ""
    assert moved.name == scene.name
    assert moved.title == f"Machine {moved.chain}"


AXES = st.sampled_from(("X", "Y", "Z", "A", "B", "C", "C1", "U", "W", "S", "t", "w"))
AXIS_WORDS = st.sampled_from(
    ("left", "right", "side", "remove", "turn", "gantry", "across", "mesh")
)
NUMBER_WORDS = st.sampled_from(("offset", "rotation", "travel", "volume", "span"))
NUMBERS = st.floats(allow_nan=True, allow_infinity=True) | st.integers(-400, 400)
SIDES = st.lists(AXES, max_size=3).map("".join)
WORDS = st.one_of(
    st.builds("chain w{}F{}t".format, SIDES, SIDES),
    st.builds("{} {}".format, AXIS_WORDS, AXES),
    st.builds("{} {} {} {!r}".format, NUMBER_WORDS, AXES, st.integers(0, 2), NUMBERS),
    st.just("sizes"),
)
SCENES = st.just(PLAIN) | st.sampled_from(scene_names()).map(load_scene)


@settings(max_examples=60, deadline=None)
@given(SCENES, st.lists(WORDS, min_size=1, max_size=6))
def test_whatever_is_done_gives_a_scene_that_reads_back_or_leaves_the_old_one(scene, words):
    for word in words:
        try:
            scene = edit(word, scene)
        except WarpspaceError:
            continue
