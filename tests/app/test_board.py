"""Boards and tabs: shared states, undo, what a dropped tab leaves behind."""

import threading

import pytest

from warpspace import load_scene
from warpspace.app.server.tab_memory import (
    KEPT_SECONDS,
    KEPT_TABS,
    Keeper,
    Left,
    ask_script,
    is_token,
    new_token,
    rename_script,
)
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.history import STEPS
from warpspace.app.state.shared_state import Board

STATE = start_state(load_scene("dvf5000_first"))


def moved(key, value):
    return lambda state: state.with_amplitude(key, value)


def test_notes_are_handed_over_and_not_kept():
    board = Board(STATE)
    assert "clamped" in board.apply(moved("EAX", 1e9))[0]
    assert board.state.notes == ()
    assert board.state.amplitudes["EAX"] == 20.0


def test_undo_and_redo_name_what_they_do():
    board = Board(STATE)
    board.apply(moved("EAX", 1.0))
    assert board.undo() == "amplitudes.EAX"
    assert board.state == STATE
    assert board.redo() == "amplitudes.EAX"
    assert board.state.amplitudes["EAX"] == 1.0
    assert board.redo() == ""


def test_everybody_else_is_told():
    board, told = Board(STATE), []
    one, two = (lambda: told.append("one")), (lambda: told.append("two"))
    board.subscribe(one)
    board.subscribe(two)
    board.apply(moved("EAX", 1.0), by=one)
    assert told == ["two"]
    board.apply(lambda state: state, by=one)
    assert told == ["two"]
    board.undo()
    assert sorted(told) == ["one", "two", "two"]
    board.unsubscribe(two)
    board.redo()
    assert told.count("two") == 2


def test_a_busy_server_does_not_make_two_steps_of_one_drag():
    board = Board(STATE)
    board.apply(moved("EAX", 1.0), at=10.0)
    board.apply(moved("EAX", 2.0), at=10.3)  # however much later it is applied
    assert len(board.history.past) == 1
    board.apply(moved("EAX", 3.0), at=12.0)
    assert len(board.history.past) == 2


def test_what_raises_changes_nothing_and_blocks_nobody():
    board = Board(STATE)

    def broken(state: AppState) -> AppState:
        raise RuntimeError("a wheel came off")

    with pytest.raises(RuntimeError):
        board.apply(broken)
    board.apply(moved("EAX", 1.0))
    assert board.state.amplitudes["EAX"] == 1.0


def test_many_steer_one_board_and_nothing_is_lost():
    board = Board(STATE)
    keys = ("EXX", "EYX", "EZX", "EAX", "EBX", "ECX")

    def steer(key):
        for value in range(60):
            board.apply(moved(key, value / 10.0))

    threads = [threading.Thread(target=steer, args=(key,)) for key in keys]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(board.state.amplitudes[key] == 5.9 for key in keys)
    assert len(board.history.past) <= STEPS


def test_a_copy_goes_its_own_way():
    board = Board(STATE)
    board.apply(moved("EAX", 1.0))
    copy = board.copy()
    board.apply(moved("EAX", 2.0))
    assert copy.state.amplitudes["EAX"] == 1.0
    copy.undo()
    assert copy.state == STATE


def test_what_is_kept_is_given_back_once():
    keeper, token = Keeper(), new_token()
    left = Left(Board(STATE), None)
    keeper.keep(token, left)
    assert keeper.take(token) is left
    assert keeper.take(token) is None


def test_what_is_kept_is_bounded_in_time_and_number():
    now = [0.0]
    keeper = Keeper(clock=lambda: now[0])
    tokens = [new_token() for _ in range(KEPT_TABS + 10)]
    for token in tokens:
        keeper.keep(token, Left(Board(STATE), None))
    assert len(keeper) == KEPT_TABS
    assert keeper.take(tokens[0]) is None
    now[0] = KEPT_SECONDS + 1.0
    assert keeper.take(tokens[-1]) is None
    assert len(keeper) == 0


@pytest.mark.parametrize(
    "text", ["", "abc", "x" * 32, "0" * 33, "A" * 32, "../" * 10, "<script>", "0" * 31 + "\n"]
)
def test_what_is_no_token_is_refused(text):
    assert not is_token(text)
    keeper = Keeper()
    keeper.keep(text, Left(Board(STATE), None))
    assert len(keeper) == 0


def test_a_page_is_asked_by_name_and_may_be_renamed():
    token = new_token()
    assert is_token(token)
    assert '"some-widget"' in ask_script("some-widget")
    assert token in rename_script(token)
