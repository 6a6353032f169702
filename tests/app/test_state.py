"""The state of a session: pure updates, and nothing wild gets in."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from warpspace.app.state.app_state import EXAGGERATION, NODES, AppState, start_state
from warpspace.app.state.ranges import amplitude_span, round_up
from warpspace.kinematics.model import Loop
from warpspace.machine.tolerances import Tolerance
from warpspace.scene.library import load_scene, scene_names

FIRST = start_state(load_scene("dvf5000_first"))
ANY_NUMBER = st.floats(allow_nan=True, allow_infinity=True)


def test_starts_as_the_scene_says() -> None:
    assert FIRST.amplitudes["EAY"] == -43.7
    assert len(FIRST.amplitudes) == 41
    assert FIRST.positions == {"B": 0.0, "C": 0.0}
    assert FIRST.exaggeration is None
    assert FIRST.loop is Loop.TOOL


@pytest.mark.parametrize("name", scene_names())
def test_every_start_lies_within_the_ranges_of_its_controls(name: str) -> None:
    state = start_state(load_scene(name))
    for key, value in state.amplitudes.items():
        span = state.spans[key]
        assert span.low <= value <= span.high
        assert 0.0 < span.step < span.high
    for axis, value in state.positions.items():
        assert state.position_spans[axis].low <= value <= state.position_spans[axis].high


def test_a_scene_with_errors_of_the_table_only_starts_in_the_relative_loop() -> None:
    assert start_state(load_scene("teach_tilted_c")).loop is Loop.RELATIVE
    assert start_state(load_scene("dvf5000_nominal")).loop is Loop.TOOL


def test_updates_leave_the_old_state_alone() -> None:
    moved = FIRST.with_amplitude("EXX", 4.0)
    assert (FIRST.amplitudes["EXX"], moved.amplitudes["EXX"]) == (0.0, 4.0)
    assert moved.notes == ()
    assert moved.changed_keys == ("EXX",)
    assert list(moved.amplitudes) == list(FIRST.amplitudes)


@given(ANY_NUMBER)
def test_any_amplitude_is_brought_into_its_range(value: float) -> None:
    span = FIRST.spans["EAX"]
    state = FIRST.with_amplitude("EAX", value)
    kept = state.amplitudes["EAX"]
    assert span.low <= kept <= span.high
    assert bool(state.notes) is (kept != value)


@given(ANY_NUMBER)
def test_any_factor_density_and_position_is_brought_into_its_range(value: float) -> None:
    factor = FIRST.with_exaggeration(value).exaggeration
    assert factor is None or EXAGGERATION.low <= factor <= EXAGGERATION.high
    nodes = FIRST.with_nodes(value).nodes
    assert NODES.low <= nodes <= NODES.high
    assert nodes % 2 == 1
    assert -120.0 <= FIRST.with_position("B", value).positions["B"] <= 30.0


def test_what_is_no_number_leaves_the_value_as_it_was_and_says_so() -> None:
    state = FIRST.with_amplitude("EAY", math.nan)
    assert state.amplitudes["EAY"] == -43.7
    assert "EAY = nan" in state.notes[0]
    assert FIRST.with_exaggeration(math.nan).exaggeration is None
    assert FIRST.with_exaggeration(math.nan).notes


@pytest.mark.parametrize(
    "state",
    [
        FIRST.with_amplitude("QQQ", 1.0),
        FIRST.with_position("A", 1.0),
        FIRST.with_component("w"),
        FIRST.with_loop("loop"),
    ],
)
def test_unknown_names_change_nothing_and_are_noted(state: AppState) -> None:
    assert state.without_notes() == FIRST
    assert state.notes


def test_reset_and_zero_of_one_axis_and_of_all() -> None:
    edited = FIRST.with_amplitude("EAY", 10.0).with_amplitude("EXX", 5.0)
    assert edited.reset("X").changed_keys == ("EAY",)
    assert edited.reset().amplitudes == FIRST.amplitudes
    assert edited.zeroed("Y").amplitudes["EAY"] == 0.0
    assert edited.zeroed("Y").amplitudes["EXX"] == 5.0
    assert not any(edited.zeroed().amplitudes.values())


def test_another_scene_keeps_how_it_is_looked_at() -> None:
    state = FIRST.with_component("z").with_nodes(11).with_shown(traces=False)
    other = state.with_scene(load_scene("dvf5000_second"))
    assert (other.component, other.nodes, other.shown.traces) == ("z", 11, False)
    assert other.amplitudes["EAY"] != FIRST.amplitudes["EAY"]


def test_slider_range_holds_tolerance_and_twice_the_value() -> None:
    assert amplitude_span("EXX", 0.0, None).high == 20.0
    assert amplitude_span("EAX", 0.0, None).high == 50.0
    assert amplitude_span("EAX", 0.0, Tolerance(-8.0, 6.0)).high == 20.0
    assert amplitude_span("EAY", -43.7, Tolerance(0.0, 20.0)).high == 100.0
    assert amplitude_span("EXX", 0.0, Tolerance(0.0, 0.0)).high == 20.0


@given(st.floats(min_value=1e-6, max_value=1e9))
def test_round_up_gives_the_next_round_number(value: float) -> None:
    found = round_up(value)
    assert value * (1 - 1e-8) <= found <= 2.5 * value * (1 + 1e-8)
    assert f"{found:e}"[0] in "125"
