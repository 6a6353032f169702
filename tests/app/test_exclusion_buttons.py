"""Buttons of one error, and the clicks of HTML that carry their words."""

import re
from html.parser import HTMLParser

import pytest
from markupsafe import Markup

from warpspace import load_scene
from warpspace.app.browser.arrangement import split_script
from warpspace.app.browser.clicks import LONGEST_WORD, MOST_CLICKS, SCRIPT, read_clicks
from warpspace.app.panels.view_words import COMPONENT_NAMES, component_of
from warpspace.app.readouts.error_controls import error_controls, with_switched
from warpspace.app.state import edits
from warpspace.app.state.app_state import start_state
from warpspace.app.state.exclusions import Exclusions
from warpspace.app.state.history import History
from warpspace.machine.parameters import parameter

STATE = start_state(load_scene("dvf5000_first"))


class _Buttons(HTMLParser):
    """Collects the attributes of the group and of its buttons."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.group: dict[str, str] = {}
        self.found: list[dict[str, str]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        if tag == "button":
            self.found.append(given)
        elif given.get("role") == "group":
            self.group = given


def buttons(exclusions: Exclusions, key: str = "EAX") -> _Buttons:
    return _Buttons(
        error_controls(
            parameter(key),
            exclusions,
            5.5,
            lambda word: Markup(f'type="button" data-word="{word}"'),
            lambda word: Markup(f'type="text" data-word="{word}"'),
        )
    )


def pressed(exclusions: Exclusions, key: str = "EAX") -> tuple[str, str]:
    only, exclude, _ = buttons(exclusions, key).found
    return only["aria-pressed"], exclude["aria-pressed"]


def test_the_buttons_say_what_they_do_to_which_error():
    only, exclude, curve = buttons(Exclusions()).found
    assert [b["data-word"] for b in (only, exclude, curve)] == [
        "only EAX",
        "exclude EAX",
        "curve EAX",
    ]
    assert only["aria-label"] == "Only EAX, roll of X"
    assert exclude["aria-label"] == "Exclude EAX, roll of X"
    assert curve["aria-label"] == "Curve of EAX, roll of X"
    assert all(b["title"] and b["type"] == "button" for b in (only, exclude, curve))


def test_the_buttons_show_what_is_pressed_and_what_is_excluded():
    assert pressed(Exclusions()) == ("false", "false")
    assert pressed(Exclusions().with_excluded("EAX", True)) == ("false", "true")
    alone = Exclusions().with_only("EAX", True)
    assert pressed(alone) == ("true", "false")
    assert pressed(alone, "EBX") == ("false", "false")
    assert "excluded" not in buttons(alone).group["aria-label"]
    assert buttons(alone, "EBX").group["aria-label"].endswith("excluded")
    assert "ws-excluded" in buttons(alone, "EBX").group["class"]
    assert "ws-excluded" not in buttons(alone).group["class"]


def test_a_click_switches_and_a_second_one_switches_back():
    once = with_switched(STATE, "only EAX")
    assert once == edits.with_only(STATE, "EAX", True)
    assert with_switched(once, "only EAX") == STATE
    excluded = with_switched(STATE, "exclude EC0Y")
    assert excluded.exclusions.excluded == frozenset({"EC0Y"})
    assert with_switched(excluded, "exclude EC0Y") == STATE


@pytest.mark.parametrize("word", ["", "only", "only EXA", "exclude <script>", "delete EAX", " EAX"])
def test_words_that_mean_nothing_change_nothing(word):
    assert with_switched(STATE, word) is STATE


def test_each_switch_is_a_step_however_fast_they_follow_each_other():
    history = History(STATE)
    for number, word in enumerate(("exclude EAX", "exclude EBX", "exclude EBX", "only EBX")):
        history = history.push(with_switched(history.present, word), 0.01 * number)
    assert history.undoes == "exclusions.only.+EBX"
    history = history.undo()
    assert history.present.exclusions == Exclusions(frozenset({"EAX"}))
    history = history.undo()
    assert history.present.exclusions == Exclusions(frozenset({"EAX", "EBX"}))
    assert history.undo().undo().present == STATE


def test_clicks_are_read_in_order_with_their_numbers():
    assert read_clicks("7:only EAX\n8:exclude EBX") == ((7, "only EAX"), (8, "exclude EBX"))
    assert read_clicks("3:a:b") == ((3, "a:b"),)


@pytest.mark.parametrize(
    "text", ["", "only EAX", "x:only EAX", "-1:a", "²:a", "9" * 40 + ":a", "1.5:a", "None"]
)
def test_what_is_no_click_is_left_out(text):
    assert read_clicks(text) == ()


def test_a_flood_of_clicks_is_bounded():
    found = read_clicks("\n".join(f"{i}:a" for i in range(10_000)))
    assert len(found) == MOST_CLICKS
    assert len(read_clicks("1:" + "a" * 1_000_000)[0][1]) == LONGEST_WORD


def test_scripts_have_balanced_braces():
    for script in (SCRIPT, split_script()):
        assert script.count("{") == script.count("}")
        assert script.count("(") == script.count(")")
    assert "0.68" in split_script(0.68)


def test_components_are_named_after_what_is_coloured():
    assert "tilt" in COMPONENT_NAMES["orientation"]["norm"]
    assert not any("E" in name for name in COMPONENT_NAMES["orientation"].values())
    for names in COMPONENT_NAMES.values():
        for component, name in names.items():
            assert component_of(name) == component
    assert component_of("<script>") == "<script>"
    spelt = [name for names in COMPONENT_NAMES.values() for name in names.values()]
    assert len(set(spelt)) == len(spelt)
    assert not [name for name in spelt if re.search(r"[<>&]", name)]
