"""What a page keeps of its tab, and what a restarted server makes of it."""

import json
from dataclasses import replace

import pytest

from warpspace.app.browser.lost_server import back_script, keep_script, say_script, watch_script
from warpspace.app.documents.kept_tab import (
    COMPARISON,
    FILE,
    LINK,
    NEVER_KEPT,
    START_VALUES,
    kept_text,
    read_kept,
)
from warpspace.app.evaluation.compare import with_pin
from warpspace.app.evaluation.resulting_scene import scene_of
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.viewport.camera import CameraMemory
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.machine.curves.table import Table
from warpspace.scene.library import load_scene

KNOWN = (load_scene("dvf5000_first"), load_scene("dvf5000_second"))
START = start_state(KNOWN[0])
CAMERA = CameraMemory((1.0, -40.0, 30.0), (0.5, 0.25, 2.0), (0.0, 0.0, 1.0), 0.75)


def edited() -> AppState:
    return START.with_amplitude("EXX", 7.125).with_position("B", -20.0).with_component("z")


def test_state_of_a_known_scene_comes_back_whole_with_its_camera() -> None:
    found = read_kept(kept_text(edited(), CAMERA, KNOWN), KNOWN)
    assert found.state == edited()
    assert found.state.start == START.start  # Reset goes where it went
    assert found.camera == CAMERA
    assert found.missing == NEVER_KEPT


def test_comparison_comes_back() -> None:
    state = with_pin(edited()).with_amplitude("EXX", 1.0)
    found = read_kept(kept_text(state, None, KNOWN), KNOWN)
    assert found.state.comparison.b is not None
    assert found.state == state


def test_scene_that_the_server_has_no_more_comes_back_from_its_file() -> None:
    found = read_kept(kept_text(edited(), None, KNOWN), KNOWN[1:])
    assert scene_of(found.state).errors == scene_of(edited()).errors
    assert found.state.component == "z"
    assert found.missing == (*NEVER_KEPT, START_VALUES)


def test_scene_that_has_changed_under_its_name_comes_back_as_it_was() -> None:
    other = replace(KNOWN[1], name="dvf5000_first")
    found = read_kept(kept_text(edited(), None, KNOWN), [other])
    assert scene_of(found.state).errors == scene_of(edited()).errors


def test_comparison_that_is_too_large_is_left_out_and_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    state = with_pin(edited()).with_amplitude("EXX", 1.0)
    alone = kept_text(START.with_amplitude("EXX", 1.0), None, KNOWN)
    monkeypatch.setattr("warpspace.app.documents.kept_tab.MAX_KEPT_TEXT", len(alone) + 300)
    found = read_kept(kept_text(state, None, KNOWN), KNOWN)
    assert found.state.comparison.b is None
    assert found.state.amplitudes["EXX"] == 1.0
    assert COMPARISON in found.missing
    monkeypatch.setattr("warpspace.app.documents.kept_tab.MAX_KEPT_TEXT", 10)
    assert kept_text(state, None, KNOWN) == ""


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", "7", "[" * 100_000, json.dumps({FILE: 7}), json.dumps({FILE: "x = ["}),
     json.dumps({LINK: "scene=../../etc", FILE: "\x00"}), "x" * 800_000],
    ids=range(9),
)  # fmt: skip
def test_anything_may_come_from_a_page(text: str) -> None:
    with pytest.raises(WarpspaceError):
        read_kept(text, KNOWN)


def test_too_large_a_text_is_not_even_parsed() -> None:
    with pytest.raises(OptionError, match="cannot be read"):
        read_kept('{"file": "' + "x" * 700_001, KNOWN)


def test_scripts_spell_texts_so_that_they_stay_texts() -> None:
    hostile = 'x"</script><script>alert(1)//'
    for script in (keep_script(hostile), say_script(hostile, [hostile])):
        assert "</script>" not in script
        assert "\\u003c/script>" in script
    assert "removeItem" in keep_script("")
    assert "setItem" not in keep_script("")
    assert "if (true)" in back_script("w", known=True)
    assert "if (false)" in back_script("w", known=False)
    assert "sendMessage === send" in watch_script()


def test_edited_curve_comes_back() -> None:
    state = edits.with_curve(START, "EYX", Table((-275.0, 275.0), ((-275.0, 1.0), (0.0, -3.0))))
    found = read_kept(kept_text(state, None, KNOWN), KNOWN)
    assert scene_of(found.state).errors == scene_of(state).errors
