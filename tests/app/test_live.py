"""From a state to a picture: the numbers of the model, and nothing computed twice."""

import numpy as np
import pytest

from warpspace.app.evaluation.cache import Cache
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import start_state
from warpspace.app.viewport.layers.box import dashes, ghost_dashes
from warpspace.app.viewport.layers.traces import apart, is_here, trace_colours
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
    assert len(apart(lines, 0.5)) > 100
    assert len(apart(lines, 1e9)) == 0


def test_traces_at_the_present_positions_are_dark(live: LiveModel) -> None:
    picture = live.evaluate(STATE)
    here = is_here(picture.traces[0].group, dict(STATE.positions))
    assert here.any()
    assert not here.all()
    colours = trace_colours(picture)
    assert colours.shape[1:] == (2, 3)
    assert len(np.unique(colours.reshape(-1, 3), axis=0)) == 2


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
