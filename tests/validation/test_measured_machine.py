"""Measured machines: closed forms, planted machines, sampled machines; sets of further tests."""

import re
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.stats import norm, t

import warpspace
from validation.test_acceptance import (
    CIRCLES,
    DIAGONALS,
    LINES,
    ONLY,
    PAGE,
    TOLERANCES,
    plan_of,
    scene_of,
)
from warpspace.acceptance_tests.acceptance import Acceptance, find_worst_machine
from warpspace.acceptance_tests.error_curves import ErrorCurves
from warpspace.acceptance_tests.measurements import estimate_from_readings, limit_estimates
from warpspace.acceptance_tests.next_tests import FurtherTests, build_constraint, passes
from warpspace.acceptance_tests.plans import load_plan
from warpspace.analysis.description import ignore_progress
from warpspace.bench.plan import simulate
from warpspace.calibration.instruments import NO_INSTRUMENT, load_instrument
from warpspace.calibration.registry import find_kind, parse_readings
from warpspace.exceptions import OptionError
from warpspace.machine.errors import Constant, Covariance, ErrorSet, Ramp, TableCurve, Tolerance
from warpspace.scene.library import load_scene

HEADER = "x_mm,y_mm,z_mm,ex_um,ey_um,ez_um,u_um\n"
FEW = (
    "default = { translation = 0, rotation = 0, squareness = 0 }\n"
    "EXX = 10\nEYX = 10\nECX = 30\nEYY = 10\nEC0Y = 30\n"
)
ROUGH = Acceptance(knots=3)


def factor(count, dof=np.inf):
    """Šidák: all of a number of intervals together with 95 %."""
    quantile = (1.0 + 0.95 ** (1.0 / count)) / 2.0
    return norm.ppf(quantile) if np.isinf(dof) else t.ppf(quantile, dof)


def write(tmp_path, rows, name="readings.csv", header=HEADER):
    path = tmp_path / name
    path.write_text(header + "".join(",".join(map(repr, row)) + "\n" for row in rows), "utf-8")
    return str(path)


def test_one_squareness_and_one_reading(tmp_path):
    """EC0Y of γ shifts X by −γ·y: a reading at y = 200 mm within ± k·u gives γ within ± k·u/0.2."""
    scene = scene_of(tmp_path, ONLY.format(key="EC0Y", half=200))
    rows = [(0.0, 0.0, -280.0, 0.0, 0.0, 0.0, 0.5), (0.0, 200.0, -280.0, -8.0, 0.0, 0.0, 0.5)]
    request = replace(ROUGH, data=(write(tmp_path, rows),))
    result = find_worst_machine(scene, (), request)
    half = factor(6) * 0.5 / 0.2
    assert result.ranges["EC0Y"] == pytest.approx((40.0 - half, 40.0 + half), rel=1e-6)
    assert result.ranges["EXX"] == (0.0, 0.0)
    assert result.bound_um[0] == pytest.approx((40.0 + half) * 0.225, rel=1e-6)
    assert result.errors["EC0Y"] == pytest.approx(40.0 + half, rel=1e-6)
    assert result.as_json()["ranges"]["EC0Y"] == [*result.ranges["EC0Y"]]
    assert "ranges" not in find_worst_machine(scene, (), ROUGH).as_json()


def test_an_unknown_of_the_set_up_leaves_the_difference_of_two_readings(tmp_path):
    """Two readings of one session: their difference is within ± 2·k·u, the shift is free."""
    scene = scene_of(tmp_path, ONLY.format(key="EC0Y", half=200))
    rows = [
        (0.0, -200.0, -280.0, 100.0 + 8.0, 50.0, 7.0, 0.5, 1),
        (0.0, 200.0, -280.0, 100.0 - 8.0, 50.0, 7.0, 0.5, 1),
    ]
    header = HEADER.replace("\n", ",session\n")
    request = replace(ROUGH, data=(write(tmp_path, rows, header=header),))
    half = 2.0 * factor(6) * 0.5 / 0.4
    ranges = find_worst_machine(scene, (), request).ranges
    assert ranges["EC0Y"] == pytest.approx((40.0 - half, 40.0 + half), rel=1e-6)
    # two files of one session share the shift: together they give the same
    files = [write(tmp_path, rows[k : k + 1] * 2, f"{k}.csv", header) for k in (0, 1)]
    moved = [(10.0, *row[1:]) for row in rows]
    files = [write(tmp_path, [rows[k], moved[k]], f"{k}.csv", header) for k in (0, 1)]
    half = 2.0 * factor(12) * 0.5 / 0.4
    ranges = find_worst_machine(scene, (), replace(ROUGH, data=tuple(files))).ranges
    assert ranges["EC0Y"] == pytest.approx((40.0 - half, 40.0 + half), rel=1e-6)


