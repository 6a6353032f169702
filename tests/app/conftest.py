"""The app as it runs, and pages of it in a real browser."""

import os
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest

from app.frames import draw
from app.page_tab import SCENES, Tab, open_page
from warpspace.app.server import viewer
from warpspace.app.server.viewer import Viewer
from warpspace.cli.services import build_services

if TYPE_CHECKING:
    from playwright.sync_api import Browser

# two processes that look for a free port from the same one on may both find it
viewer.DEFAULT_PORT = 10_000 + 10 * (os.getpid() % 2_000)


@pytest.fixture(scope="session")
def viewer() -> Iterator[Viewer]:
    """The app with figures and exports, as the command line starts it."""
    scenes = {scene.title: scene for scene in SCENES}
    with Viewer(SCENES[0], scenes, services=build_services()) as running:
        yield running


@pytest.fixture
def open_tab(viewer: Viewer, browser: "Browser") -> Iterator[Callable[..., Tab]]:
    """Open tabs, each as a visitor of its own, as of `open_page`; none reports an error."""
    tabs: list[Tab] = []

    def open_one(**how: Any) -> Tab:
        tabs.append(open_page(viewer, browser, **how))
        return tabs[-1]

    yield open_one
    for tab in tabs:
        tab.page.context.close()
    assert [error for tab in tabs for error in tab.errors] == []


@pytest.fixture
def tab(open_tab: Callable[..., Tab]) -> Iterator[Tab]:
    """A tab with the app at its start; what a test leaves of it can be drawn."""
    tab = open_tab()
    yield tab
    draw(tab.page)
