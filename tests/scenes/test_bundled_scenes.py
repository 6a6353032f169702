"""Every bundled scene loads and evaluates, and what its description says is true of its numbers."""

import re
from dataclasses import replace

import numpy as np
import pytest

from warpspace import evaluate, load_scene
from warpspace.analysis.note_tables import note_numbers, stale_remark
from warpspace.analysis.statistics import statistics
from warpspace.app.documents.scene_file import reopened
from warpspace.app.state.app_state import start_state
from warpspace.kinematics.chain import branch_pose, columns
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.scene.library import scene_names, scene_path
from warpspace.scene.model import second_order
from warpspace.scene.notes import KINDS, story

SCENES = scene_names()


@pytest.mark.parametrize("name", SCENES)
def test_bundled_scene_loads_without_remarks_and_says_what_it_is(name):
    scene = load_scene(name)
    assert scene.name == name
    assert scene.title not in ("", name)
    assert len(scene.description) > 40
    # but for rotary axes that follow a publication
    turned = [axis for axis in scene.machine.axes if scene.machine.sense(axis) < 0]
    assert not any(scene.machine.axes[axis].is_linear for axis in turned)
    assert len(scene.notes) == len(turned)
    for axis, note in zip(turned, scene.notes, strict=True):
        assert note.startswith(f"machine.direction.{axis} = ")
        assert note.endswith("against ISO 841")
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
    assert set(scene.errors) <= set(scene.tolerances.individual)
    for key in scene.errors:
        assert scene.errors.amplitude(key) == scene.tolerances.individual[key].centre


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


def test_the_review_tells_the_measured_machine_in_six_steps_whose_numbers_hold():
    scene = load_scene("review_dvf5000")
    assert scene.errors == load_scene("dvf5000_first").errors
    steps = story(scene.review)
    assert [one.step for one in steps] == [1, 2, 3, 4, 5, 6]
    assert {one.kind for one in steps} == set(KINDS)
    assert not any(map(stale_remark, steps, note_numbers(scene, steps)))
    errors = scene.errors.with_amplitude("EA0Z", 20.2, (-480.0, -80.0))
    (shimmed,) = note_numbers(replace(scene, errors=errors), steps[2:3])
    said = re.findall(r"to ([\d.]+) µm", steps[2].text)
    assert said == [f"{shimmed[name]:.1f}" for name in ("mean_um", "here_um", "max_um")]
    start = start_state(scene)
    for one in steps:
        found, camera = reopened(start, one)
        assert found.notes == ()
        assert camera is not None
        assert found.amplitudes["EA0Z"] == (20.2 if "EA0Z=20.2" in one.view else 33.9)


def test_wobbling_table_leaves_the_tool_loop_straight_and_bends_the_relative_one():
    scene = load_scene("teach_wobbling_table")
    assert statistics(evaluate(scene, grid=5, loop="tool")).max_um == 0.0
    assert statistics(evaluate(scene, grid=5)).max_um > 1.0