@pytest.mark.parametrize("dof", [np.inf, 6.0])
def test_covariance_of_two_errors(tmp_path, dof):
    """A box along the principal axes: a ± k·Σ|Q|·√λ."""
    matrix = np.array([[4.0, 3.0], [3.0, 9.0]])
    scene = replace(
        scene_of(tmp_path, FEW.replace("EYY = 10", "EA0Z = 30")),
        errors=ErrorSet({"EC0Y": Constant((0.0, 1.0), 5.0), "EA0Z": Constant((0.0, 1.0), -4.0)}),
        covariance=Covariance(("EC0Y", "EA0Z"), tuple(map(tuple, matrix.tolist())), dof),
    )
    ranges = find_worst_machine(scene, (), replace(ROUGH, measured=True)).ranges
    variances, axes = np.linalg.eigh(matrix)
    half = factor(2, dof) * np.abs(axes) @ np.sqrt(variances)
    assert ranges["EC0Y"] == pytest.approx((5.0 - half[0], 5.0 + half[0]), rel=1e-6)
    assert ranges["EA0Z"] == pytest.approx((-4.0 - half[1], -4.0 + half[1]), rel=1e-6)
    assert ranges["EXX"] == pytest.approx((-10.0, 10.0))  # limited by its tolerance alone


def test_covariance_limits_the_amplitude_of_the_curve_and_not_its_shape(tmp_path):
    """A ramp −1, 0, 1 at three knots: (v₃ − v₁)/2 is limited, the value in the middle is not."""
    curve = TableCurve((-275.0, 275.0), ((-275.0, -4.0), (275.0, 4.0)))
    scene = replace(
        scene_of(tmp_path, ONLY.format(key="EXX", half=10)),
        errors=ErrorSet({"EXX": curve}),
        covariance=Covariance(("EXX",), ((0.25,),)),
    )
    worst = find_worst_machine(scene, (), replace(ROUGH, measured=True))
    assert worst.ranges["EXX"] == pytest.approx((-10.0, 10.0))
    ends = worst.machine.errors.evaluate("EXX", np.array([-275.0, 275.0]))
    half = factor(1) * 0.5
    assert 4.0 - half - 1e-6 <= np.diff(ends)[0] / 2.0 <= 4.0 + half + 1e-6


def test_uncertainty_along_an_axis(tmp_path):
    curve = TableCurve((-275.0, 275.0), ((-275.0, 1.0), (0.0, 3.0), (275.0, 2.0)))
    uncertainty = {"EXX": Constant((-275.0, 275.0), 0.5)}
    scene = scene_of(tmp_path, ONLY.format(key="EXX", half=10))
    scene = replace(scene, errors=ErrorSet({"EXX": curve}), uncertainty=uncertainty)
    result = find_worst_machine(scene, (), replace(ROUGH, measured=True))
    half = factor(3) * 0.5
    assert result.ranges["EXX"] == pytest.approx((1.0 - half, 3.0 + half), rel=1e-6)
    assert result.bound_um[0] == pytest.approx(2.0 + 2.0 * half, rel=1e-6)  # relative to X 0


def planted(scene, rng, count, u_um=1.0):
    """Errors of a machine within tolerance, and noisy readings with the exact chain."""
    curves = ErrorCurves(scene, ROUGH.knots)
    values = rng.uniform(curves.lower, curves.upper)
    machine = replace(curves.build_scene(values), reference=None)
    at = {axis: rng.uniform(*scene.workspace.ranges[axis], count) for axis in "XYZ"}
    error_um = warpspace.evaluate(machine, at=at, exact=True, loop="relative").error_um
    noisy = error_um + rng.normal(scale=u_um, size=error_um.shape)
    rows = np.column_stack([at["X"], at["Y"], at["Z"], noisy, np.full(count, u_um)])
    text = HEADER + "".join(",".join(map(repr, row)) + "\n" for row in rows.tolist())
    return curves, values, text


