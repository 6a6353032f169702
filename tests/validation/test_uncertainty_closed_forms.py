"""Uncertainty of points, means and the worst, and probabilities: known in closed form."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, ncx2, norm, t

from warpspace.analysis.commands.adjust import Adjust
from warpspace.analysis.commands.uncertainty import Uncertainty, selected_nodes
from warpspace.analysis.uncertainty.propagation import (
    coverage_factor,
    field_uncertainty,
    scene_uncertainty,
    volume_uncertainty,
)
from warpspace.bench.base import run_test
from warpspace.bench.kinds.circular import Circular
from warpspace.bench.kinds.straightness import Squareness
from warpspace.kinematics.model import complete_coordinates
from warpspace.machine.errors import ErrorSet
from warpspace.scene.library import parse_scene

HEAD = """[machine]
chain = "wFXYZt"
[workspace]
X = [-100, 100]
Y = [-100, 100]
Z = 0
[errors]
"""
ONE = HEAD + "EC0Y = 20\n[uncertainty]\nEC0Y = 1.5\n"
PAIR = "[uncertainty.covariance]\nkeys = ['EXX', 'EYX']\nmatrix = [[4.0], [{between}, {second}]]\n"
TWO = HEAD + "EXX = 3\nEYX = 4\n" + PAIR


def trust(text, **options):
    scene = parse_scene(text, "s")
    options = {"nodes": 5, "samples": 100_000, **options}
    return Uncertainty(**options).run(scene, lambda _: None)


def sure(text, error, **at):
    """Uncertainty of a point with some error, at positions of axes."""
    scene = parse_scene(text, "s")
    axes = complete_coordinates(scene.machine, at, scene.workspace.positions)
    return field_uncertainty(scene, np.array(error), axes, scene.view())


@pytest.mark.parametrize("limit", [1.8, 2.0, 2.25])
def test_one_squareness(limit):
    # |E| = γ·|y|: 2 µm at the ends of Y and half of it in the mean; γ = 20 ± 1.5 µrad
    found = trust(ONE, limit_um=limit)
    said = found.as_json()["statistics"]
    assert said["mean_um"] == pytest.approx(1.0)
    assert said["u95_mean_um"] == pytest.approx(2 * 1.5e-3 * 50.0)
    assert said["u95_max_um"] == pytest.approx(2 * 1.5e-3 * 100.0)
    assert said["u95_rms_um"] / said["rms_um"] == pytest.approx(2 * 1.5 / 20.0)
    expected = norm.cdf((10 * limit - 20) / 1.5) - norm.cdf((-10 * limit - 20) / 1.5)
    assert found.probability_worst == pytest.approx(expected, abs=0.005)
    assert found.probability_everywhere == found.probability_worst
    assert [one["percent_of_max"] for one in found.shares] == pytest.approx([100.0])


def test_one_squareness_of_few_degrees_of_freedom():
    covariance = "[uncertainty.covariance]\nkeys = ['EC0Y']\nmatrix = [[2.25]]\ndof = 4\n"
    text = ONE.partition("[uncertainty]")[0] + covariance
    found = trust(text, limit_um=2.25, verify=True)
    assert found.as_json()["statistics"]["u95_max_um"] == pytest.approx(coverage_factor(4) * 0.15)
    assert found.probability_worst == pytest.approx(t.cdf(2.5 / 1.5, 4), abs=0.005)
    # the spread of machines drawn is that of the interval which is stated
    drawn = found.montecarlo["max_um"]["u95_um"]
    assert drawn == pytest.approx(coverage_factor(4) * 0.15, rel=0.02)


@pytest.mark.parametrize(("between", "second"), [(0.0, 4.0), (3.0, 9.0), (-6.0, 9.0)])
def test_two_translations(between, second):
    # E = (3, 4, 0) µm everywhere, so that |E| grows by 0.6 of the one and 0.8 of the other
    found = trust(TWO.format(between=between, second=second), limit_um=7.0)
    u = math.sqrt(0.36 * 4.0 + 2 * 0.48 * between + 0.64 * second)
    for name in ("mean", "rms", "p95", "max"):
        assert found.as_json()["statistics"][f"{name}_um"] == pytest.approx(5.0)
        assert found.as_json()["statistics"][f"u95_{name}_um"] == pytest.approx(2 * u)
    share = {one["key"]: one["percent_of_max"] for one in found.shares}
    assert share["EXX"] == pytest.approx(100 * (0.36 * 4.0 + 0.48 * between) / u**2)
    assert sum(share.values()) == pytest.approx(100.0)
    assert found.significant_percent == (100.0 if 2 * u < 5.0 else 0.0)
    if not between:  # |E|² over the common variance is noncentral χ² of two degrees of freedom
        expected = ncx2.cdf(49.0 / 4.0, 2, 25.0 / 4.0)
        assert found.probability_everywhere == pytest.approx(expected, abs=0.005)


def test_beyond_the_data_nothing_was_measured():
    measured = "measured_range = { X = [-100, 0], Y = [-50, 100] }\n"
    found = trust(TWO.format(between=0.0, second=4.0) + measured)
    # of five nodes an axis with weights 1 2 2 2 1: X 50 and 100 are beyond, and Y -100
    assert found.never_measured_percent == pytest.approx(100 * (1 - 5 / 8 * 7 / 8))
    assert found.probability_worst is None


def test_numbers_move_by_one_standard_uncertainty_up_and_down():
    doubt = scene_uncertainty(parse_scene(TWO.format(between=3.0, second=9.0), "s"))
    gain = np.array([[1.0, 2.0], [0.5, -1.0]])
    matrix = np.array([[4.0, 3.0], [3.0, 9.0]])
    expected = 2.0 * np.sqrt(np.diagonal(gain @ matrix @ gain.T))
    assert doubt.propagate(lambda way: 7.0 + gain @ way) == pytest.approx(expected)
    # a width at its least goes up on both sides: no gradient tells its uncertainty
    assert doubt.propagate(lambda way: np.abs(way[:1])) == pytest.approx([4.0])


def test_what_is_not_stated_leaves_all_of_it_unknown():
    found = trust(ONE.replace("EC0Y = 20", "EC0Y = 20\nEXX = 1"), limit_um=2.0, verify=True)
    assert found.unknown == ("EXX",)
    assert {*found.statistics.expanded_uncertainty.values()} == {None}
    assert (found.probability_everywhere, found.montecarlo, found.shares) == (None, {}, ())
    assert "± ?" in str([*found.blocks()])


@pytest.mark.parametrize("objective", ["rms", "max"])
def test_an_adjustment_helps_where_the_error_is_beyond_half_of_it(objective):
    # by −20 from γ = 20 ± 15 µrad: |γ − 20| < |γ| wherever γ > 10, which is 10 / 15 of u away
    scene = parse_scene(ONE.replace("1.5", "15"), "s")
    found = Adjust(grid=5, count=1, adjustable=("EC0Y",), objective=objective).run(scene)
    expected = norm.cdf(10.0 / 15.0)
    said = found.as_json()
    assert said["errors"][0]["u95_present"] == pytest.approx(30.0)
    assert said["errors"][0]["best"]["probability"] == pytest.approx(expected, abs=1e-4)
    assert said["adjustments"][0]["probability"] == pytest.approx(expected, abs=1e-4)
    assert said["before"]["u95_max_um"] == pytest.approx(2 * 15e-3 * 100.0)
    unsure = found.scene.errors.with_amplitude("EXX", 1.0, (0.0, 1.0))
    found = Adjust(grid=5, count=1).run(replace(scene, errors=unsure))
    assert found.adjustments[0].expanded_uncertainty["probability"] is None
    assert "± ?" in str([*found.blocks()])


def test_a_test_is_as_sure_as_the_squareness_it_shows():
    found = run_test(parse_scene(ONE, "s"), Squareness(plane="XY"))
    assert found.as_json()["u95_end_points_urad"] == pytest.approx(2 * 1.5, rel=1e-3)
    assert "± 3.000" in str([*found.blocks()])
    found = run_test(parse_scene(ONE, "s"), Circular(plane="XY", radius_mm=50.0))
    assert found.u95["circular_deviation_um"] == pytest.approx(2 * 1.5e-3 * 50.0, rel=1e-3)


def test_machines_drawn_move_together():
    # all of it is one number t: E = (3 + 2·t, 4 − 1.5·t) µm, so that |E|² = 25 + 6.25·t²
    scene = parse_scene(TWO.format(between=-2.999999, second=2.25), "s")
    norm_um = np.concatenate([*volume_uncertainty(scene, scene.view(), 2).machines(20_000, 0)])
    assert np.quantile(norm_um.max(axis=1), 0.95) == pytest.approx(
        math.sqrt(25 + 6.25 * norm.ppf(0.975) ** 2), rel=0.01
    )


def test_fewer_nodes_give_the_probabilities_of_all():
    # errors that are linear in the position are largest in a corner, which is among both
    text = f"{HEAD}EXX = 5\nEC0Y = 40\n[uncertainty]\nEXX = 2\nEC0Y = 20\n"
    few, every = (
        trust(text, limit_um=9.0, nodes=21, samples=2_000, verify=verify)
        for verify in (False, True)
    )
    assert 0.1 < few.probability_everywhere < few.probability_worst < 0.9
    assert few.probability_everywhere == every.probability_everywhere
    assert few.probability_worst == every.probability_worst
    assert few.statistics == every.statistics
    chosen = selected_nodes((21, 8, 1), 11)
    assert len(chosen) == 11 * 8
    assert {0, 21 * 8 - 1} < {*chosen.tolist()}


def test_each_error_counts_by_its_own_degrees_of_freedom():
    # u 4 of infinite, 0.01 of three degrees of freedom; |E| is along x
    stated = "[uncertainty]\nEXX = 4\n[uncertainty.covariance]\nkeys = ['EYY']\n"
    text = f"{HEAD}EXX = 10\n{stated}matrix = [[0.0001]]\ndof = 3\n"
    found = sure(text, [10.0, 0.0, 0.0], X=100.0, Y=0.0)
    doubt = found.errors
    assert found.u95_norm_um == pytest.approx(8.0)
    assert found.u95_um == pytest.approx([8.0, coverage_factor(3) * 0.01, 0.0])
    assert doubt.factor == 2.0
    drawn = doubt.draw(np.random.default_rng(1), 200_000)
    inside = [np.mean(np.abs(drawn[:, k]) <= doubt.u95_of(key)) for k, key in enumerate(doubt.keys)]
    assert inside == pytest.approx([0.9545] * 3, abs=2e-3)


@pytest.mark.parametrize("errors", ["", "EXX = 3\n"])
def test_where_there_is_no_error_its_uncertainty_is_all_there_is(errors):
    stated = "[uncertainty.covariance]\nkeys = ['EXX', 'EYX']\nmatrix = [[4.0], [0.0, 4.0]]\n"
    found = trust(HEAD + errors + stated, verify=True)
    said = found.as_json()["statistics"]
    expected = 2 * 2.0 if errors else 2 * math.sqrt(8.0)
    for name in ("mean", "rms", "p95", "max"):
        assert said[f"u95_{name}_um"] == pytest.approx(expected)
    assert ("first order" in " ".join(map(str, found.blocks()))) == (not errors or expected > 3.0)


@pytest.mark.parametrize("limit", [1.0, 4.0, 7.0])
@pytest.mark.parametrize("error", [[0.0, 0.0, 0.0], [1.0, 2.0, 0.0], [6.0, 8.0, 0.0]])
def test_the_probability_that_a_point_keeps_a_limit(limit, error):
    # u = 2 µm along x, y and z: |E|² / 4 is noncentral χ² of three degrees of freedom
    keys = "[uncertainty.covariance]\nkeys = ['EXX', 'EYX', 'EZX']\n"
    found = sure(HEAD + "EXX = 3\n" + keys + "matrix = [[4], [0, 4], [0, 0, 4]]\n", error)
    square = float(np.sum(np.square(error)))
    expected = ncx2.cdf(limit**2 / 4.0, 3, square / 4.0) if square else chi2.cdf(limit**2 / 4.0, 3)
    probability = float(found.conformance_probability(limit))
    assert probability == pytest.approx(expected, abs=0.02 if square else 1e-9)


def test_a_sure_point_keeps_its_limit_or_not():
    found = sure(HEAD + "EXX = 3\n[uncertainty]\nEC0Y = 1\n", [3.0, 0.0, 0.0], Y=0.0)
    assert [float(found.conformance_probability(limit)) for limit in (2.9, 3.1)] == [0.0, 1.0]


def test_where_nothing_that_is_stated_acts_all_is_unknown():
    text = HEAD.replace("wFXYZt", "wCFXYZt") + "EXX = 3\n[uncertainty]\nEXC = 1\n"
    scene = parse_scene(text, "s")
    found = Uncertainty(nodes=3, loop="tool").run(scene, lambda _: None)
    assert found.as_json()["statistics"]["u95_mean_um"] is None
    assert scene_uncertainty(scene).draw(np.random.default_rng(0), 3).shape == (3, 0)
    bare = replace(scene, errors=ErrorSet())  # what is stated moves the table only
    found = Uncertainty(nodes=3, limit_um=1.0, verify=True, loop="tool").run(bare, lambda _: None)
    assert found.as_json()["statistics"]["u95_max_um"] == 0.0
    assert (found.probability_everywhere, found.shares) == (1.0, [])
