"""Calibration against the public sphere measurements, and against errors that were planted."""

from dataclasses import replace

import numpy as np
import pytest

from bench_scenes import scene_with, vectors
from warpspace.bench.base import find_test
from warpspace.bench.plan import simulate
from warpspace.calibration import Calibrate, calibrate, read_readings, solve
from warpspace.calibration.calibration_result import Estimability
from warpspace.calibration.kinds import VIEW, in_other_frame
from warpspace.calibration.next_best import Candidate, candidates, next_best, u95_at
from warpspace.calibration.readings import parse_reading_table
from warpspace.calibration.registry import parse_readings
from warpspace.calibration.solve import build_fit_parameters, describe_rank
from warpspace.calibration.spheres import circles_of
from warpspace.field.evaluate import evaluate_exact
from warpspace.machine.errors import Constant, ErrorSet, Ramp
from warpspace.resources import find_data
from warpspace.scene.library import load_scene

FORK = load_scene("fork_head_bc")
HEAD = {"EX0B": 60.0, "EA0B": -140.0, "EA0C": 90.0, "EB0C": -70.0, "EC0B": 210.0, "EZB": -250.0}


def sphere_circles(axis):
    table = parse_reading_table(find_data("tcp_off.csv").read_text(), "tcp_off.csv")
    return [circle for circle in circles_of(table, FORK) if circle.axis == axis]


def test_circle_about_b_with_tcp_off():
    """Least-squares circle through run b1 in X–Z."""
    (circle,) = sphere_circles("B")
    assert (circle.plane, circle.sessions, circle.count) == ("XZ", ("b1",), 5)
    assert circle.radius_mm == pytest.approx(308.963734, abs=5e-7)
    assert circle.centre_mm == pytest.approx((305.669816, -589.742446), abs=5e-7)
    assert circle.against


def test_circles_about_c_with_tcp_off():
    """Opposite readings of C lie symmetric to the centre: half their distance is the radius."""
    one, two, both = sphere_circles("C")
    assert [circle.sessions for circle in (one, two, both)] == [("c1",), ("c2",), ("c1", "c2")]
    across = np.hypot(278.915280 - 332.451531, 326.726812 - 325.422646) / 2.0
    assert one.radius_mm == pytest.approx(across, abs=0.04)
    for circle in (one, two, both):
        assert not circle.against
        assert circle.plane == "XY"
        assert circle.radius_mm == pytest.approx(26.748, abs=0.0005)


def test_tcp_on_falls_from_278_to_below_78_micrometres():
    readings = read_readings("tcp_on.csv", FORK)
    assert readings.kind == "sphere-tcp"
    found = calibrate(FORK, [readings])
    spread = readings.observed_mm - readings.observed_mm.mean(axis=0)
    assert found.rms_before_mm == pytest.approx(np.sqrt(np.mean(np.sum(spread**2, axis=1))))
    assert found.rms_before_mm == pytest.approx(0.278, abs=0.0005)
    assert found.rms_after_mm < 0.078


def test_tcp_on_by_linear_algebra_written_apart():
    """Places of B, zero of B and length of the tool, as columns that are written out here."""
    readings = read_readings("tcp_on.csv", FORK)
    found = calibrate(FORK, [readings], Calibrate(fit=("EX0B", "EY0B", "EB0B", "EZB")))
    rows = []
    for b, c in np.deg2rad(np.stack([readings.coordinates[axis] for axis in "BC"], axis=-1)):
        turn_c = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
        turn_b = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
        tip = turn_c @ turn_b @ [-0.66, -26.72, -308.96]
        about_b = np.cross(turn_c[:, 1], tip)
        columns = -turn_c[:, 0], -turn_c[:, 1], -about_b, -(turn_c @ turn_b)[:, 2]
        rows.append(np.column_stack([np.eye(3), *columns]))
    system = np.vstack(rows)
    values, *_ = np.linalg.lstsq(system, readings.observed_mm.ravel(), rcond=None)
    left = (readings.observed_mm.ravel() - system @ values).reshape(-1, 3)
    assert found.rms_after_mm == pytest.approx(np.sqrt(np.mean(np.sum(left**2, axis=1))), rel=1e-3)
    assert found.rms_after_mm == pytest.approx(0.0777, abs=0.0001)
    wanted = 1e3 * values[[3, 4, 6]], 1e6 * values[5]
    by_key = {one.key: one.value for one in found.parameters}
    assert [by_key[key] for key in ("EX0B", "EY0B", "EZB")] == pytest.approx(wanted[0], rel=5e-3)
    assert by_key["EB0B"] == pytest.approx(wanted[1], rel=5e-3)


