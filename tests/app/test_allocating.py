"""Allocation from a state of the app: what it takes over, what it refuses, how it is undone."""

import threading
from dataclasses import replace

import pytest

from warpspace import load_scene
from warpspace.app.evaluation.allocation import allocate_tolerances, with_allocated
from warpspace.app.evaluation.probability import build_ensemble, estimate
from warpspace.app.readouts.probability import spell_allocation, spell_tolerance
from warpspace.app.state import edits
from warpspace.app.state.app_state import start_state
from warpspace.app.state.specification import Specification, read_costs
from warpspace.app.state.spelling import Unreadable
from warpspace.app.state.store import StateStore
from warpspace.exceptions import OptionError
from warpspace.machine.parameters import parameter

FIRST = load_scene("dvf5000_first")
KEYS = ("EXX", "EYX", "EA0Z")


@pytest.fixture(scope="module")
def ensemble():
    return build_ensemble(FIRST)


def state_with(**changes):
    return replace(start_state(FIRST), specification=Specification(40.0, **changes))


def allocated(state, ensemble):
    found = allocate_tolerances(state, ensemble, threading.Event(), lambda _: None)
    assert found is not None
    return found


def test_the_probability_on_the_page_reaches_what_was_wanted(ensemble):
    state = state_with(percent=98.0, fixed=frozenset({"EA0Z"}), costs="EB0Z=9")
    done = []
    found = allocate_tolerances(state, ensemble, threading.Event(), done.append)
    assert found is not None
    assert sum(done) == pytest.approx(1.0)
    after = with_allocated(state, state, found)
    shown = estimate(ensemble, after.tolerances, 40.0).probability.probability
    assert 0.98 <= shown < 0.985
    assert after.notes == ()
    assert edits.half_width_of(after, "EA0Z") == 25.0
    assert "EA0Z" not in found.tolerances
    assert edits.half_width_of(after, "EB0Z") > 1.3 * edits.half_width_of(after, "EC0Y")


def test_it_is_one_change_and_one_undo(ensemble):
    store = StateStore(state_with())
    asked = store.state
    found = allocated(asked, ensemble)
    store.apply(lambda state: with_allocated(state, asked, found))
    assert store.state.tolerances != asked.tolerances
    store.undo()
    assert store.state == asked


def test_what_was_changed_meanwhile_is_not_overwritten(ensemble):
    asked = state_with()
    found = allocated(asked, ensemble)
    moved = edits.with_half_width(asked, "EXX", 3.0)
    kept = with_allocated(moved, asked, found)
    assert kept.tolerances == moved.tolerances
    assert "allocate again" in kept.notes[0]
    # an error that was moved is none of its inputs
    other = with_allocated(asked.with_amplitude("EXX", 2.0), asked, found)
    assert other.tolerances != asked.tolerances


def test_it_can_be_cancelled_before_and_during_the_work(ensemble):
    cancelled = threading.Event()

    def cancel(_):
        cancelled.set()

    assert allocate_tolerances(state_with(), ensemble, cancelled, cancel) is None
    assert allocate_tolerances(state_with(), ensemble, cancelled, lambda _: None) is None


def test_keys_of_another_machine_are_left_out(ensemble):
    state = state_with(fixed=frozenset({"EXA"}), costs="EYA=3")
    assert allocated(state, ensemble).wish.fixed == frozenset()


def test_without_tolerances_there_is_nothing_to_allocate():
    scene = load_scene("dvf5000_nominal")
    with pytest.raises(OptionError, match="nothing to allocate"):
        allocated(start_state(scene), build_ensemble(scene))


def test_scaling_leaves_fixed_and_zero_ones_and_ends_at_the_widest():
    state = edits.with_fixed(start_state(FIRST), "EXX", True)
    state = edits.with_half_width(state, "EYX", 0.0)
    scaled = edits.with_scaled_tolerances(state, KEYS, 1.5)
    assert [edits.half_width_of(scaled, key) for key in KEYS] == [10.0, 0.0, 37.5]
    assert edits.half_width_of(scaled, "EZX") == 10.0
    for _ in range(20):
        scaled = edits.with_scaled_tolerances(scaled, KEYS, 1.5)
    assert edits.half_width_of(scaled, "EA0Z") == 1000.0


def test_a_slider_reaches_what_was_allocated():
    state = edits.with_half_widths(start_state(FIRST), {"EA0Z": 61.7})
    assert edits.half_width_span(state, "EA0Z").high == 100.0
    assert state.tolerances.get("EA0Z").centre == FIRST.tolerances.get("EA0Z").centre


@pytest.mark.parametrize(
    ("text", "costs"),
    [
        ("", {}),
        ("exx=2", {"EXX": 2.0}),
        ("EXX 2; EYX = 0.5\nEA0Z 1e3", {"EXX": 2.0, "EYX": 0.5, "EA0Z": 1000.0}),
        (" , ,", {}),
    ],
)
def test_costs_are_read(text, costs):
    assert read_costs(text, KEYS) == costs


@pytest.mark.parametrize(
    "text", ["EXX", "EXX=2=3", "EXQ 2", "EXX nan", "EXX 0", "EXX -1", "EXX 9e9"]
)
def test_costs_that_mean_nothing_are_refused_with_their_text(text):
    with pytest.raises(Unreadable, match=text.split("=")[0].split()[0]):
        read_costs(text, KEYS)
    state = edits.with_costs(start_state(FIRST), "EXX 2")
    kept = edits.with_costs(state, text)
    assert kept.specification.costs == "EXX=2"
    assert "costs stay as they were" in kept.notes[0]


def test_hostile_numbers_and_keys_change_nothing():
    state = start_state(FIRST)
    assert edits.with_fixed(state, "<script>", True) == state
    wanted = state.specification
    assert wanted.with_percent(float("nan")).percent == 95.0
    assert wanted.with_percent(1e9).percent == pytest.approx(99.99)
    assert wanted.with_percent(-1.0).percent == 50.0


def test_readouts_say_probability_cost_and_state(ensemble):
    found = allocated(state_with(), ensemble)
    text = spell_allocation(found)
    assert f"{100.0 * found.after.probability:.1f} %" in text
    assert "21 tolerances" in text
    row = spell_tolerance(
        parameter("EXX"), 0.25, 0.5, fixed=True, button=lambda word: f"data-word={word}"
    )
    assert 'aria-checked="true"' in row
    assert "25.0 %" in row
    assert "--share:0.500" in row