def constrain(curves, text):
    sets = [parse_readings(text, "readings.csv", curves.scene)]
    estimates = estimate_from_readings(curves, sets, NO_INSTRUMENT, ignore_progress)
    return replace(curves, measured=limit_estimates([*estimates]))


def test_planted_machines_lie_within_the_ranges(tmp_path):
    scene, rng, within, widths = scene_of(tmp_path, FEW), np.random.default_rng(1), 0, []
    for _ in range(50):
        curves, values, text = planted(scene, rng, 30, 0.5)
        try:
            ranges = constrain(curves, text).find_ranges((), ignore_progress)
        except OptionError:  # no machine agrees with the readings: not within
            continue
        low, high = (np.array([ranges[key][end] for key, _ in curves.variables]) for end in (0, 1))
        within += bool(np.all((low - 1e-6 <= values) & (values <= high + 1e-6)))
        widths.append(ranges["EC0Y"][1] - ranges["EC0Y"][0])
    assert within >= 0.95 * 50
    assert np.mean(widths) < 0.75 * 60.0  # the readings say something


def test_more_readings_shrink_the_ranges(tmp_path):
    curves, _, text = planted(scene_of(tmp_path, FEW), np.random.default_rng(2), 80)
    lines, widths = text.splitlines(keepends=True), []
    for count in (5, 20, 80):
        constrained = constrain(curves, "".join(lines[: count + 1]))
        ranges = constrained.find_ranges((), ignore_progress)
        widths.append(sum(high - low for low, high in ranges.values()))
    assert widths[0] > widths[1] > widths[2]


def test_sampled_machines_stay_within_ranges_and_bound(tmp_path):
    scene = scene_of(tmp_path, FEW)
    curves, values, text = planted(scene, np.random.default_rng(3), 15)
    constrained, rng = constrain(curves, text), np.random.default_rng(4)
    tests = plan_of(scene, [CIRCLES[0].replace("limit_um = 8", "limit_um = 20")])
    path = tmp_path / "readings.csv"
    path.write_text(text, "utf-8")
    result = find_worst_machine(scene, tests, replace(ROUGH, data=(str(path),)))
    (measured,) = constrained.measured
    circle = build_constraint(curves, tests[0], ignore_progress)
    count, free = len(values), circle.form.free.shape[1]
    rows = np.vstack([
        np.eye(count, count + free),
        np.hstack([measured.form.rows, np.zeros((len(measured.form.rows), free))]),
        np.hstack([circle.form.rows, -circle.form.free]) * circle.form.factor / circle.limit,
    ])  # fmt: skip
    middle = np.concatenate([np.zeros(count), measured.target, np.zeros(len(circle.form.rows))])
    half = np.concatenate([curves.upper, np.ones(len(rows) - count)])
    both, ends = np.vstack([rows, -rows]), np.concatenate([middle + half, half - middle])
    vertices = np.array([
        linprog(cost, both, ends, bounds=(None, None)).x
        for cost in rng.normal(size=(30, count + free)) * (np.arange(count + free) < count)
    ])  # fmt: skip
    point, machines = vertices.mean(axis=0), []
    for _ in range(200):
        direction = np.diff(vertices[rng.choice(len(vertices), 2, replace=False)], axis=0)[0]
        change, room = both @ direction, ends - both @ point
        moves = np.abs(change) > 1e-9
        steps = room[moves] / change[moves]
        step = rng.uniform(steps[steps < 0.0].max(initial=-1.0), steps[steps > 0.0].min())
        point = point + step * direction
        machines.append(point[:count])
    low, high = (
        np.array([result.ranges[key][end] for key, _ in curves.variables]) for end in (0, 1)
    )
    assert np.all((low - 1e-6 <= machines) & (machines <= high + 1e-6))
    norms = np.linalg.norm(np.einsum("nxv,mv->mnx", curves.gains, machines), axis=-1)
    assert 0.3 * result.bound_um[1] < norms.max() <= result.bound_um[1]
    without = find_worst_machine(scene, tests, ROUGH)
    assert result.bound_um[0] <= without.bound_um[1]
    assert result.bound_um[1] < 0.9 * without.bound_um[0]


