"""Circular test: squareness comes back, by the formula γ·R/2 of a ball bar."""

from dataclasses import replace

import numpy as np
import pytest

import warpspace
from warpspace.machine.errors import Constant, ErrorSet, Ramp

KEYS = {"XY": "EC0Y", "XZ": "EB0Z", "YZ": "EA0Z"}


def scene_with(**errors):
    scene = warpspace.load_scene("dvf5000_nominal")
    return replace(
        scene, errors=ErrorSet({key: Constant((0, 1), value) for key, value in errors.items()})
    )


@pytest.mark.parametrize("plane", KEYS)
def test_other_planes_do_not_disturb(plane):
    scene = scene_with(EC0Y=10.0, EB0Z=20.0, EA0Z=-30.0, EXX=4.0, EYY=-3.0, EZZ=2.0)
    found = warpspace.ballbar(scene, plane=plane, radius_mm=150)
    assert found.squareness_urad == pytest.approx(found.given_urad, abs=0.1)


def test_a_long_x_axis_is_an_ellipse_along_x():
    scene = warpspace.load_scene("dvf5000_nominal")
    scene = replace(scene, errors=ErrorSet({"EXX": Ramp((-275.0, 275.0), 11.0)}))
    found = warpspace.ballbar(scene, plane="XY", radius_mm=200)
    # 11 µm over 550 mm: 4 µm more at +x and −4 at −x, so 4 cos²φ = 2 + 2 cos 2φ
    assert found.radius_um == pytest.approx(2.0)
    assert found.scale_difference_um == pytest.approx(2.0)
    assert found.circular_deviation_um == pytest.approx(4.0)
    assert found.squareness_urad == pytest.approx(0.0, abs=1e-9)


def test_both_directions_trace_the_same():
    found = warpspace.ballbar(warpspace.load_scene("dvf5000_first"), plane="XY", radius_mm=150)
    assert found.hysteresis_um < 1e-3
    np.testing.assert_allclose(found.clockwise_um[1:], found.radial_um[1:][::-1])
    assert found.clockwise_um[0] == found.radial_um[0]


def test_axes_that_move_against_their_name_give_the_same_squareness():
    from warpspace.machine.description import build_machine

    scene = scene_with(EC0Y=20.0)
    machine = scene.machine
    turned = build_machine(
        machine.chain,
        offset_mm={name: axis.offset_mm for name, axis in machine.axes.items()},
        travel={name: axis.travel for name, axis in machine.axes.items()},
        direction={"Y": -1},
    )
    scene = replace(scene, model=replace(scene.model, machine=turned))
    assert warpspace.ballbar(scene, plane="XY", radius_mm=100).squareness_urad == pytest.approx(
        20.0
    )


@pytest.mark.parametrize("scene_name", ["dvf5000_first", "dvf5000_second"])
@pytest.mark.parametrize("plane", KEYS)
def test_the_bench_finds_what_the_ball_bar_does(scene_name, plane):
    # figures 5-3, 5-9 and 5-14 of the thesis are circles of the measured machines
    from warpspace.bench.kinds.circular import Circular

    scene = warpspace.load_scene(scene_name)
    known = warpspace.ballbar(scene, plane=plane, radius_mm=150)
    found = warpspace.run_test(scene, Circular(plane=plane, radius_mm=150.0)).model.outcome
    assert found["circular_deviation_um"] == pytest.approx(known.circular_deviation_um, abs=0.005)
    assert found["squareness_urad"] == pytest.approx(known.squareness_urad, abs=0.02)
    assert found["scale_difference_um"] == pytest.approx(known.scale_difference_um, abs=0.005)
