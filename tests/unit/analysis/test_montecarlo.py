"""Sampled machines: draws, places and samples, the same numbers however they are run."""

import dataclasses
import itertools
import random
import time
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from scipy import stats

import warpspace
from products import pairwise
from warpspace.analysis.blocks import blocks_html
from warpspace.analysis.commands.concepts import Concepts
from warpspace.analysis.commands.montecarlo import MonteCarlo
from warpspace.analysis.sampling import cases, machine_sampling
from warpspace.analysis.sampling import distribution as streams
from warpspace.analysis.sampling.cases import BLOCK, Case, SamplingPlan, choose_cylinder
from warpspace.analysis.sampling.distribution import Distribution, Draws, Stream, build_draws
from warpspace.analysis.sampling.machine_sampling import montecarlo_each, run_in_order
from warpspace.exceptions import OptionError, SceneError, WorkersLostError
from warpspace.field.evaluate import SecondOrder, View, compare_orders
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop, Model
from warpspace.kinematics.transforms import apply, inverse
from warpspace.machine.errors import Tolerance, ToleranceSet

SCENE = warpspace.load_scene("dvf5000_general")


@pytest.mark.parametrize(
    ("over", "loop"), pairwise(["sampled", "max", "mean"], ["tool", "workpiece", "relative"])
)
def test_workers_do_not_change_a_bit(over, loop):
    options = {"samples": 3 * BLOCK + 17, "over": over, "loop": loop, "grid": 4, "limit_um": 40}
    one, three = (warpspace.montecarlo(SCENE, workers=n, **options).sampled for n in (1, 3))
    assert numbers(one) == numbers(three)


def test_seed_changes_the_numbers_and_repeats_them():
    means = [warpspace.montecarlo(SCENE, samples=1000, seed=seed).mean_um for seed in (1, 1, 2)]
    assert means[0] == means[1] != means[2]


def test_streams_are_those_of_spawn():
    plan = SamplingPlan(samples=2 * BLOCK + 5, seed=7, workers=2)
    found = list(machine_sampling.sample_chunks(lambda rng, count: rng.random(count), plan))
    children = np.random.SeedSequence(7).spawn(3)
    counts = [BLOCK, BLOCK, 5]
    for values, child, count in zip(found, children, counts, strict=True):
        np.testing.assert_array_equal(values, np.random.default_rng(child).random(count))


def test_a_failing_or_interrupted_chunk_ends_the_run():
    def job(rng, count):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(machine_sampling.sample_chunks(job, SamplingPlan(samples=100 * BLOCK, workers=2)))


@pytest.mark.parametrize(
    ("loop", "over", "reference"),
    pairwise(
        ["tool", "workpiece", "relative"],
        ["sampled", "max"],
        [None, {"X": 0.0, "Y": 0.0, "Z": -280.0}],
    ),
)
def test_both_orders_are_those_of_the_same_machines(loop, over, reference):
    scene = dataclasses.replace(SCENE, reference=reference)
    case = warpspace.montecarlo(scene, samples=300, seed=4, loop=loop, over=over).case
    first, exact = cases.both_orders(case, 300)
    worst = np.linalg.norm(first, axis=-1).max(axis=-1)
    np.testing.assert_allclose(worst, case.build_job()(*case.plan.block(0))[: len(worst)])
    found = compare_orders(first, exact)
    assert 0.0 < found.um < 0.1
    assert not found.matters


@pytest.mark.parametrize(
    ("um", "largest_um", "matters"),
    [(0.11, 1e5, True), (0.09, 1e5, False), (0.09, 8.0, True), (0.0009, 0.01, False)],
)
def test_the_second_order_matters_above_a_tenth_or_one_per_cent(um, largest_um, matters):
    assert SecondOrder(um, largest_um).matters == matters


def case(loop=Loop.TOOL, **plan):
    draws = machine_sampling.scene_draws(SCENE, loop, "uniform", clip=False)
    return Case(SCENE.model, draws, SCENE.workspace, View(loop), SamplingPlan(**plan))


def numbers(found):
    names = {field.name for field in dataclasses.fields(found)} - {"case", "histogram"}
    return (*(getattr(found, name) for name in sorted(names)), *found.histogram.counts.tolist())


class Late(Executor):
    def __init__(self, workers, longest_s=0.005):
        self._threads, self._longest_s = ThreadPoolExecutor(workers), longest_s
        self._chance = random.Random(workers)

    def submit(self, fn, /, *args, **kwargs):
        wait_s = self._chance.uniform(0.0, self._longest_s)

        def call():
            time.sleep(wait_s)
            return fn(*args, **kwargs)

        return self._threads.submit(call)


def test_results_come_in_the_order_of_the_tasks():
    tasks = [(number,) for number in range(100)]
    found = list(run_in_order(lambda number: number**2, tasks, Late(7), 20))
    assert found == [((number,), number**2) for number in range(100)]


