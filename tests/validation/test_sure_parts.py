"""U95 of parts, programs, distances and compensations against closed forms of one squareness error.

Y turned by γ about z moves a point by −γ·y along x, mm times µrad being nm. What an inspector fits
out is a turn by γ/2; what is left is (−γ/2·y, −γ/2·x).
"""

import math

import numpy as np
import pytest
import trimesh
from scipy.stats import norm, t

from warpspace.analysis.commands.distance import Distance
from warpspace.analysis.description import ignore_progress
from warpspace.formats.compensation.compensate import Compensate
from warpspace.parts.part import Part
from warpspace.parts.program import Program
from warpspace.parts.workpiece import Workpiece
from warpspace.scene.library import parse_scene

MACHINE = """[machine]
chain = "wFXYZt"
[workspace]
X = [-150, 150]
Y = [-120, 120]
Z = [-100, 100]
[errors]
EC0Y = 20
"""
STATED = MACHINE + "[uncertainty]\nEC0Y = 1.5\n"
FEW = MACHINE + '[uncertainty.covariance]\nkeys = ["EC0Y"]\nmatrix = [[2.25]]\ndof = 5\n'
U, PLACE = 1.5, (0.0, 0.0, 0.0)
TOLERANCE = """[[features]]
is = "plane"
near = [50.0, 0.0, 0.0]
name = "side"
[[features]]
is = "plane"
near = [0.0, 50.0, 0.0]
measure = "squareness"
to = ["side"]
tolerance_urad = {limit}
"""


def scene(text):
    return parse_scene(text, "s")


def cube(text, **more):
    mesh = trimesh.creation.box((100.0, 100.0, 100.0))
    own = Workpiece("cube", np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32))
    found = Part(mesh=own, place=PLACE, **more).run(scene(text), ignore_progress)
    return found, found.as_json()


def test_the_deviation_of_a_part_is_as_unsure_as_its_errors():
    _, told = cube(STATED)
    middle = (np.arange(100) + 0.5) - 50.0  # x and y of six sides, evenly
    x, y = np.broadcast_arrays(middle[:, None], middle)
    side = np.full_like(x, 50.0)
    sides = np.array([(side, y), (side, y), (x, side), (x, side), (x, y), (x, y)])
    arms = {"deviation": np.abs(sides[:, 1]), "placed": np.hypot(*np.moveaxis(sides, 1, 0)) / 2.0}
    for state, arm in arms.items():
        numbers = told["deviation"] if state == "deviation" else told["placed"]["deviation"]
        rms = np.sqrt(np.mean(arm**2))
        most = math.hypot(50.0, 50.0) / 2.0 if state == "placed" else 50.0
        expected = {"mean": arm.mean(), "rms": rms, "p95": np.quantile(arm, 0.95), "max": most}
        for name, length in expected.items():
            assert numbers[f"{name}_um"] == pytest.approx(20.0 * length * 1e-3, rel=0.01)
            assert numbers[f"u95_{name}_um"] == pytest.approx(2.0 * U * length * 1e-3, rel=0.01)
    for feature in told["features"]:  # planes stay flat, whatever the squareness
        flatness = feature["measures"]["flatness"]
        assert flatness["u95_placed_difference_um"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("limit", "verdict"), [(25.0, "pass"), (22.0, "undecided"), (17.0, "fail")]
)
@pytest.mark.parametrize(("text", "law"), [(STATED, norm), (FEW, t(5))])
def test_a_verdict_is_pass_or_fail_with_95_percent(text, law, limit, verdict):
    found, told = cube(text, tolerances=("f.toml", TOLERANCE.format(limit=limit)))
    (one,) = [
        measure
        for feature in told["features"]
        for name, measure in feature["measures"].items()
        if name.startswith("squareness")
    ]
    assert abs(one["placed_difference_urad"]) == pytest.approx(20.0, rel=1e-4)
    factor = 2.0 if law is norm else law.ppf(0.5 + 0.9545 / 2.0)
    assert one["u95_placed_difference_urad"] == pytest.approx(factor * U, rel=1e-4)
    expected = law.cdf((limit - 20.0) / U) - law.cdf((-limit - 20.0) / U)
    assert one["probability"] == pytest.approx(expected, rel=1e-3)
    if text is FEW and limit == 25.0:
        assert expected > 0.95
    if text is FEW and limit == 17.0:  # 5 degrees of freedom: 5.1 %
        verdict = "undecided"
    assert one["verdict"] == verdict
    assert any(verdict in " ".join(row) for row in list(found.blocks())[-1].cells())


