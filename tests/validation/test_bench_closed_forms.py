"""Each single error alone gives the known figure of each test, to 1e-6 relative, first order."""

import numpy as np
import pytest

from bench_scenes import scene_with
from warpspace.bench.base import BenchRun, run_test
from warpspace.bench.kinds.ball_plate import BallPlate
from warpspace.bench.kinds.circular import Circular
from warpspace.bench.kinds.cone_frustum import ConeFrustum
from warpspace.bench.kinds.diagonals import Diagonals
from warpspace.bench.kinds.positioning import Positioning
from warpspace.bench.kinds.rotary_axis import RotaryAxis, RTest
from warpspace.bench.kinds.straightness import Squareness, Straightness
from warpspace.bench.plan import simulate
from warpspace.machine.curves.simple import Directional
from warpspace.machine.errors import Constant, Harmonics, Poly, TableCurve

EXACT = {"rel": 1e-6, "abs": 1e-9}


def run(scene, test, *, exact=False):
    plan = test.plan(scene)
    readings = simulate(scene, plan, exact=exact)
    return BenchRun("model", plan, readings, test.evaluate(plan, readings))


def backlash(value):
    span = (0.0, 1.0)
    return Directional(span, Constant(span, value / 2.0), Constant(span, -value / 2.0))


RAMP, WAVE = ("ramp", 11.0), Harmonics((0.0, 360.0), ((2, 3.0, 0.0),))
STRAIGHTNESS = ("end_points_um", "least_squares_um", "minimum_zone_um")
CLOSED_FORMS = [
    # 11 µm over 550 mm: 4 µm more at +x and −4 at −x, so 4 cos²φ = 2 + 2 cos 2φ
    ({"EXX": RAMP}, Circular(radius_mm=200.0),
     {"radius_um": 2.0, "radius_difference_um": 4.0, "circular_deviation_um": 4.0,
      "squareness_urad": 0.0}),
    # 100 µm/m over a radius of 150 mm: 15 µm
    ({"EXX": ("ramp", 55.0)}, Circular(radius_mm=150.0), {"radius_difference_um": 15.0}),
    ({"EC0Y": 30.0}, Circular(radius_mm=150.0, end_deg=180.0, points=181),
     {"squareness_urad": 30.0}),
    ({"EXX": backlash(6.0)}, Diagonals(),
     {"B_um": 6.0 * 550.0 / np.linalg.norm([550.0, 450.0, 400.0])}),
    # every line sees the sagitta of a parabola; a squareness is no straightness
    ({"EYX": Poly((-275.0, 275.0), (0.0, 0.0, 1e-4))}, Straightness(axis="X", across="y"),
     dict.fromkeys(STRAIGHTNESS, 1e-4 * 275.0**2)),
    ({"EC0Y": 50.0}, Straightness(axis="Y", across="x"), dict.fromkeys(STRAIGHTNESS, 0.0)),
    # a radial error along x of the moving table is 3·cos 2θ towards the point that turns with it
    ({"EZC": WAVE}, RotaryAxis(), {"axial_um": 6.0}),
    ({"ECC": WAVE}, RotaryAxis(), {"angular_urad": 6.0, "radial_um": 0.0}),
    ({"EXC": WAVE}, RotaryAxis(), {"radial_um": 6.0}),
    ({"EBC": WAVE}, RotaryAxis(), {"tilt_urad": 6.0}),
    # squareness of the vertical axis does not show in a level plate
    ({"EXX": RAMP}, BallPlate(), {"scale_X_um_per_m": 20.0, "length_error_um": 11.0}),
    ({"EA0Z": 30.0}, BallPlate(), {"length_error_um": 0.0}),
    ({"EB0Z": 30.0}, BallPlate(), {"length_error_um": 0.0}),
    # a cone that stands level and is no cone at all is a circle: γ·R of circular deviation; axial
    # errors of the table move the circle of a level cone out of its plane only
    ({"EC0Y": 30.0}, ConeFrustum(half_apex_deg=0.0, tilt_deg=0.0, radius_mm=100.0),
     {"circular_deviation_um": 3.0}),
    ({"EZC": 5.0}, ConeFrustum(half_apex_deg=10.0, tilt_deg=0.0, radius_mm=50.0),
     {"circular_deviation_um": 0.0}),
]  # fmt: skip


