"""What to repair: against direct evaluation, least squares, and a second convex solver."""

from dataclasses import replace
from itertools import combinations, pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import lsq_linear, minimize

from warpspace.analysis import adjustment_search
from warpspace.analysis.adjustment_search import Objective, least_rms
from warpspace.analysis.commands.adjust import Adjust, apply_adjustments
from warpspace.analysis.statistics import volume_statistics
from warpspace.field.grid import build_grid
from warpspace.machine.errors import ErrorSet
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.model import evaluate_grid

FIRST = load_scene("dvf5000_first")
NODES = 11
SQUARENESS = ("EC0Y", "EA0Z", "EB0Z")
EIGHT = (*SQUARENESS, "EXX", "EYX", "EAY", "EBZ", "EZZ")


def outcome_of(scene, nodes=NODES):
    """Mean, RMS, P95 and max of a scene by evaluating it anew."""
    grid = build_grid(scene.model, scene.workspace, nodes)
    return volume_statistics(evaluate_grid(scene, grid, scene.view()), grid).four


def response(keys, scene=FIRST):
    """Matrix of the nodes, [3N, k], their present error, [3N], and the weight of each row."""
    grid = build_grid(scene.model, scene.workspace, NODES)

    def errors(of):
        return evaluate_grid(of, grid, scene.view()).error_um.reshape(-1)

    present = errors(scene)
    columns = []
    for key in keys:
        raised = apply_adjustments(scene, {key: scene.errors.amplitude(key) + 1.0})
        columns.append(errors(raised) - present)
    return np.array(columns).T, present, np.repeat(grid.weights.reshape(-1), 3)


def least_max(keys, low, high, scene=FIRST, mean_um=np.inf):
    """The smallest largest error by SLSQP on all nodes, with a mean of at most `mean_um`."""
    matrix, present, weights = response(keys, scene)
    matrix, present, weights = (
        matrix.reshape(-1, 3, len(keys)),
        present.reshape(-1, 3),
        weights[::3],
    )
    low, high = np.broadcast_to(low, len(keys)), np.broadcast_to(high, len(keys))

    def norms(change):
        return np.linalg.norm(present + matrix @ change, axis=1)

    def room(z):
        return z[-1] - norms(z[:-1])

    def allowed(z):
        return np.append(room(z), mean_um - weights @ norms(z[:-1]) if mean_um < np.inf else 0.0)

    start = np.append(np.clip(np.zeros(len(keys)), low, high), 0.0)
    start[-1] = -room(start).min()
    found = minimize(
        lambda z: z[-1],
        start,
        jac=lambda z: np.eye(len(z))[-1],
        constraints={"type": "ineq", "fun": allowed},
        bounds=[*zip(low, high, strict=True), (0.0, None)],
        method="SLSQP",
        options={"ftol": 1e-12, "maxiter": 500},
    )
    return -room(np.append(found.x[:-1], 0.0)).min()


def test_leaving_one_out_is_what_direct_evaluation_gives():
    found = Adjust(grid=NODES).run(FIRST)
    assert found.before.four == pytest.approx(outcome_of(FIRST), abs=1e-9)
    assert {effect.key for effect in found.errors} == set(FIRST.errors) - {"EX0B", "EZ0B"}
    for effect in found.errors:
        others = {k: f for k, f in FIRST.errors.functions.items() if k != effect.key}
        without = replace(FIRST, errors=ErrorSet(others))
        assert effect.left_out.four == pytest.approx(outcome_of(without), abs=1e-9)
        best = apply_adjustments(FIRST, {effect.key: effect.best.value})
        assert effect.best.four == pytest.approx(outcome_of(best), abs=1e-9)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_rms_is_the_least_squares_optimum_over_all_sets(size):
    found = Adjust(grid=NODES, adjustable=SQUARENESS).run(FIRST).adjustments[size - 1]
    best = np.inf
    for keys in combinations(SQUARENESS, size):
        matrix, present, weights = response(keys)
        root = np.sqrt(weights)
        change, *_ = np.linalg.lstsq(matrix * root[:, None], -present * root)
        rms = np.linalg.norm((matrix @ change + present) * root)
        if rms < best:
            best, chosen = rms, dict(zip(keys, change, strict=True))
    assert found.rms_um == pytest.approx(best, abs=1e-9)
    assert set(found.adjust) == set(chosen)
    for key, value in found.adjust.items():
        assert value - FIRST.errors.amplitude(key) == pytest.approx(chosen[key], abs=1e-6)


def test_rms_within_limits_is_the_bounded_optimum():
    keys, limit = ("EXX", "EYX", "EZX", "EAY", "EA0Z"), 4.0
    plan = Adjust(count=5, adjustable=keys, limit={"all": limit, "EA0Z": 1.5}, grid=NODES)
    found = plan.run(FIRST).adjustments[-1]
    matrix, present, weights = response(keys)
    root = np.sqrt(weights)
    high = np.array([1.5 if key == "EA0Z" else limit for key in keys])
    second = lsq_linear(matrix * root[:, None], -present * root, (-high, high), method="trf",
                        tol=1e-14)  # fmt: skip
    assert found.rms_um == pytest.approx(np.sqrt(2 * second.cost), abs=1e-6)
    for key, value in found.adjust.items():
        allowed = 1.5 if key == "EA0Z" else limit
        assert abs(value - FIRST.errors.amplitude(key)) <= allowed + 1e-9


