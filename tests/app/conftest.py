"""The app as it runs, and pages of it that one test hands on to the next."""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest

from app.frames import draw
from app.page_tab import SCENES, Tab, open_page
from warpspace.app.server.viewer import Viewer
from warpspace.cli.services import build_services

if TYPE_CHECKING:
    from playwright.sync_api import Browser

FAILED = pytest.StashKey[bool]()


@pytest.fixture(scope="session")
def viewer() -> Iterator[Viewer]:
    """The app with figures and exports, as the command line starts it."""
    scenes = {scene.title: scene for scene in SCENES}
    with Viewer(SCENES[0], scenes, services=build_services()) as running:
        yield running


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """Remember which tests have failed: what they leave of a page is not used again."""
    report = yield
    if report.failed:
        item.stash[FAILED] = True
    return report


@pytest.fixture(scope="session")
def kept_tabs(browser: "Browser") -> Iterator[list[Tab]]:
    """The page that one test hands on to the next, if there is one."""
    tabs: list[Tab] = []
    yield tabs
    for tab in tabs:
        tab.page.context.close()


def take(kept_tabs: list[Tab], viewer: Viewer, browser: "Browser") -> Tab:
    """Give the page that the last test has left, or open one."""
    from playwright.sync_api import Error

    if kept_tabs:
        try:
            kept_tabs[0].begin_anew()
        except (Error, pytest.fail.Exception):  # what a test has left is no fault of the next
            kept_tabs.pop().page.context.close()
    if not kept_tabs:
        kept_tabs.append(open_page(viewer, browser))
    return kept_tabs[0]


@pytest.fixture
def tab(
    viewer: Viewer, browser: "Browser", kept_tabs: list[Tab], request: pytest.FixtureRequest
) -> Iterator[Tab]:
    """A tab with the app at its start; fails the test if the page reported an error."""
    own = request.node.get_closest_marker("own_page") is not None
    tab = open_page(viewer, browser) if own else take(kept_tabs, viewer, browser)
    yield tab
    if own:
        tab.page.context.close()
    elif request.node.stash.get(FAILED, False) or tab.errors:
        kept_tabs.pop().page.context.close()
    else:
        draw(tab.page)  # what the test has left can be drawn
    assert tab.errors == []


@pytest.fixture
def open_tab(viewer: Viewer, browser: "Browser") -> Iterator[Callable[..., Tab]]:
    """Open further tabs, each as a visitor of its own, as of `open_page`; none reports an error."""
    tabs: list[Tab] = []

    def open_one(**how: Any) -> Tab:
        tabs.append(open_page(viewer, browser, **how))
        return tabs[-1]

    yield open_one
    for tab in tabs:
        tab.page.context.close()
    assert [error for tab in tabs for error in tab.errors] == []
