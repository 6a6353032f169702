"""The page at every size, from a phone to a very large screen: all is seen, nothing is covered."""

from functools import partial

import numpy as np
import pytest
from viser.transforms import SO3

from app.frames import new_visitor
from app.page_tab import Tab
from warpspace.app.browser import actions as do
from warpspace.app.drawing.shapes import SCENE_PER_MM
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.state.app_state import start_state
from warpspace.scene.library import load_scene

PICTURE = LiveModel().evaluate(start_state(load_scene("dvf5000_first")))
PHONE = (390, 844)
BOXES = """() => {
  const box = part => {
    const { left, top, right, bottom } = part.getBoundingClientRect();
    return [left, top, right, bottom];
  };
  const all = selector => [...document.querySelectorAll(selector)].map(box);
  return { head: all("[data-piece=head] > *")[0], tabs: all("[role=tab]"), foot: all(".ws-foot")[0],
    room: box(window.__viserMutable.canvas), legend: all("[data-piece=legend] .ws-scale")[0],
    columns: all("#ws-left, #ws-right, #ws-top") };
}"""
PROJECT = """points => {
  const { camera, canvas, nodeRefFromName } = window.__viserMutable;
  const rect = canvas.getBoundingClientRect(), root = nodeRefFromName[""];
  return points.map(([x, y, z]) => {
    const at = camera.position.clone().set(x, y, z).applyMatrix4(root.matrixWorld).project(camera);
    return [rect.left + (at.x + 1) / 2 * rect.width, rect.top + (1 - at.y) / 2 * rect.height];
  });
}"""
"""Where points of the drawing are on the page, by three.js itself."""
BARS = """() => ["mm", "um"].map(name => {
  const bar = document.querySelector(`[data-bar-scale=${name}]`);
  const { width } = bar.firstElementChild.getBoundingClientRect();
  return [+bar.dataset.length, width, bar.textContent.trim()];
})"""
"""What the bars of lengths and of errors stand for, mm and µm, their pixels and words."""


def overlap(a, b):
    return all(a[i] < b[i + 2] - 0.5 and b[i] < a[i + 2] - 0.5 for i in (0, 1))


def within(inner, outer):
    return all(inner[i] >= outer[i] - 0.5 and inner[i + 2] <= outer[i + 2] + 0.5 for i in (0, 1))


def nodes():
    """Nominal corners and drawn nodes of the map, in units of the drawing, [n, 3]."""
    corners = np.stack(np.meshgrid(*PICTURE.grid.bounds_mm.T), axis=-1).reshape(-1, 3)
    return np.concatenate([corners, PICTURE.drawn_mm[::4, ::4, ::4].reshape(-1, 3)]) * SCENE_PER_MM


def extent(tab):
    """Where the box is on the page: left, top, right, bottom."""
    seen = np.array(tab.page.evaluate(PROJECT, nodes().tolist()))
    return [*seen.min(axis=0).tolist(), *seen.max(axis=0).tolist()]


def settled(tab):
    """Wait until the camera stands still, and tell where the box is then."""
    tab.until(lambda: tab.session.context.camera.reported_room is not None)
    return tab.still(lambda: extent(tab), 0.2)


def filled_share(tab):
    """The share of the free height or width that the box fills."""
    box, found = extent(tab), tab.page.evaluate(BOXES)
    width, height = box[2] - box[0], box[3] - box[1]
    room = found["room"]
    return max(width / (room[2] - room[0]), height / (found["foot"][1] - found["head"][3]))


def check_page(tab):
    """See that nothing covers anything, and that the box fills its room."""
    tab.until(lambda: filled_share(tab) > 0.5)  # the camera follows the page, sooner or later
    box = settled(tab)
    found = tab.page.evaluate(BOXES)
    head, room = found["head"], found["room"]
    page = [0.0, 0.0, *tab.page.viewport_size.values()]
    assert within(head, room)
    assert len(found["tabs"]) == 5
    for name in found["tabs"]:
        assert not overlap(head, name)
        assert within(name, page)
        # as wide and as high as a finger or a mouse wants it
        assert min(name[2] - name[0], name[3] - name[1]) >= 20
    for column in found["columns"]:
        assert not overlap(column, room)
    assert within(found["legend"], room)
    assert not overlap(found["legend"], head)
    # between heading and controls, and filling what is left one way or the other
    free = [room[0], head[3], room[2], found["foot"][1]]
    assert within(box, free)
    assert filled_share(tab) > 0.5


def camera(tab):
    """The camera of the session of a page, which may have connected anew."""
    return tab.session.context.camera


