"""Where the panels stand in a real Chromium, and the names they call things by."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from app.page_tab import Tab
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.state.app_state import start_state
from warpspace.app.viewport.tone_map import vertex_colours
from warpspace.scene.library import load_scene

pytestmark = pytest.mark.browser
LIVE = LiveModel()
START = start_state(load_scene("dvf5000_first"))
STRIPS = """() => [...document.querySelectorAll('[role=tablist]')].map(strip =>
    new Set([...strip.children].map(tab => tab.offsetTop)).size)"""
HEIGHTS = """() => [...document.querySelectorAll('[data-dock-region=left] [data-dock-leaf]')]
    .map(leaf => leaf.offsetHeight)"""
OVERLAPS = """() => [...document.querySelectorAll('.ws-error')].filter(row => {
    const label = row.parentElement.nextElementSibling.querySelector('p');
    const free = parseFloat(getComputedStyle(label).paddingRight);
    const right = label.getBoundingClientRect().right - free;
    return right > row.querySelector('button').getBoundingClientRect().left;
}).length"""
DIVIDER = "[data-dock-region=left] [data-dock-divider=column]"


def shares(tab: Tab) -> tuple[float, float]:
    errors, curve = tab.page.evaluate(HEIGHTS)
    return errors / (errors + curve), float(errors + curve)


def test_tabs_are_all_seen_and_sliders_have_the_height(
    tab: Tab, open_tab: Callable[..., Tab]
) -> None:
    for page in (tab, open_tab(size=(1600, 900))):
        assert max(page.page.evaluate(STRIPS)) <= 2
        page.until(lambda page=page: shares(page)[0] > 0.66)
        # labels do not reach below the buttons beside them
        assert page.page.evaluate(OVERLAPS) == 0
        assert page.errors == []


def test_the_divider_on_the_left_can_be_moved(tab: Tab) -> None:
    tab.until(lambda: shares(tab)[0] > 0.66)
    before, height = shares(tab)
    for by in (-90, 90):
        at = tab.page.locator(DIVIDER).bounding_box()
        x, start = at["x"] + 60, at["y"] + at["height"] / 2
        end, share = start + by, before + min(by, 0) / height
        tab.page.mouse.move(x, start)
        tab.page.mouse.down()
        tab.page.mouse.move(x, (start + end) / 2)
        tab.page.mouse.move(x, end)
        tab.page.mouse.up()
        tab.until(lambda share=share: abs(shares(tab)[0] - share) < 0.02)


def test_the_colours_of_tilts_are_called_tilts(tab: Tab) -> None:
    tab.choose("Quantity", "tool-orientation error [µrad]")
    colour = tab.page.get_by_label("Component", exact=True)
    tab.until(lambda: colour.input_value() == "|φ| tilt of the tool axis")
    tab.choose("Component", "φ_y tilt about y")
    tilted = replace(START, look=START.look.with_choice(quantity="orientation"))
    picture = LIVE.evaluate(tilted.with_component("y"))
    wanted = vertex_colours(
        picture.scale, picture.values.reshape(-1)[picture.topology.surface.nodes]
    )
    tab.until(lambda: tab.shows_colours(wanted))
    worst = tab.page.locator("[data-mark='max']").get_attribute("title")
    assert worst.endswith("µrad")
    assert float(worst.split()[0].replace("−", "-")) == pytest.approx(
        picture.values.max(), abs=0.006
    )
    tab.choose("Quantity", "position error [µm]")
    tab.until(lambda: colour.input_value() == "E_y")
