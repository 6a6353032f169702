"""From a state to a picture: the numbers of the model, and nothing computed twice."""

from dataclasses import replace

import numpy as np
import pytest

from warpspace.analysis.circles import fit_circle
from warpspace.app.evaluation.cache import Cache
from warpspace.app.evaluation.chosen_trace import chosen_trace, motion_of, moved_traces
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import start_state
from warpspace.app.viewport.layers.box import dashes, ghost_dashes
from warpspace.app.viewport.layers.traces import apart, name_place
from warpspace.field.evaluate import evaluate_first_order
from warpspace.kinematics.model import Loop
from warpspace.machine.errors import ErrorSet
from warpspace.scene.library import load_scene
from warpspace.scene.pipeline import evaluate

SCENE = load_scene("dvf5000_first")
STATE = start_state(SCENE)


@pytest.fixture(scope="module")
def live() -> LiveModel:
    return LiveModel()


@pytest.fixture(scope="module")
def picture(live: LiveModel) -> LivePicture:
    return live.evaluate(STATE)


def test_field_is_that_of_the_scene(picture: LivePicture) -> None:
    np.testing.assert_allclose(picture.field.error_um, evaluate(SCENE, grid=21).error_um, atol=1e-9)


def test_moved_slider_gives_the_field_of_the_changed_set(live: LiveModel) -> None:
    state = STATE.with_amplitude("EXX", 7.0).with_amplitude("EAY", 10.0).with_nodes(5)
    changed: ErrorSet = SCENE.errors
    for key, value in (("EXX", 7.0), ("EAY", 10.0)):
        changed = changed.with_amplitude(key, value, (0.0, 1.0))
    picture = live.evaluate(state)
    wanted = evaluate_first_order(SCENE.model, changed, picture.grid.coordinates)
    np.testing.assert_allclose(picture.field.error_um, wanted.error_um, atol=1e-9)


def test_exaggeration_auto_number_and_true_scale(live: LiveModel, picture: LivePicture) -> None:
    assert picture.exaggeration == 1000.0
    for factor in (1.0, 250.0):
        drawn = live.evaluate(STATE.with_exaggeration(factor))
        shift = drawn.drawn_mm - drawn.grid.nominal_mm
        np.testing.assert_allclose(shift, factor * 1e-3 * picture.field.error_um, atol=1e-9)


def test_component_chooses_values_and_scale(live: LiveModel) -> None:
    picture = live.evaluate(STATE.with_component("y"))
    np.testing.assert_array_equal(picture.values, picture.field.error_um[..., 1])
    assert picture.scale.diverging
    assert picture.scale.high >= np.abs(picture.values).max()


def test_response_is_kept_until_grid_place_or_loop_change(live: LiveModel) -> None:
    kept = live.response(STATE)
    assert live.response(STATE.with_amplitude("EXX", 3.0)) is kept
    assert live.response(STATE.with_component("x")) is kept
    for other in (
        STATE.with_nodes(5),
        STATE.with_position("B", -20.0),
        STATE.with_loop("relative"),
    ):
        assert live.response(other) is not kept


def test_rotary_positions_matter_in_the_relative_loop(live: LiveModel) -> None:
    tilted = start_state(load_scene("teach_tilted_c")).with_nodes(3)
    assert tilted.loop is Loop.RELATIVE
    here = live.evaluate(tilted).field.error_um
    there = live.evaluate(tilted.with_position("B", -90.0)).field.error_um
    assert np.abs(here - there).max() > 1.0


def test_scene_without_errors_is_drawn_where_it_is_nominal(live: LiveModel) -> None:
    picture = live.evaluate(start_state(load_scene("dvf5000_nominal"), nodes=5))
    assert picture.statistics.max_um == 0.0
    np.testing.assert_array_equal(picture.drawn_mm, picture.grid.nominal_mm)


def test_traces_are_displaced_by_the_workpiece_loop(live: LiveModel) -> None:
    picture = live.evaluate(start_state(load_scene("teach_tilted_c"), nodes=3))
    lines = picture.traces[0]
    shift = np.linalg.norm(lines.actual_mm - lines.nominal_mm, axis=-1)
    assert shift.max() > 1.0
    assert len(apart(lines.nominal_mm, lines.actual_mm, 0.5)) > 100
    assert len(apart(lines.nominal_mm, lines.actual_mm, 1e9)) == 0


def test_trace_is_named_outside_of_its_largest_error(live: LiveModel) -> None:
    picture = live.evaluate(start_state(load_scene("teach_wobbling_table"), nodes=3))
    line = moved_traces(picture)[chosen_trace(picture)]
    place, largest = name_place(line, 1000.0)
    assert largest == pytest.approx(line.largest_um)
    gaps = np.linalg.norm(line.actual_mm - place, axis=-1)
    assert gaps.min() == pytest.approx(30.0, rel=1e-3)
    middle = line.actual_mm.mean(axis=0)
    farthest = np.linalg.norm(line.actual_mm - middle, axis=-1).max()
    assert np.linalg.norm(place - middle) > farthest


