"""Conventions: every choice is applied, measured against the scene's own, and undone."""

import numpy as np
import pytest

from warpspace.app.conventions import (
    Effects,
    choices,
    chosen,
    with_choice,
    with_own_conventions,
    with_reference,
)
from warpspace.app.conventions_text import switchboard_html
from warpspace.app.live import LiveModel
from warpspace.app.state import start_state
from warpspace.scene.library import load_scene

LIVE = LiveModel()
START = start_state(load_scene("dvf5000_first"), nodes=7)


@pytest.mark.parametrize("choice", choices(START))
def test_every_choice_can_be_made_and_measures_its_change(choice: str) -> None:
    state = with_choice(START, choice)
    assert choice in chosen(state)
    effect = Effects().of(START)[choice]
    change = LIVE.frame(state).field.error_um - LIVE.frame(START).field.error_um
    length = np.linalg.norm(change, axis=-1)
    assert effect.mean_um == pytest.approx(float(length.mean()), abs=1e-9)
    assert effect.max_um == pytest.approx(float(length.max()), abs=1e-9)


def test_nonsense_changes_nothing() -> None:
    for word in ("", "loop=all", "direction Q=1", "direction C=2", "reference=<b>", "x" * 500):
        assert with_choice(START, word) is START


def test_a_reference_is_held_still_clamped_and_taken_back() -> None:
    state = with_reference(START, {"X": 0.0, "Y": 0.0, "Z": -280.0})
    frame = LIVE.frame(state)
    assert np.abs(frame.field.error_um[3, 3, 3]).max() < 1e-9
    assert with_own_conventions(state) == START
    wild = with_reference(START, {"X": 1e9, "Y": float("nan")})
    assert wild.scene.reference is not None
    assert wild.scene.reference["X"] == 275.0
    assert wild.scene.reference["Y"] == 0.0
    assert len(wild.notes) == 2


def test_reset_of_the_errors_keeps_the_conventions() -> None:
    state = with_choice(START, "component_errors=before_motion").with_amplitude("EAX", 1.0)
    assert "component_errors=before_motion" in chosen(state.reset())
    assert state.reset().amplitudes == START.amplitudes


def test_the_effect_of_all_choices_is_that_of_the_state() -> None:
    state = with_choice(with_choice(START, "component_errors=before_motion"), "loop=workpiece")
    change = LIVE.frame(state).field.error_um - LIVE.frame(START).field.error_um
    found = Effects().of(state)["all"]
    assert found.max_um == pytest.approx(float(np.linalg.norm(change, axis=-1).max()))


def test_the_switchboard_marks_what_is_in_force() -> None:
    state = with_choice(START, "loop=relative")
    text = switchboard_html(state, {}, lambda word, role: f'role="{role}"')
    assert 'data-choice="loop=relative" aria-checked="true"' in text
    assert 'data-choice="loop=tool" aria-checked="false"' in text