def test_where_an_error_acts_of_which_nothing_is_stated_no_verdict_is_given():
    text = STATED.replace("[uncertainty]", "EA0Z = 3\n[uncertainty]")
    found, told = cube(text, tolerances=("f.toml", TOLERANCE.format(limit=500)))
    assert told["deviation"]["u95_mean_um"] is None
    said = [one for feature in told["features"] for one in feature["measures"].values()]
    assert {one.get("verdict", "undecided") for one in said} == {"undecided"}
    assert any("EA0Z" in words for words in found.blocks() if isinstance(words, str))


def test_without_a_statement_verdicts_are_those_of_the_model():
    _, told = cube(MACHINE, tolerances=("f.toml", TOLERANCE.format(limit=20.5)))
    said = [one for feature in told["features"] for one in feature["measures"].values()]
    assert {one["verdict"] for one in said if "verdict" in one} == {"pass"}
    assert not [key for one in (*said, told["deviation"]) for key in one if "u95" in key]


def path(text, lines):
    return Program(file="p.ngc", text=lines).run(scene(text), ignore_progress).json_fields()


def test_a_path_is_as_unsure_along_it_as_across_it():
    along = path(STATED, "G21 G90 G1 F500 X-100 Y100 Z0\nX100\n")  # from where the machine stands
    line = [one for one in along["worst"] if one["line"] == 2]
    assert [(one["um"], one["u95_um"]) for one in line] == [pytest.approx((2.0, 0.3))]
    rise = path(STATED, "G21 G90 G0 X0 Y0 Z0\nG1 F500 Y100\n")
    across, none = rise["across"], rise["along"]
    shares = {"mean": 0.5, "rms": 1.0 / math.sqrt(3.0), "max": 1.0}
    for name, share in shares.items():  # samples every 10 mm: trapezoids
        for numbers in (across, rise["deviation"]):
            assert numbers[f"{name}_um"] == pytest.approx(2.0 * share, rel=6e-3)
            assert numbers[f"u95_{name}_um"] == pytest.approx(0.3 * share, rel=6e-3)
        assert none[f"u95_{name}_um"] == pytest.approx(0.0, abs=1e-12)


def test_a_difference_between_points_is_as_unsure_as_the_squareness():
    asked = Distance(start=(("X", 50.0),), end=(("Y", 100.0),), corner=(("Y", 0.0),))
    found = asked.run(scene(STATED), ignore_progress)
    told = found.as_json()
    assert told["u95_along_um"] == pytest.approx([2 * U * 0.1, 0.0, 0.0], abs=1e-9)
    assert told["u95_deviation_urad"] == pytest.approx(2 * U, rel=1e-6)  # the angle is γ wider
    # from X 50 to Y 100: x shrinks by γ · 100, of which 50 / √(50² + 100²) is along the line
    assert told["u95_difference_um"] == pytest.approx(
        2 * U * 0.1 * 50 / math.hypot(50, 100), rel=1e-4
    )
    assert not [key for key in asked.run(scene(MACHINE), ignore_progress).as_json() if "u95" in key]


def test_what_a_table_leaves_is_not_below_what_is_not_known():
    asked = Compensate(formats=("isg-csv",))
    bare, sure = (asked.run(scene(text), ignore_progress) for text in (MACHINE, STATED))
    before, after = sure.as_json()["before"], sure.as_json()["after"]
    assert before["u95_max_um"] == pytest.approx(2.0 * U * 0.12)
    assert after["rms_um"] < 0.01
    # RMS of γ·y over −120 … 120, nodes of a grid weighed
    assert after["expected_rms_um"] == pytest.approx(U * 0.12 / math.sqrt(3.0), rel=5e-3)
    assert "expected_rms_um" not in bare.as_json()["after"]
    assert not [key for key in bare.as_json()["before"] if "u95" in key]
