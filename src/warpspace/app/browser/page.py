"""What a page is told beside its widgets: scripts of our own, its title, messages."""

import asyncio
import json
from collections.abc import Callable
from typing import Any

from viser import ClientHandle
from viser import _messages as messages

from warpspace.exceptions import WarpspaceError

NOTE_SECONDS = 8.0


class Page:
    """The page of one tab; usable from any thread.

    Parameters
    ----------
    client : viser.ClientHandle
    """

    def __init__(self, client: ClientHandle) -> None:
        self._client = client
        # viser also sets this event from the thread that sends, for which it is not made: that may
        # meet the sender itself. What viser then asks of the loop is enough.
        connection: Any = client._websock_connection  # noqa: SLF001 # pyright: ignore[reportPrivateUsage]
        event = connection.get_message_buffer().message_event
        event.set = _set_on_loop(event)

    @property
    def is_open(self) -> bool:
        """Whether the page is connected; it ends before its session is told."""
        server = self._client._viser_server  # noqa: SLF001 # pyright: ignore[reportPrivateUsage]
        return self._client.client_id in server.get_clients()

    def leave(self) -> None:
        """Take out of the server's tabs what has been built since the connection ended."""
        # viser does so when the connection ends, when a step may still be on its way
        self._client.gui._release_cross_scope_nesting()  # noqa: SLF001 # pyright: ignore[reportPrivateUsage]

    def run_script(self, source: str) -> None:
        """Run JavaScript of our own in the page; no word of a user's may be in it unescaped."""
        # viser has a message for it and no method
        self._client._websock_connection.queue_message(  # noqa: SLF001 # pyright: ignore[reportPrivateUsage]
            messages.RunJavascriptMessage(source=source)
        )

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
        known = isinstance(error, WarpspaceError)
        text = str(error) if known else f"{type(error).__name__}: {error}"
        self.notify("That did not work", text, "red")


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


def _set_on_loop(event: Any) -> Callable[[], None]:
    """Give the setter of an event of asyncio that does nothing on other threads."""
    original: Callable[[], None] = event.set

    def set_event() -> None:
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return
        original()

    return set_event


def is_passing(error: Exception) -> bool:
    """Tell whether an error is gone when the same is done again.

    viser wakes its sender from our thread, which once in ten thousands of pictures meets the sender
    itself. What was to be sent is in its buffer all the same; showing the state again sends the
    rest.
    """
    return isinstance(error, RuntimeError) and "mutated during iteration" in str(error)