def test_rms_is_least_where_many_limits_are_met_one_after_the_other():
    rng = np.random.default_rng(1)
    for _ in range(100):
        matrix = rng.normal(size=(12, 10)) @ (np.eye(10) + 3.0 * rng.normal(size=(10, 10)))
        error, high = 10.0 * rng.normal(size=12), 3.0 * rng.random(10)
        limits = np.stack([-high, high], -1)
        found = least_rms(SimpleNamespace(triangle=(matrix, error)), tuple(range(10)), limits)
        second = lsq_linear(matrix, -error, (-high, high), method="trf", tol=1e-15, max_iter=1000)
        assert found.value_um == pytest.approx(np.sqrt(2 * second.cost), abs=1e-9)


@pytest.mark.parametrize(
    ("keys", "limit"),
    [(("EA0Z",), 200.0), (SQUARENESS, 200.0), (SQUARENESS, 3.0), (("EAY", "EA0Z", "EYX"), 200.0)],
)
def test_max_is_what_a_second_solver_finds(keys, limit):
    options = {"adjustable": keys, "limit": {"all": limit}, "grid": NODES, "unconstrained": True}
    found = Adjust(objective="max", count=len(keys), **options).run(FIRST).adjustments[-1]
    assert found.max_um == pytest.approx(least_max(keys, -limit, limit), abs=1e-3)
    largest = outcome_of(apply_adjustments(FIRST, found.adjust))[3]
    assert largest == pytest.approx(found.max_um, abs=1e-9)
    for key, value in found.adjust.items():
        assert abs(value - FIRST.errors.amplitude(key)) <= limit + 1e-9


@pytest.mark.parametrize("keys", [("EA0Z",), SQUARENESS, ("EYX", "EAB", "EA0B"), ("EB0Z", "EXX")])
def test_proposals_keep_the_tolerances_and_the_mean(keys):
    """Against a second solver; some of them raise the mean where nothing keeps it."""
    mean = outcome_of(FIRST)[0]
    options = {"objective": "max", "count": len(keys), "adjustable": keys, "grid": NODES}
    best = Adjust(**options).run(FIRST).adjustments[-1]
    tolerances = [FIRST.tolerances.get(key).half_width for key in best.adjust]
    present = np.array([FIRST.errors.amplitude(key) for key in best.adjust])
    for value, tolerance in zip(best.adjust.values(), tolerances, strict=True):
        assert abs(value) <= tolerance + 1e-9
    assert outcome_of(apply_adjustments(FIRST, best.adjust))[0] <= mean + 1e-3
    low, high = -np.array(tolerances) - present, np.array(tolerances) - present
    assert best.max_um == pytest.approx(
        least_max(tuple(best.adjust), low, high, mean_um=mean), abs=2e-3
    )


def test_the_mean_is_kept_where_the_smallest_largest_error_would_raise_it():
    options = {"objective": "max", "count": 1, "adjustable": ("EAX",), "grid": NODES}
    free = Adjust(**options, unconstrained=True).run(FIRST).adjustments[0]
    mean = outcome_of(FIRST)[0]
    assert free.mean_um > mean  # the case is one
    kept = Adjust(**options).run(FIRST).adjustments[0]
    assert kept.mean_um <= mean + 1e-3
    assert free.max_um < kept.max_um <= outcome_of(FIRST)[3]


def test_the_smallest_rms_keeps_the_mean_as_well():
    volume = SimpleNamespace(triangle=(np.array([[1.0]]), np.array([-1.0])))
    volume.mean = lambda indices, change: (5.0 + change[0], np.array([1.0]))
    bounds = np.array([[-2.0, 2.0]])
    assert least_rms(volume, (0,), bounds).change == pytest.approx(1.0)
    assert least_rms(volume, (0,), bounds, 5.5).change == pytest.approx(0.5, abs=1e-6)
    assert least_rms(volume, (0,), bounds, 2.0) is None


def test_a_set_that_gains_little_is_not_proposed():
    result = Adjust(grid=NODES, adjustable=SQUARENESS).run(FIRST)
    assert result.worthwhile == [0, 1]
    text = " ".join(block for block in result.blocks() if isinstance(block, str))
    assert "not proposed: set 3 (gains less than 1% of the RMS |E| over smaller sets)" in text


@pytest.mark.parametrize("objective", Objective)
def test_more_adjustments_are_never_worse(objective):
    found = Adjust(objective=objective, count=4, adjustable=EIGHT, grid=5).run(FIRST)
    values = [getattr(one, f"{objective}_um") for one in found.adjustments]
    assert [len(one.adjust) for one in found.adjustments] == [1, 2, 3, 4]
    assert all(b <= a + 1e-3 for a, b in pairwise(values))
    assert values[0] < getattr(found.before, f"{objective}_um")


@pytest.mark.parametrize("objective", Objective)
def test_sets_that_are_built_up_say_so_and_are_near_the_best(objective, monkeypatch):
    plan = Adjust(objective=objective, count=3, adjustable=EIGHT, grid=3)
    every = plan.run(FIRST)
    assert all(one.proven for one in every.adjustments)
    monkeypatch.setattr(adjustment_search, "MOST_SETS", dict.fromkeys(Objective, 21))
    built = plan.run(FIRST)
    assert [one.proven for one in built.adjustments] == [True, False, False]
    for one, best in zip(built.adjustments, every.adjustments, strict=True):
        value = getattr(one, f"{objective}_um")
        least = getattr(best, f"{objective}_um")
        assert least - 1e-3 <= value < 1.25 * least + 1e-3


def test_nothing_to_repair():
    found = Adjust(grid=5).run(load_scene("dvf5000_nominal"))
    assert (found.before.max_um, found.errors, found.adjustments) == (0.0, (), ())


def test_a_loop_without_alignment_has_no_sets():
    scene = parse_scene('[machine]\nchain = "wFXt"\n[errors]\nEXX = { ramp = 5 }\n', "x")
    found = Adjust(grid=5).run(scene)
    assert found.adjustments == ()
    assert found.errors != ()
