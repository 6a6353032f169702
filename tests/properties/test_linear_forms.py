"""The linear form of every quantity of every test agrees with its evaluation."""

import numpy as np
import pytest
from scipy.optimize import linprog

from bench_scenes import scene_with
from warpspace.bench.base import bench_names, find_test
from warpspace.bench.plan import respond

VARIANTS = {
    "circular": ({}, {"end_deg": 120.0, "points": 40}, {"rotary": "C", "bar": "axial"}),
    "diagonals": ({}, {"kind": "face"}, {"kind": "step"}),
    "straightness": ({}, {"axis": "Z", "across": "x"}),
    "squareness": ({}, {"plane": "YZ"}),
    "positioning": ({}, {"axis": "C"}),
    "ball-plate": ({}, {"plane": "XZ", "positions": 2}),
    "r-test": ({}, {"frame": "workpiece"}),
}
CASES = [(name, options) for name in bench_names() for options in VARIANTS.get(name, ({},))]
WITHOUT = (
    *("A", "R", "rms", "minimum_zone_urad"),  # dispersion of runs, RMS, angle of zones
    *("B", "M", "E_forward", "E_backward", "hysteresis", "circular_deviation_c"),  # reversal
    *("mean_radial", "radial_deviation", "radius_difference", "scale"),
    "squareness_urad",  # of a ball plate and of an arc
)


def least_size(form):
    """Return factor · min over u of max |rows − free u| by an independent linear program."""
    rows, free = form.rows, form.free
    columns = np.column_stack([free, np.ones(len(rows))])
    matrix = np.concatenate([-columns, np.column_stack([free, -np.ones(len(rows))])])
    cost = np.append(np.zeros(free.shape[1]), 1.0)
    bounds = [(None, None)] * free.shape[1] + [(0.0, None)]
    solution = linprog(cost, matrix, np.concatenate([-rows, rows]), bounds=bounds)
    return form.factor * solution.fun


@pytest.mark.parametrize(("name", "options"), CASES)
def test_form_equals_evaluation(name, options):
    scene = scene_with("dvf5000_nominal")
    test, rng = find_test(name)(**options), np.random.default_rng(4)
    plan = test.plan(scene)
    responses = rng.normal(scale=3.0, size=(plan.readings, 3))  # any readings, with reversal
    readings = responses @ [0.5, -1.0, 0.25]
    outcome = test.evaluate(plan, readings)
    forms = test.linear_forms(plan, readings)
    for key, form in forms.items():
        assert least_size(form) == pytest.approx(abs(outcome[key]), rel=1e-6, abs=1e-7), key
    for key, form in test.linear_forms(plan, responses).items():
        rows = form.rows @ [0.5, -1.0, 0.25]
        np.testing.assert_allclose(rows, forms[key].rows, atol=1e-9, err_msg=key)
    assert outcome.quantities[0].key.startswith(("A_", *forms))
    for quantity in outcome.quantities:
        assert quantity.key in forms or quantity.key.startswith(WITHOUT)


def test_first_quantity_has_a_form():
    scene = scene_with("dvf5000_nominal")
    for name in bench_names():
        test = find_test(name)()
        plan = test.plan(scene)
        gains = respond(scene, plan, scene.parameter_keys)
        assert test.linear_forms(plan, gains), name
