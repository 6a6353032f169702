"""Undo and redo: every change can be taken back, a drag is one step, memory is bounded."""

from dataclasses import dataclass, field, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from warpspace.app.state.history import SAME_STEP_S, History, describe_change


@dataclass(frozen=True)
class Inner:
    dark: bool = False


@dataclass(frozen=True)
class State:
    values: dict[str, float] = field(default_factory=lambda: {"EAX": 0.0, "EBX": 0.0})
    component: str = "norm"
    inner: Inner = Inner()

    def at(self, key, value):
        return replace(self, values={**self.values, key: value})


def test_a_drag_is_one_step():
    history = History(State())
    for tick in range(40):
        history = history.push(State().at("EAX", tick + 1.0), at=tick * 0.05)
    assert len(history.past) == 1
    assert history.undo().present == State()
    assert history.undo().redo().present == State().at("EAX", 40.0)


def test_a_pause_and_another_slider_begin_another_step():
    history = History(State()).push(State().at("EAX", 1.0), 0.0)
    later = history.push(State().at("EAX", 2.0), SAME_STEP_S + 0.1)
    assert len(later.past) == 2
    other = history.push(history.present.at("EBX", 1.0), 0.01)
    assert other.undoes == "values.EBX"
    assert other.undo().undoes == "values.EAX"


def test_the_same_state_is_no_step():
    history = History(State())
    assert history.push(State(), 1.0) is history


def test_a_change_after_undo_forgets_the_future():
    history = History(State()).push(State().at("EAX", 1.0), 0.0).undo()
    assert history.redoes == "values.EAX"
    history = history.push(State().at("EAX", 3.0), 0.1)
    assert history.redo() is history
    assert history.undo().present == State()


def test_the_past_is_bounded():
    history = History(State(), limit=10)
    for tick in range(50):
        history = history.push(State().at("EAX", tick + 1.0), at=10.0 * tick)
    assert len(history.past) == 10


def test_nothing_to_undo_or_redo_changes_nothing():
    history = History(State())
    assert history.undo() is history
    assert history.redo() is history


@pytest.mark.parametrize(
    ("new", "what"),
    [
        (State(), ""),
        (State(component="x"), "component"),
        (State(inner=Inner(dark=True)), "inner.dark"),
        (State().at("EAX", 1.0).at("EBX", 2.0), "values.EAX, values.EBX"),
    ],
)
def test_changes_are_named(new, what):
    assert describe_change(State(), new) == what


@given(
    st.lists(
        st.one_of(
            st.tuples(st.sampled_from(["EAX", "EBX"]), st.integers(-3, 3)),
            st.sampled_from(["undo", "redo"]),
        ),
        max_size=40,
    )
)
def test_undo_and_redo_are_inverse(actions):
    history, at = History(State()), 0.0
    for action in actions:
        at += 1.0
        if action == "undo":
            history = history.undo()
        elif action == "redo":
            history = history.redo()
        else:
            history = history.push(history.present.at(action[0], float(action[1])), at)
    if history.past:
        assert history.undo().redo().present == history.present
    back = history
    while back.past:
        back = back.undo()
    assert back.present == State()
