"""The explanation of a point closes: contributions and remainder add up to the exact error."""

import numpy as np
import pytest

from warpspace import load_scene
from warpspace.analysis.explain import explain
from warpspace.field.evaluate import View
from warpspace.kinematics.model import Loop, complete_coordinates


@pytest.mark.parametrize("loop", list(Loop))
@pytest.mark.parametrize("reference", [None, {"X": 0.0, "Y": 0.0, "Z": -280.0}])
def test_contributions_and_remainder_add_up_to_the_exact_error(loop, reference):
    scene = load_scene("dvf5000_first")
    at = complete_coordinates(scene.machine, {"X": 100.0, "Y": -225.0, "Z": -480.0, "B": 10.0})
    found = explain(scene.model, scene.errors, at, View(loop, reference=reference))
    total = sum((part.error_um for part in found.contributions), np.zeros(3))
    np.testing.assert_allclose(total + found.remainder_um, found.error_um, atol=1e-12)
    assert sum(part.along_um for part in found.contributions) == pytest.approx(
        np.linalg.norm(total)
    )


def test_squareness_alone_is_explained_by_its_printed_lever():
    # table 4-3 at Y -225, Z -480: EC0Y 1.30 and 0.07 (levers 1299 and 70 mm), EBY 0.66 (658 mm)
    scene = load_scene("teach_squareness")
    at = complete_coordinates(scene.machine, {"X": 0.0, "Y": -225.0, "Z": -480.0})
    (part,) = explain(scene.model, scene.errors, at).contributions
    assert part.key == "EC0Y"
    assert part.value == 30.0
    np.testing.assert_allclose(part.lever_mm, [-70.0, -1299.0, -658.0])
