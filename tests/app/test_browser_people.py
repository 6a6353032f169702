"""A first visit and work without a mouse in a real Chromium."""

from dataclasses import replace

import pytest

from app.frames import new_visitor
from app.page_tab import SCENES, Tab, wait_until_open
from app.wire import end_work
from warpspace.app.documents.scene_file import state_to_toml
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import start_state

TITLES = ["What this is", "Drag", "Click", "Repair", "Compare"]
FOCUS_IN_TOUR = "document.getElementById('warpspace-tour').contains(document.activeElement)"


def title(page):
    return page.inner_text("#warpspace-tour h2")


def tree(page):
    """Role and name of all that a screen reader finds."""
    session = page.context.new_cdp_session(page)
    nodes = session.send("Accessibility.getFullAXTree")["nodes"]
    session.detach()
    return [
        (node["role"]["value"], node.get("name", {}).get("value", "").strip())
        for node in nodes
        if not node["ignored"]
    ]


def test_the_tour_is_shown_once_and_keeps_the_keys_to_itself(viewer, browser):
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
        assert ("tab", "View") not in tree(page)
        page.keyboard.press("Escape")
        assert page.locator("#warpspace-tour").count() == 0
        assert "×1000" in page.inner_text("[data-value=factor]")
        assert page.get_by_text("Keys and help").count() == 0
        assert ("tab", "View") in tree(page)
        page.reload()
        wait_until_open(page)
        assert page.locator("#warpspace-tour").count() == 0
        # it comes back from the help and from the palette
        page.keyboard.press("h")
        page.get_by_role("button", name="Take the tour").click()
        page.wait_for_selector("#warpspace-tour")
        page.get_by_role("button", name="Skip").click()
        page.wait_for_selector("#warpspace-tour", state="detached")
        page.keyboard.press("Control+k")
        page.get_by_placeholder("Search commands").fill("tour")
        page.keyboard.press("Enter")
        page.wait_for_selector("#warpspace-tour")


def test_words_of_a_scene_are_never_run(browser):
    words = "<img src=x onerror='window.taken=1'><script>window.taken=1</script>"
    scene = replace(SCENES[0], title=f"T {words}", description=f"D {words}")
    with Viewer(scene) as viewer, new_visitor(browser, (1024, 768)) as context:
        tab = Tab(context.new_page(), viewer, "&tour=on", everything=False)
        page = tab.page
        tab.until(lambda: page.locator("#warpspace-tour").count() == 1)
        tab.until(lambda: words in page.inner_text("#warpspace-tour"))
        card = page.locator("#warpspace-tour section").bounding_box()
        assert card["x"] >= 0
        assert card["y"] >= 0
        assert card["x"] + card["width"] <= 1024
        assert card["y"] + card["height"] <= 768
        page.keyboard.press("Escape")
        page.get_by_text("About this scene").click()
        tab.until(lambda: words in page.inner_text("[data-value=description]"))
        tab.panel("Files")
        evil = replace(SCENES[1], title=f"U {words}")
        tab.upload("evil.toml", state_to_toml(start_state(evil)).encode())
        tab.until(lambda: tab.session.state.scene.name == "evil")
        tab.panel("Compare")
        tab.button("Pin as before")
        tab.until(page.get_by_text("<script>").first.is_visible)
        page.keyboard.press("h")
        tab.until(lambda: page.locator(".ws-help").count() == 1)
        assert page.evaluate("window.taken") is None
        assert page.locator("img[src=x]").count() == 0
        assert tab.errors == []
        end_work(viewer)


START = start_state(SCENES[0])
NAMED = {
    "button", "checkbox", "combobox", "dialog", "image", "group", "searchbox", "slider",
    "spinbutton", "tab", "tablist", "textbox", "Canvas", "DisclosureTriangle",
}  # fmt: skip
FOCUSED = "document.activeElement.getAttribute('aria-label') ?? document.activeElement.innerText"
SCHEME = "document.documentElement.getAttribute('data-mantine-color-scheme')"
OUTLINE = "parseFloat(getComputedStyle(document.activeElement).outlineWidth)"


