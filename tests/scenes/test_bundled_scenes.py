"""Every bundled scene loads and evaluates, and what its description says is true of its numbers."""

from dataclasses import replace

import numpy as np
import pytest

from warpspace import evaluate, load_scene
from warpspace.analysis.statistics import statistics
from warpspace.field.evaluate import View, evaluate_exact
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, columns
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.scene.library import scene_names, scene_path
from warpspace.scene.model import second_order

SCENES = scene_names()
TURN_DEG = np.arange(0.0, 360.0, 15.0)


def table_errors(scene, point_mm, c_deg, b_deg=0.0):
    """Nominal position in R and exact error of a point of the workpiece frame, [..., 3]."""
    coordinates = complete_coordinates(scene.machine, {"B": b_deg, "C": c_deg})
    pose = branch_pose(scene.model, "workpiece", coordinates)
    point = transforms.apply(pose, point_mm)
    field = evaluate_exact(scene.model, scene.errors, coordinates, View(Loop.WORKPIECE), point)
    return point, field.error_um


def harmonic(values, order):
    return float(2.0 * np.abs(np.fft.rfft(values)[order]) / len(values))


@pytest.mark.parametrize("name", SCENES)
def test_bundled_scene_loads_without_remarks_and_says_what_it_is(name):
    scene = load_scene(name)
    assert scene.name == name
    assert scene.title not in ("", name)
    assert len(scene.description) > 40
    assert scene.notes == ()
    assert scene.trace_points_mm
    assert load_scene(scene_path(name)) == scene


@pytest.mark.parametrize("name", SCENES)
def test_bundled_scene_is_small_enough_for_the_first_order(name):
    assert second_order(load_scene(name)).um <= 0.02


def test_nominal_scene_has_no_error_at_all():
    for loop in Loop:
        assert statistics(evaluate(load_scene("dvf5000_nominal"), loop=loop)).max_um == 0.0


@pytest.mark.parametrize("name", ["dvf5000_first", "dvf5000_second", "dvf5000_nominal"])
def test_working_volume_reaches_51_mm_below_the_table_surface(name):
    scene = load_scene(name)
    table = branch_pose(scene.model, "workpiece", complete_coordinates(scene.machine, {}))
    nominal = evaluate(scene, grid=2).nominal_mm
    assert nominal[..., 2].min() - table[2, 3] == pytest.approx(-51.0)
    assert np.ptp(nominal.reshape(-1, 3), axis=0) == pytest.approx([550.0, 450.0, 400.0])


def test_proposed_errors_are_the_centres_of_the_proposed_ranges():
    scene = load_scene("dvf5000_proposed")
    assert set(scene.errors) <= set(scene.tolerances.own)
    for key in scene.errors:
        assert scene.errors.amplitude(key) == scene.tolerances.own[key].centre


@pytest.mark.parametrize("name", ["dvf5000_general", "dvf5000_proposed"])
def test_tolerance_scenes_cover_every_parameter(name):
    scene = load_scene(name)
    assert scene.tolerances.missing(scene.parameter_keys) == ()


def test_squareness_bends_every_layer_into_the_same_parallelogram():
    scene = load_scene("teach_squareness")
    assert list(scene.errors) == ["EC0Y"]
    field = evaluate(scene, grid=5)
    layers = field.error_um - field.error_um[:, :, :1]
    np.testing.assert_allclose(layers, 0.0, atol=1e-9)
    along_x = np.diff(field.error_um, axis=0)
    np.testing.assert_allclose(along_x, 0.0, atol=1e-9)
    y_mm = field.nominal_mm[0, :, 0, 1]
    lean = np.diff(field.error_um[0, :, 0], axis=0) / np.diff(y_mm)[:, None] * 1e3
    np.testing.assert_allclose(lean, [[-30.0, 0.0, 0.0]] * 4, atol=1e-9)


def test_squareness_shift_is_the_fixed_part_of_a_lever_of_1_3_m_and_goes_with_a_reference():
    scene = load_scene("teach_squareness")
    coordinates = complete_coordinates(scene.machine, {"Y": -225.0, "Z": -480.0})
    point = evaluate(scene, at={"Y": -225.0, "Z": -480.0}).nominal_mm
    lever = columns(scene.model, Loop.TOOL, ["EC0Y"], coordinates, point)["EC0Y"].lever_mm
    assert np.hypot(lever[0], lever[1]) == pytest.approx(1300.0, abs=5.0)
    held = replace(scene, reference={"X": 0.0, "Y": 0.0, "Z": -280.0})
    field = evaluate(held, grid=5)
    np.testing.assert_allclose(field.error_um[2, 2, 2], 0.0, atol=1e-9)
    assert statistics(field).max_um == pytest.approx(0.030 * 225.0)
    assert statistics(evaluate(scene, grid=5)).mean_um > 4.0 * statistics(field).max_um