def test_readings_of_a_test(tmp_path):
    """A circle that was measured: the true squareness is within its range, and that is small."""
    scene = replace(scene_of(tmp_path, ONLY.format(key="EC0Y", half=200)), reference=None)
    kind = find_kind("circular:plane=XY:radius=100:points=36")
    errors = ErrorSet({"EC0Y": Constant((0.0, 1.0), 70.0)})
    plan = kind.test.plan(scene)
    readings = replace(
        kind.plan_readings(scene),
        observed_mm=simulate(replace(scene, errors=errors), plan)[:, None] * 1e-3,
        sigma_mm=np.full(plan.readings, 0.5e-3),
    )
    curves = ErrorCurves(scene, ROUGH.knots)
    estimates = estimate_from_readings(curves, [readings], NO_INSTRUMENT, ignore_progress)
    known = replace(curves, measured=limit_estimates([*estimates]))
    low, high = known.find_ranges((), ignore_progress)["EC0Y"]
    # γ·R·sin 2φ/2 within ± k·u of the readings where it is largest
    half = factor(plan.readings) * 0.5 / 0.05
    assert (low, high) == pytest.approx((70.0 - half, 70.0 + half), abs=0.6)


def test_an_instrument_states_the_uncertainty_of_readings_without_one(tmp_path):
    """Scatter 0.5 µm of each reading, and a zero with u = 1.2 µm common to all: u = 1.3 µm."""
    scene = scene_of(tmp_path, ONLY.format(key="EC0Y", half=200))
    rows = [(0.0, 0.0, -280.0, 0.0, 0.0, 0.0), (0.0, 200.0, -280.0, -8.0, 0.0, 0.0)]
    data = (write(tmp_path, rows, header=HEADER.replace(",u_um", "")),)
    with pytest.raises(OptionError, match=r"readings\.csv: the uncertainty of its .* u_um"):
        find_worst_machine(scene, (), replace(ROUGH, data=data))
    lines = [
        f'[[contributions]]\nname = "{acts}"\ntype = "B"\ndistribution = "normal"\n'
        f'value = {um}\nunit = "µm"\nsensitivity = 1\nacts = "{acts}"\nsource = "test"\n'
        for acts, um in (("each", 0.5), ("all", 1.2))
    ]
    file = tmp_path / "probe.toml"
    file.write_text("".join(lines), "utf-8")
    request = replace(ROUGH, data=data, instrument=load_instrument(str(file)))
    half = factor(6) * 1.3 / 0.2
    ranges = find_worst_machine(scene, (), request).ranges
    assert ranges["EC0Y"] == pytest.approx((40.0 - half, 40.0 + half), rel=1e-6)


def test_refusals(tmp_path):
    scene = scene_of(tmp_path, ONLY.format(key="EC0Y", half=200))
    with pytest.raises(OptionError, match=r"measured: the scene states no uncertainty"):
        find_worst_machine(scene, (), replace(ROUGH, measured=True))
    with pytest.raises(OptionError, match=r"2 values of kinds for 1 files"):
        find_worst_machine(scene, (), replace(ROUGH, data=("a.csv",), kinds=("points", "points")))
    with pytest.raises(OptionError, match="no readings; expected data FILE"):
        find_worst_machine(scene, (), replace(ROUGH, kinds=("points",)))
    rows = [(0.0, 0.0, -280.0, 0.0, 0.0, 0.0, 0.5), (0.0, 200.0, -280.0, -80.0, 0.0, 0.0, 0.5)]
    far = write(tmp_path, rows, "far.csv")
    with pytest.raises(OptionError, match=r"the readings of far\.csv exclude all"):
        find_worst_machine(scene, (), replace(ROUGH, data=(far,)))
    rows[1] = (0.0, 200.0, -280.0, -20.0, 0.0, 0.0, 0.5)
    near, tests = write(tmp_path, rows, "near.csv"), plan_of(scene, CIRCLES[:1] + LINES[:1])
    with pytest.raises(
        OptionError, match=r": the readings of near\.csv and circular XY .*each oth"
    ):
        find_worst_machine(scene, tests, replace(ROUGH, data=(near,)))