def test_an_error_is_found_set_looked_at_and_undone_without_a_mouse(tab):
    page = tab.page
    keys = page.keyboard.press
    # 1. find: the cursor goes into the search box, and on to the number of what was found
    keys("/")
    page.keyboard.type("squareness y to x")
    tab.until(lambda: page.locator(".ws-error").count() == 1)
    keys("Enter")
    tab.until(lambda: page.evaluate(FOCUSED).startswith("EC0Y"))
    # 2. set: in a box they are letters
    keys("Control+a")
    page.keyboard.type("-12.5")
    keys("Enter")
    tab.until(lambda: tab.session.state.amplitudes["EC0Y"] == -12.5)
    keys("Escape")
    # 3. colour by z, true scale, dark mode
    keys("4")
    tab.until(lambda: tab.session.state.component == "z")
    keys("t")
    tab.until(lambda: "true scale" in tab.text("factor"))
    keys("m")
    tab.until(lambda: page.evaluate(SCHEME) == "dark")
    keys("m")
    tab.until(lambda: page.evaluate(SCHEME) == "light")
    keys("Control+z")
    keys("Control+z")
    keys("Control+z")
    tab.until(lambda: tab.session.state.exaggeration is None)
    # 4. open a tab by its name; the focus is on it, and Tab goes on into it
    keys("Control+k")
    tab.until(lambda: page.evaluate("document.activeElement.placeholder") == "Search commands...")
    page.keyboard.type("tab: compare")
    page.get_by_text("Tab: Compare").wait_for()
    keys("Enter")
    compare = page.get_by_role("tab", name="Compare", exact=True)
    tab.until(lambda: compare.get_attribute("aria-selected") == "true")
    tab.until(lambda: page.evaluate(FOCUSED) == "Compare")
    # ... and its neighbour with an arrow
    keys("ArrowRight")
    beside = page.get_by_role("tab", name="Calibrate", exact=True)
    tab.until(lambda: beside.get_attribute("aria-selected") == "true")
    # 5. undo both
    keys("Control+z")
    keys("Control+z")
    tab.until(lambda: tab.session.state.component == "norm")
    tab.until(lambda: tab.session.state.amplitudes["EC0Y"] == START.amplitudes["EC0Y"])
    # 6. and all errors are there again
    tab.until(lambda: float(tab.box("EC0Y").input_value()) == START.amplitudes["EC0Y"])
    keys("/")
    keys("Delete")
    tab.until(lambda: page.locator(".ws-error").count() > 30)
    # 7. where the focus is can be seen, and a folder is opened with a key
    folder = page.get_by_role("button", name="B axis · 10 errors")
    for place in (
        tab.thumb("EXX"),
        tab.box("EXX"),
        page.get_by_role("button", name="Undo", exact=True),
        page.get_by_role("tab", name="Machine", exact=True),
        page.get_by_label("Nominal box", exact=True),
        page.get_by_label("Component", exact=True).first,
        folder,
    ):
        place.focus()
        assert page.evaluate(OUTLINE) >= 2.0
    tab.until(lambda: folder.get_attribute("aria-expanded") == "false")
    keys("Enter")
    tab.until(lambda: folder.get_attribute("aria-expanded") == "true")
    tab.until(tab.thumb("EXB").is_visible)
    keys(" ")
    tab.until(lambda: folder.get_attribute("aria-expanded") == "false")


@pytest.mark.nightly
def test_all_that_is_operated_or_drawn_has_a_name(tab):
    for name in tab.page.get_by_role("tab").all_inner_texts():
        tab.panel(name)
        assert tab.page.get_by_role("tab", name=name, exact=True).get_attribute("title") == name
        tab.until(
            lambda: [role for role, said in tree(tab.page) if role in NAMED and not said] == []
        )
    tab.panel("View")
    tab.panel("Volumetric error")
    tab.session.context.post(lambda state: state.with_chosen_error("EAY"))
    # a slider and its number, a text box, a group of buttons, a chart, the drawing, the colours
    wanted = {
        ("slider", "EAX · ε_xX · roll of X [µrad]"),
        ("textbox", "EAX · ε_xX · roll of X [µrad]"),
        ("textbox", "Find an error"),
        ("slider", "Exaggeration, logarithmic"),
        ("group", "History"),
        ("button", "Command palette"),
        ("combobox", "Component"),
        (
            "image",
            (
                "Chart of EAY, pitch of Y: starts with 0 µrad at −225 mm,"
                " ends with −43.7 µrad at 225 mm"
            ),
        ),
    }
    tab.until(lambda: wanted <= {*tree(tab.page)})
    images = [said for role, said in tree(tab.page) if role == "image"]
    for begin in ("Drawing of the deformed working volume. DVF5000", "Colour bar from 0 to 60 µm"):
        assert any(said.startswith(begin) for said in images)
