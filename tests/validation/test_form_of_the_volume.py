"""Closed forms of the bent volume: squareness, straightness, flatness, reach and lines."""

import math
from dataclasses import replace

import numpy as np
import pytest

from warpspace import load_scene
from warpspace.analysis.commands.conformance import Conformance, largest_box
from warpspace.analysis.commands.form import Form, zone_width
from warpspace.analysis.commands.line import Line
from warpspace.analysis.description import ignore_progress
from warpspace.exceptions import OptionError
from warpspace.machine.curves.simple import Constant, Poly
from warpspace.machine.errors import ErrorSet

NOMINAL = load_scene("dvf5000_nominal")
X, Y = (NOMINAL.workspace.ranges[name] for name in "XY")


def with_errors(**errors):
    return replace(NOMINAL, errors=ErrorSet(errors))


def certified(scene):
    found: dict[tuple[str, str], list[float]] = {}
    for one in Form(nodes=5).run(scene, ignore_progress).deviations:
        found.setdefault((one.kind, one.of), []).append(one.value)
    return found


def test_a_machine_without_errors_is_flat_straight_and_square():
    assert all(abs(v) < 1e-9 for values in certified(NOMINAL).values() for v in values)


@pytest.mark.parametrize(
    ("key", "pair"), [("EC0Y", "Y to X"), ("EA0Z", "Z to Y"), ("EB0Z", "Z to X")]
)
def test_squareness_of_the_volume_is_that_of_the_axes(key, pair):
    found = certified(with_errors(**{key: Constant(Y, 23.1)}))
    # a positive turn about z or x opens the angle of Y to X, Z to Y; about y it closes Z to X
    sign = -1.0 if key == "EB0Z" else 1.0
    assert found["squareness", pair] == [pytest.approx(sign * 23.1, abs=1e-6)]
    assert (
        max(abs(v) for (kind, _), values in found.items() if kind != "squareness" for v in values)
        < 1e-6
    )


def test_a_parabola_across_an_axis_has_the_zone_of_its_sagitta():
    # δ = c·q²: over ±L the chord's zone is c·L² wide (the parabola and its tangent)
    c, half = 2e-4, (X[1] - X[0]) / 2.0
    found = certified(with_errors(EYX=Poly(X, (0.0, 0.0, c))))
    assert found["straightness", "X in y"] == [pytest.approx(c * half**2, rel=1e-6)]
    assert found["straightness", "X in z"] == [pytest.approx(0.0, abs=1e-9)]


def test_the_zone_is_the_narrowest():
    x = np.linspace(-1.0, 1.0, 41)
    assert zone_width(3.0 * x + 1.0, x) == pytest.approx(0.0, abs=1e-9)
    assert zone_width(np.abs(x), x) == pytest.approx(1.0)
    y = np.cos(np.pi * np.arange(41))
    assert zone_width(0.5 * y + 7.0 * x, x) == pytest.approx(1.0)


def test_of_an_error_that_grows_along_x_the_reach_is_its_share_of_the_range():
    # |E| = |s·q| ≤ limit for |q| ≤ limit/s: limit 13.75 µm of 27.5 µm at the ends is half of X
    scene = with_errors(EXX=Poly(X, (0.0, 0.1)))
    found = Conformance(limit_um=13.75, nodes=21).run(scene, ignore_progress)
    assert found.percent == pytest.approx(50.0, abs=1.5)
    assert found.box["X"] == pytest.approx((-137.5, 137.5), abs=1e-6)
    assert found.box["Y"] == pytest.approx(Y)
    assert found.keeps_um["100%"] == pytest.approx(27.5)


def test_the_largest_box_is_that_of_trying_all():
    keeps = np.random.default_rng(3).random((5, 4, 6)) < 0.8
    spans = [[(i, j) for i in range(n) for j in range(i + 1, n)] for n in keeps.shape]
    sizes = [
        math.prod(b - a for a, b in (x, y, z))
        for x in spans[0] for y in spans[1] for z in spans[2]
        if keeps[x[0] : x[1] + 1, y[0] : y[1] + 1, z[0] : z[1] + 1].all()
    ]  # fmt: skip
    found = largest_box(keeps, [4.0, 3.0, 5.0])
    assert found is not None
    assert math.prod(b - a for a, b in found) == max(sizes)


def test_nothing_keeps_a_limit_below_every_error():
    scene = with_errors(EXX=Constant(Y, 50.0))
    found = Conformance(limit_um=10.0, nodes=3).run(scene, ignore_progress)
    assert (found.percent, found.box) == (0.0, None)


def test_along_a_line_a_pitch_turns_the_tool_and_moves_it_by_its_lever():
    scene = with_errors(EC0Y=Constant(Y, 20.0))
    ends = ((("X", 0.0), ("Y", -100.0)), (("X", 0.0), ("Y", 100.0)))
    found = Line(start=ends[0], end=ends[1], points=3).run(scene, ignore_progress)
    assert found.length_mm == pytest.approx(200.0)
    # E_x = −γ·(y of the tool from the origin of Y): 20 µrad · 200 mm = 4 µm less at the end
    assert found.error_um[:, 0] - found.error_um[0, 0] == pytest.approx([0.0, -2.0, -4.0])
    assert found.orientation_urad[:, 0] == pytest.approx([0.0] * 3)


def test_a_line_of_one_point_is_refused():
    same = (("X", 1.0),)
    with pytest.raises(OptionError, match="one point"):
        Line(start=same, end=same).run(NOMINAL, ignore_progress)
