"""Covariances in scene files: what they keep, and what is refused by key and value."""

import math
from dataclasses import replace

import numpy as np
import pytest

from warpspace.analysis.doubt import find_doubt
from warpspace.exceptions import SceneError
from warpspace.machine.errors import Covariance
from warpspace.scene.library import parse_scene
from warpspace.scene.save import scene_to_toml

SCENE = """[machine]
chain = "wFXYZt"
[workspace]
X = [-100, 100]
Y = [-100, 100]
Z = [-50, 50]
[errors]
EC0Y = 20
EA0Z = -30
[uncertainty.covariance]
keys = ["EC0Y", "EA0Z"]
matrix = [[4.0], [3.0, 9.0]]
"""
WHOLE = Covariance(
    ("EC0Y", "EA0Z"),
    ((4.0, 3.0), (3.0, 9.0)),
    12.0,
    {"X": (-10.0, 20.0), "Z": (5.0, 5.0)},
    ("EXX", "EYY"),
    61.9,
)


def test_all_that_a_covariance_says_comes_back_from_its_text():
    scene = replace(parse_scene(SCENE, "s"), covariance=WHOLE)
    text = scene_to_toml(scene)
    assert "Z = 5.0" in text
    assert parse_scene(text, "s").covariance == WHOLE
    nothing = Covariance((), (), untold=("EXX",))
    back = parse_scene(scene_to_toml(replace(scene, covariance=nothing)), "s")
    assert back.covariance == nothing
    assert find_doubt(back).unknown == ("EC0Y", "EA0Z", "EXX")


def test_what_is_left_open_is_unknown_also_where_its_value_is_zero():
    doubt = find_doubt(replace(parse_scene(SCENE, "s"), covariance=WHOLE))
    assert (doubt.unknown, doubt.is_known) == (("EXX", "EYY"), False)
    assert not replace(doubt, unknown=()).is_known  # as an app does that counts again
    said = " ".join(doubt.remarks())
    assert "the readings did not determine EXX, EYY: unknown wherever they act" in said
    assert "residuals were 61.9 times what its readings scatter; U95 does not contain" in said
    assert "not stated" not in said
    known = find_doubt(parse_scene(SCENE, "s"))
    assert (known.is_known, [*known.remarks()]) == (True, [])


def test_errors_that_are_found_anew_leave_the_others():
    left = WHOLE.without(("EC0Y", "EYY"))
    assert left == replace(WHOLE, keys=("EA0Z",), rows=((9.0,),), untold=("EXX",))


def test_an_axis_that_stood_still_was_measured_nowhere_else():
    at = {"X": np.array([0.0, 0.0, 21.0, 20.0]), "Z": np.array([5.0, 5.1, 5.0, 5.0 + 1e-9])}
    assert WHOLE.outside(at, (4,)).tolist() == [False, True, True, False]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        # large entries beside small ones: compared in units of the uncertainties
        (
            "[[4.0], [3.0, 9.0]]",
            "[[1e-4, 0.005], [-0.005, 1e6]]",
            r"matrix\[0\]\[1\] = 0.005: is not symmetric; expected -0.005 as in \[1\]\[0\]",
        ),
        ("[[4.0], [3.0, 9.0]]", "[[4.0], [3.0, -9.0]]", r"matrix\[1\]\[1\] = -9.0: .*EA0Z"),
        ("[[4.0], [3.0, 9.0]]", "[[4.0], [7.0, 9.0]]", r"matrix\[[01]\] = .*E[CA]0[YZ] and others"),
        ('"EC0Y", "EA0Z"]', '"EC0X", "EA0Z"]', 'keys = "EC0X": is zero by definition'),
        ("matrix", 'untold = ["EC0X"]\nmatrix', 'keys = "EC0X": is zero by definition'),
        ("matrix", 'untold = ["EA0Z"]\nmatrix', 'keys = "EA0Z": expected each error once'),
        ("matrix", 'untold = ["EA0Q"]\nmatrix', "EA0Q: unknown error parameter"),
        ("matrix", "lack_of_fit = -1\nmatrix", "lack_of_fit = -1: expected at least 0"),
        ("matrix", "reach = { X = [5, 4] }\nmatrix", r"reach.X = \[5, 4\]: expected"),
    ],
)
def test_what_is_wrong_is_said_with_its_row_and_value(old, new, said):
    with pytest.raises(SceneError, match=said):
        parse_scene(SCENE.replace(old, new), "s")


def test_degrees_of_freedom_that_are_not_given_are_infinite():
    assert parse_scene(SCENE, "s").covariance.freedom == math.inf