def test_second_difference(tmp_path):
    """Three knots, EXX relative to the middle: |e₁ − e₂| ≤ 10 + d/2, d the second difference."""
    scene = scene_of(tmp_path, ONLY.format(key="EXX", half=10))
    limit = 10.0 / 0.275**2  # µm/m², 10 µm between knots 0.275 m apart
    result = find_worst_machine(scene, (), replace(ROUGH, second_difference=limit))
    assert result.bound_um[0] == pytest.approx(15.0, rel=1e-6)
    assert find_worst_machine(scene, (), ROUGH).bound_um[0] == pytest.approx(20.0, rel=1e-6)


# --- Further tests --------------------------------------------------------------------------------

MINUTES = "\nminutes = 15"


def further_tests(tmp_path, entries, tolerances=FEW):
    scene = scene_of(tmp_path, tolerances)
    tests = plan_of(scene, [entry + MINUTES for entry in entries])
    curves = ErrorCurves(scene, 2)
    constraints = [build_constraint(curves, test, ignore_progress) for test in tests]
    return curves, constraints, FurtherTests(curves, tests, constraints, ignore_progress)


def keep(further, numbers):
    """Restrict the further tests to a few."""
    further.tests = [further.tests[number] for number in numbers]
    further.constraints = [further.constraints[number] for number in numbers]
    further.passing, further.minutes = further.passing[numbers], further.minutes[numbers]


@pytest.mark.parametrize("share", [0.9, 0.75, 0.6])
def test_smallest_set_is_that_of_an_exhaustive_search(tmp_path, share):
    curves, constraints, further = further_tests(tmp_path, [LINES[0], LINES[3]])
    worst = curves.find_largest(constraints, ignore_progress)
    fails = [n for n, each in enumerate(further.constraints) if not passes(worst.machine, each)]
    few = [*fails[:8], 0]
    keep(further, few)
    further.minutes = np.linspace(30.0, 10.0, len(few))
    limit_um = share * worst.low_um
    chosen = further.find_smallest_set(limit_um)

    def keeps(numbers):
        extended = [*constraints, *(further.constraints[number] for number in numbers)]
        return curves.find_largest(extended, ignore_progress, limit_um).high_um <= limit_um

    everything = range(len(further.tests))
    for size in range(len(everything) + 1):
        sets = [numbers for numbers in combinations(everything, size) if keeps(numbers)]
        if sets:
            minutes = min(sum(further.minutes[[*numbers]]) for numbers in sets)
            assert len(chosen) == size
            names = [test.name for test in chosen]
            picked = [number for number in everything if further.tests[number].name in names]
            assert sum(further.minutes[picked]) == pytest.approx(minutes)
            return
    assert chosen is None


def test_the_first_further_test_is_that_of_a_search_through_all(tmp_path):
    curves, constraints, further = further_tests(tmp_path, [*CIRCLES[:1], LINES[0], LINES[3]])
    worst = curves.find_largest(constraints, ignore_progress)
    keep(further, [*range(0, len(further.tests), 3)])
    (step,) = further.find_next(worst, 1)
    left_um = [
        curves.find_largest([*constraints, each], ignore_progress).low_um
        for each in further.constraints
    ]
    rates = (worst.low_um - np.array(left_um)) / further.minutes
    names = [test.name for test in further.tests]
    number = names.index(step.name)
    assert rates[number] == pytest.approx(rates.max(), rel=1e-6)  # several may be equal
    assert step.bound_um == pytest.approx(left_um[number], rel=0.02)
    assert (rates < 0.9 * rates.max()).any()


@pytest.mark.parametrize("knots", [3, pytest.param(5, marks=pytest.mark.nightly)])
def test_factor_of_the_limits_is_the_largest(tmp_path, knots):
    """With 1.02 × the factor another solver finds a machine that exceeds the limit."""
    scene = scene_of(tmp_path, TOLERANCES)
    tests = plan_of(scene, CIRCLES + LINES + DIAGONALS)
    limit_um = 70.0
    result = find_worst_machine(scene, tests, Acceptance(keep_um=limit_um, knots=knots))
    check_factor(scene, tests, result.factor, limit_um, knots)


