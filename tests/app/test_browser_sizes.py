"""The page at every size, from a phone to a very large screen: all is seen, nothing is covered."""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from app.frames import new_visitor
from app.page_tab import TIDY, Tab, wait_until_open
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import start_state
from warpspace.app.viewport.layers import SCENE_PER_MM
from warpspace.scene.library import load_scene

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = pytest.mark.browser
PICTURE = LiveModel().evaluate(start_state(load_scene("dvf5000_first")))
LARGEST = pytest.param((3840, 2160), marks=pytest.mark.proof)
SIZES = [(1024, 768), (1600, 1000), LARGEST]
PHONE = (390, 844)
BOXES = """() => {
  const box = part => {
    const { left, top, right, bottom } = part.getBoundingClientRect();
    return [left, top, right, bottom];
  };
  const all = selector => [...document.querySelectorAll(selector)].map(box);
  return { head: all(".ws-room-head > *")[0], tabs: all("[role=tab]"),
    room: box(window.__viserMutable.canvas), docks: all("[data-dock-region]"),
    foot: all(".ws-room-foot")[0], shown: ["mean", "max", "max at"].map(
      name => all(`[data-value="${name}"]`)[0]), scale: all(".ws-scale")[0] };
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
BARS = """() => Object.fromEntries([...document.querySelectorAll("[data-bar-scale]")].map(bar =>
    [bar.dataset.barScale, [+bar.dataset.length,
      bar.firstElementChild.getBoundingClientRect().width, bar.textContent.trim()]]))"""
ACROSS = """() => {
  const { camera, nodeRefFromName } = window.__viserMutable;
  const world = nodeRefFromName[""].matrixWorld.clone().invert();
  const c = camera.matrixWorld.elements, right = camera.position.clone().set(c[0], c[1], c[2]);
  right.transformDirection(world);
  return [right.x, right.y, right.z];
}"""
"""The direction across the line of sight, in the drawing's own axes."""


def overlap(a: list[float], b: list[float]) -> bool:
    return a[0] < b[2] - 0.5 and b[0] < a[2] - 0.5 and a[1] < b[3] - 0.5 and b[1] < a[3] - 0.5


def within(inner: list[float], outer: list[float]) -> bool:
    return (
        inner[0] >= outer[0] - 0.5
        and inner[1] >= outer[1] - 0.5
        and inner[2] <= outer[2] + 0.5
        and inner[3] <= outer[3] + 0.5
    )


def nodes() -> np.ndarray:
    """Nominal corners and drawn nodes of the map, in units of the drawing, [n, 3]."""
    corners = np.stack(np.meshgrid(*PICTURE.grid.bounds_mm.T), axis=-1).reshape(-1, 3)
    drawn = PICTURE.drawn_mm[::4, ::4, ::4].reshape(-1, 3)
    return np.concatenate([corners, drawn]) * SCENE_PER_MM


def extent(tab: Tab) -> list[float]:
    """Where the box is on the page: left, top, right, bottom."""
    seen = np.array(tab.page.evaluate(PROJECT, nodes().tolist()))
    return [*seen.min(axis=0).tolist(), *seen.max(axis=0).tolist()]


def settled(tab: Tab) -> list[float]:
    """Wait until the camera stands still, and tell where the box is then."""
    before = extent(tab)
    for _ in range(40):
        tab.page.wait_for_timeout(500)
        now = extent(tab)
        if np.abs(np.subtract(now, before)).max() < 0.2 and tab.session.context.camera._told:
            return now
        before = now
    pytest.fail("the camera does not come to rest")