def test_no_more_tasks_are_taken_than_are_in_flight():
    taken = itertools.count()
    tasks = ((next(taken),) for _ in range(1000))
    results = run_in_order(lambda number: number, tasks, Late(3, 0.0), 6)
    for (number,), _ in itertools.islice(results, 50):
        assert next(taken) - 1 <= number + 60 + 7  # `next` counts here as well


def test_a_fleet_is_what_its_machines_are_one_by_one():
    fleet = [case(samples=n, seed=seed) for n, seed in ((3000, 1), (20 * BLOCK, 2), (10, 3))]
    done: list[int] = []
    taken: dict[int, list[np.ndarray]] = {}
    one_by_one = [numbers(next(montecarlo_each([of]))) for of in fleet]
    found = montecarlo_each(
        iter(fleet), executor=Late(4), workers=4, progress=done.append,
        take=lambda at, values: taken.setdefault(at, []).append(values),
    )  # fmt: skip
    assert [numbers(each) for each in found] == one_by_one
    assert sum(done) == sum(of.plan.samples for of in fleet)
    for at, of in enumerate(fleet):
        values = np.concatenate(taken[at])
        assert len(values) == of.plan.samples
        assert float(values.max()) in one_by_one[at]


def test_tasks_follow_from_the_plan_alone_and_grow_with_it():
    sizes = [case(samples=10**n).task_blocks for n in range(13)]
    assert sizes[:9] == [cases.LEAST_BLOCKS] * 9
    assert sizes[-1] == cases.MOST_BLOCKS
    assert sizes == sorted(sizes)


def test_a_bad_case_of_a_fleet_is_refused_by_its_number():
    with pytest.raises(OptionError, match="samples: 0"):
        list(montecarlo_each([case(samples=10), case(samples=0)], executor=Late(2)))


class Broken(Executor):
    def __init__(self, *, at_once):
        self._at_once = at_once

    def submit(self, fn, /, *args, **kwargs):
        if self._at_once:
            raise BrokenExecutor("gone")
        future: Future[Any] = Future()
        future.set_exception(BrokenExecutor("gone"))
        return future


@pytest.mark.parametrize("at_once", [True, False])
def test_an_executor_that_gives_up_is_said(at_once):
    with pytest.raises(WorkersLostError, match="the workers are lost"):
        list(montecarlo_each([case(samples=10)], executor=Broken(at_once=at_once)))


def test_what_is_waiting_is_dropped_when_the_result_is_not_wanted_any_more():
    with ThreadPoolExecutor(1) as pool:
        begun: list[int] = []

        def task(number):
            begun.append(number)
            time.sleep(0.01)
            return number

        found = run_in_order(task, ((number,) for number in range(1000)), pool, 50)
        next(found)
        found.close()
    assert len(begun) < 50


def draws(distribution, *, clip=False):
    return Draws(
        ("EAX", "EXX"), np.array([5.0, 0.0]), np.array([6.0, 0.0]), Distribution(distribution), clip
    )


@pytest.mark.parametrize(
    ("distribution", "clip"), [("uniform", False), ("normal", False), ("normal", True)]
)
def test_variance_mean_and_limits(distribution, clip):
    chosen = draws(distribution, clip=clip)
    values = chosen.draw(np.random.default_rng(0), 400_000)
    np.testing.assert_allclose(values.mean(axis=0), [5.0, 0.0], atol=0.03)
    np.testing.assert_allclose(values.var(axis=0), chosen.variance, rtol=0.01)
    outside = np.abs(values[:, 0] - 5.0) > 6.0
    if distribution == "normal" and not clip:
        assert outside.mean() == pytest.approx(0.0027, abs=0.0004)
    else:
        assert not outside.any()
    assert np.all(values[:, 1] == 0.0)


@pytest.mark.parametrize("clip", [False, True])
@pytest.mark.parametrize("distribution", list(Distribution))
def test_inverse_distribution_has_the_same_variance(distribution, clip):
    chosen = draws(distribution, clip=clip)
    if distribution is Distribution.NORMAL and clip:
        assert chosen.variance[0] == pytest.approx(4.0 * stats.truncnorm.var(-3.0, 3.0))
    unit = np.repeat((np.arange(200_000)[:, None] + 0.5) / 200_000, 2, axis=1)
    np.testing.assert_allclose(chosen.from_unit(unit).var(axis=0), chosen.variance, rtol=1e-3)