def test_pitching_axis_has_a_lever_of_more_than_a_metre_and_abbe_s_error():
    scene = load_scene("teach_pitching_axis")
    assert list(scene.errors) == ["EAY"]
    ends = scene.errors.evaluate("EAY", np.array([-225.0, 225.0]))
    assert ends.tolist() == [-20.0, 20.0]
    coordinates = complete_coordinates(scene.machine, {"Y": [-225.0, 0.0, 225.0], "Z": -480.0})
    point = evaluate(scene, at={"Y": [-225.0, 0.0, 225.0], "Z": -480.0}).nominal_mm
    lever = columns(scene.model, Loop.TOOL, ["EAY"], coordinates, point)["EAY"].lever_mm
    assert np.hypot(lever[:, 1], lever[:, 2]).min() > 1000.0
    error = evaluate(scene, grid=5).error_um
    np.testing.assert_allclose(error[..., 0], 0.0, atol=1e-9)
    assert error[..., 2].min() < -5.0 < 5.0 < error[..., 2].max()
    stretch = error[0, -1, :, 1] - error[0, 0, :, 1]
    slope = np.diff(stretch) / 100.0 * 1e3
    np.testing.assert_allclose(slope, -40.0, atol=1e-9)


def test_wobbling_table_leaves_the_tool_loop_straight_and_bends_the_relative_one():
    scene = load_scene("teach_wobbling_table")
    assert statistics(evaluate(scene, grid=5)).max_um == 0.0
    assert statistics(evaluate(scene, grid=5, loop="relative")).max_um > 1.0


def test_wobbling_table_moves_a_traced_point_axially_once_and_radially_twice_a_turn():
    scene = load_scene("teach_wobbling_table")
    point, error = table_errors(scene, scene.trace_points_mm[0], TURN_DEG)
    outward = point[:, :2] / np.linalg.norm(point[:, :2], axis=-1, keepdims=True)
    radial = np.sum(error[:, :2] * outward, axis=-1)
    assert harmonic(radial, 2) == pytest.approx(4.0, abs=0.01)
    assert harmonic(radial, 1) < 0.01
    tilted = -15.0 * 0.275 * np.sin(np.deg2rad(TURN_DEG))
    axial = 3.0 * np.cos(np.deg2rad(TURN_DEG - 45.0))
    np.testing.assert_allclose(error[:, 2], tilted + axial, atol=0.01)
    assert harmonic(error[:, 2], 2) < 0.01
    tilt = evaluate(scene, at={"C": TURN_DEG}, loop="workpiece").orientation_urad
    np.testing.assert_allclose(np.linalg.norm(tilt, axis=-1), 15.0, atol=1e-9)


@pytest.mark.parametrize("index", [0, 1])
def test_tilted_c_keeps_circles_circles_but_tilted_and_displaced(index):
    scene = load_scene("teach_tilted_c")
    point_mm = scene.trace_points_mm[index]
    point, error = table_errors(scene, point_mm, TURN_DEG)
    actual = point + error / 1e3
    centre = actual.mean(axis=0)
    radius = np.linalg.norm(actual - centre, axis=-1)
    np.testing.assert_allclose(radius, 275.0, rtol=0, atol=1e-9)
    _, size, (*_, normal) = np.linalg.svd(actual - centre)
    assert size[2] < 1e-9
    tilt = np.arccos(np.abs(normal[2])) * 1e6
    assert tilt == pytest.approx(np.hypot(40.0, 25.0), rel=1e-3)
    displaced = (centre - point.mean(axis=0)) * 1e3
    expected = np.array([8.0, -5.0, 0.0]) + np.cross([40.0, -25.0, 0.0], [0, 0, point_mm[2]]) / 1e3
    np.testing.assert_allclose(displaced, expected, atol=1e-3)


def test_tilting_b_turns_the_error_of_the_c_axis_with_the_table():
    scene = load_scene("teach_tilted_c")
    _, level = table_errors(scene, (275.0, 0.0, 0.0), 30.0)
    _, tilted = table_errors(scene, (275.0, 0.0, 0.0), 30.0, -90.0)
    turn = transforms.axis_rotation(1, np.deg2rad(-90.0))
    np.testing.assert_allclose(tilted, transforms.rotate(turn, level), atol=1e-9)
    assert np.abs(tilted - level).max() > 1.0
