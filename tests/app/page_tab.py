"""A tab of a real Chromium with the app in it: what tests ask of it, and do to it."""

import json
from collections.abc import Callable
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from app.frames import draw, new_visitor
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.server.session import Session
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.store import StateStore
from warpspace.app.viewport.named_views import CameraSetup
from warpspace.geometry.colour import colour_table
from warpspace.scene.library import load_scene

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

# What the client or Chromium says of itself in a software renderer.
HARMLESS = (
    "THREE.Clock", "GL Driver Message", "SwiftShader", "Software WebGL", "favicon",
    # of a widget that comes and goes between two messages, viser still sends what changed of it
    "Tried to update non-existent component",
)  # fmt: skip
VERTICES = """() => {
  const node = window.__viserMutable.nodeRefFromName['/box/surface'];
  let found = null;
  if (node) node.traverse(o => {
    if (o.isMesh && o.geometry.attributes.color) {
      const { position, color } = o.geometry.attributes;
      found = [Array.from(position.array), Array.from(color.array)];
    }
  });
  return found;
}"""
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
TIDY = """() => {
  history.replaceState(null, '', location.pathname + '?fixedDpr=1');
  const close = '.mantine-Notification-closeButton, #warpspace-server button';
  document.querySelectorAll(close).forEach(b => b.click());
  return document.querySelectorAll('.mantine-Notification-root, #warpspace-server').length;
}"""
"""Takes the link out of the address, closes the messages, and counts those that were there."""
LIVE = LiveModel()


def wait_until_open(page: "Page") -> None:
    """Wait until all of a page is there."""
    shown = ":is([data-value='max'], [data-strip='max']):visible"  # the latter on a phone
    page.wait_for_selector(f"html[data-warpspace=open] {shown}", timeout=60_000)


