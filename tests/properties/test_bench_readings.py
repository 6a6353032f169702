"""Readings are linear in small errors: the response of every test against the exact chain."""

from dataclasses import replace

import numpy as np
import pytest

from warpspace.bench.base import bench_names, find_test
from warpspace.bench.plan import respond, simulate
from warpspace.machine.axes import parameter
from warpspace.machine.errors import ErrorSet
from warpspace.scene.library import load_scene

SCENES = ("dvf5000_first", "machine_head_head_ca", "machine_trunnion_on_cross_table")
SMALL = {"circular": {"points": 12}, "cone-frustum": {"points": 12}, "ball-plate": {"balls": 3}}


@pytest.mark.parametrize("scene_name", SCENES)
@pytest.mark.parametrize("name", bench_names())
def test_response_is_the_derivative_of_the_exact_readings(scene_name, name):
    scene = load_scene(scene_name)
    test = find_test(name)(**SMALL.get(name, {}))
    plan = test.plan(scene)
    keys = scene.parameter_keys
    response = respond(scene, plan, keys)
    assert response.shape == (plan.readings, len(keys))
    amplitudes = np.array([scene.errors.amplitude(key) for key in keys])
    np.testing.assert_allclose(response @ amplitudes, simulate(scene, plan, exact=False))
    for column, key in enumerate(keys):
        span = scene.axis_span(parameter(key).axis)
        curves = [
            scene.errors.with_amplitude(key, size, span).functions[key] for size in (0.5, -0.5)
        ]
        up, down = (
            simulate(replace(scene, errors=ErrorSet({key: curve})), plan) for curve in curves
        )
        np.testing.assert_allclose(up - down, response[:, column], atol=2e-7)


@pytest.mark.parametrize("name", bench_names())
def test_set_up_gives_readings_of_its_own(name):
    plan = find_test(name)(**SMALL.get(name, {})).plan(load_scene("dvf5000_first"))
    design = np.stack(list(plan.setup.values()), -1)
    assert design.shape[0] == plan.readings
    assert np.linalg.matrix_rank(design) == design.shape[1]
    for values in (*plan.marks.values(), *plan.travel.values(), *plan.coordinates.values()):
        assert np.isfinite(values).all()
    np.testing.assert_allclose(np.linalg.norm(plan.direction, axis=-1), 1.0)