@pytest.mark.parametrize(("errors", "test", "expected"), CLOSED_FORMS)
def test_closed_form(errors, test, expected):
    values = run(scene_with(**errors), test).values
    assert {key: values[key] for key in expected} == pytest.approx(expected, **EXACT)


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_positioning_of_a_ramp(axis):
    found = run(scene_with(**{f"E{axis}{axis}": ("ramp", 11.0)}), Positioning(axis=axis)).outcome
    for key in ("A_um", "E_um", "M_um", "A_forward_um", "E_backward_um"):
        assert found[key] == pytest.approx(11.0, **EXACT)
    assert found["R_um"] == found["B_um"] == 0.0


def test_positioning_of_rotary_axes():
    for axis, key in (("C", "ECC"), ("B", "EBB")):
        scene = scene_with(**{key: Harmonics((0.0, 360.0), ((1, 20.0, 0.0),))})
        found = run(scene, Positioning(axis=axis, targets=361, start=0.0, end=30.0))
        low = 20.0 * np.cos(np.deg2rad(30.0))
        assert found.outcome["E_urad"] == pytest.approx(20.0 - low, **EXACT)
        assert found.readings[0] == pytest.approx(20.0, **EXACT)


def test_abbe_error_of_positioning():
    # a pitch ramp of 10 µrad on the lever from the X frame down to the tool point
    scene = scene_with(EBX=("ramp", 10.0))
    short = run(scene, Positioning(axis="X")).outcome["E_um"]
    longer = run(scene, Positioning(axis="X", tool_extension_mm=100.0)).outcome["E_um"]
    assert longer - short == pytest.approx(1.0, **EXACT)


@pytest.mark.parametrize("exact", [True, False])
def test_backlash_is_the_reversal(exact):
    scene = scene_with(EXX=backlash(6.0))
    found = run(scene, Positioning(axis="X"), exact=exact).outcome
    assert found["B_um"] == found["R_um"] == found["A_um"] == pytest.approx(6.0, **EXACT)
    assert found["M_um"] == pytest.approx(0.0, abs=1e-9)
    assert found["B_mean_um"] == pytest.approx(6.0, **EXACT)


@pytest.mark.parametrize(("plane", "key"), [("XY", "EC0Y"), ("XZ", "EB0Z"), ("YZ", "EA0Z")])
def test_squareness_is_an_ellipse_at_45_degrees(plane, key):
    found = run(scene_with(**{key: 30.0}), Circular(plane=plane, radius_mm=150.0, points=360))
    assert found.outcome["squareness_urad"] == pytest.approx(30.0, **EXACT)
    assert found.outcome["circular_deviation_um"] == pytest.approx(4.5, **EXACT)
    angle = found.plan.marks["angle_deg"]
    assert angle[np.argmax(np.abs(found.readings))] % 90.0 == pytest.approx(45.0)


@pytest.mark.parametrize(("plane", "key"), [("XY", "EC0Y"), ("XZ", "EB0Z"), ("YZ", "EA0Z")])
def test_a_ball_bar_separates_the_squareness_of_its_plane_from_other_errors(plane, key):
    errors = {"EC0Y": 10.0, "EB0Z": 20.0, "EA0Z": -30.0, "EXX": 4.0, "EYY": -3.0, "EZZ": 2.0}
    outcome = run(scene_with(**errors), Circular(plane=plane, radius_mm=150.0)).outcome
    assert outcome["squareness_urad"] == pytest.approx(errors[key], abs=0.1)


def test_both_directions_trace_the_same_on_a_circle_that_touches_the_limits():
    circle = run(scene_with(EC0Y=23.1, EXX=4.0), Circular(radius_mm=225.0))
    assert circle.outcome["hysteresis_um"] < 1e-3
    forward, backward = np.split(circle.readings, 2)
    np.testing.assert_allclose(backward[::-1], forward)


