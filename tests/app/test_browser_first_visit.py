"""The first visit in a real Chromium: the tour by keyboard and mouse, and what explains a scene."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from app.frames import new_visitor
from app.page_tab import SCENES, Tab, wait_until_open
from warpspace.app.server.viewer import Viewer

pytestmark = pytest.mark.browser
TITLES = ["What this is", "Drag", "Click", "Repair", "Compare"]
FOCUS_IN_TOUR = "document.getElementById('warpspace-tour').contains(document.activeElement)"


def title(page: Any) -> str:
    return page.inner_text("#warpspace-tour h2")


def tabs_heard(page: Any) -> set[str]:
    """Names of the tabs in Chromium's accessibility tree."""
    nodes = page.context.new_cdp_session(page).send("Accessibility.getFullAXTree")["nodes"]
    return {
        node["name"]["value"]
        for node in nodes
        if not node["ignored"] and node["role"]["value"] == "tab"
    }


def test_the_tour_is_shown_once_and_keeps_the_keys_to_itself(viewer: Viewer, browser: Any) -> None:
    with new_visitor(browser) as context:
        page = context.new_page()
        page.goto(viewer.url)
        page.wait_for_selector("#warpspace-tour", timeout=60_000)
        dialog = page.get_by_role("dialog", name="What this is")
        assert dialog.get_attribute("aria-modal") == "true"
        assert "DVF5000, first machine measured. Seven key errors" in dialog.inner_text()
        # five steps with Enter, and Tab never leaves them
        seen = [title(page)]
        for _ in range(4):
            for key in ("Tab", "Tab", "Tab", "Tab", "Shift+Tab", "Shift+Tab", "t", "h"):
                page.keyboard.press(key)
                assert page.evaluate(FOCUS_IN_TOUR)
            page.get_by_role("button", name="Next", exact=True).focus()
            page.keyboard.press("Enter")
            seen.append(title(page))
        assert seen == TITLES
        page.keyboard.press("ArrowLeft")
        assert title(page) == "Repair"
        # what is behind can neither be reached nor heard
        assert "View" not in tabs_heard(page)
        page.keyboard.press("Escape")
        assert page.locator("#warpspace-tour").count() == 0
        page.wait_for_timeout(300)
        assert "×1000" in page.inner_text("[data-value=factor]")
        assert page.get_by_text("Keys and help").count() == 0
        assert "View" in tabs_heard(page)
        page.reload()
        wait_until_open(page)
        page.wait_for_timeout(500)
        assert page.locator("#warpspace-tour").count() == 0


def test_the_tour_comes_back_from_help_and_palette(tab: Tab) -> None:
    page = tab.page
    tour = page.locator("#warpspace-tour")
    assert tour.count() == 0  # a page with fixedDpr is driven by a program
    page.keyboard.press("h")
    page.get_by_role("button", name="Take the tour").click()
    tab.until(lambda: tour.count() == 1)
    assert title(page) == TITLES[0]
    page.get_by_role("button", name="Skip").click()
    tab.until(lambda: tour.count() == 0 and page.get_by_text("Keys and help").count() == 0)
    page.keyboard.press("Control+k")
    page.get_by_placeholder("Search commands").fill("tour")
    page.keyboard.press("Enter")
    tab.until(lambda: tour.count() == 1)
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    assert tour.count() == 0


def test_the_scene_says_what_it_is_and_help_what_is_drawn(tab: Tab) -> None:
    page = tab.page
    about = page.locator("[data-value=description]")
    assert not about.is_visible()
    page.get_by_text("About this scene").click()
    assert about.inner_text().startswith("Seven key errors as measured (thesis tables 5-3 to 5-5)")
    page.keyboard.press("h")
    tab.until(lambda: page.get_by_text("Keys and help").is_visible())
    for words in ("the nominal working volume", "×1 is true scale", "length of the error"):
        assert page.locator(".ws-help").get_by_text(words).first.is_visible()
    page.keyboard.press("Escape")
    tab.until(lambda: page.get_by_text("Keys and help").count() == 0)


def test_words_of_a_scene_are_never_run(browser: Any) -> None:
    words = "<img src=x onerror='window.taken=1'><script>window.taken=1</script>"
    scene = replace(SCENES[0], title=f"T {words}", description=f"D {words}")
    with (
        Viewer(scene) as viewer,
        new_visitor(browser, (1024, 768)) as context,
    ):
        tab = Tab(context.new_page(), viewer, "&tour=on", everything=False)
        page = tab.page
        tab.until(lambda: page.locator("#warpspace-tour").count() == 1)
        assert words in page.inner_text("#warpspace-tour")
        card = page.locator("#warpspace-tour section").bounding_box()
        assert card["x"] >= 0
        assert card["y"] >= 0
        assert card["x"] + card["width"] <= 1024
        assert card["y"] + card["height"] <= 768
        page.keyboard.press("Escape")
        page.get_by_text("About this scene").click()
        assert words in page.inner_text("[data-value=description]")
        page.keyboard.press("h")
        tab.until(lambda: page.locator(".ws-help").count() == 1)
        assert page.evaluate("window.taken") is None
        assert page.locator(".ws-help img, .ws-about img, #warpspace-tour img").count() == 0


@pytest.mark.parametrize("query", ["&tour=off", "&tour=on"])
def test_the_address_says_whether_there_is_a_tour(open_tab: Callable[..., Tab], query: str) -> None:
    tab = open_tab(query=query, everything=False)
    tab.page.wait_for_timeout(500)
    assert tab.page.locator("#warpspace-tour").count() == (query == "&tour=on")