def test_bad_tolerances():
    for widths, keys, said in (
        ({}, ["EAX"], "has no tolerances"),
        ({"default": {"translation": 1.0}}, ["EXX", "EAX", "EC0Y"], "no half width for EAX, EC0Y"),
        ({"individual": {"EAX": Tolerance(0.0, -1.0)}}, ["EAX"], "half width -1"),
        ({"individual": {"EAX": Tolerance(0.0, float("nan"))}}, ["EAX"], "half width nan"),
    ):
        with pytest.raises(SceneError, match=said):
            build_draws(ToleranceSet(**widths), keys)
    with pytest.raises(OptionError, match="distribution 'beta'"):
        build_draws(ToleranceSet({"rotation": 1.0}), ["EAX"], "beta")


def test_workpiece_points_fill_the_cylinder_uniformly():
    size = choose_cylinder(SCENE.model)
    assert size == cases.Cylinder(550.0, 450.0)
    rng = np.random.default_rng(1)
    places = case(Loop.WORKPIECE).random(rng, 50_000)
    pose = branch_pose(SCENE.model, "workpiece", places.coordinates)
    x, y, z = apply(inverse(pose), places.point_mm).T
    radius = np.hypot(x, y)
    assert radius.max() <= 275.0 + 1e-6
    assert z.min() >= -1e-6
    assert z.max() <= 450.0 + 1e-6
    assert np.mean(radius**2) == pytest.approx(275.0**2 / 2.0, rel=0.01)
    assert np.mean(z) == pytest.approx(225.0, rel=0.01)
    assert places.coordinates["B"].min() == pytest.approx(-120.0, abs=0.1)
    assert places.coordinates["C"].max() == pytest.approx(360.0, abs=0.1)


@pytest.mark.parametrize("loop", list(Loop))
def test_places_have_one_point_per_node(loop):
    site = case(loop)
    spread = site.spread(5)
    assert spread.point_mm.reshape(-1, 3).shape == (125, 3)
    extreme = site.extreme(5)
    assert len(extreme.point_mm) == (8 if loop is not Loop.WORKPIECE else 2 * 5 * 5 * 5)
    assert site.average().point_mm.shape[-1] == 3


def test_a_workpiece_point_on_the_axis_stands_for_no_cylinder():
    with pytest.raises(OptionError, match="cylinder DIAMETER"):
        choose_cylinder(Model(SCENE.machine))


def test_a_fine_histogram_keeps_its_resolution_and_loses_no_sample(monkeypatch):
    """The same samples kept whole and as a fine histogram."""
    values = np.random.default_rng(3).gamma(4.0, 10.0, 60_000)
    exact = Stream(len(values), 50.0)
    monkeypatch.setattr(streams, "EXACT_SAMPLES", 10)
    fine = Stream(len(values), 50.0)
    for chunk in np.array_split(values, 7):
        exact.add(chunk)
        fine.add(chunk)
    assert exact.exact_quantiles
    assert not fine.exact_quantiles
    for share in (0.01, 0.5, 0.95, 0.99):
        assert exact.quantile(share) == pytest.approx(np.quantile(values, share), rel=1e-12)
        assert fine.quantile(share) == pytest.approx(exact.quantile(share), rel=2e-4)
    assert fine.mean_um == pytest.approx(values.mean(), rel=1e-12)
    assert fine.max_um == values.max()
    assert fine.mode_um() == pytest.approx(exact.mode_um(), abs=0.2)
    assert exact.mode_um() == pytest.approx(30.0, abs=1.5)  # of that gamma distribution
    shown = [stream.display_histogram() for stream in (exact, fine)]
    for histogram in shown:
        assert histogram.counts.sum() == len(values)
        assert histogram.edges_um[0] == 0.0
        assert 32 <= len(histogram.counts) <= 81
    assert np.abs(shown[0].counts - shown[1].counts).max() < 30


def test_probability_is_the_wilson_interval():
    stream = Stream(1000, 0.25)
    stream.add(np.arange(1000) / 1000.0)
    found = stream.probability()
    expected = stats.binomtest(251, 1000).proportion_ci(method="wilson")
    assert found.probability == 0.251
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))


def test_all_zero_samples():
    stream = Stream(5)
    stream.add(np.zeros(5))
    assert stream.mode_um() == 0.0
    assert stream.display_histogram().counts.tolist() == [5]


@pytest.mark.parametrize("kind", [MonteCarlo, Concepts])
def test_a_limit_is_that_of_the_scenes_unless_given(kind):
    scene, other = (dataclasses.replace(SCENE, limit_um=at) for at in (100.0, 90.0))

    def words(scenes, **options):
        result = kind(samples=100, **options).run_all(scenes, lambda _: None)
        return blocks_html(result.blocks())

    assert "≤ 100 µm" in words([scene])
    assert "≤ 80 µm" in words([scene], limit_um=80.0)
    assert "≤ 100 µm" in words([scene, scene])
    for scenes in ([scene, other], [dataclasses.replace(scene, limit_um=None)]):
        assert "≤" not in words(scenes)
