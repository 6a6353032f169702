"""Tasks on executors: order, the same numbers, few held, and what is done when one gives up."""

import dataclasses
import itertools
import random
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import warpspace
from warpspace.analysis.cases import LEAST_BLOCKS, MOST_BLOCKS, Case
from warpspace.analysis.distribution import Stream, summarise
from warpspace.analysis.engine import run_in_order
from warpspace.analysis.montecarlo import MonteCarlo, montecarlo_each
from warpspace.analysis.plan import BLOCK, Plan
from warpspace.exceptions import OptionError, WorkersLostError
from warpspace.field.evaluate import View
from warpspace.kinematics.model import Loop
from warpspace.scene.verbs import scene_draws

SCENE = warpspace.load_scene("dvf5000_general")


def case(**plan: Any) -> Case:
    draws = scene_draws(SCENE, Loop.TOOL, "uniform", clip=False)
    return Case(SCENE.model, draws, SCENE.workspace, View(), Plan(**plan))


def numbers(found: MonteCarlo) -> tuple[object, ...]:
    names = {field.name for field in dataclasses.fields(found)} - {"plan", "draws", "histogram"}
    return (*(getattr(found, name) for name in sorted(names)), *found.histogram.counts.tolist())


class Late(Executor):
    """Threads whose results come in any order."""

    def __init__(self, workers: int, longest_s: float = 0.005) -> None:
        self._threads, self._longest_s = ThreadPoolExecutor(workers), longest_s
        self._chance = random.Random(workers)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        wait_s = self._chance.uniform(0.0, self._longest_s)

        def call() -> Any:
            time.sleep(wait_s)
            return fn(*args, **kwargs)

        return self._threads.submit(call)


def test_results_come_in_the_order_of_the_tasks() -> None:
    tasks = [(number,) for number in range(100)]
    found = list(run_in_order(lambda number: number**2, tasks, Late(7), 20))
    assert found == [((number,), number**2) for number in range(100)]


def test_no_more_tasks_are_taken_than_are_in_flight() -> None:
    taken = itertools.count()
    tasks = ((next(taken),) for _ in range(1000))
    for (number,), _ in itertools.islice(
        run_in_order(lambda number: number, tasks, Late(3, 0.0), 6), 50
    ):
        assert next(taken) - 1 <= number + 60 + 7  # `next` counts here as well


@pytest.mark.parametrize(("samples", "spec_um"), [(50_000, None), (17 * BLOCK + 3, 40.0)])
def test_one_worker_and_forty_give_the_same_to_the_last_bit(
    samples: int, spec_um: float | None
) -> None:
    of = case(samples=samples, seed=3, spec_um=spec_um)
    (alone,) = montecarlo_each([of], workers=1)
    for workers in (1, 40):
        (found,) = montecarlo_each([of], workers=workers, executor=Late(workers))
        assert numbers(found) == numbers(alone)


def test_counted_samples_are_put_together_like_kept_ones() -> None:
    rng = np.random.default_rng(2)
    values = [np.abs(rng.standard_normal(n)) * 10.0 for n in (500, 1, 499)]
    one, parts = Stream(2_000_000, 8.0), Stream(2_000_000, 8.0)
    for block in values:
        one.add(block)
    parts.merge(summarise(values[:2], 8.0, keep=False, count=True))
    parts.merge(summarise(values[2:], 8.0, keep=False, count=True))
    exact = np.concatenate(values)
    for stream in (one, parts):
        assert stream.mean_um == one.mean_um
        assert stream.rms_um == one.rms_um
        assert stream.quantile(0.3) == pytest.approx(np.quantile(exact, 0.3), rel=3e-3)
        assert stream.probability().probability == np.mean(exact <= 8.0)
    np.testing.assert_array_equal(one.display_histogram().counts, parts.display_histogram().counts)


def test_a_fleet_is_what_its_machines_are_one_by_one() -> None:
    cases = [case(samples=n, seed=seed) for n, seed in ((3000, 1), (20 * BLOCK, 2), (10, 3))]
    done: list[int] = []
    taken: dict[int, list[np.ndarray]] = {}
    one_by_one = [numbers(next(montecarlo_each([of]))) for of in cases]
    found = montecarlo_each(
        iter(cases), executor=Late(4), workers=4, progress=done.append,
        take=lambda at, values: taken.setdefault(at, []).append(values),
    )  # fmt: skip
    assert [numbers(each) for each in found] == one_by_one
    assert sum(done) == sum(of.plan.samples for of in cases)
    for at, of in enumerate(cases):
        values = np.concatenate(taken[at])
        assert len(values) == of.plan.samples
        assert float(values.max()) in one_by_one[at]


def test_tasks_follow_from_the_plan_alone_and_grow_with_it() -> None:
    sizes = [case(samples=10**n).task_blocks for n in range(13)]
    assert sizes[:9] == [LEAST_BLOCKS] * 9
    assert sizes[-1] == MOST_BLOCKS
    assert sizes == sorted(sizes)


def test_a_bad_case_of_a_fleet_is_refused_by_its_number() -> None:
    with pytest.raises(OptionError, match="samples: 0"):
        list(montecarlo_each([case(samples=10), case(samples=0)], executor=Late(2)))


class Broken(Executor):
    """Gives up at the task, or while it works on it."""

    def __init__(self, *, at_once: bool) -> None:
        self._at_once = at_once

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        if self._at_once:
            raise BrokenExecutor("gone")
        future: Future[Any] = Future()
        future.set_exception(BrokenExecutor("gone"))
        return future


@pytest.mark.parametrize("at_once", [True, False])
def test_an_executor_that_gives_up_is_said(at_once: bool) -> None:
    with pytest.raises(WorkersLostError, match="the workers are lost"):
        list(montecarlo_each([case(samples=10)], executor=Broken(at_once=at_once)))


def test_what_is_waiting_is_dropped_when_the_result_is_not_wanted_any_more() -> None:
    with ThreadPoolExecutor(1) as pool:
        begun: list[int] = []

        def task(number: int) -> int:
            begun.append(number)
            time.sleep(0.01)
            return number

        found = run_in_order(task, ((number,) for number in range(1000)), pool, 50)
        next(found)
        found.close()
    assert len(begun) < 50
