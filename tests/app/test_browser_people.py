"""A first visit, work without a mouse, and what a screen reader finds, in a real Chromium."""

import re
from dataclasses import replace

import pytest
from axe_playwright_python.sync_playwright import Axe

from app.frames import new_visitor
from app.page_tab import SCENES, Tab, wait_until_open
from app.test_browser_sizes import overlap, settled
from app.test_journeys import MOST
from app.wire import end_work
from page_client import selector
from warpspace.app.browser import actions as do
from warpspace.app.documents.scene_file import state_to_toml
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import start_state
from warpspace.app.state.look import TASKS

START = start_state(SCENES[0])
HINTS = """() => {
  const boxes = found => found.filter(node => node.checkVisibility({ visibilityProperty: true }))
    .map(node => node.getBoundingClientRect()).filter(box => box.width && box.height);
  const hints = [...document.querySelectorAll(".ws-hint")];
  const others = [...document.querySelectorAll("button, input, select, summary, [role=tab],"
    + " .ws-head > *, .ws-legend > b, .ws-scale, .ws-scale i, .ws-words > span, .ws-error,"
    + " .ws-section, .ws-triad")]
    .filter(node => !node.closest(".ws-hint"));
  return [boxes(hints), boxes(others)].map(
    list => list.map(({ left, top, right, bottom }) => [left, top, right, bottom]));
}"""
"""Rectangles of the hints, and of what they might cover."""
FOCUSED = """() => {
  const own = document.activeElement, part = own.closest("#ws-top, #ws-left, #ws-over, #ws-right");
  return [part?.id ?? "", parseFloat(getComputedStyle(own).outlineWidth)];
}"""
UNFOLD = """() => document.querySelectorAll("#ws-right details:not(:has(> [data-do]))")
  .forEach(part => { part.open = true; })"""
"""Unfolds what the page unfolds by itself."""


def hints_of(page):
    return page.evaluate(HINTS)[0]


@pytest.mark.parametrize("size", [(360, 740), (1024, 768), (1440, 900), (2560, 1440)])
def test_hints_cover_nothing_and_the_first_visit_is_as_calm_as_others(open_tab, size):
    tab = open_tab(size=size, query="&hints=on")
    box, (hints, others) = settled(tab), tab.page.evaluate(HINTS)
    assert len(hints) == 3
    assert len(others) > 20
    for hint in hints:
        assert [other for other in [box, *others] if overlap(hint, other)] == []
        assert hint[0] >= 0
        assert hint[2] <= size[0]
    if size == (1440, 900):
        tab.says("51.7 → 49.5 µm")
        assert all(n <= most for n, most in zip(tab.seen(), MOST, strict=True)), tab.seen()


def test_hints_are_shown_once_and_hidden_by_their_button_esc_or_first_use(viewer, browser):
    with new_visitor(browser, (1440, 900)) as context:
        page = context.new_page()
        page.goto(viewer.url)
        wait_until_open(page)
        page.get_by_role("button", name="Got it").click()
        assert hints_of(page) == []
        page.reload()
        wait_until_open(page)
        assert hints_of(page) == []
        for hide in (
            lambda: page.keyboard.press("Escape"),
            lambda: page.get_by_role("tab", name="Measure").click(),
            lambda: page.locator("#ws-left input[type=range]").first.press("ArrowRight"),
        ):
            page.locator("#ws-task-understand").focus()
            page.keyboard.press("Control+k")
            page.get_by_label("Find a command").fill("hints")
            page.keyboard.press("Enter")
            page.wait_for_selector(".ws-hint button:focus")
            page.wait_for_selector("#ws-window:not([open])", state="attached")
            assert len(hints_of(page)) == 3
            hide()
            assert hints_of(page) == []


def test_words_of_a_scene_are_never_run(browser):
    words = "<img src=x onerror='window.taken=1'><script>window.taken=1</script>"
    scene = replace(SCENES[0], title=f"T {words}", description=f"D {words}")
    evil = replace(SCENES[1], title=f"U {words}", name=f"V {words}")
    with Viewer(scene, {evil.title: evil}) as viewer, new_visitor(browser) as context:
        tab = Tab(context.new_page(), viewer)
        page = tab.page
        tab.until(lambda: words in page.title())
        for window in ("scenes", "files", "report", "help"):
            tab.send(do.Input.OPEN_DIALOG(window))
            page.wait_for_selector(f"[data-key=window-{window}]")
            tab.press("Escape")
        tab.give("evil.toml", state_to_toml(start_state(evil)).encode(),
                 lambda: page.get_by_role("button", name="Open", exact=True).click())  # fmt: skip
        tab.until(lambda: tab.state.scene.title.startswith("U "))
        tab.send(do.Signal.PIN_AS_A)
        for task in TASKS:
            tab.send(do.SetLeaf("page.task", task))
            page.wait_for_selector(f"#ws-task-{task}[aria-selected=true]")
        tab.says("U <img src=x")
        assert page.evaluate("window.taken") is None
        assert page.locator("img[src=x]").count() == 0
        assert tab.errors == []
        end_work(viewer)