def test_poses_left_out_are_predicted():
    lines = find_data("tcp_on.csv").read_text(encoding="utf-8").splitlines()
    rows = [line for line in lines if not line.startswith("#")]
    wide = [row for row in rows[1:] if row.startswith(("30,", "-30,"))]
    near = [row for row in rows[1:] if row not in wide]
    files = [parse_readings("\n".join([rows[0], *part]), "a.csv", FORK) for part in (near, wide)]
    assert (len(near), len(wide)) == (15, 8)
    found = calibrate(FORK, files[:1], predict=files[1:])
    assert found.rms_predicted_before_mm == pytest.approx(0.447, abs=0.001)
    assert found.rms_predicted_after_mm is not None
    assert found.rms_predicted_after_mm < 0.3 * found.rms_predicted_before_mm
    # the intervals do not hold there, and the repeated pose B0 C0 tells that the model is too small
    assert found.predicted_coverage_95 == pytest.approx(0.583, abs=0.001)
    assert found.lack_of_fit == pytest.approx(3.19, abs=0.01)
    assert any("3.2 times the scatter of repeated readings" in note for note in found.notes)


def planted(errors, kind, poses, noise=0.0, seed=0):
    functions = {}
    for key, value in errors.items():
        axis = key[-1]
        linear = FORK.machine.axes[axis].is_linear and key[2] != "0"
        curve = (Ramp if linear else Constant)(FORK.axis_span(axis))
        functions[key] = curve.with_amplitude(value)
    blank = vectors(FORK, poses, np.zeros((len(next(iter(poses.values()))), 3)))
    error = evaluate_exact(FORK.model, ErrorSet(functions), blank.coordinates, VIEW).error_um * 1e-3
    error = error + noise * np.random.default_rng(seed).standard_normal(error.shape)
    if kind == "points":
        return replace(blank, observed_mm=error)
    tip = blank.nominal_mm
    observed = tip.mean(axis=0) + np.array([1.0, -2.0, 3.0]) - error
    if kind == "lengths":
        observed = np.linalg.norm(tip + error - [900.0, -400.0, 100.0], axis=-1)[:, None] - 12.5
    return replace(blank, kind=kind, observed_mm=observed, session=("a",) * len(blank))


def sphere_poses():
    b, c = (values.ravel() for values in np.meshgrid([-60, -25, 0, 40, 75], [0, 70, 160, 250]))
    still = {"X": 350.0, "Y": 300.0, "Z": -700.0}
    return {"B": b, "C": c, **{axis: np.full(20, at) for axis, at in still.items()}}


def volume_poses(count=60):
    draw = np.random.default_rng(4).uniform
    spans = {**FORK.workspace.ranges, "B": (-60.0, 60.0), "C": (-180.0, 180.0)}
    return {name: draw(*span, count) for name, span in spans.items()}


@pytest.mark.parametrize("kind", ["sphere-tcp", "points", "lengths"])
def test_planted_errors_are_found_to_a_thousandth(kind):
    poses = sphere_poses() if kind == "sphere-tcp" else volume_poses()
    found = calibrate(FORK, [planted(HEAD, kind, poses)], Calibrate(fit=tuple(HEAD)))
    assert [one.identifiable for one in found.parameters] == [True] * len(HEAD)
    for one in found.parameters:
        assert one.value == pytest.approx(HEAD[one.key], rel=1e-3)
    assert found.rms_after_mm < 1e-6 * found.rms_before_mm


def test_large_errors_are_found_by_the_exact_model():
    large = {"EA0C": 20_000.0, "EC0B": -15_000.0, "EX0B": 5_000.0}
    found = calibrate(FORK, [planted(large, "points", volume_poses())], Calibrate(fit=tuple(large)))
    assert {one.key: one.value for one in found.parameters} == pytest.approx(large, rel=1e-6)


