"""Work without a mouse and without eyes: keys, focus, and the names in the accessibility tree."""

from typing import Any

import pytest

from app.page_tab import Tab
from warpspace.app.state.app_state import start_state
from warpspace.scene.library import load_scene

pytestmark = pytest.mark.browser
START = start_state(load_scene("dvf5000_first"))
NAMED = {
    "button", "checkbox", "combobox", "dialog", "image", "group", "searchbox", "slider",
    "spinbutton", "tab", "tablist", "textbox", "Canvas", "DisclosureTriangle",
}  # fmt: skip
FOCUSED = "document.activeElement.getAttribute('aria-label') ?? document.activeElement.innerText"
OUTLINE = "parseFloat(getComputedStyle(document.activeElement).outlineWidth)"


def tree(tab: Tab) -> list[tuple[str, str]]:
    """Role and name of all that a screen reader finds."""
    session = tab.page.context.new_cdp_session(tab.page)
    nodes = session.send("Accessibility.getFullAXTree")["nodes"]
    session.detach()
    return [
        (node["role"]["value"], node.get("name", {}).get("value", "").strip())
        for node in nodes
        if not node["ignored"]
    ]


def keys(tab: Tab, *pressed: str) -> None:
    for key in pressed:
        tab.page.keyboard.press(key)
        tab.page.wait_for_timeout(70)


def test_an_error_is_found_set_looked_at_and_undone_without_a_mouse(tab: Tab) -> None:
    page = tab.page
    # 1. find: the cursor goes into the search box, and on to the number of what was found
    keys(tab, "/")
    page.keyboard.type("squareness y to x")
    tab.until(lambda: tab.page.locator(".ws-error").count() == 1)
    keys(tab, "Enter")
    tab.until(lambda: page.evaluate(FOCUSED).startswith("EC0Y"))
    # 2. set
    keys(tab, "Control+a")
    page.keyboard.type("-12.5")
    keys(tab, "Enter", "Escape")
    tab.until(lambda: tab.session.state.amplitudes["EC0Y"] == -12.5)
    # 3. colour by z
    keys(tab, "4")
    tab.until(lambda: tab.session.state.component == "z")
    # 4. open a tab by its name; the focus is on it, and Tab goes on into it
    keys(tab, "Control+k")
    tab.until(lambda: page.evaluate("document.activeElement.placeholder") == "Search commands...")
    page.keyboard.type("tab: compare")
    page.get_by_text("Tab: Compare").wait_for()
    keys(tab, "Enter")
    compare = page.get_by_role("tab", name="Compare", exact=True)
    tab.until(lambda: compare.get_attribute("aria-selected") == "true")
    tab.until(lambda: page.evaluate(FOCUSED) == "Compare")
    # ... and its neighbour with an arrow
    keys(tab, "ArrowRight")
    beside = page.get_by_role("tab", name="Calibrate", exact=True)
    tab.until(lambda: beside.get_attribute("aria-selected") == "true")
    # 5. undo both
    keys(tab, "Control+z", "Control+z")
    tab.until(lambda: tab.session.state.component == "norm")
    tab.until(lambda: tab.session.state.amplitudes["EC0Y"] == START.amplitudes["EC0Y"])
    # 6. and all errors are there again
    tab.until(lambda: float(tab.box("EC0Y").input_value()) == START.amplitudes["EC0Y"])
    keys(tab, "/", "Delete")
    tab.until(lambda: tab.page.locator(".ws-error").count() > 30)


def test_keys_work_in_a_check_box_and_not_where_text_is_written(tab: Tab) -> None:
    page = tab.page
    page.get_by_label("Nominal box", exact=True).click()
    tab.until(lambda: not tab.session.state.shown.ghost)
    assert page.evaluate("document.activeElement.type") == "checkbox"
    keys(tab, "t")
    tab.until(lambda: "true scale" in tab.text("factor"))
    keys(tab, "Control+z")
    tab.until(lambda: "1000" in tab.text("factor"))
    keys(tab, " ")  # still ticks the box
    tab.until(lambda: tab.session.state.shown.ghost)
    # chosen with the mouse, an option leaves the keys alone
    tab.choose("Component", "E_y")
    tab.until(lambda: tab.session.state.component == "y")
    page.wait_for_timeout(100)
    keys(tab, "2")
    tab.until(lambda: tab.session.state.component == "x")
    tab.written("Find an error").click()
    page.keyboard.type("t4/")
    assert tab.written("Find an error").input_value() == "t4/"
    assert (tab.state().component, tab.session.state.exaggeration) == ("x", None)
    keys(tab, "Escape", "4")
    tab.until(lambda: tab.session.state.component == "z")


