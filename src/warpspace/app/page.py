"""What a page is told beside its widgets: scripts of our own, its title, messages."""

import json

from viser import ClientHandle
from viser import _messages as messages

NOTE_SECONDS = 8.0


class Page:
    """The page of one tab; usable from any thread.

    Parameters
    ----------
    client : viser.ClientHandle
    """

    def __init__(self, client: ClientHandle) -> None:
        self._client = client

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
