"""What a page is sent beside its widgets: scripts of our own, its title, messages."""

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files

from viser import ClientHandle, ViserServer

from warpspace.app.browser.events import Events
from warpspace.app.browser.viser_private import (
    send_script,
    wake_sender_on_its_thread,
)
from warpspace.exceptions import WarpspaceError

SCRIPTS = ("page.js", "room.js", "mesh.js", "server.js", "tour.js")


class Page:
    """The page of one tab; usable from any thread."""

    def __init__(self, server: ViserServer, client: ClientHandle) -> None:
        self._server, self._client = server, client
        self._sent: dict[str, str] = {}
        wake_sender_on_its_thread(client)

    def open(self, events: Events) -> None:
        """Lay out the page."""
        self.run_script("\n".join(map(script_source, SCRIPTS)))
        self.tell(carrier=events.carrier)

    def tell(self, **facts: object) -> None:
        """Tell the page its carrier of events, uploads and keys."""
        self.run_script(f"warpspacePage.open({_spelt(facts)});")

    def put(self, pieces: Mapping[str, str]) -> None:
        """Write pieces of HTML by the name of their place; what stands there is not sent again."""
        changed = {name: text for name, text in pieces.items() if self._sent.get(name) != text}
        if changed:
            self._sent |= changed
            self.run_script(f"warpspacePage.show({_spelt(changed)});")

    def forget(self, place: str) -> None:
        """Write a place again next time, whatever stands there."""
        self._sent.pop(place, None)

    def call(self, name: str, *values: object) -> None:
        """Call a function of the page: of `warpspacePage`, or ``room.NAME`` of the drawing's."""
        home, _, function = f"warpspacePage.{name}".replace(
            "warpspacePage.room.", "warpspaceRoom."
        ).rpartition(".")
        self.run_script(f"{home}.{function}({', '.join(map(_spelt, values))});")

    @property
    def is_open(self) -> bool:
        """Whether the page is connected; it ends before its session is stopped."""
        return self._client.client_id in self._server.get_clients()

    def run_script(self, source: str) -> None:
        """Run JavaScript of our own in the page; no word of a user's may be in it unescaped."""
        send_script(self._client, source)

    def set_title(self, title: str) -> None:
        """Name the browser tab."""
        spelt = json.dumps(f"{title} · warpspace").replace("<", "\\u003c")
        self.run_script(f"document.title = {spelt};")

    def notify(self, title: str, text: str = "", kind: str = "done") -> None:
        """Show a message in this tab."""
        self.call("toast", kind, title, text)

    def report(self, error: Exception) -> None:
        """Tell the user of this tab what went wrong."""
        self.notify("That did not work", error_words(error), "problem")


@cache
def script_source(name: str) -> str:
    """Give the text of a script or a style sheet of the page."""
    return files("warpspace.app.browser").joinpath(name).read_text("utf-8")


def _spelt(value: object) -> str:
    """Spell a value as JavaScript; a text of a user's can end neither it nor the script."""
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def style_sheets(*names: str) -> str:
    """Write the script that gives a page its style sheets."""
    return style_script("page", "\n".join(map(script_source, names)))


def style_script(name: str, css: str) -> str:
    """Write the script that gives a page a style sheet.

    It goes into the page's head: what `add_html` puts into a panel is gone while the panel is
    collapsed.
    """
    return f"""(() => {{
  const id = {json.dumps(f"warpspace-{name}")};
  const sheet = document.getElementById(id) ?? document.createElement("style");
  sheet.id = id;
  sheet.textContent = {json.dumps(css)};
  document.head.append(sheet);
}})();"""


def error_words(error: Exception) -> str:
    """Say what went wrong; of what nobody foresaw its kind as well."""
    return str(error) if isinstance(error, WarpspaceError) else f"{type(error).__name__}: {error}"
