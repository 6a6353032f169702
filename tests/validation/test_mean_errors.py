"""Volumetric error of the two machines measured, and what the linearisation costs."""

import numpy as np
import pytest

from warpspace import evaluate, load_scene
from warpspace.analysis.statistics import statistics
from warpspace.scene.model import second_order

MEASURED = ("dvf5000_first", "dvf5000_second")


@pytest.mark.parametrize(("name", "mean_um"), [("dvf5000_first", 31.66), ("dvf5000_second", 14.58)])
@pytest.mark.parametrize("exact", [False, True])
def test_table_5_5_mean_error_over_11_cubed_nodes(name, mean_um, exact):
    field = evaluate(load_scene(name), grid=11, exact=exact)
    assert field.error_um.shape == (11, 11, 11, 3)
    assert statistics(field).mean_um == pytest.approx(mean_um, abs=0.02)


@pytest.mark.parametrize("name", MEASURED)
@pytest.mark.parametrize("loop", ["tool", "workpiece", "relative"])
def test_exact_minus_first_order_is_at_most_a_hundredth_of_a_micrometre(name, loop):
    scene = load_scene(name)
    exact = evaluate(scene, grid=21, loop=loop, exact=True)
    first = evaluate(scene, grid=21, loop=loop)
    difference = np.linalg.norm(exact.error_um - first.error_um, axis=-1).max()
    assert difference <= 0.01
    if loop != "workpiece":
        assert 0.0 < second_order(scene, loop).um <= difference
