"""Controls do what they say: keys stay in the page, values revert, messages cover nothing."""

import pytest

from app.page_tab import Tab
from page_client import selector
from warpspace.app.browser import actions as do
from warpspace.app.state.app_state import start_state
from warpspace.app.state.store import SAME_STEP_S
from warpspace.scene.library import load_scene

FIRST = start_state(load_scene("dvf5000_first"))
CAMERA = "window.__viserMutable.camera.position.toArray()"
DRAG_FILE = """([place, type]) => {
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File(["x"], "a.toml"));
  document.querySelector(place).dispatchEvent(
    new DragEvent(type, { bubbles: true, cancelable: true, dataTransfer }));
}"""
COVERED = """message => {
  const box = node => node.getBoundingClientRect();
  const { left, right, top, bottom } = box(message);
  const parts = ".ws-head > *, [role=tab], #ws-top button, .ws-foot summary, .ws-legend, #ws-left"
    + ", #ws-right, [open] > .ws-sheet, .ws-bars, .ws-triad";
  const scrolls = part => innerWidth <= 700 && part.closest("#ws-left, #ws-right");
  return [...document.querySelectorAll(parts)].filter(part => {
    const at = box(part), across = at.left < right - 1 && left < at.right - 1;
    const isShown = part.checkVisibility() && at.width && !scrolls(part);
    return isShown && across && at.top < bottom - 1 && top < at.bottom - 1;
  }).map(part => part.outerHTML.slice(0, 80));
}"""
"""Headings, menus and controls under a message; the columns of a phone scroll above it."""


def test_keys_on_rows_buttons_tabs_and_boxes_do_not_move_the_camera(tab: Tab):
    before = tab.still(lambda: tab.page.evaluate(CAMERA))
    for place, key in (
        ("[role=treeitem]", "ArrowRight"), ("#ws-top button", "ArrowRight"), ("[role=tab]", "d"),
        (".ws-controls summary", "ArrowUp"), ("#ws-find", "e"),
    ):  # fmt: skip
        tab.page.focus(place)
        tab.page.keyboard.press(key, delay=300)
    assert tab.still(lambda: tab.page.evaluate(CAMERA)) == pytest.approx(before)
    tab.page.evaluate("document.activeElement.blur()")
    tab.page.keyboard.press("ArrowRight", delay=300)
    tab.until(lambda: tab.page.evaluate(CAMERA) != pytest.approx(before))


def test_a_rejected_value_reverts_with_the_reason(tab: Tab):
    tab.page.click("[data-key=menu-exaggeration] summary")
    box = tab.page.locator("#ws-SetLeaf-exaggeration")
    for text, value in (("abc", "1000"), ("5e9", "1000000"), ("6e9", "1000000")):
        box.fill(text)
        box.press("Enter")
        tab.says("exaggeration = ", within="#ws-toasts")
        tab.until(lambda value=value: box.input_value() == value)


def test_the_same_rejected_text_reverts_each_time(tab: Tab):
    """The second time the HTML is the same, so that only `settle` reverts the box."""
    tab.task("Machine")
    tab.unfold("Edit the machine")
    box = tab.page.locator(selector(do.EditMachine("chain"), "set"))
    accepted = box.input_value()
    for _ in range(3):
        box.click()
        tab.page.keyboard.press("Control+a")
        tab.page.keyboard.type("nonsense")
        tab.page.keyboard.press("Enter")
        tab.until(lambda: box.input_value() == accepted, seconds=10.0)


def test_a_list_with_new_choices_shows_the_selected_one(tab: Tab):
    for options in ("<option selected>B", "<option>B<option selected>program<option>C"):
        pieces = {"story": f"<select id=a-list>{options}</select>"}
        tab.page.evaluate("pieces => warpspacePage.show(pieces)", pieces)
    assert tab.page.locator("#a-list").input_value() == "program"


def test_a_drag_with_a_pause_is_one_step_and_undo_restores_the_range(tab: Tab):
    slider = tab.page.get_by_role("slider", name="EA0Z squareness of Z to Y")
    box = slider.bounding_box()
    y = box["y"] + box["height"] / 2
    tab.page.mouse.move(box["x"] + 0.66 * box["width"], y)
    tab.page.mouse.down()
    for share in (0.3, 0.4):
        tab.page.mouse.move(box["x"] + share * box["width"], y)
        tab.page.wait_for_timeout(1000 * SAME_STEP_S + 200)
    tab.page.mouse.up()
    tab.until(lambda: tab.state.amplitudes["EA0Z"] < 0.0)
    tab.press("Control+z")
    tab.until(lambda: tab.state == FIRST)
    ends = slider.get_attribute("max")
    tab.page.click("#ws-box-EA0Z")
    tab.page.keyboard.type("2000\n")
    tab.until(lambda: slider.get_attribute("max") == "5000")
    tab.press("Control+z")
    tab.until(lambda: slider.get_attribute("max") == ends)


def test_files_over_the_page_show_where_they_go(tab: Tab):
    drop = tab.page.locator("#ws-drop")
    tab.page.evaluate(DRAG_FILE, ["#ws-over", "dragover"])
    assert drop.inner_text() == "Drop to open"
    assert drop.bounding_box() == tab.page.locator("#ws-over").bounding_box()
    drop.wait_for(state="hidden")  # the browser repeats the event while files are over the page
    tab.page.click("#ws-error-EA0Z")
    tab.page.wait_for_selector("textarea.ws-rows-box")
    tab.page.evaluate(DRAG_FILE, ["textarea.ws-rows-box", "dragover"])
    assert drop.inner_text() == "Drop: numbers of this curve"
    tab.page.evaluate(DRAG_FILE, ["#ws-over", "dragleave"])
    assert drop.is_hidden()


@pytest.mark.parametrize("size", [(360, 740), (430, 930), (1024, 700), (1440, 900), (2560, 1440)])
def test_messages_and_menus_cover_nothing_and_notes_are_reached_at_every_size(open_tab, size):
    tab: Tab = open_tab(size=size)
    page = tab.page
    for _ in range(2):
        page.evaluate(
            "warpspacePage.toast('stays', 'Opened', 'A text of several words. '.repeat(9))"
        )
    message = page.locator("#ws-toasts").element_handle()
    for menu in ("map", "surface", "limit", "compare"):
        page.evaluate("name => warpspacePage.menu(name)", menu)
        tab.until(lambda: page.evaluate(COVERED, message) == [])
        sheet = page.locator("[open] > .ws-sheet")
        at, head = sheet.bounding_box(), page.locator(".ws-head h1").bounding_box()
        assert at["y"] >= head["y"] + head["height"]
        page.keyboard.press("Escape")
    for task in ("Machine", "Design"):
        page.get_by_role("tab", name=task).click()
        page.get_by_role("button", name="Help").click()
        page.locator("#ws-window").get_by_role("button", name="Notes", exact=True).click()
        page.locator("#ws-notes header").wait_for()
        assert tab.in_sight("#ws-notes header")
        page.locator("#ws-notes [data-do='close_notes']").click()


def test_the_playback_bar_of_a_program_keeps_within_a_phone(open_tab):
    tab: Tab = open_tab(size=(390, 800))
    line = "<div class=ws-line>" + "G1 X80.0000 Y-80.0000 36.1 µm, " * 9 + "</div>"
    bar = f"<div><div class=ws-turn><button>Play</button><span>line 6</span></div>{line}</div>"
    tab.page.evaluate("bar => warpspacePage.show({ playback: bar })", bar)
    box = tab.page.locator(".ws-playback > div").bounding_box()
    assert box["x"] + box["width"] <= 390
