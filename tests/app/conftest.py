"""The app as it runs, and a tab of a real Chromium that looks at it."""

import json
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from warpspace.app.live import Frame
from warpspace.app.state import AppState
from warpspace.app.viewer import Viewer
from warpspace.cli.services import build_services
from warpspace.scene.library import load_scene

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

# What the client or Chromium says of itself in a software renderer.
HARMLESS = ("THREE.Clock", "GL Driver Message", "SwiftShader", "Software WebGL", "favicon")
VERTICES = """() => {
  const node = window.__viserMutable.nodeRefFromName['/box/surface'];
  let found = null;
  if (node) node.traverse(o => {
    if (o.isMesh && o.geometry.attributes.color) {
      const p = o.geometry.attributes.position, c = o.geometry.attributes.color;
      found = [Array.from(p.array), Array.from(c.array)];
    }
  });
  return found;
}"""


def wait_until_open(page: "Page") -> None:
    """Wait until all of a page is there."""
    page.wait_for_selector("html[data-warpspace=open] [data-value='max']", timeout=60_000)


class Tab:
    """A browser tab with the app in it."""

    def __init__(self, page: "Page", url: str) -> None:
        self.page = page
        self.errors: list[str] = []
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", self._listen)
        page.goto(f"{url}/?fixedDpr=1")
        wait_until_open(page)
        self.until(lambda: self.vertices() is not None)

    def _listen(self, message: Any) -> None:
        if message.type == "error" and not any(word in message.text for word in HARMLESS):
            self.errors.append(message.text)

    def until(self, fine: Callable[[], bool], seconds: float = 15.0) -> None:
        """Wait until something holds."""
        for _ in range(int(seconds / 0.1)):
            if fine():
                return
            self.page.wait_for_timeout(100)
        pytest.fail(f"did not come true within {seconds:g} s")

    def surface(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Vertices (mm) and colours of the drawn surface, read back from the browser's scene."""
        found = self.page.evaluate(VERTICES)
        if found is None:
            return None
        return np.reshape(found[0], (-1, 3)), np.reshape(found[1], (-1, 3))

    def vertices(self) -> np.ndarray | None:
        """Vertices of the drawn surface, [M, 3], mm."""
        found = self.surface()
        return None if found is None else found[0]

    def shows(self, vertices: np.ndarray) -> bool:
        """Whether the surface drawn has these vertices."""
        drawn = self.vertices()
        return (
            drawn is not None
            and drawn.shape == vertices.shape
            and np.allclose(drawn, vertices, atol=1e-3)
        )

    def text(self, value: str) -> str:
        """A number on the page, as it is spelt."""
        return self.page.inner_text(f"[data-value='{value}']")

    def number(self, value: str) -> float:
        """A number on the page, without its unit."""
        return float(self.text(value).split()[0])

    def widget(self, label: str) -> str:
        """Id of the widget whose label begins with a word."""
        script = """label => [...document.querySelectorAll('label')]
            .find(l => l.textContent.startsWith(label)).getAttribute('for')"""
        return self.page.evaluate(script, label)

    def box(self, label: str) -> Any:
        """Number box of the slider whose label begins with a word."""
        return self.page.locator(f"[id='{self.widget(label)}'] ~ div input")

    def thumb(self, label: str) -> Any:
        """Thumb of the slider whose label begins with a word."""
        return self.page.locator(f"[id='{self.widget(label)}'] [role=slider]")

    def send(self, label: str, value: str) -> None:
        """Send a value as a hostile page would, spelt in JavaScript."""
        self.page.evaluate(
            f"window.__viserMutable.sendMessage({{type: 'GuiUpdateMessage',"
            f" uuid: {json.dumps(self.widget(label))}, updates: {{value: {value}}}}})"
        )

    def drag(self, label: str, values: list[float]) -> None:
        """Send the positions of a drag 10 ms apart, however busy the page is with drawing."""
        self.page.evaluate(
            """([uuid, values]) => {
              for (const value of values) {
                window.__viserMutable.sendMessage(
                  {type: 'GuiUpdateMessage', uuid, updates: {value}});
                const until = performance.now() + 10;
                while (performance.now() < until);
              }
            }""",
            [self.widget(label), values],
        )

    def panel(self, name: str) -> None:
        """Bring a tab of a panel to the front."""
        self.page.get_by_role("tab", name=name, exact=True).click()

    def upload(self, name: str, content: bytes) -> None:
        """Give a file to the page."""
        self.page.locator("input[type=file]").set_input_files(
            {"name": name, "mimeType": "text/plain", "buffer": content}
        )

    def choose(self, label: str, option: str) -> None:
        """Choose an option of a dropdown."""
        self.page.get_by_label(label, exact=True).first.click()
        self.page.get_by_role("option", name=option, exact=True).first.click()


SCENES = [load_scene(name) for name in ("dvf5000_first", "dvf5000_second", "teach_tilted_c")]
"""What the app with services is started with, the first of them shown."""


def drawn_nodes(frame: Frame) -> np.ndarray:
    """Where a frame draws the nodes of its surface, [M, 3], mm."""
    return frame.drawn_mm.reshape(-1, 3)[frame.topology.surface.nodes]


def state_of(viewer: Viewer, tab: Tab) -> AppState:
    """State of the newest session: that of the tab under test."""
    tab.page.wait_for_timeout(200)
    return viewer.sessions[-1].state


@pytest.fixture(scope="session")
def serving_viewer() -> Iterator[Viewer]:
    """The app with figures and exports, as the command line starts it."""
    scenes = {scene.title: scene for scene in SCENES}
    with Viewer(SCENES[0], scenes, services=build_services()) as running:
        yield running


@pytest.fixture(scope="session")
def viewer() -> Iterator[Viewer]:
    """The app, serving the thesis machine and two more scenes."""
    scenes = [load_scene(n) for n in ("dvf5000_first", "dvf5000_nominal", "teach_tilted_c")]
    with Viewer(scenes[0], {scene.title: scene for scene in scenes}) as running:
        yield running


@pytest.fixture
def tab(viewer: Viewer, page: "Page") -> Iterator[Tab]:
    """A tab with the app; fails the test if the page reported an error."""
    opened = Tab(page, viewer.url)
    yield opened
    assert opened.errors == []


@pytest.fixture
def open_tab(viewer: Viewer, browser: "Browser") -> Iterator[Callable[[], Tab]]:
    """Open further tabs, each as a visitor of its own."""
    contexts: list[Any] = []

    def open_one() -> Tab:
        contexts.append(browser.new_context(viewport={"width": 1280, "height": 720}))
        return Tab(contexts[-1].new_page(), viewer.url)

    yield open_one
    for context in contexts:
        context.close()