def test_all_errors_of_linear_axes_are_found_from_points():
    errors = {"EXX": 12.0, "EBY": -20.0, "EAZ": 15.0, "EC0Y": 23.0, "EA0Z": -31.0, "EB0Z": 9.0}
    found = calibrate(FORK, [planted(errors, "points", volume_poses(200))])
    by_key = {one.key: one for one in found.parameters}
    for key, value in errors.items():
        assert by_key[key].value == pytest.approx(value, rel=1e-3)
    # a slope of straightness is a squareness by another name
    alike = next(group for group in found.rank.confounded if group[0] == "EXY")
    assert "EC0Y" in alike
    assert any("the slope of EXY" in words for words in describe_rank(found.rank, found.slopes))
    assert found.rms_after_mm < 1e-6 * found.rms_before_mm


@pytest.mark.parametrize(
    ("robust", "far_off", "trials", "near"),
    [
        (False, 0.0, 40, 0.07),
        pytest.param(False, 0.0, 1000, 0.02, marks=pytest.mark.nightly),
        pytest.param(True, 0.0, 300, 0.03, marks=pytest.mark.nightly),
        pytest.param(True, 0.1, 300, 0.03, marks=pytest.mark.nightly),
    ],
)
def test_intervals_hold_in_95_percent_of_trials(robust, far_off, trials, near):
    """Readings scatter by a micrometre, a share of them by fifty."""
    clean, held = planted(HEAD, "sphere-tcp", sphere_poses()), []
    for seed in range(trials):
        draw = np.random.default_rng(seed)
        noise = 1e-3 * draw.standard_normal((len(clean), 3))
        noise[draw.choice(len(clean), round(far_off * len(clean)), replace=False)] *= 50.0
        noisy = replace(clean, observed_mm=clean.observed_mm + noise)
        for one in calibrate(FORK, [noisy], Calibrate(fit=tuple(HEAD), robust=robust)).parameters:
            held.append(one.interval_95[0] <= HEAD[one.key] <= one.interval_95[1])
            assert one.standard_uncertainty < 5.0
    assert np.mean(held) == pytest.approx(0.95, abs=near)


@pytest.mark.parametrize(
    ("trials", "near"), [(10, 0.1), pytest.param(300, 0.03, marks=pytest.mark.nightly)]
)
def test_told_combinations_hold_in_95_percent_of_trials(trials, near):
    """Their parameters by themselves hold in about half."""
    scene = load_scene("dvf5000_nominal")
    keys = tuple(key for key in scene.parameter_keys if key[-1] in "XYZ")
    corners = np.meshgrid(*[np.linspace(*scene.workspace.ranges[axis], 3) for axis in "XYZ"])
    poses = {axis: corner.ravel() for axis, corner in zip("XYZ", corners, strict=True)}
    poses |= {axis: np.full(27, scene.workspace.positions[axis]) for axis in "BC"}
    curves = {key: (Constant if key[2] == "0" else Ramp)(scene.axis_span(key[-1])) for key in keys}
    held = []
    for seed in range(trials):
        draw = np.random.default_rng(seed)
        drawn = {key: one.with_amplitude(draw.normal(0, 10)) for key, one in curves.items()}
        truth = ErrorSet(drawn)
        read = evaluate_exact(scene.model, truth, poses, VIEW).error_um
        read = read + draw.standard_normal((27, 3))
        found = calibrate(scene, [vectors(scene, poses, read)], Calibrate(fit=keys))
        parts = [one.key for one in found.parameters if one.estimable is Estimability.CONFOUNDED]
        assert parts == [next(iter(one.factors)) for one in found.combinations] != []
        assert all(one.interval_95 is None for one in found.parameters if not one.identifiable)
        for one in found.combinations:
            value = sum(share * truth.amplitude(key) for key, share in one.factors.items())
            held.append(one.interval_95[0] <= value <= one.interval_95[1])
    assert np.mean(held) == pytest.approx(0.95, abs=near)


def test_one_outlier_is_named_and_hardly_moves_a_robust_fit():
    clean = planted(HEAD, "sphere-tcp", sphere_poses(), noise=1e-3)
    observed = clean.observed_mm.copy()
    observed[7] += [0.4, -0.3, 0.2]
    spoilt = replace(clean, observed_mm=observed)
    plain = calibrate(FORK, [spoilt], Calibrate(fit=tuple(HEAD)))
    robust = calibrate(FORK, [spoilt], Calibrate(fit=tuple(HEAD), robust=True))

    def off(found):
        return sum(abs(one.value - HEAD[one.key]) for one in found.parameters)

    assert 7 in robust.fitted[0].outliers
    assert off(robust) < 0.1 * off(plain)


