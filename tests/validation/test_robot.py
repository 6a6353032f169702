"""A six-axis robot, and whether stated intervals hold: on data of others, and on planted errors."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from products import first
from warpspace import evaluate
from warpspace.calibration import Calibrate, calibrate, read_readings
from warpspace.calibration.instruments import load_instrument
from warpspace.calibration.kinds import Positions, Prediction
from warpspace.calibration.registry import parse_readings
from warpspace.exceptions import OptionError, SceneError
from warpspace.kinematics.chain import branch_pose
from warpspace.machine.errors import Constant, ErrorSet
from warpspace.resources import find_data
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.scene_writer import scene_to_toml

UR10 = load_scene("ur10")
NOMINAL = load_scene("dvf5000_nominal")
TRACKER = load_instrument("tracker")
JOINTS = tuple(f"C{at}" for at in range(1, 7))
FIT = find_data("fit_600.csv").read_text(encoding="utf-8")


def test_chain_is_the_denavit_hartenberg_table():
    """Standard parameters, Rz(θ)·Tz(d)·Tx(a)·Rx(α): those in the README of the data."""
    table = [[127.3, 0, 90], [0, -612, 0], [0, -572.3, 0], [163.941, 0, 90], [115.7, 0, -90],
             [92.2, 0, 0]]  # fmt: skip
    angles = np.random.default_rng(5).uniform(-180.0, 180.0, (6, 20))
    expected = np.eye(4)
    for (d, a, alpha), theta in zip(table, np.deg2rad(angles), strict=True):
        turn = Rotation.from_euler("z", theta[:, None]) * Rotation.from_euler(
            "x", np.deg2rad(alpha)
        )
        step = np.tile(np.eye(4), (20, 1, 1))
        step[:, :3, :3] = turn.as_matrix()
        step[:, :3, 3] = np.stack([a * np.cos(theta), a * np.sin(theta), np.full(20, d)], -1)
        expected = expected @ step
    found = branch_pose(UR10.model, "tool", dict(zip(JOINTS, angles, strict=True)))
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_600_poses_of_a_tracker_predict_3000_others_inside_their_intervals():
    """Nominal geometry leaves 0.84 mm on unseen poses, parameters of all joints at most 0.44 mm."""
    files = [read_readings(name, UR10, "points") for name in ("fit_600.csv", "check_3000.csv")]
    found = calibrate(UR10, files[:1], predict=files[1:])
    assert found.rms_predicted_before_mm == pytest.approx(0.8314, abs=5e-5)
    assert found.rms_predicted_after_mm == pytest.approx(0.436, abs=0.002)
    assert found.predicted_coverage_95 == pytest.approx(0.95, abs=0.02)
    assert found.lack_of_fit is None  # no uncertainty stated, no pose repeated
    assert max(abs(one.value) for one in found.parameters) < 2000.0


def test_planted_errors_place_and_reflector_are_found_from_two_stations():
    draw = np.random.default_rng(8).uniform
    rows = [*draw(-170.0, 170.0, (60, 6))]
    planted = {"EX0C3": 800.0, "EA0C4": -900.0, "EB0C5": 1500.0}
    setup = np.array([2000, -900, 300, 200, -2900, 600, -700, 80, 1e3, 0, 30, 1200, 5, -20, 93.0])
    head = "j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg,session,x_mm,y_mm,z_mm"
    stations = ["a", "b"] * 30
    spelled = [",".join([*map(str, row), one]) for row, one in zip(rows, stations, strict=True)]
    coordinates = {name: np.array(rows)[:, at] for at, name in enumerate(JOINTS)}
    like = replace(
        read_readings("fit_600.csv", UR10),
        coordinates=coordinates, session=tuple(stations), lines=tuple(range(60)),
    )  # fmt: skip
    errors = ErrorSet({key: Constant((-1.0, 1.0), value) for key, value in planted.items()})
    guess = Prediction(errors, Positions().unknowns(like), setup)
    seen = Positions().observe(UR10, like, guess)
    lines = [
        f"{one},{','.join(map(repr, map(float, at)))}"
        for one, at in zip(spelled, seen, strict=True)
    ]
    readings = parse_readings("\n".join([head, *lines]), "planted.csv", UR10)
    found = calibrate(UR10, [readings], Calibrate(fit=tuple(planted)))
    assert found.rms_after_mm < 1e-6
    assert {one.key: one.value for one in found.parameters} == pytest.approx(planted, rel=1e-4)
    turned = np.array([found.unknowns[name] for name in guess.unknowns])
    np.testing.assert_allclose(turned, setup, atol=1e-4)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("J3_deg", "J33_deg"), "has no column j3_deg: did you mean 'j33_deg'"),
        (
            ("temperature_C", "J7_deg"),
            "has column j7_deg, but the machine has no axis J7; expected J1",
        ),
        (("x_mm", "X"), "has no column ex_um"),
    ],
)
def test_columns_of_joints_that_are_not_there_are_said(change, said):
    with pytest.raises(SceneError, match=said):
        parse_readings(FIT.replace(*change, 1), "robot.csv", UR10, "points")


def test_positions_in_metres_are_refused():
    rows = FIT.splitlines()
    small = [",".join([*row.split(",")[:-3], *(str(float(at) / 1e3) for at in row.split(",")[-3:])])
             for row in rows[1:]]  # fmt: skip
    with pytest.raises(OptionError, match="Are they in mm"):
        parse_readings("\n".join([rows[0], *small]), "robot.csv", UR10)


def test_names_of_columns_survive_a_saved_machine_and_are_one_each():
    own = replace(UR10.machine, columns={"C1": "base"})
    scene = replace(UR10, model=replace(UR10.model, machine=own))
    text = scene_to_toml(scene)
    assert parse_scene(text, "own").machine.columns == {"C1": "base"}
    for name in ("C2", "c2"):
        with pytest.raises(SceneError, match="is the name of C2 as well"):
            parse_scene(text.replace('"base"', f'"{name}"'), "own")
    with pytest.raises(SceneError, match="unknown frame of this machine"):
        parse_scene(text.replace('C1 = "base"', 'C9 = "base"'), "own")


def planted_points(scatter_um, session="", stated_um="", seed=0, count=40):
    """Error vectors of a machine that is out of square, written as a file."""
    draw = np.random.default_rng(seed)
    at = draw.uniform([-275, -225, -480], [275, 225, -80], (count, 3))
    machine = replace(NOMINAL, errors=ErrorSet({"EC0Y": Constant((-225.0, 225.0), 40.0)}))
    axes = dict(zip("XYZ", at.T, strict=True))
    error = evaluate(machine, at=axes, loop="relative", frame="workpiece", exact=True).error_um
    read = error + (5.0 if session else 0.0) + scatter_um * draw.standard_normal((count, 3))
    rows = ["x_mm,y_mm,z_mm,ex_um,ey_um,ez_um,session" + ",u_um" * bool(stated_um)]
    last = [session, stated_um] if stated_um else [session]
    rows += [",".join(map(str, [*row, *last])) for row in np.hstack([at, read])]
    return parse_readings("\n".join(rows), "planted.csv", NOMINAL, "points")


@pytest.mark.parametrize("session", first("new", ""))
def test_95_percent_of_planted_readings_lie_inside_the_intervals_stated_for_them(session):
    """Also where the predicted readings place their own set-up, which fits them in part."""
    shares = []
    for seed in range(25):
        files = [planted_points(3.0, seed=seed, count=8),
                 planted_points(3.0, session, seed=100 + seed, count=6)]  # fmt: skip
        found = calibrate(NOMINAL, files[:1], Calibrate(fit=("EC0Y", "EXX", "EYY")), files[1:])
        shares.append(found.predicted_coverage_95)
    assert np.mean(shares) == pytest.approx(0.95, abs=0.02)  # of 450


def test_residuals_beyond_their_stated_uncertainty_are_said():
    fit = Calibrate(fit=("EC0Y",))
    honest, short = (
        calibrate(NOMINAL, [planted_points(3.0, stated_um=stated)], fit) for stated in (3.0, 1.0)
    )
    assert honest.lack_of_fit == pytest.approx(1.0, abs=0.15)
    assert not any("lack of fit" in note for note in honest.notes)
    assert short.lack_of_fit == pytest.approx(3.0 * honest.lack_of_fit, rel=1e-6)
    said = "lack of fit: residuals are 3.0 times their stated uncertainty"
    assert said.partition("3.0")[0] in " ".join(short.notes)
    assert short.as_json()["lack_of_fit"] == short.lack_of_fit


def test_a_scale_of_the_tracker_makes_the_links_of_a_robot_as_unsure():
    """±0.5 K of steel, rectangular: 3.32 µm/m, on the upper arm of 612 mm 2.03 µm."""
    readings = parse_readings("\n".join(FIT.splitlines()[:201]), "robot.csv", UR10)
    kept = tuple(one for one in TRACKER.contributions if one.acts != "scale")
    whole, less = (
        calibrate(UR10, [readings], Calibrate(instrument=one))
        for one in (TRACKER, replace(TRACKER, contributions=kept))
    )
    at = whole.fit.index("EX0C3")
    variance, without = (one.covariance[at, at] for one in (whole, less))
    u, added = np.sqrt(variance), np.sqrt(variance - without)
    link_m = 0.612
    scale = np.hypot(11.5 * 0.5 / np.sqrt(3.0), 0.4)  # temperature and wavelength, µm/m
    assert u > 2.03
    assert added == pytest.approx(scale * link_m, rel=0.05)  # other links answer to it as well
