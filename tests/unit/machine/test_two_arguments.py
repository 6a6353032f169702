"""Errors that depend on the positions of two axes."""

import numpy as np
import pytest

from warpspace.exceptions import OptionError, SceneError
from warpspace.machine.curves.curve import OWN
from warpspace.machine.errors import Constant, Directional, ErrorSet, Ramp, Table, TwoArguments
from warpspace.scene.library import parse_scene
from warpspace.scene.pipeline import evaluate
from warpspace.scene.save import scene_to_toml

SPAN = (-275.0, 275.0)
X, Z = (-100.0, 0.0, 300.0), (-480.0, -80.0)
VALUES = ((1.0, 5.0), (2.0, -8.0), (6.0, 4.0))
CURVE = TwoArguments(SPAN, ("X", "Z"), (X, Z), VALUES)
SURFACE = (
    "EXX = { table2 = { axes = ['Z', 'X'], X = [-100, 0, 300], Z = [-480, -80],"
    " values = [[1, 2, 6], [5, -8, 4]] } }"
)


def at(x: float | list[float], z: float | list[float]) -> np.ndarray:
    return CURVE.evaluate_at("X", {"X": np.array(x), "Z": np.array(z)})


def test_it_has_its_values_at_its_points() -> None:
    found = CURVE.evaluate_at("X", {"X": np.array(X)[:, None], "Z": np.array(Z)})
    assert found.tolist() == [list(row) for row in VALUES]


def test_between_them_it_is_the_mean_of_four_points_weighted_by_opposite_areas() -> None:
    # a quarter of the way along X from 0 to 300, and of the way along Z from -480 to -80
    by_hand = 0.75 * (0.75 * 2.0 + 0.25 * -8.0) + 0.25 * (0.75 * 6.0 + 0.25 * 4.0)
    assert float(at(75.0, -380.0)) == pytest.approx(by_hand, rel=1e-15)


def test_its_ends_are_held_along_both_axes() -> None:
    assert at([-900.0, 900.0, 900.0], [-900.0, -900.0, 900.0]).tolist() == [1.0, 6.0, 4.0]
    assert float(at(-900.0, -280.0)) == 3.0


def test_a_batch_gives_what_a_loop_over_its_points_gives() -> None:
    random = np.random.default_rng(1)
    x, z = random.uniform(-300, 400, (4, 1, 5)), random.uniform(-500, 0, (3, 1))
    found = CURVE.evaluate_at("X", {"X": x, "Z": z})
    assert found.shape == (4, 3, 5)
    for i, j, k in np.ndindex(found.shape):
        assert found[i, j, k] == float(at(float(x[i, 0, k]), float(z[j, 0])))


def test_one_row_is_constant_along_that_axis() -> None:
    flat = TwoArguments(SPAN, ("X", "Z"), ((3.0,), Z), ((1.0, 5.0),))
    found = flat.evaluate_at("X", {"X": np.array([-9.0, 3.0, 9.0]), "Z": np.array(-280.0)})
    assert found.tolist() == [3.0, 3.0, 3.0]


def test_the_amplitude_scales_the_whole_surface() -> None:
    assert CURVE.amplitude == -8.0
    twice = CURVE.with_amplitude(-16.0)
    assert twice.values == ((2.0, 10.0), (4.0, -16.0), (12.0, 8.0))
    assert CURVE.with_amplitude(0.0).amplitude == 0.0


def test_sets_name_the_arguments_of_every_error() -> None:
    errors = ErrorSet({"EXX": CURVE, "EYX": Ramp(SPAN, 1.0), "EC0Y": Constant(SPAN, 1.0)})
    assert [errors.arguments(key) for key in ("EXX", "EYX", "EC0Y", "EZX")] == [
        ("X", "Z"),
        ("X",),
        (),
        (),
    ]
    assert Ramp(SPAN, 1.0).arguments == (OWN,)
    assert Directional(SPAN, CURVE, Constant(SPAN, 1.0)).arguments == ("X", "Z")


