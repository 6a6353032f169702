"""What pictures, figures and reports say of conventions that differ between axes."""

from dataclasses import replace

from warpspace.picture.scene_picture import evaluate_picture
from warpspace.picture.words import convention_sentences, convention_words
from warpspace.scene.library import load_scene, parse_scene

MIXED = """
title = "mixed"
machine = "dvf5000"
[convention]
component_errors = { rotary = "before_motion" }
"""


def test_one_convention_is_named_once():
    scene = load_scene("dvf5000_first")
    assert convention_words(scene) == "component errors after the motion"
    assert len(convention_sentences(scene)) == 1
    assert evaluate_picture(scene, grid=3).settings["component_errors"] == "after_motion"


def test_all_conventions_are_named_with_their_axes():
    scene = parse_scene(MIXED, "mixed")
    expected = "component errors after the motion of X Y Z, before the motion of B C"
    assert convention_words(scene) == expected
    first, second = convention_sentences(scene)
    assert first.startswith("Component errors of X, Y, Z ")
    assert second.startswith("Component errors of B, C ")
    assert "(before the motion)" in second
    picture = evaluate_picture(scene, grid=3)
    assert picture.settings["component_errors"]["B"] == "before_motion"
    assert picture.settings["component_errors"]["X"] == "after_motion"
    assert "B=before_motion" in picture.remarks["component_errors"]


def test_every_axis_with_a_convention_of_its_own_is_one_convention():
    scene = parse_scene(MIXED, "mixed")
    axes = tuple((axis, "before_motion") for axis in scene.machine.axes)
    model = replace(scene.model, own_component_errors=axes)
    assert convention_words(replace(scene, model=model)) == "component errors before the motion"
