"""Numbers and tables entered as a new user would, in a real browser."""

from collections.abc import Callable

import numpy as np
import pytest

from app.page_tab import Tab
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.state import edits
from warpspace.app.state.app_state import start_state
from warpspace.app.state.listing import used_keys
from warpspace.machine.errors import Table
from warpspace.scene.library import load_scene

pytestmark = pytest.mark.browser
START = start_state(load_scene("dvf5000_first"))
LIVE = LiveModel()


def type_number(tab: Tab, key: str, text: str) -> None:
    """Type into the number box of an error as a user does, key by key."""
    box = tab.box(key)
    box.click()
    tab.page.keyboard.press("Control+a")
    tab.page.keyboard.type(text)
    tab.page.keyboard.press("Enter")


def messages(tab: Tab) -> int:
    return tab.page.get_by_text("Not a number").count()


def test_a_typed_number_is_believed_and_widens_the_slider(tab: Tab) -> None:
    type_number(tab, "EAX", "87.3")
    tab.until_shown(edits.with_typed_amplitude(START, "EAX", 87.3))
    tab.until(lambda: tab.box("EAX").input_value() == "87.3")
    thumb = tab.thumb("EAX")
    tab.until(lambda: thumb.get_attribute("aria-valuemax") == "200")
    assert float(thumb.get_attribute("aria-valuenow")) == 87.3
    marks = tab.page.locator(f"[id='{tab.widget('EAX')}'] .mantine-Slider-markLabel")
    tab.until(lambda: marks.all_inner_texts() == ["-200", "0", "200"])
    # the box keeps the focus, and the range goes back with the number
    assert tab.page.evaluate("document.activeElement.dataset.number") == "EAX"
    tab.page.keyboard.press("Escape")
    tab.page.get_by_role("button", name="Undo").click()
    tab.until_shown(START)
    tab.until(lambda: tab.box("EAX").input_value() == "5.5")


@pytest.mark.parametrize(
    ("typed", "value", "shown"),
    [
        ("1,5e2", 150.0, "150"),
        ("-1e-3", -1e-3, "-0.001"),
        ("1.23456789", 1.23456789, "1.23456789"),
        ("12,5 µrad", 12.5, "12.5"),
    ],
)
def test_exponents_commas_and_all_digits_are_kept(
    tab: Tab, typed: str, value: float, shown: str
) -> None:
    type_number(tab, "EAX", typed)
    tab.until(lambda: tab.session.state.amplitudes["EAX"] == value)
    tab.until(lambda: tab.box("EAX").input_value() == shown)
    assert messages(tab) == 0


def test_what_is_no_number_restores_the_old_one_with_one_message(tab: Tab) -> None:
    type_number(tab, "EAX", "<b>12</b>")
    tab.until(lambda: messages(tab) == 1)
    assert tab.page.get_by_text("EAX: “<b>12</b>” is no number; it stays 5.5 µrad.").is_visible()
    tab.until(lambda: tab.box("EAX").input_value() == "5.5")
    # leaving the box says nothing more
    tab.page.keyboard.press("Tab")
    tab.page.wait_for_timeout(300)
    assert messages(tab) == 1
    assert tab.session.state == START


def test_a_number_beyond_the_model_is_clamped_and_said(tab: Tab) -> None:
    type_number(tab, "EXX", "1e9")
    tab.until(lambda: tab.page.get_by_text("Clamped", exact=True).count() == 1)
    tab.until(lambda: tab.box("EXX").input_value() == "100000")


def test_the_slider_and_the_box_follow_each_other(tab: Tab) -> None:
    tab.send("EXX", "7.5")
    tab.until(lambda: tab.box("EXX").input_value() == "7.5")
    type_number(tab, "EXX", "2,5")
    tab.until(lambda: tab.thumb("EXX").get_attribute("aria-valuenow") == "2.5")


def test_a_table_is_pasted_for_an_error_that_is_zero(tab: Tab) -> None:
    # three actions: the curve of the error, its kind, and paste
    tab.page.get_by_role("button", name="Curve of EYX, straightness of X in y").click()
    error = tab.page.get_by_label("Error", exact=True)
    tab.until(lambda: error.input_value().startswith("EYX"))
    tab.choose("Curve", "table")
    numbers = tab.written("Numbers")
    tab.until(lambda: len(numbers.input_value().splitlines()) == 5)
    pasted = "X [mm]\tEYX [µm]\n275\t-12,5\n-275\t0\n0\t30\n0\t34"
    numbers.evaluate(
        """(box, text) => { box.focus(); box.select();
        document.execCommand('insertText', false, text); }""",
        pasted,
    )
    span = edits.axis_span(START, "EYX")
    table = Table(span, ((-275.0, 0.0), (0.0, 32.0), (275.0, -12.5)))
    wanted = edits.with_curve(START, "EYX", table)
    tab.until_shown(wanted)
    tab.until(lambda: tab.text("curve remark") != "")
    assert tab.text("curve remark") == (
        "Heading left out: “X [mm] EYX [µm]”. Rows sorted by position. Values of the same position"
        " averaged, at 0."
    )
    tab.until(lambda: tab.box("EYX").input_value() == "32")
    # its slider scales the table
    tab.send("EYX", "16")
    tab.until(lambda: tab.session.state.amplitudes["EYX"] == 16.0)
    curve = edits.curve_of(tab.session.state, "EYX")
    np.testing.assert_allclose(curve.evaluate(np.array([0.0, 275.0])), [16.0, -6.25])


def test_errors_that_are_zero_are_hidden_and_found(open_tab: Callable[..., Tab]) -> None:
    tab = open_tab(everything=False)
    keys = "[...document.querySelectorAll('input[data-number]')].map(box => box.dataset.number)"
    used = used_keys(START)
    assert {*tab.page.evaluate(keys)} == {*used}
    search = tab.written("Find an error")
    search.fill("EXX")
    tab.until(lambda: tab.page.evaluate(keys) == ["EXX"])
    type_number(tab, "EXX", "10")
    tab.until_shown(START.with_amplitude("EXX", 10.0))
    search.fill("")
    tab.until(lambda: {*tab.page.evaluate(keys)} == {*used, "EXX"})
    tab.page.get_by_role("checkbox", name="Sort by effect").check()
    state = START.with_amplitude("EXX", 10.0)
    alone = {
        key: LIVE.evaluate(edits.with_only(state, key, True)).statistics.rms_um
        for key in (*used, "EXX")
    }
    wanted = sorted(alone, key=lambda key: -alone[key])
    tab.until(lambda: tab.page.evaluate(keys) == wanted)
    # none leaves while it is being moved to zero, and undo brings one back
    type_number(tab, wanted[0], "0")
    tab.until(lambda: tab.box(wanted[0]).input_value() == "0")
    assert tab.listed() == 8
    tab.page.get_by_role("checkbox", name="Hide errors that are zero").uncheck()
    tab.until(lambda: tab.listed() == 41)
    assert tab.errors == []
