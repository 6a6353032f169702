"""Closed forms of distances and angles between points."""

from dataclasses import replace

import numpy as np
import pytest

from warpspace import load_scene
from warpspace.analysis.commands.distance import Distance
from warpspace.analysis.description import ignore_progress
from warpspace.exceptions import OptionError
from warpspace.machine.curves.simple import Constant, Poly
from warpspace.machine.errors import ErrorSet

NOMINAL = load_scene("dvf5000_nominal")
X, Y = (NOMINAL.workspace.ranges[name] for name in "XY")


def measured(scene=NOMINAL, errors=None, **options):
    if errors:
        scene = replace(scene, errors=ErrorSet(errors))
    return Distance(**options).run(scene, ignore_progress)


def test_a_pure_ramp_of_exx_over_500_mm_adds_its_micrometres():
    found = measured(errors={"EXX": Poly(X, (0.0, 0.04))}, start={"X": -250}, end={"X": 250})
    assert found.distance_mm == pytest.approx((500.0, 500.02), abs=1e-9)
    assert found.difference_um == pytest.approx(20.0, abs=1e-6)
    assert found.along_um == pytest.approx([20.0, 0.0, 0.0], abs=1e-9)
    back = measured(errors={"EXX": Poly(X, (0.0, 0.04))}, start={"X": 250}, end={"X": -250})
    assert (back.difference_um, back.along_um[0]) == pytest.approx((20.0, -20.0))


def test_a_constant_error_lengthens_nothing():
    found = measured(errors={"EXX": Constant(X, 20.0)}, start={"X": -250}, end={"X": 250})
    assert found.difference_um == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("x", "sign"), [(250, 1.0), (-250, -1.0)])
def test_a_pure_ec0y_is_the_squareness_of_edges_along_x_and_y(x, sign):
    # EC0Y turns Y away from +X: the angle to the edge along +X is wider, that to −X narrower
    found = measured(
        errors={"EC0Y": Constant(Y, 23.1)}, corner={"X": 0}, start={"X": x}, end={"X": 0, "Y": 200}
    )
    assert found.is_squareness
    assert found.angle_deg[0] == pytest.approx(90.0, abs=1e-12)
    assert found.deviation_urad == pytest.approx(sign * 23.1, abs=1e-4)


def test_an_angle_of_45_degrees_is_no_squareness():
    corner, start, end = {"X": 0, "Y": 0}, {"X": 100, "Y": 0}, {"X": 100, "Y": 100}
    found = measured(errors={"EC0Y": Constant(Y, 20.0)}, corner=corner, start=start, end=end)
    # the end of the diagonal moves by −y·EC0Y along x, across the diagonal by half of the angle
    assert (found.is_squareness, found.angle_deg[0]) == (False, pytest.approx(45.0))
    assert found.deviation_urad == pytest.approx(10.0, abs=1e-3)


def test_on_a_machine_whose_table_moves_the_points_are_those_of_the_workpiece():
    scene = load_scene("machine_printer_3d")
    ends = [{name: ends[i] for name, ends in scene.workspace.ranges.items()} for i in (0, 1)]
    edges = [high - low for low, high in scene.workspace.ranges.values()]
    for loop in ("tool", "workpiece", "relative"):
        found = measured(replace(scene, errors=ErrorSet()), start=ends[0], end=ends[1], loop=loop)
        assert found.distance_mm == pytest.approx((np.linalg.norm(edges),) * 2)


def test_points_that_coincide_are_refused_by_name():
    with pytest.raises(OptionError, match="start and end are one point"):
        measured(start={"X": 1}, end={"X": 1})
    with pytest.raises(OptionError, match="corner is an end of an edge"):
        measured(start={"X": 1}, end={"X": 2}, corner={"X": 2})
