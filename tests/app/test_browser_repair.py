"""A new user finds the best repair and applies it: two actions, and one takes it back."""

import pytest

from app.page_tab import SCENES, Tab
from warpspace.app.state.app_state import start_state
from warpspace.scene import repairs as scene_repairs

pytestmark = pytest.mark.browser
START = start_state(SCENES[0])


def test_find_and_apply_the_best_repair(tab: Tab) -> None:
    found = scene_repairs.repair(SCENES[0])
    tab.panel("Repair")  # action 1
    tab.until(lambda: tab.page.locator("[data-repair='2 mean']").count() == 1)
    for size, repair in ((1, found.repairs[0]), (2, found.repairs[1])):
        shown = float(tab.page.inner_text(f"[data-repair='{size} mean']"))
        assert shown == pytest.approx(repair.outcome.mean_um, abs=0.006)
    out = float(tab.page.inner_text("[data-repair='EA0Z out max']"))
    assert out == pytest.approx(63.59, abs=0.006)

    tab.page.locator("[data-set='2'] button", has_text="Apply").click()  # action 2
    wanted = found.repairs[1].adjust
    tab.until(lambda: tab.state().amplitudes["EA0Z"] == pytest.approx(wanted["EA0Z"]))
    state = tab.session.state
    tab.until_shown(state)
    tab.panel("Compare")
    compared = tab.page.inner_text(".ws-comparison")
    assert "before repair" in compared
    assert "30.89" in compared
    assert f"{found.repairs[1].outcome.mean_um:.2f}" in compared

    tab.page.keyboard.press("Control+z")  # one takes it back
    tab.until(lambda: tab.state().amplitudes == START.amplitudes)
    assert tab.session.state.comparison.b is None


def test_compare_draws_the_repaired_volume_and_changes_no_error(tab: Tab) -> None:
    tab.panel("Repair")
    tab.until(lambda: tab.page.locator("[data-set='1']").count() == 1)
    tab.page.locator("[data-set='1'] button", has_text="Compare").click()
    tab.until(lambda: tab.state().comparison.b is not None)
    state = tab.session.state
    assert state.amplitudes == START.amplitudes
    tab.until_shown(state)


def test_the_smallest_max_is_another_repair(tab: Tab) -> None:
    tab.panel("Repair")
    tab.choose("Make smallest", "largest |E| of the volume")
    tab.until(lambda: tab.page.locator("[data-repair='3 max']").count() == 1)
    assert float(tab.page.inner_text("[data-repair='3 max']")) == pytest.approx(45.19, abs=0.02)
    assert float(tab.page.inner_text("[data-repair='1 max']")) == pytest.approx(46.09, abs=0.02)


def test_the_budget_says_that_it_is_no_advice(tab: Tab) -> None:
    box = tab.page.locator("canvas").first.bounding_box()
    assert box is not None
    tab.page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    tab.until(lambda: tab.page.locator("[data-value='no advice']").count() == 1)
    assert "See Repair" in tab.text("no advice")
