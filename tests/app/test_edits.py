"""Curves and tolerances of a state: edited, clamped, reset; only and exclude in the numbers."""

from dataclasses import replace

import numpy as np
import pytest

from warpspace import load_scene
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.state import edits
from warpspace.app.state.app_state import start_state
from warpspace.app.state.history import describe_change
from warpspace.machine.errors import Constant, Harmonics, Ramp, Table
from warpspace.scene.library import parse_scene
from warpspace.scene.save import scene_to_toml

STATE = start_state(load_scene("dvf5000_first"))
LIVE = LiveModel()
SPAN = (-275.0, 275.0)


def test_a_curve_moves_amplitude_slider_and_picture():
    curve = Table(SPAN, ((-275.0, 0.0), (0.0, 30.0), (275.0, -4.0)))
    state = edits.with_curve(STATE, "EXX", curve)
    assert state.amplitudes["EXX"] == 30.0
    assert state.spans["EXX"].high >= 30.0
    assert edits.curve_of(state, "EXX") == curve
    before, after = LIVE.evaluate(STATE), LIVE.evaluate(state)
    moved = (after.field.error_um - before.field.error_um)[:, 10, 10, 0]
    np.testing.assert_allclose(moved[[0, 10, 20]], [0.0, 30.0, -4.0], atol=1e-9)


def test_the_slider_scales_the_curve():
    curve = Harmonics(SPAN, ((1.0, 4.0, 30.0),))
    state = edits.with_curve(STATE, "EXX", curve).with_amplitude("EXX", 8.0)
    assert edits.curve_of(state, "EXX").amplitude == pytest.approx(8.0)


def test_a_constant_parameter_takes_constants_only():
    state = edits.with_curve(STATE, "EC0Y", Ramp((-225.0, 225.0), 3.0))
    assert state.amplitudes == STATE.amplitudes
    assert "constant" in state.notes[0]
    assert edits.with_curve(STATE, "EC0Y", Constant((-225.0, 225.0), 3.0)).amplitudes["EC0Y"] == 3.0


def test_the_present_curve_changes_nothing():
    assert edits.with_curve(STATE, "EAX", edits.curve_of(STATE, "EAX")) is STATE


def test_reset_brings_curves_back_and_forgets_that_any_was_edited():
    state = edits.with_curve(STATE, "EAX", Constant(SPAN, 3.0))
    state = edits.with_curve(state, "EAY", Constant((-225.0, 225.0), 2.0))
    assert state.origin is STATE.scene
    half = state.reset("X")
    assert edits.curve_of(half, "EAX") == edits.curve_of(STATE, "EAX")
    assert edits.curve_of(half, "EAY") == Constant((-225.0, 225.0), 2.0)
    whole = half.reset()
    assert whole.scene is STATE.scene
    assert whole.loaded is None


def test_an_edited_scene_saves_and_reloads():
    scene = edits.with_curve(STATE, "EXX", Harmonics(SPAN, ((1.0, 4.0, 30.0),))).scene
    assert parse_scene(scene_to_toml(scene), scene.name) == scene


@pytest.mark.parametrize(
    ("given", "kept"), [(3.0, 3.0), (-5.0, 0.0), (1e9, 1000.0), (float("nan"), 20.0)]
)
def test_half_widths_are_clamped_and_the_centre_stays(given, kept):
    state = edits.with_half_width(STATE, "EAX", given)
    assert edits.half_width_of(state, "EAX") == kept
    assert bool(state.notes) == (given != kept)
    proposed = start_state(load_scene("dvf5000_proposed"))
    assert edits.with_half_width(proposed, "EAX", 1.0).tolerances.get("EAX").centre == -8.0


def test_tolerances_go_back_to_the_scene():
    state = edits.with_half_width(STATE, "EAX", 3.0)
    assert edits.with_scene_tolerances(state).tolerances == STATE.scene.tolerances


def test_unknown_keys_change_nothing():
    assert edits.with_excluded(STATE, "EXA", True) is STATE
    assert edits.with_only(STATE, "EXA", True) is STATE
    assert edits.with_half_width(STATE, "EXA", 1.0).tolerances == STATE.tolerances
    assert edits.with_curve(STATE, "EXA", Constant(SPAN, 1.0)).amplitudes == STATE.amplitudes


def test_solo_draws_one_error_alone_and_mute_leaves_it_out():
    alone = LIVE.evaluate(edits.with_only(STATE, "EC0Y", True))
    without = LIVE.evaluate(edits.with_excluded(STATE, "EC0Y", True))
    whole = LIVE.evaluate(STATE)
    np.testing.assert_allclose(
        alone.field.error_um + without.field.error_um, whole.field.error_um, atol=1e-9
    )
    assert alone.state.amplitudes == STATE.amplitudes
    assert edits.include_all(without.state) == STATE


@pytest.mark.parametrize("limit", [float("nan"), float("inf"), -3.0, 1e9])
def test_the_specification_is_clamped(limit):
    wanted = STATE.specification.with_limit(limit)
    assert 1.0 <= wanted.limit_um <= 300.0
    assert wanted.with_over("<script>") == wanted
    assert wanted.with_distribution("cauchy") == wanted


def test_a_change_of_a_curve_has_a_name():
    state = edits.with_curve(STATE, "EXX", Constant(SPAN, 3.0))
    assert "amplitudes.EXX" in describe_change(STATE, state)
    assert describe_change(STATE, replace(STATE, nodes=11)) == "nodes"
