"""A gantry: what two guides give, derived by hand, and what a file may say of them."""

import numpy as np
import pytest

from warpspace import evaluate
from warpspace.machine.errors import Constant, Harmonics, Poly, Ramp, TableCurve
from warpspace.scene.curve_reader import combine_curves
from warpspace.scene.library import parse_scene
from warpspace.scene.scene_writer import scene_to_toml

SPAN = (-500.0, 500.0)


def scene_text(errors, gantry="X = { span_mm = 1800 }", chain="wFXYZt"):
    return f"""
title = "gantry"
[machine]
chain = "{chain}"
[machine.travel]
X = [-500, 500]
Y = [-900, 900]
[machine.gantry]
{gantry}
[errors]
{errors}
"""


def test_a_guide_that_is_ahead_by_9_um_turns_the_bridge_of_1800_mm_by_5_urad():
    scene = parse_scene(scene_text("EXX = { guides = [0, 9] }"), "g")
    assert scene.errors.functions["EXX"] == Constant(SPAN, 4.5)
    # c·z × 1800 mm·y = −c·1800 mm·x, which is 9 µm for c = −5 µrad
    assert scene.errors.functions["ECX"].amplitude == pytest.approx(-5.0, rel=1e-15)


@pytest.mark.parametrize(
    ("axis", "across", "key", "sign"),
    [
        ("X", "y", "ECX", -1),  # c·z × y = −c·x
        ("X", "z", "EBX", 1),  # b·y × z = +b·x
        ("Y", "x", "ECY", 1),  # c·z × x = +c·y
        ("Y", "z", "EAY", -1),  # a·x × z = −a·y
        ("Z", "x", "EBZ", -1),  # b·y × x = −b·z
        ("Z", "y", "EAZ", 1),  # a·x × y = +a·z
    ],
)
def test_sign_and_axis_of_the_rotation_by_the_right_hand_rule(axis, across, key, sign):
    gantry = f'{axis} = {{ span_mm = 500, across = "{across}" }}'
    text = scene_text(f"E{axis}{axis} = {{ guides = [1, 4] }}", gantry)
    scene = parse_scene(text, "g")
    assert scene.errors.amplitude(f"E{axis}{axis}") == 2.5
    assert scene.errors.amplitude(key) == pytest.approx(sign * 3.0 / 500.0 * 1000.0)
    assert [*scene.errors] == [f"E{axis}{axis}", key]


@pytest.mark.parametrize(("axis", "across"), [("X", "y"), ("Y", "x"), ("Z", "x"), ("U", "y")])
def test_the_direction_across_is_the_other_horizontal_one(axis, across):
    chain = "wFXYZUt" if axis == "U" else "wFXYZt"
    scene = parse_scene(scene_text("", f"{axis} = {{ span_mm = 500 }}", chain), "g")
    assert scene.machine.gantries[axis].across == across


def test_a_tool_over_a_guide_has_the_positioning_error_of_that_guide():
    errors = (
        "EXX = { guides = [{ table = [[-500, 0], [0, 3], [500, -6]] },"
        " { harmonics = [[1, 7, 30], [3, 2, 0]] }] }"
    )
    scene = parse_scene(scene_text(errors), "g")
    x = np.linspace(-500.0, 500.0, 41)
    first = np.interp(x, [-500, 0, 500], [0, 3, -6])
    second = 7 * np.cos(np.deg2rad(x - 30)) + 2 * np.cos(np.deg2rad(3 * x))
    for y, expected in ((-900.0, first), (0.0, (first + second) / 2.0), (900.0, second)):
        found = evaluate(scene, at={"X": x, "Y": y, "Z": 0.0}, exact=True)
        assert found.error_um[:, 0] == pytest.approx(expected, abs=2e-4)


@pytest.mark.parametrize(
    ("first", "second", "kind"),
    [
        (Constant(SPAN, 2.0), Constant(SPAN, -1.0), Constant),
        (Ramp(SPAN, 4.0), Ramp(SPAN, 7.0), Ramp),
        (Poly(SPAN, (1.0, 0.01)), Poly(SPAN, (2.0, 0.0, 1e-5)), Poly),
        (Ramp(SPAN, 4.0), Poly(SPAN, (2.0, 0.0, 1e-5)), Poly),
        (Constant(SPAN, 4.0), Ramp(SPAN, 7.0), Poly),
        (Harmonics(SPAN, ((1, 3, 10),)), Harmonics(SPAN, ((1, 2, 10), (2, 1, 0))), Harmonics),
        (Harmonics(SPAN, ((1, 3, 10),)), Constant(SPAN, 2.0), Harmonics),
        (
            TableCurve(SPAN, ((-500, 1), (500, 2))),
            TableCurve(SPAN, ((-100, 3), (0, 1), (100, 5))),
            TableCurve,
        ),
        (Constant(SPAN, 2.0), TableCurve(SPAN, ((-100, 3), (0, 1), (100, 5))), TableCurve),
        (Constant(SPAN, 0.0), Ramp(SPAN, 2.0), Ramp),
    ],
)
def test_sums_of_equal_kinds_are_exact(first, second, kind):
    found = combine_curves(first, second, (0.5, -0.25))
    assert type(found) is kind
    at = np.linspace(-600.0, 600.0, 301)
    exact = 0.5 * first.evaluate(at) - 0.25 * second.evaluate(at)
    assert found.evaluate(at) == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize(
    "pair",
    ["[1, 2]", "[{ ramp = 3 }, { ramp = 5 }]", "[{ poly = [0, 0.01] }, 4]",
     "[{ harmonics = [[1, 2, 0]] }, { harmonics = [[2, 1, 0]] }]",
     "[{ table = [[-500, 0], [500, 3]] }, { table = [[-500, 0], [0, 5]] }]",
     "[{ table = [[-500, 0], [500, 3]] }, { ramp = 4 }]"],
)  # fmt: skip
def test_a_saved_gantry_reloads_to_the_same_scene(pair):
    scene = parse_scene(scene_text(f"EXX = {{ guides = {pair} }}"), "g")
    text = scene_to_toml(scene)
    assert "[machine.gantry]" in text
    assert parse_scene(text, "g") == scene