def check_factor(scene, tests, found, limit_um, knots=5):
    curves = ErrorCurves(scene, knots)
    constraints = [build_constraint(curves, test, ignore_progress) for test in tests]
    assert 0.0 < found < 1.0

    def scaled(factor):
        return [replace(each, limit=factor * each.limit) for each in constraints]

    kept = curves.find_largest(scaled(found), ignore_progress, limit_um)
    assert kept.high_um <= limit_um
    worst = curves.find_largest(scaled(1.02 * found), ignore_progress, limit_um)
    assert np.isinf(worst.high_um)
    count = len(curves.upper)
    width = count + sum(each.form.free.shape[1] for each in constraints)
    blocks, ends, column = [], [], count
    for each in scaled(1.02 * found):
        block = np.zeros((len(each.form.rows), width))
        free = each.form.free.shape[1]
        block[:, :count] = each.form.rows
        block[:, column : column + free] = -each.form.free
        column += free
        blocks += [block, -block]
        ends.append(np.full(2 * len(block), each.limit / each.form.factor))
    bounds = [*zip(curves.lower, curves.upper, strict=True), *[(None, None)] * (width - count)]
    cost = np.zeros(width)
    cost[:count] = -worst.error_um / worst.low_um @ curves.gains[worst.node]
    solution = linprog(cost, np.vstack(blocks), np.concatenate(ends), bounds=bounds)
    assert -solution.fun > 0.999 * limit_um


@pytest.mark.nightly
def test_factor_of_the_limits_of_a_real_machine():
    scene = replace(load_scene("dvf5000_first"), reference={"X": 0.0, "Y": 0.0, "Z": -280.0})
    tests = load_plan("iso_3_axes", scene)
    result = find_worst_machine(scene, tests, Acceptance(keep_um=150.0))
    check_factor(scene, tests, result.factor, 150.0)


def test_tolerances_about_a_centre_and_readings(tmp_path):
    """The box is not symmetric: the readings leave its far side only."""
    scene = scene_of(tmp_path, ONLY.format(key="EC0Y", half=0))
    tolerances = replace(scene.tolerances, individual={"EC0Y": Tolerance(40.0, 10.0)})
    scene = replace(scene, tolerances=tolerances)
    rows = [(0.0, 0.0, -280.0, 0.0, 0.0, 0.0, 0.5), (0.0, 200.0, -280.0, -10.0, 0.0, 0.0, 0.5)]
    result = find_worst_machine(scene, (), replace(ROUGH, data=(write(tmp_path, rows),)))
    low = 50.0 - factor(6) * 0.5 / 0.2
    assert result.ranges["EC0Y"] == pytest.approx((low, 50.0), rel=1e-6)


@pytest.mark.nightly
@pytest.mark.parametrize("nodes", [2, 3, 5])
def test_table_of_measured_points(tmp_path, nodes):
    """The table of docs/acceptance.md: simulated readings, u = 2 µm, on grids of the volume."""
    scene = scene_of(tmp_path, TOLERANCES)
    curves = {
        "EXX": Ramp(scene.axis_span("X"), 6.0),
        "ECX": Ramp(scene.axis_span("X"), -12.0),
        "EAY": Ramp(scene.axis_span("Y"), 15.0),
        "EC0Y": Constant((0.0, 1.0), 14.0),
        "EB0Z": Constant((0.0, 1.0), -9.0),
    }
    machine = replace(scene, errors=ErrorSet(curves), reference=None)
    error_um = warpspace.evaluate(machine, grid=nodes, exact=True).error_um.reshape(-1, 3)
    ends = [np.linspace(*scene.workspace.ranges[axis], nodes) for axis in "XYZ"]
    points = np.stack(np.meshgrid(*ends, indexing="ij"), axis=-1).reshape(-1, 3)
    rows = np.column_stack([points, error_um, np.full(nodes**3, 2.0)])
    request = Acceptance(data=(write(tmp_path, rows.tolist()),))
    tests = plan_of(scene, CIRCLES + LINES + DIAGONALS)
    result = find_worst_machine(scene, tests, request)
    printed = {row[0]: row[1:] for row in table_of("points measured")}
    assert printed[nodes**3] == [round(result.without_tests_um), round(result.bound_um[0])]
    assert result.ranges["EC0Y"] == pytest.approx((-25.0, 25.0))


def table_of(heading):
    rows = PAGE.split(f"| {heading} |", 1)[1].split("\n\n", 1)[0].splitlines()[3:]
    return [[int(number) for number in re.findall(r"\d+", row)] for row in rows]
