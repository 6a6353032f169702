"""What a page is sent beside its drawing: scripts of our own, pieces of HTML, messages."""

import json
import threading
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib.resources import files

from viser import ClientHandle, ViserServer

from warpspace.app.browser.viser_private import send_at_once, send_script
from warpspace.exceptions import WarpspaceError

SCRIPTS = ("page", "room", "mesh", "fly", "server", "tour", "story", "together")


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
        """Send what is drawn and written meanwhile in one go; for the session."""
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
        """Write pieces of HTML by the name of their place; what stands there is not sent again."""
        changed = {name: text for name, text in pieces.items() if self._sent.get(name) != text}
        if changed:
            self._sent |= changed
            self.call("show", changed)

    def forget(self, place: str) -> None:
        """Write a place again next time, whatever stands there."""
        self._sent.pop(place, None)

    def call(self, name: str, *values: object) -> None:
        """Call a function of the page: of `warpspacePage`, or ``room.NAME`` of the drawing's."""
        home = f"warpspacePage.{name}".replace("warpspacePage.room.", "warpspaceRoom.")
        self.run_script(f"{home}({', '.join(map(_spelt, values))});")

    @property
    def is_open(self) -> bool:
        """Whether the page is connected; it ends before its session is stopped."""
        return self._client.client_id in self._server.get_clients()

    def run_script(self, source: str) -> None:
        """Run JavaScript of our own in the page; no word of a user's may be in it unescaped."""
        with self._lock:
            if self._held is None:
                send_script(self._client, source)
            else:
                self._held.append(source)

    def notify(self, title: str, text: str = "", kind: str = "done") -> None:
        """Show a message in this tab: "done", "warning", "problem", or one that "stays"."""
        self.call("toast", kind, title, text)

    def report(self, error: Exception, title: str = "That did not work") -> None:
        self.notify(title, error_words(error), "problem")


@cache
def script_source(name: str) -> str:
    return files("warpspace.app.browser").joinpath(name).read_text("utf-8")


def _spelt(value: object) -> str:
    """Spell a value as JavaScript; a text of a user's can end neither it nor the script."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")


def page_script() -> str:
    sheet = f"warpspacePage.style({json.dumps(script_source('page.css'))});"
    return "\n".join((*(script_source(f"{name}.js") for name in SCRIPTS), sheet))


def error_words(error: Exception) -> str:
    """Say what went wrong; of what nobody foresaw its kind as well."""
    return str(error) if isinstance(error, WarpspaceError) else f"{type(error).__name__}: {error}"
