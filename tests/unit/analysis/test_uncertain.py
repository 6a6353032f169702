"""Standard uncertainties of errors in the field, and in sampled machines."""

import math

import numpy as np
import pytest

from warpspace.analysis.montecarlo import Plan
from warpspace.exceptions import SceneError
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.uncertainty import evaluate_uncertainty, uncertain_montecarlo

HEAD = """[machine]
chain = "wFXYZt"
[machine.offset_mm]
t = [0, 0, -300]
[workspace]
X = [-100, 100]
Y = [-100, 100]
Z = 0
"""
SCENE = (
    HEAD
    + """[errors]
EXX = 5
[uncertainty]
EXX = 0.4
EYX = { table = [[-100, 0.1], [100, 0.3]] }
EBX = 1
"""
)


def test_gains_times_uncertainties_add_up_in_squares() -> None:
    found = evaluate_uncertainty(parse_scene(SCENE, "s"), at={"X": [-100.0, 0.0, 100.0]})
    # along x: 0.4 µm, and 1 µrad on an arm of 300 mm; along y the table; along z nothing at X 0 …
    x = math.hypot(0.4, 0.3)
    np.testing.assert_allclose(found.error_um[:, 0], x)
    np.testing.assert_allclose(found.error_um[:, 1], [0.1, 0.2, 0.3])
    np.testing.assert_allclose(found.error_um[:, 2], 0.0, atol=1e-12)
    # … and |E| is along x
    np.testing.assert_allclose(found.norm_um, x)
    np.testing.assert_allclose(found.orientation_urad[:, 1], 1.0)


def test_where_there_is_no_error_the_vector_counts_as_a_whole() -> None:
    found = evaluate_uncertainty(parse_scene(SCENE.replace("EXX = 5\n", ""), "s"), at={"X": 0.0})
    assert float(found.norm_um) == pytest.approx(math.sqrt(0.4**2 + 0.3**2 + 0.2**2))


def test_with_a_reference_one_error_goes_the_same_way_at_both_points() -> None:
    held = SCENE + "[view]\nreference = { X = -100, Y = 0, Z = 0 }\n"
    found = evaluate_uncertainty(parse_scene(held, "s"), at={"X": [-100.0, 100.0]})
    np.testing.assert_allclose(found.error_um, [[0, 0, 0], [0, 0.2, 0]], atol=1e-12)


def test_sampled_machines_scatter_by_it_around_the_errors() -> None:
    scene = parse_scene(HEAD + "[errors]\nEXX = 50\n[uncertainty]\nEXX = 3\n", "s")
    result = uncertain_montecarlo(scene, Plan(samples=40_000, seed=2))
    assert result.mean_um == pytest.approx(50.0, abs=0.1)
    spread = math.sqrt(result.rms_um**2 - result.mean_um**2)
    assert spread == pytest.approx(3.0, abs=0.05)
    assert result.p95_um == pytest.approx(50.0 + 1.645 * 3.0, abs=0.15)
    flat = uncertain_montecarlo(scene, Plan(samples=40_000), distribution="uniform")
    assert flat.max_um == pytest.approx(50.0 + math.sqrt(3.0) * 3.0, abs=0.01)


@pytest.mark.parametrize("over", ["max", "mean"])
def test_over_all_points_each_machine_keeps_its_own_errors(over: str) -> None:
    text = (
        HEAD
        + "[errors]\nEXX = { ramp = 50 }\n[uncertainty]\nEXX = { table = [[-100, 0], [100, 3]] }\n"
    )
    result = uncertain_montecarlo(parse_scene(text, "s"), Plan(samples=5000, over=over, nodes=5))
    assert result.median_um == pytest.approx(50.0 if over == "max" else 25.0, abs=0.3)


def test_the_scene_must_have_some() -> None:
    with pytest.raises(SceneError, match="has no uncertainties; expected an"):
        evaluate_uncertainty(load_scene("dvf5000_first"))