LAYOUTS = {
    "dvf5000_nominal": ("EC0Y", "EB0Z", "EA0Z"),
    # of an axis that carries the other one, the errors rotate both: the other one is not square
    "machine_c_frame_mill": ("EC0X", "EB0Z", "EA0Z"),
    "machine_printer_3d": ("EC0Y", "EB0X", "EA0Z"),
    "machine_lathe_mill": ("EC0Y", "EB0X", "EA0Y"),
}


@pytest.mark.parametrize("scene", LAYOUTS)
@pytest.mark.parametrize("number", range(3))
def test_squareness_of_every_layout_is_the_same_in_every_test(scene, number):
    plane, key, seen = (
        ("XY", "XZ", "YZ")[number],
        LAYOUTS[scene][number],
        pytest.approx(20.0, **EXACT),
    )
    bent = scene_with(scene, **{key: 20.0})
    assert run(bent, Circular(plane=plane, radius_mm=60.0)).outcome["squareness_urad"] == seen
    square = run(bent, Squareness(plane=plane)).outcome
    for line in ("end_points", "least_squares", "minimum_zone"):
        assert square[f"{line}_urad"] == seen
    assert run(bent, BallPlate(plane=plane)).outcome["squareness_urad"] == seen
    for kind in ("body", "face"):
        assert run(bent, Diagonals(kind=kind)).outcome[f"squareness_{key}_urad"] == seen


def test_backlash_steps_on_the_circle():
    # +3 µm while X moves upwards, −3 µm while downwards: ±3·cos φ on the two halves
    found = run(scene_with(EXX=backlash(6.0)), Circular(radius_mm=100.0, points=360))
    marks = found.plan.marks
    forward = -np.sin(np.deg2rad(marks["angle_deg"]) + 1e-9 * marks["sense"]) * marks["sense"] > 0.0
    expected = np.where(forward, 3.0, -3.0) * np.cos(np.deg2rad(marks["angle_deg"]))
    np.testing.assert_allclose(found.readings, expected, atol=1e-9)
    # where X turns back both runs have come alike; a degree further on they differ most
    assert found.outcome["hysteresis_um"] == pytest.approx(6.0 * np.cos(np.deg2rad(1.0)), **EXACT)


def test_each_sense_has_its_own_centre_and_radii_count_from_the_nominal_one():
    # ISO 230-4:2005: a circle of radius R + 5 µm about (4, 0) µm, back R + 3 µm about (−4, 0) µm,
    # both with a squareness: r = 5 + 4 cos φ − 2 sin 2φ and r = 3 − 4 cos φ − 2 sin 2φ
    phi, found = evaluated_circle(
        720, lambda phi, sense: 4 + sense * (1 + 4 * np.cos(phi)) - 2 * np.sin(2 * phi)
    )
    readings = np.append(5 + 4 * np.cos(phi), 3 - 4 * np.cos(phi)) - 2 * np.sin(2 * np.tile(phi, 2))
    expected = {
        "circular_deviation_counter_clockwise_um": 4.0,  # G
        "circular_deviation_clockwise_um": 4.0,
        # G(b): the two displacements cancel, the common centre is the nominal one
        "circular_deviation_um": np.ptp(readings),
        "radial_deviation_max_um": readings.max(),  # Fmax
        "radial_deviation_min_um": readings.min(),  # Fmin
        "mean_radial_deviation_um": 4.0,  # D
        "hysteresis_um": 10.0,  # H: 2·(1 + 4) at φ = 0
    }
    assert {key: found[key] for key in expected} == pytest.approx(expected, **EXACT)


def evaluated_circle(points, readings):
    test = Circular(radius_mm=100.0, points=points)
    plan = test.plan(scene_with())
    phi, sense = np.deg2rad(plan.marks["angle_deg"]), plan.marks["sense"]
    outcome = test.evaluate(plan, readings(phi, sense))
    return phi[:points], {quantity.key: quantity.value for quantity in outcome.quantities}