def test_uncertainties_weigh_the_readings():
    """Two constant groups: the weighted mean, and its standard uncertainty."""
    count = 8
    poses = {"X": np.linspace(150.0, 550.0, count), "Y": np.full(count, 300.0)}
    base = planted({}, "points", poses)
    values = np.repeat([0.010, 0.020], 4)
    sigma = np.repeat([0.001, 0.003], 4)
    observed = np.column_stack([values, np.zeros((count, 2))])
    readings = replace(base, observed_mm=observed, sigma_mm=sigma)
    found = calibrate(FORK, [readings], Calibrate(fit=("EXX:constant",)))
    weight = 1.0 / sigma**2
    (one,) = found.parameters
    assert one.value == pytest.approx(1e3 * np.sum(weight * values) / np.sum(weight))
    assert one.standard_uncertainty == pytest.approx(1e3 / np.sqrt(np.sum(weight)))


def test_what_looks_alike_is_said():
    readings = planted({}, "sphere-tcp", sphere_poses())
    keys = ("EZB", "EX0B", "EC0B", "EC0C", "EX0C", "EZ0C", "EZ0B", "EXX:constant")
    rank = calibrate(FORK, [replace(readings, session=("",) * 20)], Calibrate(fit=keys)).rank
    assert ("EC0C", "EC0B") in rank.confounded
    assert {("EX0C",), ("EZ0C",), ("EZ0B",), ("EXX",)} < set(rank.confounded)
    assert rank.rank == 3
    assert rank.is_identifiable("EX0B")
    assert not rank.is_identifiable("EC0B")


def test_poses_at_the_ends_of_the_travel_are_proposed():
    scene = load_scene("machine_trunnion_bc")
    names = [one.name for one in candidates(scene) if one.name.startswith("sphere, TCP on: B")]
    # B at ±90° brings a linear axis to an end of its travel, but for rounding
    assert "B at -90, -60, -30, 0, 30, 60, 90°" in names[0]


def test_lengths_to_stations_are_no_centres_of_a_sphere():
    rows = [f"{turn},{turn},0,0,{100 + turn}" for turn in range(8)]
    text = "\n".join(["c_deg,x_mm,y_mm,z_mm,length_mm", *rows])
    assert parse_readings(text, "a.csv", load_scene("dvf5000_nominal")).kind == "lengths"


@pytest.mark.parametrize("instrument", ["tracker", "ball bar", "probe", "sphere"])
def test_predicted_covariance_of_the_next_measurement_is_the_one_obtained(instrument):
    """What an instrument reads and what its set-up leaves open: the promise is what a fit gives."""
    scene = replace(load_scene("dvf5000_nominal"), tolerances=type(FORK.tolerances)({}, {}))
    keys = ("EC0Y", "EXX", "EBX", "EYY", "EXZ:constant", "EX0C")
    first = next(one.readings for one in candidates(scene) if one.name.startswith("tracker"))
    first = replace(first, session=("before",) * len(first), sigma_mm=np.full(len(first), 1e-3))
    found = calibrate(scene, [first], Calibrate(fit=keys))
    choice = [one for one in candidates(scene) if one.name.startswith(instrument)][:1]
    (step,) = next_best(scene, [first], found, 1, choice)
    second = replace(choice[0].readings, sigma_mm=np.full(len(choice[0].readings), 1e-3))
    both = calibrate(scene, [first, second], Calibrate(fit=keys))
    asked = [one.key for one in found.parameters]
    said = np.sqrt(np.diag(step.covariance))
    got = np.sqrt(np.diag(both.covariance))
    for at, key in enumerate(both.fit):
        assert said[asked.index(key)] == pytest.approx(got[at], rel=0.02)
    assert any(
        width < one.standard_uncertainty
        for width, one in zip(said, found.parameters, strict=True)
        if one.standard_uncertainty
    )