@pytest.mark.daily
def test_an_error_is_found_set_and_undone_without_a_mouse(tab):
    page, keys = tab.page, tab.page.keyboard.press
    # from the top over the errors and the drawing to the tasks, and the focus is seen
    page.evaluate("document.activeElement.blur()")
    order: list[str] = []
    while "ws-right" not in order[-1:]:
        keys("Tab")
        part, outline = page.evaluate(FOCUSED)
        assert outline >= 2.0
        order += [part] if part not in order[-1:] else []
    # a message that still stands, or what scrolls, may take the focus between two regions
    assert [part for part in order if part] == ["ws-top", "ws-left", "ws-over", "ws-right"]
    # found by a part of its name, and its number typed on its slider
    keys("/")
    page.keyboard.type("squareness y to x")
    tab.until(lambda: page.locator("#ws-left input[type=range]").count() == 1)
    page.locator("#ws-left input[type=range]").focus()
    page.keyboard.type("-12.5")
    keys("Enter")
    tab.until(lambda: tab.state.amplitudes["EC0Y"] == -12.5)
    # the focus is on its slider again, and stays there while the page is written anew
    slider = f"document.activeElement.matches(`{selector(do.SetError('EC0Y'), 'set')}`)"
    tab.until(lambda: page.evaluate(slider))
    keys("ArrowRight")
    tab.until(lambda: tab.state.amplitudes["EC0Y"] > -12.5)
    tab.until(lambda: tab.shows_state(tab.state))
    assert page.evaluate(slider)
    # a task by its arrow, a section by Enter
    page.locator("#ws-task-understand").focus()
    keys("ArrowRight")
    page.wait_for_selector("#ws-task-measure[aria-selected=true]:focus")
    # letters and digits act where nothing is typed
    for key, holds in (
        ("4", lambda: tab.state.component == "z"),
        ("t", lambda: tab.state.exaggeration == 1.0),
        ("m", lambda: tab.state.shown.dark),
    ):
        keys(key)
        tab.until(holds)
    page.wait_for_selector("html.ws-dark")
    page.locator("[data-key=test] > summary").focus()
    for opened in (1, 0):
        keys("Enter" if opened else "Space")
        tab.until(lambda opened=opened: page.locator("[data-key=test][open]").count() == opened)
    # a window keeps the focus, and gives it back
    keys("Control+k")
    page.get_by_label("Find a command").wait_for()
    for _ in range(60):
        keys("Tab")
        assert page.evaluate(
            "document.activeElement === document.body"
            " || document.getElementById('ws-window').contains(document.activeElement)"
        )
    keys("Escape")
    page.wait_for_selector("[data-key=test] > summary:focus")
    while tab.state.amplitudes != START.amplitudes:
        before = tab.state
        keys("Control+z")
        tab.until(lambda before=before: tab.state != before)


def serious(tab):
    """What axe-core finds serious or critical on the page as it is."""
    found = Axe().run(tab.page, options={"resultTypes": ["violations"]}).response["violations"]
    return [
        (one["id"], [node["html"][:200] for node in one["nodes"]])
        for one in found
        if one["impact"] in ("serious", "critical")
    ]


@pytest.mark.parametrize("themes", [1, pytest.param(2, marks=pytest.mark.nightly)])
def test_a_screen_reader_finds_landmarks_headings_and_names(tab, themes):
    for dark in (False, True)[:themes]:
        if dark:
            tab.press("m")
            tab.page.wait_for_selector("html.ws-dark")
        assert serious(tab) == []
        for task, words in TASKS.items():
            tab.task(words)
            tab.page.wait_for_selector(f"#ws-task-{task}[aria-selected=true]")
            for name in tab.session.display.panels["tasks"].sections[task]:
                if not dark and name not in tab.state.page.open:
                    tab.send(do.Input.FOLD_SECTION(name))
                place = f"[data-piece='section.{name}']"
                tab.page.wait_for_selector(f"{place} .ws-body, {place} > .ws-section:not(details)",
                                           state="attached")  # fmt: skip
            tab.page.evaluate(UNFOLD)
            assert serious(tab) == [], task
        for window in ("scenes", "files", "report", "help", "machines"):
            tab.send(do.Input.OPEN_DIALOG(window))
            tab.page.wait_for_selector(f"[data-key=window-{window}]")
            assert serious(tab) == [], window
            tab.page.keyboard.press("Escape")
        tab.send(do.Signal.CLOSE_DIALOG)
        tab.page.wait_for_selector("#ws-window:not([open])", state="attached")
        for text in ("Why here?", "") if not dark else ("",):
            tab.send(do.Input.PIN_NOTE())
            tab.page.locator("#ws-notes textarea:focus").wait_for()
            if text:
                tab.page.keyboard.type(text)
                tab.click("Save note")
                tab.click("Add to story")
                tab.page.locator("#ws-notes textarea").wait_for(state="detached")
        assert serious(tab) == []
        tab.send(do.Signal.CLOSE_NOTES)
    for landmark in ("banner", "navigation", "main", "complementary"):
        assert tab.page.get_by_role(landmark).count() == 1, landmark
    for role, name in (("heading", "^Errors up to 51.7 µm"), ("slider", "^EAX roll of X$")):
        assert tab.page.get_by_role(role, name=re.compile(name)).count() == 1, role