def test_nothing_is_covered_and_the_box_fills_its_room_unless_it_was_turned(open_tab):
    tab = open_tab(size=(1024, 768))
    check_page(tab)
    start = camera(tab).remember()
    tab.page.set_viewport_size({"width": 1600, "height": 1000})
    tab.until(lambda: not np.allclose(camera(tab).remember().position, start.position, atol=0.1))
    check_page(tab)
    room = tab.page.evaluate(BOXES)["room"]
    x, y = (room[0] + room[2]) / 2, (room[1] + room[3]) / 2
    filled = camera(tab).remember()
    tab.page.mouse.move(x, y)
    tab.page.mouse.down()
    tab.page.mouse.move(x + 80, y + 20, steps=4)
    tab.page.mouse.up()
    tab.until(lambda: not np.allclose(camera(tab).remember().position, filled.position, atol=0.1))
    turned = tab.still(lambda: camera(tab).remember().position)
    told = camera(tab).reported_room
    tab.page.set_viewport_size({"width": 1280, "height": 720})
    tab.until(lambda: camera(tab).reported_room != told)
    settled(tab)
    assert np.allclose(camera(tab).remember().position, turned, atol=1e-3)


def bars_agree(tab):
    """Wait until both bars are as long as what they stand for across the line of sight."""
    across = SO3(tab.session.context.client.camera.wxyz).as_matrix()[:, 0]
    middle = PICTURE.grid.bounds_mm.mean(axis=0)

    def pixels(length_mm):
        ends = [SCENE_PER_MM * (middle + at * length_mm * across) for at in (-0.5, 0.5)]
        seen = tab.page.evaluate(PROJECT, np.array(ends).tolist())
        return float(np.linalg.norm(np.subtract(*seen)))

    def agree():
        (mm, mm_px, _), (um, um_px, _) = tab.page.evaluate(BARS)
        wanted = [pixels(mm), pixels(um * 1e-3 * PICTURE.exaggeration)]
        return [mm_px, um_px] == pytest.approx(wanted, abs=0.1)

    # bars follow the camera with the next frame, for which software rendering takes its time
    tab.until(agree)
    (mm, mm_px, mm_text), (um, um_px, um_text) = tab.page.evaluate(BARS)
    assert min(mm_px, um_px) > 20
    assert mm_text == f"{mm:g} mm geometry"
    assert um_text == f"{um:g} µm error, drawn ×1000"


VIEWS = {"front": (0, -1, 0), "right": (1, 0, 0), "top": (0, 0, 1), "iso": None}


def test_every_view_looks_along_its_axis_through_both_lenses_with_right_scale_bars(tab):
    camera = tab.session.context.client.camera

    def away():
        return camera.position - camera.look_at

    def looks_along(direction):
        return np.allclose(away() / np.linalg.norm(away()), direction, atol=5e-3)

    def size():
        return float(np.linalg.norm(away()) * np.tan(camera.fov / 2))

    settled(tab)
    wide = camera.fov
    for view, direction in VIEWS.items():
        tab.send(do.ViewFrom(view))
        if direction is not None:
            tab.until(partial(looks_along, direction))
        settled(tab)
        bars_agree(tab)
    tab.still(away)  # the page has told the server where its camera has come to stand
    before = size()
    tab.send(do.SetOrthographic("1"))
    tab.until(lambda: abs(np.rad2deg(camera.fov) - 3.0) < 1e-6)
    tab.until(lambda: size() == pytest.approx(before, rel=5e-3))
    settled(tab)
    bars_agree(tab)
    tab.send(do.SetOrthographic("0"))
    tab.until(lambda: abs(camera.fov - wide) < 1e-6)
    tab.send(do.SetLeaf("look.bars", "0"))
    tab.until(lambda: tab.page.locator("[data-bar-scale]").count() == 0)


@pytest.mark.daily
def test_a_phone_has_the_drawing_on_top_and_the_columns_below(viewer, browser):
    context = new_visitor(browser, PHONE, device_scale_factor=1, is_mobile=True, has_touch=True)
    phone = Tab(context.new_page(), viewer)
    box = settled(phone)
    found = phone.page.evaluate(BOXES)
    free = [found["room"][0], found["head"][3], found["room"][2], found["foot"][1]]
    assert within(box, free)
    assert within(found["legend"], found["room"])
    assert "mean 30.9 µm" in phone.part("head").inner_text()
    names = phone.page.locator(".ws-words [data-kind=axis]").all_inner_texts()
    assert sorted(names) == ["X [mm]", "Y [mm]", "Z [mm]"]
    for action in (do.SetError("EXX", "1"), do.SetError("EYY", "1"), do.Signal.UNDO):
        phone.send(action)
    for step in ("undo", "redo"):
        phone.page.wait_for_selector(f"[data-do={step}]")
    for part in ("document.documentElement", "document.querySelector('#ws-top')"):
        assert phone.page.evaluate(f"{part}.scrollWidth") <= PHONE[0]
    phone.page.get_by_role("tab", name="Improve").scroll_into_view_if_needed()
    phone.page.get_by_role("tab", name="Improve").tap()
    phone.says("Compensate")
    context.close()
    assert phone.errors == []