def test_a_ball_bar_is_no_thirty_six_error_vectors():
    """Radial readings and an unknown centre lower the map by a tenth of what vectors would."""
    scene = load_scene("dvf5000_first")
    grid = next(one.readings for one in candidates(scene) if one.name.startswith("tracker"))
    corners = replace(grid, kind="points", session=("",) * len(grid))
    keys = tuple(key for key in scene.parameter_keys if key[-1] in "XYZ")
    found = calibrate(scene, [corners], Calibrate(fit=keys))
    bar = next(one for one in candidates(scene) if one.name.startswith("ball bar, circle XY"))
    assert bar.readings.observed_mm.shape == (36, 1)
    points = vectors(scene, bar.readings.coordinates, np.zeros((36, 3)))
    (said,), (full,) = (
        next_best(scene, [corners], found, 1, [Candidate("", one)])
        for one in (bar.readings, points)
    )
    gains = [step.map_before_um - step.map_after_um for step in (said, full)]
    assert 0.0 < gains[0] < 0.2 * gains[1]


def test_the_map_is_weighted_by_volume():
    """One error, known to a micrometre: the map is its RMS over the volume, ends counted half."""
    scene = replace(load_scene("dvf5000_nominal"), tolerances=type(FORK.tolerances)({}, {}))
    terms = build_fit_parameters(scene, ("EXX:ramp",))
    nodes = np.linspace(0.0, 1.0, 5)
    told = u95_at(scene, terms, "map")(np.eye(1))
    assert told == pytest.approx(2.0 * np.sqrt(np.trapezoid(nodes**2, nodes)))


def test_squareness_is_found_in_circles_of_two_planes():
    """Circles in XY and YZ, read as the bench reads them: squareness told, slopes like it said."""
    scene = load_scene("dvf5000_nominal")
    machine = scene_with(EC0Y=23.1, EA0Z=-17.0)
    sets = []
    for plane in ("XY", "YZ"):
        test = find_test("circular")(plane=plane, radius_mm=150.0, points=72)
        plan = test.plan(machine)
        readings = simulate(machine, plan)
        sign = np.where(plan.marks["sense"] > 0.0, "+", "-")
        rows = zip(sign, plan.marks["angle_deg"], readings, strict=True)
        lines = [f"{way},{angle:.9g},{value:.9g}" for way, angle, value in rows]
        text = "\n".join(["direction,angle_deg,radial_um", *lines])
        kind = f"circular:plane={plane}:radius=150"
        sets.append(parse_readings(text, f"{plane}.csv", scene, kind))
    found = calibrate(scene, sets, Calibrate(fit=("EC0Y", "EA0Z")))
    values = {one.key: one.value for one in found.parameters}
    assert values == pytest.approx({"EC0Y": 23.1, "EA0Z": -17.0}, rel=1e-5)
    assert found.rms_after_mm < 1e-6 * found.rms_before_mm
    # with one circle alone
    alone = calibrate(scene, sets[:1], Calibrate(fit=("EC0Y", "EXY:ramp")))
    assert ("EXY", "EC0Y") in alone.rank.confounded
    words = "the slope of EXY and EC0Y are confounded in these readings"
    assert words in describe_rank(alone.rank, alone.slopes)


def test_vectors_in_the_wrong_frame_are_recognised_without_a_second_fit(monkeypatch):
    """Trunnion A-C: the residuals in the right frame are those of a fit there, 6.8 µm."""
    nominal, count = load_scene("machine_trunnion_ac"), 18
    rng = np.random.default_rng(3)
    poses = {name: rng.uniform(*axis.travel, count) for name, axis in nominal.machine.axes.items()}
    errors = {"EC0Y": 250.0, "EB0A": -300.0, "EX0C": 120.0}
    curves = {key: Constant((0.0, 1.0), value) for key, value in errors.items()}
    field = evaluate_exact(nominal.model, ErrorSet(curves), poses, replace(VIEW, frame="machine"))
    read = field.error_um + rng.normal(0.0, 5.0, (count, 3))
    readings = vectors(nominal, poses, read, frame="workpiece")
    right = in_other_frame(nominal, readings)
    assert right is not None
    request = Calibrate(fit=tuple(errors))
    expected = calibrate(nominal, [right], request)
    fits = []
    fit = solve.solve
    monkeypatch.setattr(solve, "solve", lambda *a, **k: fits.append(1) or fit(*a, **k))
    wrong = calibrate(nominal, [readings], request)
    (note,) = (note for note in wrong.notes if "likely wrong" in note)
    assert f"in the machine frame {1e3 * expected.rms_after_mm:.3g} µm" in note
    assert len(fits) == 2  # set-ups alone, and the fit
