"""Scripts, HTML and messages that are sent to a page beside its drawing."""

import json
import threading
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib.resources import files

from viser import ClientHandle, ViserServer

from warpspace.app.browser.viser_private import send_at_once, send_script
from warpspace.exceptions import WarpspaceError

SCRIPTS = ("viser_private", "page", "bars", "overlay", "mesh", "fly", "server", "hints", "story",
           "together", "pictograms")  # fmt: skip


class Page:
    """The page of one tab; usable from any thread."""

    def __init__(self, server: ViserServer, client: ClientHandle) -> None:
        self._server, self._client = server, client
        self._sent: dict[str, str] = {}
        self._held: list[str] | None = None
        self._lock = threading.Lock()
        send_at_once(client)

    @contextmanager
    def batch(self) -> Generator[None]:
        """Send everything drawn and written in the context as one message. For the session."""
        with self._client.atomic():
            self._held = []
            try:
                yield
            finally:
                with self._lock:
                    scripts, self._held = self._held, None
                if scripts:
                    send_script(self._client, "\n".join(scripts))

    def put(self, pieces: Mapping[str, str]) -> None:
        """Write HTML by the name of its place; unchanged HTML is not sent again."""
        changed = {name: text for name, text in pieces.items() if self._sent.get(name) != text}
        if changed:
            self._sent |= changed
            self.call("show", changed)

    def forget(self, place: str) -> None:
        """Send a place again next time, even if unchanged."""
        self._sent.pop(place, None)

    def call(self, name: str, *values: object) -> None:
        home = f"warpspacePage.{name}".replace("warpspacePage.overlay.", "warpspaceOverlay.")
        self.run_script(f"{home}({', '.join(map(_spelt, values))});")

    @property
    def is_open(self) -> bool:
        """True while the page is connected; it closes before its session is stopped."""
        return self._client.client_id in self._server.get_clients()

    def run_script(self, source: str) -> None:
        """Run JavaScript in the page; texts of users in it must be escaped."""
        with self._lock:
            if self._held is None:
                send_script(self._client, source)
            else:
                self._held.append(source)

    def notify(self, title: str, text: str = "", kind: str = "done") -> None:
        """Show a message in this tab: "done", "warning", "problem", or one that "stays"."""
        self.call("toast", kind, title, text)

    def report(self, error: Exception, title: str = "The action failed") -> None:
        self.notify(title, error_words(error), "problem")


@cache
def script_source(name: str) -> str:
    return files("warpspace.app.browser").joinpath(name).read_text("utf-8")


def _spelt(value: object) -> str:
    """Format a value as JavaScript; a text in it can end neither the literal nor the script."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")


def page_script() -> str:
    sheet = f"warpspacePage.style({json.dumps(script_source('page.css'))});"
    return "\n".join((*(script_source(f"{name}.js") for name in SCRIPTS), sheet))


def error_words(error: Exception) -> str:
    """Format an exception; an unexpected one with its type."""
    return str(error) if isinstance(error, WarpspaceError) else f"{type(error).__name__}: {error}"
