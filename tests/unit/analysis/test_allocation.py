"""Allocation of tolerances against closed forms, and against what no better choice may beat."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import special, stats

from warpspace.analysis.allocation import (
    Wish,
    allocate,
    build_ensemble,
    largest_scale,
    scales_within,
)
from warpspace.analysis.allocation.allocate import round_down
from warpspace.analysis.draws import Distribution, Draws, build_draws
from warpspace.analysis.montecarlo import Plan, montecarlo
from warpspace.analysis.nodes import Over
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.field.evaluate import View
from warpspace.field.grid import Workspace
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.description import build_machine
from warpspace.machine.tolerances import Tolerance, ToleranceSet
from warpspace.scene import verbs
from warpspace.scene.library import load_scene

MODEL = Model(build_machine("wFXYZt"), tool_point_mm=(0.0, 0.0, -200.0))
HERE = Workspace({"X": (0.0, 0.0), "Y": (0.0, 0.0), "Z": (0.0, 0.0)})
"""One point: the tool tip 200 mm below all axes, where every gain is known by hand."""
LEVER = 0.2
"""µm per µrad: 200 mm times a microradian."""
Z95 = float(special.ndtri(0.975))
"""Half of 95 % of a normal distribution lies within so many standard deviations of one side."""


def draws_of(distribution=Distribution.UNIFORM, centre=0.0, **half_widths) -> Draws:
    own = {key: Tolerance(centre, width) for key, width in half_widths.items()}
    return build_draws(ToleranceSet({}, own), tuple(half_widths), distribution)


def widths(draws, limit_um=40.0, plan=None, workspace=HERE, **wish):
    found = allocate(MODEL, draws, workspace, Wish(limit_um, **wish), plan=plan or Plan())
    return dict(zip(draws.keys, found.half_width, strict=True)), found


def test_one_uniform_error_alone_is_as_wide_as_its_quantile_allows():
    # |E| = w |u|, u uniform: P(|E| ≤ L) = L/w
    found, result = widths(draws_of(EXX=3.0), probability=0.9)
    assert found["EXX"] == pytest.approx(40.0 / 0.9, rel=0.006)
    assert result.after.low <= 0.9 + 0.004
    assert result.after.high >= 0.9
    assert result.before.probability == 1.0


def test_one_normal_angle_alone_is_as_wide_as_lever_and_quantile_allow():
    # |E| = 0.2 w |z| / 3
    found, _ = widths(draws_of(Distribution.NORMAL, EBX=50.0))
    assert found["EBX"] == pytest.approx(3.0 * 40.0 / (LEVER * Z95), rel=0.008)


def test_two_equal_errors_at_a_right_angle_get_equal_widths_from_the_area_of_a_disc():
    # uniform over a square of side 2w: the share of it in a disc of radius L, w < L < w√2
    found, _ = widths(draws_of(EXX=1.0, EYY=10.0), probability=0.9)

    def share(w):
        r = 40.0 / w
        corner = math.acos(1.0 / r)
        return (r * r * (math.pi / 2.0 - 2.0 * corner) + 2.0 * math.sqrt(r * r - 1.0)) / 2.0

    w = min(np.linspace(30.0, 39.9, 20_000), key=lambda w: abs(share(w) - 0.9))
    assert found["EXX"] == pytest.approx(w, rel=0.02)
    assert found["EYY"] == pytest.approx(w, rel=0.02)


COSTS = {"EXX": 1.0, "EXY": 8.0, "EXZ": 27.0, "EBX": 1.0, "EBY": 0.125}
GAINS = {"EXX": 1.0, "EXY": 1.0, "EXZ": 1.0, "EBX": LEVER, "EBY": LEVER}


def test_where_the_variance_decides_widths_go_with_the_cube_root_of_cost_by_squared_gain():
    # normal errors that all move the point along x: E is normal, P depends on Σ (gain·w)² alone
    draws = draws_of(Distribution.NORMAL, **dict.fromkeys(COSTS, 10.0))
    found, result = widths(draws, costs=COSTS)
    rule = {key: (COSTS[key] / GAINS[key] ** 2) ** (1.0 / 3.0) for key in COSTS}
    sigma = math.sqrt(sum((GAINS[key] * rule[key] / 3.0) ** 2 for key in rule))
    scale = 40.0 / (Z95 * sigma)
    for key, width in found.items():
        assert width == pytest.approx(scale * rule[key], rel=0.03), key
    best = sum(COSTS[key] / (scale * rule[key]) for key in rule)
    assert result.cost_after == pytest.approx(best, rel=0.01)


def test_isotropic_normal_errors_follow_maxwell():
    keys = ("EXX", "EYX", "EZX")
    found, _ = widths(draws_of(Distribution.NORMAL, **dict.fromkeys(keys, 1.0)), probability=0.99)
    sigma = 40.0 / stats.maxwell.ppf(0.99)
    np.testing.assert_allclose(list(found.values()), 3.0 * sigma, rtol=0.03)


def test_what_is_fixed_stays_and_takes_its_part_of_the_variance():
    draws = draws_of(Distribution.NORMAL, EXX=40.0, EXY=1.0)
    found, result = widths(draws, fixed=frozenset({"EXX"}))
    assert found["EXX"] == 40.0
    left = math.sqrt((3.0 * 40.0 / Z95) ** 2 - 40.0**2)
    assert found["EXY"] == pytest.approx(left, rel=0.012)
    assert result.tolerances == {"EXY": found["EXY"]}


def test_zero_holds_an_error_and_what_moves_nothing_keeps_its_tolerance():
    # a rotation about the line on which the tool point lies has no lever
    found, result = widths(draws_of(EXX=5.0, EYY=0.0, ECZ=7.0))
    assert found["EYY"] == 0.0
    assert found["ECZ"] == 7.0
    assert set(result.tolerances) == {"EXX"}


def test_a_centre_counts():
    # 10 + w u within ±40: only the upper end is met, by (1 + 30/w)/2 of the machines
    found, _ = widths(draws_of(centre=10.0, EXX=5.0), probability=0.9)
    assert found["EXX"] == pytest.approx(30.0 / 0.8, rel=0.008)


def test_the_widest_is_never_passed_and_the_others_use_what_is_left():
    draws = draws_of(Distribution.NORMAL, EXX=40.0, EBX=1.0)
    found, result = widths(draws, widest=70.0)
    assert found["EBX"] == 70.0
    assert result.at_widest == ("EBX",)
    left = math.sqrt((3.0 * 40.0 / Z95) ** 2 - (LEVER * 70.0) ** 2)
    assert found["EXX"] == pytest.approx(left, rel=0.01)


@pytest.mark.parametrize("over", [Over.SAMPLED, Over.MAX])
@pytest.mark.parametrize("loop", [Loop.TOOL, Loop.RELATIVE])
def test_the_measured_machine_keeps_the_limit_on_machines_of_its_own(loop, over):
    scene = load_scene("dvf5000_proposed")
    found = verbs.allocate(scene, Wish(60.0), loop=loop, over=over, samples=40_000, seed=4)
    own = {**scene.tolerances.own}
    own |= {k: Tolerance(scene.tolerances.get(k).centre, w) for k, w in found.tolerances.items()}
    allocated = replace(scene, tolerances=replace(scene.tolerances, own=own))
    run = verbs.montecarlo(allocated, loop=loop, over=over, samples=40_000, seed=99, spec_um=60.0)
    assert run.probability.probability == pytest.approx(0.95, abs=0.006)
    assert found.after.low - 0.003 < run.probability.probability < found.after.high + 0.003


def test_no_other_proportions_are_cheaper():
    scene = load_scene("dvf5000_first")
    found = verbs.allocate(scene, Wish(40.0), over="max", samples=50_000, seed=1)
    draws, view = found.draws, View()
    judge = build_ensemble(scene.model, draws.keys, scene.workspace, view, Over.MAX, seed=77)
    free, rng = found.free, np.random.default_rng(5)

    def cost(half):
        """Cost once scaled to 95 % on machines that neither has seen; all free, no centres."""
        norm = judge.norm_um(draws.centre, np.where(free, half, 0.0))
        scale = 40.0 / np.quantile(norm, 0.95)
        return float(np.sum(1.0 / (half[free] * scale)))

    best = cost(found.half_width)
    others = [cost(found.half_width * np.exp(rng.normal(0.0, 0.2, len(free)))) for _ in range(40)]
    assert min(others) > best
    assert cost(np.ones(len(free))) > 1.05 * best


def test_a_cost_widens_what_is_dear():
    scene = load_scene("dvf5000_first")
    plain = verbs.allocate(scene, Wish(40.0), samples=20_000).tolerances
    dear = verbs.allocate(scene, Wish(40.0, costs={"EA0Z": 20.0}), samples=20_000).tolerances
    assert dear["EA0Z"] > 1.8 * plain["EA0Z"]
    assert dear["EXX"] < plain["EXX"]


def test_the_same_seed_gives_the_same_tolerances_whatever_the_threads():
    scene = load_scene("dvf5000_first")
    one, two = (
        verbs.allocate(scene, Wish(40.0), samples=20_000, seed=3, workers=n) for n in (1, 2)
    )
    np.testing.assert_array_equal(one.half_width, two.half_width)
    assert one.after == two.after


def test_the_check_is_a_plain_monte_carlo_with_its_seed():
    draws = draws_of(EXX=3.0, EYX=3.0)
    _, found = widths(draws, plan=Plan(samples=20_000))
    plan = Plan(found.samples, found.seed, spec_um=40.0)
    run = montecarlo(MODEL, replace(draws, half_width=found.half_width), HERE, plan=plan)
    assert run.probability == found.after


def test_progress_adds_up_to_the_whole_and_may_end_the_work():
    done = []
    allocate(MODEL, draws_of(EXX=1.0, EYX=1.0), HERE, Wish(40.0), progress=done.append)
    assert sum(done) == pytest.approx(1.0)
    assert min(done) >= 0.0

    def stop(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        allocate(MODEL, draws_of(EXX=1.0, EYX=1.0), HERE, Wish(40.0), progress=stop)


REFUSED = {
    "limit": ({"limit_um": 0.0}, "limit: 0 µm; expected 0.001 to 1e\\+06"),
    "no limit": ({"limit_um": math.nan}, "limit: nan"),
    "certainty": ({"limit_um": 40.0, "probability": 1.0}, "probability: 1; expected 0.5 to 0.9999"),
    "cost": ({"limit_um": 40.0, "costs": {"EXX": 0.0}}, "cost of EXX: 0; expected"),
    "both": (
        {"limit_um": 40.0, "costs": {"EXX": 2.0}, "fixed": frozenset({"EXX"})},
        "EXX: has a cost and is fixed",
    ),
    "nothing free": ({"limit_um": 40.0, "fixed": frozenset({"EXX", "EYX"})}, "nothing to allocate"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_allocated_is_refused_by_name(case):
    wish, says = REFUSED[case]
    with pytest.raises(OptionError, match=says):
        allocate(MODEL, draws_of(EXX=1.0, EYX=1.0), HERE, Wish(**wish))


def test_an_unknown_parameter_is_named():
    with pytest.raises(UnknownNameError, match="EXQ"):
        allocate(MODEL, draws_of(EXX=1.0), HERE, Wish(40.0, fixed=frozenset({"EXQ"})))


def test_what_is_fixed_too_wide_is_said_with_its_share():
    draws = draws_of(EXX=80.0, EYX=1.0)
    with pytest.raises(OptionError, match=r"with all free ones at zero, (49|50)\.\d % keep it"):
        allocate(MODEL, draws, HERE, Wish(40.0, fixed=frozenset({"EXX"})))


def test_the_worst_point_of_the_workpiece_loop_is_refused():
    with pytest.raises(OptionError, match="one random point per machine"):
        verbs.allocate(load_scene("dvf5000_proposed"), Wish(40.0), loop="workpiece", over="max")


# --- the exact scale ------------------------------------------------------------------------------


def test_the_interval_of_a_machine_ends_where_its_error_meets_the_limit():
    rng = np.random.default_rng(8)
    base, move = rng.normal(0.0, 1.0, (3, 500)), rng.normal(0.0, 1.0, (3, 500))
    low, high = scales_within(base, move, 2.0).T
    there = low <= high
    assert 50 < there.sum() < 500
    for t in (low, high):
        error = np.linalg.norm(base + t * move, axis=0)[there & (t > 0.0)]
        np.testing.assert_allclose(error, 2.0)
    best = -np.einsum("cs,cs->s", base, move) / np.einsum("cs,cs->s", move, move)
    nearest = np.linalg.norm(base + np.maximum(best, 0.0) * move, axis=0)
    np.testing.assert_array_equal(there, nearest <= 2.0)


def test_the_worst_of_several_points_decides():
    base = np.zeros((3, 1, 2))
    move = np.zeros((3, 1, 2))
    move[0, 0] = 1.0, 4.0
    np.testing.assert_allclose(scales_within(base, move, 2.0), [[0.0, 0.5]])


def test_the_largest_scale_is_that_of_the_machine_that_decides():
    within = np.array([[0.0, high] for high in (1.0, 2.0, 3.0, 4.0, 5.0)])
    assert largest_scale(within, 1.0) == 1.0
    assert largest_scale(within, 0.8) == 2.0
    assert largest_scale(within, 0.61) == 2.0
    assert largest_scale(within, 0.6) == 3.0
    outside = np.array([[np.inf, -np.inf], [0.0, 1.0]])
    assert largest_scale(outside, 0.5) == 1.0
    assert largest_scale(outside, 0.6) is None
    assert largest_scale(np.array([[0.0, np.inf]]), 1.0) == np.inf


def test_half_widths_are_rounded_down_to_three_digits():
    given = np.array([12.3, 12.39, 0.12345, 999.9, 1000.0, 0.0, 12.299999999999])
    np.testing.assert_array_equal(round_down(given), [12.3, 12.3, 0.123, 999, 1000, 0, 12.2])