def test_an_eccentric_circle_is_round_but_not_where_it_should_be():
    # a ball 7 µm off along +x and 2 µm up: F keeps what G takes out
    _, found = evaluated_circle(360, lambda phi, _: 7.0 * np.cos(phi) + 2.0)
    expected = {
        "circular_deviation_um": 0.0, "circular_deviation_clockwise_um": 0.0,
        "radial_deviation_max_um": 9.0, "radial_deviation_min_um": -5.0,
        "mean_radial_deviation_um": 2.0,
    }  # fmt: skip
    assert {key: found[key] for key in expected} == pytest.approx(expected, **EXACT)


def test_one_sense_alone_has_no_bidirectional_figures(tmp_path):
    rows = [f"+,{angle},{3.0 + np.cos(np.deg2rad(2 * angle))}" for angle in range(0, 360, 5)]
    data = tmp_path / "one.csv"
    data.write_text("direction,angle_deg,radial_um\n" + "\n".join(rows) + "\n")
    found = run_test(scene_with(), Circular(radius_mm=100.0), data).measured.outcome
    labels = {quantity.key: quantity.name for quantity in found.quantities}
    assert labels["circular_deviation_um"] == "circular deviation G"
    assert not labels.keys() & {"mean_radial_deviation_um", "hysteresis_um"}
    assert found["circular_deviation_um"] == pytest.approx(2.0, **EXACT)


def test_an_arc_shorter_than_half_a_circle_has_no_squareness():
    quarter = run(scene_with(EC0Y=30.0), Circular(radius_mm=150.0, end_deg=90.0, points=91))
    assert "squareness_urad" not in quarter.values


@pytest.mark.parametrize(
    ("bar", "key", "size", "expected"),
    [
        ("radial", "EX0C", 5.0, lambda theta: -5.0 * np.cos(theta)),
        ("tangential", "EX0C", 5.0, lambda theta: 5.0 * np.sin(theta)),
        ("axial", "EA0C", 20.0, lambda theta: -20.0 * 0.1 * np.sin(theta)),
    ],
)
def test_circle_that_follows_a_rotary_axis(bar, key, size, expected):
    # a table that runs out by 5 µm along x in R is seen by the radial bar as −5·cos θ,
    # by the tangential one as +5·sin θ; an axial bar sees EA0C · R · sin θ
    found = run(scene_with(**{key: size}), Circular(rotary="C", bar=bar, radius_mm=100.0))
    theta = np.deg2rad(found.plan.marks["angle_deg"])
    np.testing.assert_allclose(found.readings, expected(theta), atol=1e-9)
    if bar == "axial":
        assert found.outcome["circular_deviation_um"] == pytest.approx(4.0, **EXACT)


def lengths(found):
    rows = found.outcome.details["diagonals"]
    return {row["diagonal"]: row["length_deviation_um"] for row in rows}


def test_body_diagonals_differ_by_squareness():
    # edges 550 × 450 × 400: γ·a·b/L each way
    found = run(scene_with(EC0Y=40.0), Diagonals())
    change = 40e-3 * 550.0 * 450.0 / np.linalg.norm([550.0, 450.0, 400.0])
    expected = {"PPP": -change, "PPN": -change, "NPP": change, "PNP": change}
    assert lengths(found) == pytest.approx(expected, **EXACT)
    assert found.outcome["length_difference_um"] == pytest.approx(2.0 * change, **EXACT)


def test_face_diagonals_and_scale():
    found = lengths(run(scene_with(EXX=RAMP), Diagonals(kind="face")))
    expected = dict.fromkeys(("XY:PP", "XY:NP"), 11.0 * 550.0 / np.hypot(550.0, 450.0))
    expected["YZ:PP"] = 0.0
    assert {name: found[name] for name in expected} == pytest.approx(expected, **EXACT)


def test_step_diagonals_tell_the_axes_apart():
    length = np.linalg.norm([550.0, 450.0, 400.0])
    found = run(scene_with(EYY=("ramp", 9.0)), Diagonals(kind="step"))
    for row in found.outcome.details["diagonals"]:
        assert row["by_axis_um"]["X"] == pytest.approx(0.0, abs=1e-9)
        assert row["by_axis_um"]["Y"] == pytest.approx(9.0 * 450.0 / length, **EXACT)


