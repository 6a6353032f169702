"""Volumetric errors of measured and of sampled machines, and the analytical check of E|E|²."""

import math

import numpy as np
import pytest

import warpspace
from products import pairwise
from warpspace.analysis.commands.contributions import expected_square
from warpspace.analysis.loop_parameters import loop_keys
from warpspace.analysis.sampling.cases import Case, Reduction, SamplingPlan, reduce_nodes
from warpspace.analysis.sampling.distribution import build_draws
from warpspace.analysis.sampling.machine_sampling import montecarlo
from warpspace.analysis.statistics import statistics
from warpspace.kinematics.model import Loop
from warpspace.scene.model import second_order

MEANS = [
    ("dvf5000_general", "tool", "uniform", 41.1, 0.5),
    ("dvf5000_general", "tool", "normal", 23.5, 0.4),
    ("dvf5000_general", "workpiece", "uniform", 16.2, 0.5),
    ("dvf5000_proposed", "workpiece", "uniform", 11.2, 0.5),
    ("dvf5000_proposed", "tool", "uniform", 28.7, 0.5),
]


@pytest.mark.parametrize(("name", "loop", "distribution", "mean", "within"), MEANS)
def test_mean_of_sampled_machines(name, loop, distribution, mean, within):
    result = warpspace.montecarlo(
        warpspace.load_scene(name), loop=loop, distribution=distribution, samples=100_000
    )
    assert result.mean_um == pytest.approx(mean, abs=within)


@pytest.mark.parametrize(
    ("name", "loop", "distribution"),
    pairwise(
        ["dvf5000_general", "dvf5000_proposed"],
        ["tool", "workpiece", "relative"],
        ["uniform", "normal"],
    ),
)
def test_sampled_mean_square_is_the_trace(name, loop, distribution):
    scene = warpspace.load_scene(name)
    result = warpspace.montecarlo(
        scene,
        loop=loop,
        distribution=distribution,
        clip=distribution == "normal",
        samples=100_000,
        seed=5,
    )
    variance, offset = expected_square(result.case)
    assert result.rms_um == pytest.approx(math.sqrt(variance.sum() + offset), rel=0.005)


@pytest.mark.parametrize("over", ["sampled", "max", "mean"])
@pytest.mark.parametrize("clip", [False, True])
@pytest.mark.parametrize("distribution", ["uniform", "normal"])
def test_every_mode_has_the_mean_square_of_the_trace_at_a_single_point(over, distribution, clip):
    scene = warpspace.load_scene("dvf5000_proposed")
    point = scene.workspace.moved({"X": 50.0, "Y": -100.0, "Z": -300.0})
    keys = loop_keys(scene.model, Loop.TOOL, scene.parameter_keys)
    draws = build_draws(scene.tolerances, keys, distribution, clip=clip)
    case = Case(
        scene.model, draws, point, plan=SamplingPlan(samples=200_000, reduction=over, seed=2)
    )
    result = montecarlo(case)
    variance, offset = expected_square(case)
    assert result.rms_um == pytest.approx(math.sqrt(variance.sum() + offset), rel=0.005)


def test_max_over_the_corners_is_the_max_over_the_grid():
    scene = warpspace.load_scene("dvf5000_general")
    keys = loop_keys(scene.model, Loop.TOOL, scene.parameter_keys)
    draws = build_draws(scene.tolerances, keys, "uniform")
    case = Case(scene.model, draws, scene.workspace)
    machines = draws.draw(np.random.default_rng(0), 500)
    found = [
        reduce_nodes(machines, case.responses(find(7)), Reduction.MAX)
        for find in (case.extreme, case.spread)
    ]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-12)


MEASURED = ("dvf5000_first", "dvf5000_second")


@pytest.mark.parametrize(("name", "mean_um"), [("dvf5000_first", 31.66), ("dvf5000_second", 14.58)])
@pytest.mark.parametrize("exact", [False, True])
def test_table_5_5_mean_error_over_11_cubed_nodes(name, mean_um, exact):
    field = warpspace.evaluate(warpspace.load_scene(name), grid=11, exact=exact)
    assert field.error_um.shape == (11, 11, 11, 3)
    assert statistics(field).mean_um == pytest.approx(mean_um, abs=0.02)


@pytest.mark.parametrize("name", MEASURED)
@pytest.mark.parametrize("loop", ["tool", "workpiece", "relative"])
def test_exact_minus_first_order_is_at_most_a_hundredth_of_a_micrometre(name, loop):
    scene = warpspace.load_scene(name)
    exact = warpspace.evaluate(scene, grid=21, loop=loop, exact=True)
    first = warpspace.evaluate(scene, grid=21, loop=loop)
    difference = np.linalg.norm(exact.error_um - first.error_um, axis=-1).max()
    assert difference <= 0.01
    if loop != "workpiece":
        assert 0.0 < second_order(scene, loop).um <= difference