class Tab:
    """A browser tab with the app in it; `query` goes into its address."""

    def __init__(
        self, page: "Page", viewer: Viewer, query: str = "", *, everything: bool = True
    ) -> None:
        self.page, self.viewer = page, viewer
        self.errors: list[str] = []
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", self._listen)
        page.goto(f"{viewer.url}/?fixedDpr=1{query}")
        wait_until_open(page)
        self.until(lambda: self.vertices() is not None)
        if everything:
            self.list_all()
        self._camera = self.session.context.camera.remember()

    @property
    def session(self) -> Session:
        """The session of this tab."""
        token = self.page.evaluate("window.__warpspaceTab")
        return next(session for session in self.viewer.sessions if session.token == token)

    def list_all(self) -> None:
        """List the errors that are zero as well."""
        box = self.page.get_by_role("checkbox", name="Hide errors that are zero")
        if box.is_checked():
            box.uncheck()
            self.until(lambda: self.listed() == len(self.session.state.amplitudes))

    def listed(self) -> int:
        """Number of errors listed."""
        return self.page.locator("input[data-number]").count()

    def begin_anew(self) -> None:
        """Make the page again what it was when it was opened, in a tenth of the time."""
        start, session = start_state(SCENES[0]), self.session

        def forget() -> None:
            session.use(StateStore(start))
            session.context.camera._stand = CameraSetup()

        self.page.wait_for_selector("html[data-warpspace=open]")
        self.page.keyboard.press("Escape")
        self.written("Find an error").fill("")
        self.list_all()
        self.panel("Volumetric error")
        self.panel("View")
        session.context.act(forget)
        session.context.look_from(self._camera)
        self.until(lambda: self.page.evaluate(TIDY) == 0)
        self.until(lambda: session.state == start and self.shows_state(start))

    def screenshot(self) -> bytes:
        """Draw the page as it is now, and give its picture."""
        draw(self.page)
        return self.page.screenshot()

    def _listen(self, message: Any) -> None:
        if message.type == "error" and not any(word in message.text for word in HARMLESS):
            self.errors.append(message.text)

    def until(self, fine: Callable[[], bool], seconds: float = 60.0) -> None:
        """Wait until something holds."""
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

    def eye(self) -> list[float]:
        """Where the page's camera stands."""
        return self.page.evaluate("() => window.__viserMutable.camera.position.toArray()")

    def surface(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Vertices (mm) and colours of the drawn surface, read back from the browser's scene."""
        found = self.page.evaluate(VERTICES)
        return None if found is None else tuple(np.reshape(part, (-1, 3)) for part in found)

    def shows_colours(self, wanted: np.ndarray) -> bool:
        """Whether the surface drawn has these colours; not while the page loads another one."""
        found = self.surface()
        return (
            found is not None
            and found[1].shape == wanted.shape
            and np.allclose(found[1], wanted, atol=1e-5)
        )

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

    def drawn(self, name: str) -> np.ndarray | None:
        """Points of a node that is shown, [n, 3]; None where it is hidden or absent."""
        found = self.page.evaluate(DRAWN, name)
        return None if found is None else np.reshape(found, (-1, 3))

    def shows_state(self, state: AppState) -> bool:
        """Whether the surface drawn is that of a state."""
        return self.shows(drawn_nodes(LIVE.evaluate(state)))

    def until_shown(self, state: AppState, seconds: float = 60.0) -> None:
        """Wait until the surface drawn is that of a state."""
        wanted = drawn_nodes(LIVE.evaluate(state))
        self.until(lambda: self.shows(wanted), seconds)

    def text(self, value: str) -> str:
        """A number on the page, as it is spelt."""
        return self.page.inner_text(f"[data-value='{value}']")

    def number(self, value: str) -> float:
        """A number on the page, without its unit."""
        return float(self.text(value).split()[0])

    def widget(self, label: str) -> str:
        """Id of the widget whose label begins with a word."""
        script = """label => [...document.querySelectorAll('label')]
            .find(l => l.textContent.startsWith(label))?.getAttribute('for')"""
        return self.page.wait_for_function(script, arg=label).json_value()

    def box(self, label: str) -> Any:
        """Number box of the slider whose label begins with a word: that of an error, or viser's."""
        own = self.page.locator(f"input[data-number='{label}']")
        if own.count():
            return own
        return self.page.locator(f"[id='{self.widget(label)}'] ~ div input")

    def written(self, label: str) -> Any:
        """Text box beside a label; viser does not tie them together."""
        row = self.page.locator(f"//label[text()='{label}']/ancestor::div[2]")
        return row.locator("input, textarea").first

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

    def press(self, *keys: str) -> None:
        """Press keys with no widget in focus."""
        self.page.evaluate("document.activeElement && document.activeElement.blur()")
        for key in keys:
            self.page.keyboard.press(key)

    def button(self, name: str) -> None:
        """Press a button."""
        self.page.get_by_role("button", name=name, exact=True).last.click()

    def arrived(self, label: str, value: str) -> None:
        """Wait until what was put into a widget is on the server: messages may overtake it."""
        handles = self.session._client.gui._gui_input_handle_from_uuid
        self.until(
            lambda: any(
                (one.label, str(one.value)) == (label, value)
                for one in list(handles.values())
                if hasattr(one, "label") and hasattr(one, "value")
            )
        )

    def tick(self, label: str) -> None:
        """Click a check box."""
        self.page.locator(f"[id='{self.widget(label)}']").click()

    def place(self, name: str) -> np.ndarray | None:
        """Where a node that is shown stands, in the drawing's axes, mm."""
        found = self.page.evaluate(PLACE, name)
        return None if found is None else 100.0 * np.array(found)

    def panel(self, name: str) -> None:
        """Bring a tab of a panel to the front."""
        self.page.get_by_role("tab", name=name, exact=True).click()

    def upload(self, name: str, content: bytes) -> None:
        """Give a scene or the like to the page, in the tab Files."""
        self.page.locator("input[type=file][accept^='.toml']").set_input_files(
            {"name": name, "mimeType": "text/plain", "buffer": content}
        )

    def choose(self, label: str, option: str) -> None:
        """Choose an option of a dropdown."""
        self.page.get_by_label(label, exact=True).first.click()
        self.page.get_by_role("option", name=option, exact=True).first.click()


SCENES = [load_scene(name) for name in ("dvf5000_first", "dvf5000_second", "teach_tilted_c")]
"""What the app with services is started with, the first of them shown."""


def pixels_of_the_map(png: bytes) -> int:
    """Count pixels whose colour is one of the colour map's, within three levels."""
    shown = np.asarray(Image.open(BytesIO(png)).convert("RGB")).reshape(-1, 3).astype(np.int16)
    table = colour_table().astype(np.int16)
    key, counts = np.unique(shown, axis=0, return_counts=True)
    near = np.abs(key[:, None] - table[None]).max(axis=-1).min(axis=-1) <= 3
    return int(counts[near].sum())


def drawn_nodes(picture: LivePicture) -> np.ndarray:
    """Where a picture draws the nodes of its surface, [M, 3], mm."""
    return picture.drawn_mm.reshape(-1, 3)[picture.topology.surface.nodes]


def open_page(
    viewer: Viewer,
    browser: "Browser",
    query: str = "",
    size: tuple[int, int] = (1280, 720),
    *,
    everything: bool = True,
) -> Tab:
    """Open the app as a visitor of its own; `query` goes into the address."""
    page = new_visitor(browser, size).new_page()
    return Tab(page, viewer, query, everything=everything)