def test_traces_that_no_error_moves_are_not_drawn(live: LiveModel) -> None:
    assert live.evaluate(STATE).traces
    assert moved_traces(live.evaluate(STATE)) == {}
    assert chosen_trace(live.evaluate(STATE)) == ""
    moved = live.evaluate(STATE.with_amplitude("EXC", 2.0).with_nodes(3))
    assert set(moved_traces(moved)) == {
        *(f"C at B {b}°, point (275, 0, 0) mm" for b in ("−30", "0", "30")),
        "B at C 0°, point (275, 0, 0) mm",
        *(f"C at B {b}°, point (0, 275, 450) mm" for b in ("−30", "0", "30")),
        "B at C 0°, point (0, 275, 450) mm",
    }
    assert chosen_trace(moved) == "C at B 0°, point (275, 0, 0) mm"
    assert moved_traces(live.evaluate(moved.state.with_shown(traces=False))) == {}


def test_chosen_trace_stays_as_long_as_it_is_moved(live: LiveModel) -> None:
    name = "C at B −30°, point (0, 275, 450) mm"
    state = STATE.with_amplitude("EXC", 2.0).with_nodes(3)
    chosen = replace(state, rotary=state.rotary.with_chosen(name))
    assert live.response(chosen) is live.response(state)
    assert chosen_trace(live.evaluate(chosen)) == name
    without = replace(chosen, rotary=chosen.rotary.with_point(1, on=False))
    assert chosen_trace(live.evaluate(without)) == "C at B 0°, point (275, 0, 0) mm"
    hostile = replace(state, rotary=state.rotary.with_chosen("<script>" * 1000))
    assert len(hostile.rotary.chosen) == 200
    assert chosen_trace(live.evaluate(hostile)) == "C at B 0°, point (275, 0, 0) mm"


def test_motion_of_the_chosen_axis_is_that_of_the_state(live: LiveModel) -> None:
    picture = live.evaluate(start_state(load_scene("teach_wobbling_table"), nodes=3))
    moved = moved_traces(picture)
    line = moved[chosen_trace(picture, moved)]
    motion = motion_of(picture, line)
    assert motion is not None
    assert [m.times_a_turn for m in motion.motions] == [2, 1, 1]  # runs out twice, tilts once
    assert [m.peak_to_valley for m in motion.motions] == pytest.approx([8.0, 6.0, 30.0], rel=1e-3)
    # the trace of the point itself: radial as such, axial less radius times tilt
    centre, radius, normal = fit_circle(line.nominal_mm)
    outwards = (line.nominal_mm - centre) / radius
    at = line.trace.axis
    sweep = picture.traces[0].group.coordinates[at][
        picture.traces[0].group.traces.index(line.trace)
    ]
    radial = np.interp(sweep, motion.angle_deg, motion.radial.values)
    face = motion.axial.values - 1e-3 * radius * motion.tilt.values
    np.testing.assert_allclose(np.sum(line.error_um * outwards, axis=-1), radial, atol=0.02)
    np.testing.assert_allclose(
        line.error_um @ normal, np.interp(sweep, motion.angle_deg, face), atol=0.02
    )


def test_motion_without_the_error_that_tilts_has_no_tilt(live: LiveModel) -> None:
    state = start_state(load_scene("teach_wobbling_table"), nodes=3)
    quiet = state.with_amplitude("EAC", 0.0).with_amplitude("EBC", 0.0)
    picture = live.evaluate(quiet)
    moved = moved_traces(picture)
    motion = motion_of(picture, moved[chosen_trace(picture, moved)])
    assert motion is not None
    assert motion.tilt.peak_to_valley == pytest.approx(0.0, abs=1e-9)
    assert motion.tilt.times_a_turn is None
    assert motion.radial.motion_value == pytest.approx(8.0, rel=1e-3)


def test_dashes_begin_and_end_at_the_corners(picture: LivePicture) -> None:
    found = dashes(np.array([[[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]]]), 12.0, 8.0)
    assert found[0, 0, 0] == 0.0
    assert found[-1, 1, 0] == pytest.approx(100.0)
    assert (np.diff(found[..., 0].reshape(-1)) > 0.0).all()
    drawn = ghost_dashes(picture).reshape(-1, 3)
    nominal = picture.grid.nominal_mm.reshape(-1, 3)
    np.testing.assert_allclose(drawn.min(axis=0), nominal.min(axis=0), atol=1e-3)
    np.testing.assert_allclose(drawn.max(axis=0), nominal.max(axis=0), atol=1e-3)


def test_kept_results_are_dropped_oldest_first() -> None:
    kept: Cache[str] = Cache(10)
    built: list[str] = []

    def build(name: str) -> str:
        built.append(name)
        return name

    for name in "abacb":
        kept.get(name, lambda name=name: build(name), lambda _: 5)
    assert built == ["a", "b", "c", "b"]
