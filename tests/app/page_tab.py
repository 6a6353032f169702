"""A tab of a real Chromium with the app in it: what tests ask of it, and do to it."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from app.frames import new_visitor
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.server.session import Session
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import AppState
from warpspace.picture.map_mesh import map_mesh
from warpspace.scene.library import load_scene

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator, Page

# What the client or Chromium says of itself in a software renderer.
HARMLESS = (
    "THREE.Clock", "GL Driver Message", "SwiftShader", "Software WebGL", "favicon",
)  # fmt: skip
DRAWN = """name => {
  const node = window.__viserMutable.nodeRefFromName[name];
  let found = null;
  if (node) node.traverse(o => {
    if (!found && o.geometry && o.visible) {
      const at = o.geometry.attributes;
      const seen = at.instanceStart ? at.instanceStart.data.array : at.position.array;
      let shown = true;
      for (let up = o; up; up = up.parent) shown = shown && up.visible;
      if (shown) found = Array.from(seen);
    }
  });
  return found;
}"""
PLACE = """name => {
  const { nodeRefFromName } = window.__viserMutable, node = nodeRefFromName[name];
  if (!node || !node.visible) return null;
  node.updateWorldMatrix(true, false);
  const world = nodeRefFromName[""].matrixWorld.clone().invert();
  const at = node.position.clone().setFromMatrixPosition(node.matrixWorld).applyMatrix4(world);
  return at.toArray();
}"""
SEEN = """() => {
  const seen = node => {
    if (!node.checkVisibility()) return false;
    const box = node.getBoundingClientRect();
    if (!box.width || !box.height || getComputedStyle(node).visibility === 'hidden') return false;
    const x = box.x + box.width / 2, y = box.y + box.height / 2;
    if (x < 0 || y < 0 || x >= innerWidth || y >= innerHeight) return false;
    const top = document.elementFromPoint(x, y);
    return top && (top === node || node.contains(top) || top.contains(node));
  };
  const count = what => [...document.querySelectorAll(what)].filter(seen).length;
  const words = [];
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const node = walk.currentNode, parent = node.parentElement;
    if (!node.data.trim() || parent.closest('option, script, style') || !seen(parent)) continue;
    words.push(...node.data.trim().split(/\\s+/));
  }
  return [count('button, [role=button], summary'), count('input, select, textarea'), words.length];
}"""
"""Buttons, inputs and words that are visible and not covered."""
SCENES = [load_scene(name) for name in ("dvf5000_first", "dvf5000_second", "teach_tilted_c")]
"""What the app with services is started with, the first of them shown."""
LIVE = LiveModel()


def wait_until_open(page: "Page") -> None:
    page.wait_for_selector("html[data-warpspace=open] [data-piece=head] h1", timeout=60_000)


class Tab:
    """A browser tab with the app in it; `query` goes into its address.

    `actions` counts what a user has done: clicks, choices, numbers typed, files given.
    """

    def __init__(self, page: "Page", viewer: Viewer, query: str = "") -> None:
        self.page, self.viewer, self.actions = page, viewer, 0
        self.errors: list[str] = []
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", self._listen)
        page.goto(f"{viewer.url}/?fixedDpr=1{query}")
        wait_until_open(page)
        self.until(lambda: self.vertices() is not None)

    def _listen(self, message: Any) -> None:
        if message.type == "error" and not any(word in message.text for word in HARMLESS):
            self.errors.append(message.text)

    @property
    def session(self) -> Session:
        token = self.page.evaluate("window.__warpspaceTab")
        return next(session for session in self.viewer.sessions if session.token == token)

    @property
    def state(self) -> AppState:
        """What the session shows, or is about to."""
        return self.session.state

    # --- what a user does ----------------------------------------------------------------------

    def click(self, name: str, role: Any = "button", within: str = "#ws-page") -> None:
        self.actions += 1
        found = self.page.locator(within).get_by_role(role, name=name, exact=True)
        found.first.click()

    def task(self, name: str) -> None:
        self.click(name, "tab")

    def unfold(self, name: str) -> None:
        self.actions += 1
        self.page.locator(f"#ws-right .ws-fold:has-text({name!r})").first.click()

    def type(self, label: str, text: str) -> None:
        self.actions += 1
        box = self.page.get_by_label(label, exact=True).first
        box.fill(text)
        box.press("Enter")

    def give(self, name: str, content: bytes, click: Callable[[], None]) -> None:
        with self.page.expect_file_chooser() as chooser:
            click()
        self.actions += 1
        chooser.value.set_files({"name": name, "mimeType": "text/plain", "buffer": content})

    def press(self, *keys: str) -> None:
        self.page.evaluate("document.activeElement && document.activeElement.blur()")
        for key in keys:
            self.actions += 1
            self.page.keyboard.press(key)

    def send(self, action: object) -> None:
        """Send an action as a page does."""
        self.page.evaluate("action => warpspacePage.send(action)", str(action))

    # --- what is seen --------------------------------------------------------------------------

    def part(self, name: str) -> "Locator":
        return self.page.locator(f"[data-piece='{name}']")

    def says(self, words: str, within: str = "#ws-page") -> None:
        self.page.locator(within).get_by_text(words).first.wait_for(timeout=60_000)

    def seen(self) -> tuple[int, int, int]:
        return tuple(self.page.evaluate(SEEN))

    def in_sight(self, place: str) -> bool:
        box = self.page.locator(place).first.bounding_box()
        size = self.page.viewport_size or {"width": 0, "height": 0}
        return box is not None and box["y"] >= 0 and box["y"] + box["height"] <= size["height"]

    def until(self, fine: Callable[[], bool], seconds: float = 60.0) -> None:
        for _ in range(int(seconds / 0.05)):
            if fine():
                return
            self.page.wait_for_timeout(50)
        pytest.fail(f"did not come true within {seconds:g} s")

    def still(self, read: Callable[[], Any], apart: float = 1e-6) -> Any:
        """Wait until what is read does not change any more for half a second, and give it."""
        last, same = read(), 0
        for _ in range(80):
            self.page.wait_for_timeout(250)
            now = read()
            fine = now is not None and np.shape(now) == np.shape(last)
            same = same + 1 if fine and np.allclose(now, last, atol=apart) else 0
            if same == 2:
                return now
            last = now
        pytest.fail("does not come to rest")

    def vertices(self) -> np.ndarray | None:
        """Vertices of the drawn surface, [M, 3], mm."""
        return self.drawn("/box/surface")

    def drawn(self, name: str) -> np.ndarray | None:
        """Points of a node that is shown, [n, 3]; None where it is hidden or absent."""
        found = self.page.evaluate(DRAWN, name)
        return None if found is None else np.reshape(found, (-1, 3))

    def shows_state(self, state: AppState) -> bool:
        return same_points(self.vertices(), map_mesh(LIVE.evaluate(state)).vertices_mm)

    def place(self, name: str) -> np.ndarray | None:
        """Where a node that is shown stands, in the drawing's axes, mm."""
        found = self.page.evaluate(PLACE, name)
        return None if found is None else 100.0 * np.array(found)


def same_points(drawn: np.ndarray | None, wanted: np.ndarray, atol: float = 2e-3) -> bool:
    return (
        drawn is not None and drawn.shape == wanted.shape and np.allclose(drawn, wanted, atol=atol)
    )


def open_page(
    viewer: Viewer, browser: "Browser", query: str = "", size: tuple[int, int] = (1440, 900)
) -> Tab:
    """Open the app as a visitor of its own; `query` goes into the address."""
    return Tab(new_visitor(browser, size).new_page(), viewer, query)