def test_all_that_is_operated_or_drawn_has_a_name(tab: Tab) -> None:
    page = tab.page
    names = page.get_by_role("tab").all_inner_texts()
    for name in names:
        tab.panel(name)
        page.wait_for_timeout(900 if name in ("Tolerances", "Sensitivities") else 400)
        found = tree(tab)
        assert [role for role, said in found if role in NAMED and not said] == [], name
    tab.panel("View")
    tab.panel("Volumetric error")
    tab.session.context.post(lambda state: state.with_chosen_error("EAY"))
    page.wait_for_timeout(900)
    found = tree(tab)
    # a slider and its number, a text box, a group of buttons, a chart, the drawing, the colours
    for role, said in (
        ("slider", "EAX · ε_xX · roll of X [µrad]"),
        ("textbox", "EAX · ε_xX · roll of X [µrad]"),
        ("textbox", "Find an error"),
        ("slider", "Exaggeration, logarithmic"),
        ("group", "History"),
        ("button", "Command palette"),
        ("combobox", "Component"),
    ):
        assert (role, said) in found
    images = [said for role, said in found if role == "image"]
    assert (
        "Chart of EAY, pitch of Y: starts with 0 µrad at −225 mm, ends with −43.7 µrad at 225 mm"
        in images
    )
    assert any(
        said.startswith("Drawing of the deformed working volume. DVF5000") for said in images
    )
    assert any(said.startswith("Colour bar from 0 to 60 µm") for said in images)


def test_the_histogram_is_told_in_words(tab: Tab) -> None:
    tab.panel("Tolerances")
    tab.until(
        lambda: any(
            role == "image" and said.startswith("Histogram of |E|: machines from")
            for role, said in tree(tab)
        )
    )


def test_the_exaggeration_is_said_as_it_is(tab: Tab) -> None:
    thumb = tab.thumb("Exaggeration, logarithmic")
    tab.until(lambda: thumb.get_attribute("aria-valuetext") == "×1000")
    keys(tab, "t")
    tab.until(lambda: thumb.get_attribute("aria-valuetext") == "×1")


def test_the_focus_is_seen_and_folders_open_by_key(tab: Tab) -> None:
    page = tab.page
    keys(tab, "/")  # the keyboard is in use
    tab.thumb("EXX").focus()
    keys(tab, "ArrowRight")
    for place in (
        tab.thumb("EXX"),
        page.get_by_role("button", name="Undo", exact=True),
        page.get_by_role("tab", name="Machine", exact=True),
        page.get_by_label("Nominal box", exact=True),
        page.get_by_label("Component", exact=True).first,
        tab.box("EXX"),
    ):
        place.focus()
        assert page.evaluate(OUTLINE) >= 2.0
    folder = page.get_by_role("button", name="B axis · 10 errors")
    tab.until(lambda: folder.get_attribute("aria-expanded") == "false")
    folder.focus()
    assert page.evaluate(OUTLINE) >= 2.0
    keys(tab, "Enter")
    tab.until(lambda: folder.get_attribute("aria-expanded") == "true")
    tab.until(lambda: tab.thumb("EXB").is_visible())
    keys(tab, " ")
    tab.until(lambda: folder.get_attribute("aria-expanded") == "false")


def test_tab_reaches_sliders_and_tabs_one_after_the_other(tab: Tab) -> None:
    page = tab.page
    tab.written("Find an error").focus()
    seen: list[Any] = []
    for _ in range(14):
        keys(tab, "Tab")
        seen.append(page.evaluate(FOCUSED))
    assert "EXX · δ_xX · positioning of X [µm]" in seen
    assert seen.index("Reset") < seen.index("EXX · δ_xX · positioning of X [µm]")


def test_panels_for_developers_are_hidden(tab: Tab) -> None:
    icons = tab.page.locator(".tabler-icon-adjustments")
    assert icons.count() > 0  # viser's button for them is still in the page
    assert not any(icon.is_visible() for icon in icons.all())
    for words in ("Dev Settings", "Orbit Origin Tool", "Save Canvas"):
        assert not tab.page.get_by_text(words).first.is_visible()
