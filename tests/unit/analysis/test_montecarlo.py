"""The engine: the same numbers however it is run, and bounded memory."""

import dataclasses

import numpy as np
import pytest

import warpspace
from warpspace.analysis.montecarlo import BLOCK, Plan, sample_chunks
from warpspace.analysis.nodes import reduce_nodes
from warpspace.exceptions import OptionError, SceneError

SCENE = warpspace.load_scene("dvf5000_general")


@pytest.mark.parametrize("over", ["sampled", "max", "mean"])
@pytest.mark.parametrize("loop", ["tool", "workpiece", "relative"])
def test_workers_do_not_change_a_bit(over: str, loop: str) -> None:
    one, three = (
        warpspace.montecarlo(
            SCENE, samples=3 * BLOCK + 17, over=over, loop=loop, grid=4, workers=workers, spec_um=40
        )
        for workers in (1, 3)
    )
    names = {field.name for field in dataclasses.fields(one)} - {"plan", "draws", "histogram"}
    for name in names:
        assert getattr(one, name) == getattr(three, name), name
    np.testing.assert_array_equal(one.histogram.counts, three.histogram.counts)


def test_seed_changes_the_numbers_and_repeats_them() -> None:
    means = [warpspace.montecarlo(SCENE, samples=1000, seed=seed).mean_um for seed in (1, 1, 2)]
    assert means[0] == means[1] != means[2]


def test_streams_are_those_of_spawn() -> None:
    plan = Plan(samples=2 * BLOCK + 5, seed=7, workers=2)
    found = list(sample_chunks(lambda rng, count: rng.random(count), plan))
    children = np.random.SeedSequence(7).spawn(3)
    counts = [BLOCK, BLOCK, 5]
    for values, child, count in zip(found, children, counts, strict=True):
        np.testing.assert_array_equal(values, np.random.default_rng(child).random(count))


def test_reduce_nodes_is_the_plain_loop() -> None:
    rng = np.random.default_rng(0)
    machines, gains = rng.standard_normal((700, 5)), rng.standard_normal((3, 5, 40))
    plain = np.sqrt(np.einsum("nk,ckm->cnm", machines, gains) ** 2).astype(float)
    norms = np.sqrt((plain**2).sum(axis=0))
    np.testing.assert_allclose(reduce_nodes(machines, gains, "max"), norms.max(axis=1))
    np.testing.assert_allclose(reduce_nodes(machines, gains, "mean"), norms.mean(axis=1))


def test_a_failing_or_interrupted_chunk_ends_the_run() -> None:
    def job(rng: np.random.Generator, count: int) -> np.ndarray:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(sample_chunks(job, Plan(samples=100 * BLOCK, workers=2)))


def test_few_chunks_are_held_at_a_time() -> None:
    started = 0

    def job(rng: np.random.Generator, count: int) -> np.ndarray:
        nonlocal started
        started += 1
        return np.zeros(count)

    chunks = sample_chunks(job, Plan(samples=1000 * BLOCK, workers=2))
    next(chunks)
    assert started <= 8
    chunks.close()
    assert started <= 8


def test_progress_adds_up() -> None:
    done: list[int] = []
    warpspace.montecarlo(SCENE, samples=BLOCK + 3, progress=done.append)
    assert done == [BLOCK, 3]


def test_reference_point_held_still_lowers_the_error() -> None:
    absolute = warpspace.montecarlo(SCENE, samples=5000)
    held = dataclasses.replace(SCENE, reference={"X": 0.0, "Y": 0.0, "Z": -280.0})
    assert warpspace.montecarlo(held, samples=5000).mean_um < 0.5 * absolute.mean_um


def test_maximum_is_not_below_the_mean() -> None:
    for loop in ("tool", "workpiece"):
        largest = warpspace.montecarlo(SCENE, samples=2000, over="max", loop=loop)
        mean = warpspace.montecarlo(SCENE, samples=2000, over="mean", loop=loop)
        assert largest.mean_um > mean.mean_um


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"samples": 0}, "samples: 0"),
        ({"samples": 10**13}, "samples: 10000000000000"),
        ({"seed": -1}, "seed: -1"),
        ({"spec_um": -1.0}, "specification: -1"),
        ({"spec_um": float("inf")}, "specification: inf"),
        ({"workers": 0}, "workers: 0"),
        ({"over": "worst"}, "over 'worst'"),
        ({"loop": "head"}, "loop 'head'"),
        ({"distribution": "beta"}, "distribution 'beta'"),
        ({"grid": 1, "over": "max"}, "grid: 1 nodes"),
        ({"grid": 102, "over": "mean"}, "grid: 102 nodes"),
    ],
)
def test_bad_options(options: dict, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        warpspace.montecarlo(SCENE, **options)


def test_scene_without_tolerances() -> None:
    with pytest.raises(SceneError, match="dvf5000_nominal: has no tolerances"):
        warpspace.montecarlo(warpspace.load_scene("dvf5000_nominal"))