def test_reference_lines_of_a_kink():
    # three points 0, 0, 8: the middle one lies 4 below the line through the ends
    scene = scene_with(EZX=TableCurve((-275.0, 275.0), ((-275.0, 0.0), (0.0, 0.0), (275.0, 8.0))))
    found = run(scene, Straightness(axis="X", across="z", points=3))
    assert found.values == pytest.approx(dict.fromkeys(STRAIGHTNESS, 4.0), **EXACT)
    slopes = dict.fromkeys(("end_points", "minimum_zone", "least_squares"), 8.0 / 0.55)
    assert found.outcome.details["slope_urad"] == pytest.approx(slopes, **EXACT)


@pytest.mark.parametrize(("axis", "keys"), [
    ("C", ("EX0C_um", "EY0C_um", "EA0C_urad", "EB0C_urad")),
    ("B", ("EZ0B_um", "EX0B_um", "EC0B_urad", "EA0B_urad")),
])  # fmt: skip
def test_axis_average_line_of_a_table(axis, keys):
    for key in keys:
        found = run(scene_with(**{key[:4]: 7.0}), RotaryAxis(axis=axis, height_mm=0.0)).values
        assert found == pytest.approx({**dict.fromkeys(found, 0.0), key: 7.0}, **EXACT)


def test_tilted_c_on_the_r_test():
    # the ball at radius 100, height 60 above the axis' origin: α·h along y, −α·R·sin θ along z
    found = run(scene_with(EA0C=25.0), RTest(axis="C", ball=(100.0, 0.0, 60.0)))
    theta = np.deg2rad(found.plan.marks["angle_deg"][:73])
    x, y, z = found.readings.reshape(3, -1)
    np.testing.assert_allclose(x, 0.0, atol=1e-9)
    np.testing.assert_allclose(y, 25.0 * 0.06, rtol=1e-6)
    np.testing.assert_allclose(z, -25.0 * 0.1 * np.sin(theta), atol=1e-9)
    assert found.outcome["z_um"] == pytest.approx(5.0, **EXACT)


def test_location_of_c_on_the_r_test():
    found = run(scene_with(EX0C=8.0), RTest(axis="C", ball=(100.0, 0.0, 60.0)))
    x, y, _ = found.readings.reshape(3, -1)
    np.testing.assert_allclose(x, -8.0, rtol=1e-9)
    np.testing.assert_allclose(y, 0.0, atol=1e-9)
    turned = run(
        scene_with(EX0C=8.0), RTest(axis="C", ball=(100.0, 0.0, 60.0), frame="workpiece")
    ).outcome
    assert turned["x_um"] == pytest.approx(16.0, **EXACT)


def test_a_ball_that_stands_elsewhere_is_fitted_away():
    test = RTest(axis="C", ball=(100.0, 0.0, 60.0))
    scene = scene_with()
    plan = test.plan(scene)
    design = np.stack(list(plan.setup.values()), -1)
    found = test.evaluate(plan, design @ np.array([3.0, -2.0, 5.0]))
    assert found["rms_fitted_um"] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(found.details["ball_um"], [3.0, -2.0, 5.0])


def test_tool_stands_along_the_flank_of_the_cone():
    from warpspace.kinematics import transforms
    from warpspace.kinematics.chain import branch_pose, tool_axis

    scene = scene_with()
    test = ConeFrustum(half_apex_deg=15.0, tilt_deg=30.0, radius_mm=40.0)
    plan = test.plan(scene)
    pose = branch_pose(scene.model, "workpiece", plan.coordinates)
    axis = transforms.rotate(
        np.swapaxes(pose[..., :3, :3], -1, -2), tool_axis(scene.model, plan.coordinates)
    )
    normal = np.array([np.sin(np.deg2rad(30.0)), 0.0, np.cos(np.deg2rad(30.0))])
    np.testing.assert_allclose(axis @ normal, np.cos(np.deg2rad(15.0)), atol=1e-9)
    outward = transforms.rotate(np.swapaxes(pose[..., :3, :3], -1, -2), plan.direction)
    np.testing.assert_allclose(
        np.sum(axis * outward, axis=-1), -np.sin(np.deg2rad(15.0)), atol=1e-9
    )
