"""Points as a user asks about them: the worst one, a typed one, without a mouse; values as printed.

The numbers are those of ``warpspace field --at`` with what the page's copy button gives.
"""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from app.page_tab import Tab
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.state.app_state import start_state
from warpspace.app.state.edits import with_excluded
from warpspace.app.state.picked import Picked
from warpspace.cli.commands.field import field
from warpspace.scene.library import load_scene

pytestmark = pytest.mark.browser
LIVE = LiveModel()
START = start_state(load_scene("dvf5000_first"))
WORST = "X=275,Y=-225,Z=-480,B=0,C=0"
PLACE = "axes X 275 Y −225 Z −480 · in R x 275 y −225 z −51"
EYE = "() => JSON.stringify(__viserMutable.cameraControl.getPosition({}))"


def printed(at: str) -> dict:
    """What the command line gives for a point."""
    found = CliRunner().invoke(field, ["dvf5000_first", "--at", at, "--exact", "--json"])
    return json.loads(found.stdout)["points"][0]


def check_budget(tab: Tab, at: str) -> None:
    """Compare the error of the budget with the command line's."""
    wanted = f"{printed(at)['norm_um']:.2f} µm"
    tab.until(lambda: tab.page.locator("[data-value='why norm']").count() == 1)
    tab.until(lambda: tab.text("why norm") == wanted)


def in_front(tab: Tab) -> bool:
    """Whether the error budget is what is seen."""
    tab_of = tab.page.get_by_role("tab", name="Error budget", exact=True)
    return tab_of.get_attribute("aria-selected") == "true"


def test_the_budget_of_the_worst_point_is_one_key_away_and_can_be_copied(tab: Tab) -> None:
    tab.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    eye = tab.page.evaluate(EYE)
    tab.page.keyboard.press("w")
    tab.until(lambda: in_front(tab))
    check_budget(tab, WORST)
    assert tab.text("why at").startswith(PLACE)
    # viser's camera does not fly off with the same key
    tab.page.wait_for_timeout(300)
    assert tab.page.evaluate(EYE) == eye
    tab.page.locator("[data-value='why at'] .ws-copy").click()
    tab.until(lambda: tab.page.evaluate("navigator.clipboard.readText()") == WORST)
    assert printed(WORST)["norm_um"] == pytest.approx(51.7, abs=0.05)
    tab.page.keyboard.press("n")
    tab.until(lambda: tab.page.locator("[data-value='why norm']").count() == 0)


def test_the_budget_of_the_worst_point_is_one_click_away(tab: Tab) -> None:
    assert tab.text("max at").startswith(PLACE)
    tab.page.get_by_role("button", name="Worst point: error budget").click()
    tab.until(lambda: in_front(tab))
    check_budget(tab, WORST)


def test_a_point_is_typed_clamped_and_nonsense_leaves_the_old_one(tab: Tab) -> None:
    tab.panel("Error budget")
    typed = tab.page.get_by_label("Point, axis positions")
    typed.fill("X 100 Y -50 Z -200")
    typed.press("Enter")
    check_budget(tab, "X=100,Y=-50,Z=-200,B=0,C=0")
    typed = tab.page.get_by_label("Point, axis positions")
    tab.until(lambda: typed.input_value() == "X 100 Y −50 Z −200")
    typed.fill("X=9999,B=-30")
    typed.press("Enter")
    travel = START.scene.machine.axes["X"].travel[1]
    check_budget(tab, f"X={travel:g},Y=-50,Z=-200,B=-30,C=0")
    tab.until(lambda: tab.page.get_by_text("X = 9999 mm is outside the travel").count() > 0)
    assert tab.state().positions["B"] == -30.0
    typed.fill("somewhere")
    typed.press("Enter")
    tab.until(lambda: tab.page.get_by_text("expected positions of the axes").count() > 0)
    assert typed.input_value() == f"X {travel:g} Y −50 Z −200 B −30°"
    tab.page.get_by_role("button", name="Undo", exact=True).click()
    tab.until(lambda: tab.state().picked == Picked({"X": 100.0, "Y": -50.0, "Z": -200.0}))


def test_rows_of_the_budget_are_edited_excluded_and_show_their_lever(tab: Tab) -> None:
    tab.page.keyboard.press("w")
    check_budget(tab, WORST)
    bar = "document.querySelector('.ws-effect').getBoundingClientRect().width"
    column = "document.querySelector('.ws-why table').getBoundingClientRect().width"
    assert tab.page.evaluate(bar) > 0.95 * tab.page.evaluate(column)
    tab.page.get_by_role("button", name="Show lever of EA0Z").click()
    tab.until(lambda: "mm across the axis" in tab.text("lever"))
    tab.page.get_by_role("button", name="Edit EB0Z").click()
    focused = "document.activeElement.closest('[id]')?.id"
    tab.until(lambda: tab.page.evaluate(focused) == tab.widget("EB0Z"))
    assert tab.state().chosen_error == "EB0Z"
    tab.page.keyboard.press("ArrowRight")
    tab.until(lambda: tab.state().amplitudes["EB0Z"] != START.amplitudes["EB0Z"])
    tab.page.get_by_role("button", name="Reset", exact=True).click()
    tab.page.get_by_role("button", name="Exclude EA0Z", exact=True).click()
    without = LIVE.evaluate(with_excluded(START, "EA0Z", True)).statistics.max_um
    tab.until(lambda: tab.state().exclusions.excluded == {"EA0Z"})
    tab.until(lambda: abs(tab.number("max") - without) < 0.006)
    tab.page.get_by_role("button", name="Include EA0Z", exact=True).click()
    check_budget(tab, WORST)


def test_before_and_after_have_their_change(tab: Tab) -> None:
    tab.panel("Compare")
    tab.page.get_by_role("button", name="Pin as before").click()
    tab.until(lambda: tab.page.locator("[data-compared='max change']").count() == 1)
    tab.send("EA0Z", "0")
    before, after = LIVE.evaluate(START), LIVE.evaluate(START.with_amplitude("EA0Z", 0.0))
    difference = np.linalg.norm(after.field.error_um - before.field.error_um, axis=-1).max()
    a, b = before.statistics.max_um, after.statistics.max_um
    tab.until(lambda: tab.page.inner_text("[data-compared='max B']") == f"{b:.2f}")
    for column, value in (
        ("A", f"{a:.2f}"),
        ("change", f"+{b - a:.2f}"),
        ("B − A", f"{difference:.2f}"),
    ):
        assert tab.page.inner_text(f"[data-compared='max {column}']") == value
    assert tab.page.get_by_text("before: DVF5000").first.is_visible()
