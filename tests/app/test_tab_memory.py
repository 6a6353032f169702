"""What a dropped tab leaves behind, and how it is known again."""

import pytest

from warpspace import load_scene
from warpspace.app.browser.arrivals import ask_script, rename_script
from warpspace.app.server.tab_memory import (
    KEPT_SECONDS,
    KEPT_TABS,
    TabMemory,
    TabRecord,
    is_token,
    new_token,
)
from warpspace.app.state.app_state import start_state
from warpspace.app.state.store import StateStore

STATE = start_state(load_scene("dvf5000_first"))


def test_what_is_kept_is_given_back_once():
    memory, token = TabMemory(), new_token()
    left = TabRecord(StateStore(STATE), None)
    memory.keep(token, left)
    assert memory.take(token) is left
    assert memory.take(token) is None


def test_what_is_kept_is_bounded_in_time_and_number():
    now = [0.0]
    memory = TabMemory(clock=lambda: now[0])
    tokens = [new_token() for _ in range(KEPT_TABS + 10)]
    for token in tokens:
        memory.keep(token, TabRecord(StateStore(STATE), None))
    assert len(memory) == KEPT_TABS
    assert memory.take(tokens[0]) is None
    now[0] = KEPT_SECONDS + 1.0
    assert memory.take(tokens[-1]) is None
    assert len(memory) == 0


@pytest.mark.parametrize(
    "text", ["", "abc", "x" * 32, "0" * 33, "A" * 32, "../" * 10, "<script>", "0" * 31 + "\n"]
)
def test_what_is_no_token_is_refused(text):
    assert not is_token(text)
    memory = TabMemory()
    memory.keep(text, TabRecord(StateStore(STATE), None))
    assert len(memory) == 0


def test_a_page_is_asked_by_name_and_may_be_renamed():
    token = new_token()
    assert is_token(token)
    assert '"some-widget"' in ask_script("some-widget")
    assert token in rename_script(token)
