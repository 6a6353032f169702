"""Concepts side by side, against numbers by hand and machines drawn apart."""

from dataclasses import replace

import numpy as np
import pytest

from warpspace import evaluate
from warpspace.exceptions import SceneError
from warpspace.field.grid import build_grid
from warpspace.machine.errors import Constant, ErrorSet
from warpspace.machine.tolerances import Tolerance, ToleranceSet
from warpspace.scene.concepts import ConceptPlan, compare_concepts, expected_um
from warpspace.scene.starter import starter_scene

QUICK = ConceptPlan(samples=20_000)


def with_default(chain: str, translation: float, rotation: float, squareness: float):
    default = {"translation": translation, "rotation": rotation, "squareness": squareness}
    return replace(starter_scene(chain), tolerances=ToleranceSet(default))


@pytest.mark.parametrize(("chain", "count"), [("wFXt", 3), ("wFXYZt", 9), ("wXYFZt", 9)])
def test_translations_alone_give_the_root_of_their_number_everywhere(chain, count):
    scene = with_default(chain, 10.0, 0.0, 0.0)
    (concept,) = compare_concepts([scene], QUICK)
    grid = build_grid(scene.model, scene.workspace, 3)
    # a uniform range of ±10 µm has a variance of 100/3 µm², and each translation acts one to one
    expected = np.sqrt(count * 100.0 / 3.0)
    assert expected_um(concept, grid) == pytest.approx(expected)
    assert concept.shares.rms_um == pytest.approx(expected)
    assert concept.sampled.rms_um == pytest.approx(expected, rel=0.01)


def test_the_expected_error_is_that_of_machines_drawn_apart():
    scene = with_default("wCBFXYZt", 10.0, 20.0, 25.0)
    own = {"EAX": Tolerance(-30.0, 5.0), "EC0Y": Tolerance(40.0, 10.0)}
    scene = replace(scene, tolerances=replace(scene.tolerances, own=own))
    (concept,) = compare_concepts([scene], replace(QUICK, own_tolerances=True))
    grid = build_grid(scene.model, scene.workspace, 2)
    expected = expected_um(concept, grid)
    rng, squares, count = np.random.default_rng(3), 0.0, 600
    for _ in range(count):
        errors = {}
        for key in scene.parameter_keys:
            tolerance = scene.tolerances.get(key)
            value = tolerance.centre + tolerance.half_width * rng.uniform(-1.0, 1.0)
            errors[key] = Constant((0.0, 1.0), value)
        found = evaluate(replace(scene, errors=ErrorSet(errors)), grid=2, loop="relative")
        squares = squares + found.norm_um**2
    # the scatter of a mean square of 600 is about 4 %, of its root 2 %
    assert np.sqrt(squares / count) == pytest.approx(expected, rel=0.07)


def test_no_point_is_held_still():
    scene = with_default("wFXYZt", 10.0, 20.0, 25.0)
    held = replace(scene, reference={"X": 0.0, "Y": 0.0, "Z": -200.0})
    one, other = compare_concepts([scene, held], QUICK)
    assert one.sampled.mean_um == other.sampled.mean_um


def test_tolerances_without_width_are_said():
    with pytest.raises(SceneError, match="none of the relative loop has a width"):
        compare_concepts([with_default("wFXYZt", 0.0, 0.0, 0.0)], QUICK)
