"""Where the panels stand in a real Chromium, and the names they call things by."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from app.conftest import Tab
from warpspace.app.live import LiveModel
from warpspace.app.state import start_state
from warpspace.app.tonemap import vertex_colours
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


@pytest.mark.parametrize(("width", "height"), [(1600, 900), (1280, 800)])
def test_tabs_stand_on_one_line_and_sliders_have_the_height(
    open_tab: Callable[..., Tab], width: int, height: int
) -> None:
    tab = open_tab(size=(width, height))
    assert set(tab.page.evaluate(STRIPS)) == {1}
    tab.until(lambda: shares(tab)[0] > 0.66)
    # labels do not reach below the buttons beside them
    overlaps = tab.page.evaluate(OVERLAPS)
    assert overlaps == 0
    assert tab.errors == []


@pytest.mark.own_page
def test_the_divider_on_the_left_can_be_moved(tab: Tab) -> None:
    tab.until(lambda: shares(tab)[0] > 0.66)
    before, height = shares(tab)
    at = tab.page.locator(DIVIDER).bounding_box()
    x, y = at["x"] + 60, at["y"] + at["height"] / 2
    tab.page.mouse.move(x, y)
    tab.page.mouse.down()
    tab.page.mouse.move(x, y - 40)
    tab.page.mouse.move(x, y - 90)
    tab.page.mouse.up()
    tab.until(lambda: abs(shares(tab)[0] - (before - 90 / height)) < 0.02)


def test_the_colours_of_tilts_are_called_tilts(tab: Tab) -> None:
    tab.choose("Colour shows", "tool-orientation error [µrad]")
    colour = tab.page.get_by_label("Colour", exact=True)
    tab.until(lambda: colour.input_value() == "|φ| tilt of the tool axis")
    tab.choose("Colour", "φ_y tilt about y")
    tilted = replace(START, look=START.look.with_choice(quantity="orientation"))
    frame = LIVE.frame(tilted.with_component("y"))
    wanted = vertex_colours(frame.scale, frame.values.reshape(-1)[frame.topology.surface.nodes])
    tab.until(lambda: np.allclose(tab.surface()[1], wanted, atol=1e-5))
    worst = tab.page.locator("[data-mark='max']").get_attribute("title")
    assert worst.endswith("µrad")
    assert float(worst.split()[0].replace("−", "-")) == pytest.approx(frame.values.max(), abs=0.006)
    tab.choose("Colour shows", "position error [µm]")
    tab.until(lambda: colour.input_value() == "E_y")
