"""A comparison in a real Chromium: stored in links and files, exported, sliced; and its limits."""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
import pytest

from app.conftest import Tab
from warpspace.app import links
from warpspace.app.live import Frame, LiveModel
from warpspace.app.state import AppState, start_state
from warpspace.app.viewer import Viewer
from warpspace.cli.services import build_services
from warpspace.scene.library import load_scene

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext

pytestmark = pytest.mark.browser
LIVE = LiveModel()
SCENES = [load_scene(name) for name in ("dvf5000_first", "dvf5000_second", "teach_tilted_c")]
START = start_state(SCENES[0])


@pytest.fixture(scope="module")
def viewer() -> Iterator[Viewer]:
    """The app with figures and exports, as the command line starts it."""
    scenes = {scene.title: scene for scene in SCENES}
    with Viewer(SCENES[0], scenes, services=build_services()) as running:
        yield running


def drawn(frame: Frame) -> np.ndarray:
    return frame.drawn_mm.reshape(-1, 3)[frame.topology.surface.nodes]


def panel(tab: Tab, name: str) -> None:
    tab.page.get_by_role("tab", name=name, exact=True).click()


def state_of(viewer: Viewer, tab: Tab) -> AppState:
    """State of the newest session: that of the tab under test."""
    tab.page.wait_for_timeout(200)
    return viewer.sessions[-1].state


def upload(tab: Tab, name: str, content: bytes) -> None:
    tab.page.locator("input[type=file]").set_input_files(
        {"name": name, "mimeType": "text/plain", "buffer": content}
    )


@pytest.fixture
def follow(viewer: Viewer, browser: "Browser") -> Iterator[Callable[[str], Tab]]:
    """Open links, each as a visitor of its own; no page may report an error."""
    opened: list[tuple[BrowserContext, Tab]] = []

    def open_link(link: str) -> Tab:
        context = browser.new_context(viewport={"width": 1600, "height": 900})
        address = f"{viewer.url}/?fixedDpr=1&{links.PARAMETER}={links.pack(link)}#"
        opened.append((context, Tab(context.new_page(), address)))
        return opened[-1][1]

    yield open_link
    for context, tab in opened:
        context.close()
        assert tab.errors == []


def test_a_link_to_another_scene_with_changed_errors_leaves_no_message(
    viewer: Viewer, follow: Callable[[str], Tab]
) -> None:
    """Sliders of the former scene must not be told anything once they are to be replaced."""
    tab = follow("scene=dvf5000_second&EXX=4&EC0Y=1")
    tab.until(lambda: state_of(viewer, tab).scene is SCENES[1])
    tab.page.wait_for_timeout(1500)
