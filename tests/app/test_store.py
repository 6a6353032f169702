"""A state that one tab or several steer: nothing is lost, undo, copies."""

import threading

import pytest

from warpspace import load_scene
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.history import STEPS
from warpspace.app.state.store import StateStore

STATE = start_state(load_scene("dvf5000_first"))


def moved(key, value):
    return lambda state: state.with_amplitude(key, value)


def test_notes_are_handed_over_and_not_kept():
    store = StateStore(STATE)
    assert "clamped" in store.apply(moved("EAX", 1e9))[0]
    assert store.state.notes == ()
    assert store.state.amplitudes["EAX"] == 20.0


def test_undo_and_redo_name_what_they_do():
    store = StateStore(STATE)
    store.apply(moved("EAX", 1.0))
    assert store.undo() == "amplitudes.EAX"
    assert store.state == STATE
    assert store.redo() == "amplitudes.EAX"
    assert store.state.amplitudes["EAX"] == 1.0
    assert store.redo() == ""


def test_everybody_else_is_told():
    store, told = StateStore(STATE), []
    one, two = (lambda: told.append("one")), (lambda: told.append("two"))
    store.subscribe(one)
    store.subscribe(two)
    store.apply(moved("EAX", 1.0), by=one)
    assert told == ["two"]
    store.apply(lambda state: state, by=one)
    assert told == ["two"]
    store.undo()
    assert sorted(told) == ["one", "two", "two"]
    store.unsubscribe(two)
    store.redo()
    assert told.count("two") == 2


def test_a_busy_server_does_not_make_two_steps_of_one_drag():
    store = StateStore(STATE)
    store.apply(moved("EAX", 1.0), at=10.0)
    store.apply(moved("EAX", 2.0), at=10.3)  # however much later it is applied
    assert len(store.history.past) == 1
    store.apply(moved("EAX", 3.0), at=12.0)
    assert len(store.history.past) == 2


def test_what_raises_changes_nothing_and_blocks_nobody():
    store = StateStore(STATE)

    def broken(state: AppState) -> AppState:
        raise RuntimeError("a wheel came off")

    with pytest.raises(RuntimeError):
        store.apply(broken)
    store.apply(moved("EAX", 1.0))
    assert store.state.amplitudes["EAX"] == 1.0


def test_many_steer_one_store_and_nothing_is_lost():
    store = StateStore(STATE)
    keys = ("EXX", "EYX", "EZX", "EAX", "EBX", "ECX")

    def steer(key):
        for value in range(60):
            store.apply(moved(key, value / 10.0))

    threads = [threading.Thread(target=steer, args=(key,)) for key in keys]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(store.state.amplitudes[key] == 5.9 for key in keys)
    assert len(store.history.past) <= STEPS


def test_a_copy_goes_its_own_way():
    store = StateStore(STATE)
    store.apply(moved("EAX", 1.0))
    copy = store.copy()
    store.apply(moved("EAX", 2.0))
    assert copy.state.amplitudes["EAX"] == 1.0
    copy.undo()
    assert copy.state == STATE
