"""What a page is sent beside its widgets: scripts of our own, its title, messages."""

import json

from viser import ClientHandle, ViserServer

from warpspace.app.browser.viser_private import (
    release_tabs,
    send_script,
    wake_sender_on_its_thread,
)
from warpspace.exceptions import WarpspaceError

NOTE_SECONDS = 8.0


class Page:
    """The page of one tab; usable from any thread.

    Parameters
    ----------
    server : viser.ViserServer
    client : viser.ClientHandle
    """

    def __init__(self, server: ViserServer, client: ClientHandle) -> None:
        self._server, self._client = server, client
        wake_sender_on_its_thread(client)

    @property
    def is_open(self) -> bool:
        """Whether the page is connected; it ends before its session is stopped."""
        return self._client.client_id in self._server.get_clients()

    def leave(self) -> None:
        """Take out of the server's tabs what has been built since the connection ended."""
        release_tabs(self._client)

    def run_script(self, source: str) -> None:
        """Run JavaScript of our own in the page; no word of a user's may be in it unescaped."""
        send_script(self._client, source)

    def set_title(self, title: str) -> None:
        """Name the browser tab."""
        spelt = json.dumps(f"{title} · warpspace").replace("<", "\\u003c")
        self.run_script(f"document.title = {spelt};")

    def notify(self, title: str, text: str, colour: str) -> None:
        """Show a message in this tab."""
        self._client.add_notification(
            title,
            text,
            auto_close_seconds=NOTE_SECONDS,
            color=colour,  # type: ignore[arg-type]
        )

    def report(self, error: Exception) -> None:
        """Tell the user of this tab what went wrong."""
        self.notify("That did not work", error_words(error), "red")


def style_script(name: str, css: str) -> str:
    """Write the script that gives a page a style sheet.

    It goes into the page's head: what `add_html` puts into a panel is gone while the panel is
    collapsed.

    Parameters
    ----------
    name : str
        Of the style sheet; one of the same name is replaced.
    css : str

    Returns
    -------
    str
        JavaScript.
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
