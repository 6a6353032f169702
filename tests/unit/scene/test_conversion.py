"""Scenes written in other conventions, and read back."""

from dataclasses import replace

import pytest

from warpspace.exceptions import OptionError, SceneError, UnknownNameError
from warpspace.scene.conversion import Converted, Target, convert_scene, field_difference
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.model import Scene
from warpspace.scene.notation import Notation
from warpspace.scene.save import scene_to_toml

SAME = 3e-9
SCENE = load_scene("dvf5000_first")
HELD = {"X": 0.0, "Y": 0.0, "Z": -280.0}
TARGETS = {
    "order": Target(component_errors=dict.fromkeys("XYZBC", "before_motion")),
    "one kind": Target(component_errors={"B": "before_motion", "C": "before_motion"}),
    "line": Target(straightness=dict.fromkeys("XYZ", "minimum_zone")),
    "zero": Target(zero_at={"X": 0.0, "Y": 0.0}),
    "over": Target(notation=Notation("over_90")),
    "under": Target(notation=Notation("under_90")),
    "abbe": Target(notation=Notation(measuring_line_mm={"X": (0.0, 150.0, -80.0)})),
    "all": Target(
        straightness={"X": "least_squares"},
        zero_at={"Y": 10.0},
        notation=Notation("over_90", {"Y": (20.0, 0.0, 300.0)}),
    ),
}


@pytest.mark.parametrize("name", TARGETS)
def test_the_file_reads_back_to_the_same_field(name: str) -> None:
    found = convert_scene(SCENE, TARGETS[name])
    read = parse_scene(found.text, SCENE.name)
    assert read == found.scene
    assert max(*field_difference(SCENE, read), found.largest_um, found.largest_urad) < SAME
    # the program's own notation again: the same errors
    assert parse_scene(scene_to_toml(read), SCENE.name).errors == read.errors


def test_the_check_sees_a_difference() -> None:
    other = replace(SCENE, errors=SCENE.errors.with_amplitude("EC0Y", 23.2, (-225.0, 225.0)))
    largest_um, _ = field_difference(SCENE, other)
    assert largest_um > 1e-3


def test_numbers_are_written_with_the_sign_that_the_file_says() -> None:
    found = convert_scene(SCENE, TARGETS["over"])
    assert 'squareness = "over_90"' in found.text
    assert "EB0Z = -18.1" in found.text
    assert found.changed == {"EB0Z": (18.1, -18.1)}
    assert found.scene.errors.amplitude("EB0Z") == 18.1


def held_by_constants() -> tuple[Scene, Converted]:
    held = replace(SCENE, reference=HELD)
    return held, convert_scene(held, Target(reference="constants"))


def test_a_held_point_becomes_constants_and_a_held_point_again() -> None:
    held, found = held_by_constants()
    assert found.scene.reference is None
    assert found.largest_um < SAME
    assert {"EX0X", "EY0X"} <= {*found.changed}
    back = convert_scene(found.scene, Target(reference=HELD))
    assert back.scene.reference == HELD
    assert back.largest_um < 1e-6  # the point is held to a picometre
    assert field_difference(held, back.scene)[0] < SAME


def test_a_point_with_an_error_is_not_held_by_a_translation() -> None:
    with pytest.raises(OptionError, match=r"error at that point is 26\.\d µm; expected a point"):
        convert_scene(SCENE, Target(reference=HELD))
    with pytest.raises(OptionError, match="the scene holds no point still"):
        convert_scene(SCENE, Target(reference="constants"))


def test_readings_of_other_curves_are_left_out_and_named() -> None:
    text = scene_to_toml(SCENE) + "\n[measured.EAX]\nruns = [{ points = [[0, 1]] }]\n"
    text += "[measured.EZY]\nruns = [{ points = [[0, 1]] }]\n"
    scene = parse_scene(text, "s")
    found = convert_scene(scene, Target(component_errors={"Y": "before_motion"}))
    assert [*found.scene.measured] == ["EAX"]
    assert found.notes == ("readings of EZY are left out: they are of other curves",)


def test_axes_that_there_are_not_are_refused() -> None:
    with pytest.raises(UnknownNameError):
        convert_scene(SCENE, Target(zero_at={"W": 0.0}))
    head = 'machine = "dvf5000"\n[convention]\n'
    with pytest.raises(SceneError, match=r"convention\.measuring_line_mm\.W: unknown axis of this"):
        parse_scene(head + "measuring_line_mm = { W = [0, 0, 1] }\n", "s")
    with pytest.raises(SceneError, match=r'convention\.squareness = "x": expected one of "right'):
        parse_scene(head + 'squareness = "x"\n', "s")


def test_a_file_that_cannot_be_read_exactly_is_refused() -> None:
    text = """machine = "dvf5000"
[convention]
measuring_line_mm = { X = [0, 0, 100] }
[errors]
EBX = 5
EXX = { table2 = { axes = ["X", "Z"], X = [0, 1], Z = [0, 1], values = [[1, 2], [3, 4]] } }
"""
    with pytest.raises(SceneError, match=r"measuring_line_mm: EXX depends on X and Z"):
        parse_scene(text, "s")