@pytest.fixture(scope="module", params=SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def sized(viewer: Viewer, browser: "Browser", request: pytest.FixtureRequest) -> Iterator[Tab]:
    """A page of one size."""
    width, height = request.param
    context = new_visitor(browser, (width, height), device_scale_factor=1)
    context.set_default_timeout(60_000)
    tab = Tab(context.new_page(), viewer)
    yield tab
    context.close()
    assert tab.errors == []


def test_nothing_covers_anything_and_the_box_fills_its_room(sized: Tab) -> None:
    box = settled(sized)
    found = sized.page.evaluate(BOXES)
    head, room = found["head"], found["room"]
    page = [0.0, 0.0, *sized.page.viewport_size.values()]
    assert within(head, room)
    assert len(found["tabs"]) >= 11
    for tab in found["tabs"]:
        assert not overlap(head, tab)
        assert within(tab, page)
        # as wide and as high as a finger or a mouse wants it
        assert min(tab[2] - tab[0], tab[3] - tab[1]) >= 20
    # read without a scroll or a click: mean, max and where, and the colour bar
    right = next(dock for dock in found["docks"] if dock[0] > room[0])
    for shown in (*found["shown"], found["scale"]):
        assert within(shown, right)
        assert not overlap(shown, head)
    # between heading and scale bars, and filling what is left one way or the other
    free = [room[0], head[3], room[2], found["foot"][1]]
    assert within(box, free)
    width, height = box[2] - box[0], box[3] - box[1]
    assert max(width / (free[2] - free[0]), height / (free[3] - free[1])) > 0.62


def test_every_tab_can_be_chosen_by_its_whole_name(sized: Tab) -> None:
    for tab in sized.page.get_by_role("tab").all():
        name = tab.inner_text()
        assert tab.get_attribute("title") == name
        sized.page.get_by_role("tab", name=name, exact=True).click()
        sized.until(lambda tab=tab: tab.get_attribute("aria-selected") == "true")
    for name in ("View", "Volumetric error"):
        sized.panel(name)


def bars_agree(tab: Tab) -> None:
    """Wait until both bars are as long as what they stand for, and read what they say."""

    def agree() -> bool:
        bars = tab.page.evaluate(BARS)
        wanted = [projected(tab, bars["mm"][0]), projected(tab, drawn_mm(bars["um"][0]))]
        return [bars["mm"][1], bars["um"][1]] == pytest.approx(wanted, abs=0.1)

    # bars follow the camera with the next frame, for which software rendering takes its time
    tab.until(agree)
    bars = tab.page.evaluate(BARS)
    (mm, mm_px, mm_text), (um, um_px, um_text) = bars["mm"], bars["um"]
    assert min(mm_px, um_px) > 20
    assert mm_text == f"{mm:g} mm geometry"
    assert um_text == f"{um:g} µm error, drawn ×1000"


def drawn_mm(error_um: float) -> float:
    """How long an error is drawn, mm."""
    return error_um * 1e-3 * PICTURE.exaggeration


def projected(tab: Tab, length_mm: float) -> float:
    """Pixels of a length across the line of sight in the middle of the volume, by three.js."""
    middle = PICTURE.grid.bounds_mm.mean(axis=0) * SCENE_PER_MM
    half = length_mm / 2 * SCENE_PER_MM * np.array(tab.page.evaluate(ACROSS))
    a, b = np.array(
        tab.page.evaluate(PROJECT, [(middle - half).tolist(), (middle + half).tolist()])
    )
    return float(np.linalg.norm(b - a))


def test_scale_bars_are_right_in_every_view(tab: Tab) -> None:
    settled(tab)
    bars_agree(tab)
    lengths: set[float] = set()
    for lens in ("perspective", "orthographic"):
        if lens == "orthographic":
            tab.page.get_by_role("checkbox", name="Orthographic", exact=False).check()
        for view in ("Front", "Right", "Top", "Iso"):
            tab.page.get_by_role("button", name=view, exact=True).click()
            settled(tab)
            bars_agree(tab)
            lengths.add(round(tab.page.evaluate(BARS)["mm"][1], 1))
    assert len(lengths) > 2
    room = tab.page.evaluate(BOXES)["room"]
    tab.page.mouse.move((room[0] + room[2]) / 2, (room[1] + room[3]) / 2)
    tab.page.mouse.wheel(0, -600)
    settled(tab)
    bars_agree(tab)
    tab.page.get_by_role("checkbox", name="Orthographic", exact=False).uncheck()


def test_the_box_fills_a_room_that_grows_unless_it_was_turned(tab: Tab) -> None:
    tab.page.keyboard.press("f")
    before = settled(tab)
    tab.page.set_viewport_size({"width": 1600, "height": 720})
    wider = settled(tab)
    assert wider[3] - wider[1] > before[3] - before[1] + 5 or wider[2] > before[2] + 5
    room = tab.page.evaluate(BOXES)["room"]
    x, y = (room[0] + room[2]) / 2, (room[1] + room[3]) / 2
    start = tab.session.context.camera.remember()
    tab.page.mouse.move(x, y)
    tab.page.mouse.down()
    tab.page.mouse.move(x + 80, y + 20, steps=4)
    tab.page.mouse.up()
    camera = tab.session.context.camera
    tab.until(lambda: not np.allclose(camera.remember().position, start.position, atol=0.1))
    settled(tab)
    turned = camera.remember()
    tab.page.set_viewport_size({"width": 1280, "height": 720})
    settled(tab)
    kept = tab.session.context.camera.remember()
    assert np.allclose(kept.position, turned.position, atol=1e-3)


def test_page_style_survives_the_collapse_of_the_left_column(tab: Tab) -> None:
    height = "() => document.querySelector('[data-dock-tab]').offsetHeight"
    style = "() => getComputedStyle(document.querySelector('#warpspace-room')).pointerEvents"
    before = tab.page.evaluate("() => document.querySelectorAll('head style[id]').length")
    tabs = tab.page.get_by_role("tab", name="Sensitivities", exact=True)
    padding = "tab => getComputedStyle(tab).paddingLeft"
    own = tabs.evaluate(padding)
    tab.page.locator("[data-dock-region-handle=left]").click(position={"x": 30, "y": 5})
    tab.until(lambda: tab.page.get_by_text("Find an error", exact=True).count() == 0)
    assert tabs.evaluate(padding) == own
    assert tab.page.evaluate(style) == "none"
    assert tab.page.evaluate("() => document.querySelectorAll('head style[id]').length") == before
    assert tab.page.evaluate(height) > 0
    tab.page.locator("[data-dock-region=left] [data-dock-minimize-all]").click()
    tab.page.wait_for_selector("text=Find an error")


def ghosts(tab: Tab) -> bool:
    """Whether the ghost of the machine is drawn."""
    return tab.drawn("/ghost_machine/R_bed") is not None


@pytest.mark.own_page
def test_the_machine_is_there_at_the_first_visit_and_stays_hidden_when_hidden(tab: Tab) -> None:
    tab.until(lambda: ghosts(tab))
    tab.page.get_by_role("button", name="Hide machine", exact=True).click()
    tab.until(lambda: not ghosts(tab))
    assert not tab.state().machine.ghost
    # another page of the same browser
    page = tab.page.context.new_page()
    page.goto(f"{tab.viewer.url}/?fixedDpr=1")
    wait_until_open(page)
    button = page.get_by_role("button", name="Show machine", exact=True)
    button.wait_for(timeout=15_000)
    page.close()
    tab.page.get_by_role("button", name="Show machine", exact=True).click()
    tab.until(lambda: ghosts(tab))


def test_isolines_carry_few_values_on_plates_that_suit_the_page(tab: Tab) -> None:
    def plates() -> list[Any]:
        return tab.page.evaluate(
            "() => [...document.querySelectorAll('.ws-room-labels > span')].map(label => {"
            " const r = label.getBoundingClientRect(), s = getComputedStyle(label);"
            " return [label.textContent, r.left, r.top, r.right, r.bottom, s.backgroundColor]; })"
        )

    assert plates() == []
    tab.page.get_by_role("checkbox", name="Isolines", exact=True).check()
    tab.until(lambda: len(plates()) >= 4)
    found = plates()
    assert len(found) <= 12
    ticks = {f"{tick:g} µm" for tick in PICTURE.scale.ticks}
    assert {text for text, *_ in found} <= ticks
    boxes = [rest[:4] for _, *rest in found]
    for number, one in enumerate(boxes):
        assert not any(overlap(one, other) for other in boxes[:number])
    light = found[0][5]
    tab.page.get_by_role("checkbox", name="Dark mode", exact=True).check()
    tab.until(lambda: plates() and plates()[0][5] != light)
    # the labels of the drawing itself, too
    tab.until(
        lambda: (
            tab.page.evaluate(
                "() => { let dark = 0; window.__viserMutable.scene.traverse(({ material }) => {"
                " if (material?.uniforms?.uLabelData)"
                "   dark += /0\\.10, 0\\.11|0\\.86, 0\\.89/.test(material.fragmentShader);"
                " }); return dark; }"
            )
            >= 2
        )
    )


@pytest.fixture
def phone(viewer: Viewer, browser: "Browser") -> Iterator[Tab]:
    """A page on a phone."""
    context = new_visitor(browser, PHONE, device_scale_factor=1, is_mobile=True, has_touch=True)
    # the sheet of panels folds by itself, and what is in it is not there then
    tab = Tab(context.new_page(), viewer, everything=False)
    yield tab
    context.close()
    assert tab.errors == []


def test_a_phone_shows_drawing_and_numbers_with_the_panels_in_a_sheet(
    phone: Tab, find: Callable[[Tab, str], Any]
) -> None:
    box = settled(phone)
    found = phone.page.evaluate(BOXES)
    free = [found["room"][0], found["head"][3], found["room"][2], found["foot"][1]]
    assert within(box, free)
    assert (box[2] - box[0]) / (free[2] - free[0]) > 0.62
    strip = phone.page.locator(".ws-room-strip")
    text = strip.inner_text()
    statistics = PICTURE.statistics
    for number in (statistics.mean_um, statistics.max_um):
        assert f"{number:.2f} µm" in text
    assert "max at" in text
    assert within(found["foot"], [0, 0, *PHONE])
    # the sheet is opened: the drawing stays in view above it
    phone.until(lambda: phone.page.evaluate(TIDY) == 0)
    find(phone, "Errors").tap()
    phone.page.wait_for_selector("text=Find an error")
    sheet = phone.page.get_by_text("Find an error", exact=True)
    phone.until(lambda: extent(phone)[3] < sheet.bounding_box()["y"])
    for name, tabs in (("Volumetric error", 5), ("View", 5)):
        section = phone.page.get_by_role("button", name=f"Expand panel {name}", exact=True)
        section.scroll_into_view_if_needed()
        section.tap()
        chosen = phone.page.get_by_role("tab", name=name, exact=True).locator("xpath=..")
        names = chosen.get_by_role("tab").all()
        assert len(names) >= tabs
        for tab in names:
            tab.scroll_into_view_if_needed()
            tab.tap()
            phone.until(lambda tab=tab: tab.get_attribute("aria-selected") == "true")
            at = tab.bounding_box()
            assert at["x"] >= 0
            assert at["x"] + at["width"] <= PHONE[0]


@pytest.fixture
def find() -> Callable[[Tab, str], Any]:
    """Find a heading of the sheet."""
    return lambda tab, word: tab.page.get_by_text(word, exact=True).first