def test_along_its_axis_it_is_shown_by_sections() -> None:
    words, middle = CURVE.lines[1]
    assert [line[0] for line in CURVE.lines] == ["Z -480", "Z -280", "Z -80"]
    assert words == "Z -280"
    assert middle == Table(SPAN, ((-100.0, 3.0), (0.0, -3.0), (300.0, 5.0)))
    np.testing.assert_array_equal(CURVE.evaluate(np.array(X)), [3.0, -3.0, 5.0])


def test_scene_files_may_name_the_axes_in_either_order_and_reload_equal() -> None:
    scene = parse_scene(f'machine = "dvf5000"\n[errors]\n{SURFACE}\n', "mine")
    assert scene.errors.functions["EXX"] == CURVE
    assert parse_scene(scene_to_toml(scene), "mine") == scene


def test_it_acts_along_the_direction_of_its_own_axis_in_both_models() -> None:
    scene = parse_scene(f'machine = "dvf5000"\n[errors]\n{SURFACE}\n', "mine")
    place = {"X": [0.0, 75.0], "Y": 10.0, "Z": [-80.0, -380.0]}
    for exact in (False, True):
        field = evaluate(scene, at=place, exact=exact)
        expected = [[-8.0, 0.0, 0.0], [float(at(75.0, -380.0)), 0.0, 0.0]]
        np.testing.assert_allclose(field.error_um, expected, atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("'Z', 'X'", "'Z', 'Q'", "no axis Q in this machine; expected two of X, Y, Z, B, C"),
        ("'Z', 'X'", "'X', 'X'", "names one axis twice"),
        ("'Z', 'X'", "'Z', 'Y'", "expected X, the axis of the error, and another one"),
        ("'Z', 'X'", "'Z'", "expected two names of axes"),
        ("axes = ['Z', 'X'],", "", r"table2\.axes: is missing"),
        ("[-100, 0, 300]", "[-100, 300, 0]", "entry 3 is 0 after 300; expected ascending"),
        ("[-100, 0, 300]", "[-100, 0, 0]", "entry 3 is 0 after 0; expected ascending"),
        ("[-480, -80]", "[-480, nan]", r"table2\.Z\[1\] = nan: expected a finite number"),
        ("[1, 2, 6]", "[1, 2]", r"values\[0\]: has 2 values; expected 3, one per position of X"),
        (", [5, -8, 4]", "", "has 1 rows; expected 2, one per position of Z"),
        ("[1, 2, 6]", "[1, inf, 6]", r"values\[0\]\[1\] = inf: expected a finite number"),
        ("[1, 2, 6]", "[1, 2e9, 6]", "expected at most 100000"),
        ("X = [-100, 0, 300]", "W = [1]", r"table2\.W: unknown key; expected axes, Z, X, values"),
        ("values = ", "value = ", r"table2\.value: unknown key"),
        ("[-100, 0, 300]", "[]", "expected at least 1, not 0 entries"),
    ],
)
def test_what_is_no_such_table_is_refused_in_words(old: str, new: str, message: str) -> None:
    assert old in SURFACE
    with pytest.raises(SceneError, match=message):
        parse_scene(f'machine = "dvf5000"\n[errors]\n{SURFACE.replace(old, new)}\n', "mine")


def test_a_table_larger_than_the_limit_is_refused_before_its_values_are_read() -> None:
    many = list(range(400))
    text = f"EXX = {{ table2 = {{ axes = ['X', 'Z'], X = {many}, Z = {many}, values = [] }} }}"
    with pytest.raises(SceneError, match="has 160,000 values; expected at most 100,000"):
        parse_scene(f'machine = "dvf5000"\n[errors]\n{text}\n', "mine")


def test_rows_that_people_write_do_not_make_one() -> None:
    with pytest.raises(OptionError, match="comes from a scene file or an import"):
        TwoArguments.from_rows(SPAN, [[1.0]])
    with pytest.raises(OptionError):
        TwoArguments.from_curve(Constant(SPAN, 1.0), SPAN)
