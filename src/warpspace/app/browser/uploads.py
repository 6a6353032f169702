"""Uploads with limits: viser itself takes files of any size, under any name, into memory."""

from collections.abc import Callable
from typing import Any

from viser import ClientHandle

from warpspace.app.browser.viser_private import StartUpload, UploadMessages, UploadPart, dom_id

MOST_AT_ONCE = 16
MOST_PARTS = 64
LONGEST_NAME = 80
Received = Callable[[str, bytes], None]
Refused = Callable[[str], None]


class Uploads:
    """Watches over the uploads of one button.

    A file that is too large is refused before it is sent (by a script in the page), before it is
    kept (when a page announces it) and while it arrives (when a page has announced less).

    Parameters
    ----------
    client : viser.ClientHandle
    button : viser.GuiUploadButtonHandle
        The only one of the client.
    most_bytes : int
        Size of the largest file.
    received : callable
        Gets name and content of a file within the limit, in the order they are complete. It is
        called in the server's event loop and must only take note.
    refused : callable
        Gets the message about one that is not.
    """

    def __init__(
        self,
        client: ClientHandle,
        button: Any,
        most_bytes: int,
        received: Received,
        refused: Refused,
    ) -> None:
        self._button, self._most_bytes, self._refused = dom_id(button), most_bytes, refused
        self._messages = UploadMessages(client)
        self._messages.check(self._may_start, self._may_keep)

        @button.on_upload
        async def _(_: object) -> None:  # in order, which a plain function would not be
            received(str(button.value.name), bytes(button.value.content))

    def _may_start(self, message: StartUpload) -> bool:
        """Tell whether an upload may begin; say so where it may not."""
        if message.source_component_uuid != self._button:
            return False
        name = str(message.filename)[:LONGEST_NAME]
        size, parts = message.size_bytes, message.part_count
        counts = _is_count(size) and _is_count(parts)
        if not counts or (size <= self._most_bytes and parts > MOST_PARTS):
            problem = f"{name}: the upload makes no sense; try again"
        elif size > self._most_bytes:
            problem = size_message(name, size, self._most_bytes)
        elif len(self._messages.under_way) >= MOST_AT_ONCE:
            problem = f"{name}: more than {MOST_AT_ONCE} uploads at once; try again"
        else:
            return True
        self._messages.acknowledge(message)
        self._refused(problem)
        return False

    def _may_keep(self, message: UploadPart) -> bool:
        """Tell whether a part may be kept; an upload that is larger than announced is dropped."""
        transfer = self._messages.under_way.get(message.transfer_uuid)
        if transfer is None:
            return False
        arrived = transfer["transferred_bytes"] + len(message.content)
        if arrived <= min(transfer["total_bytes"], self._most_bytes):
            return True
        self._messages.under_way.pop(message.transfer_uuid, None)
        name = str(transfer["filename"])[:LONGEST_NAME]
        self._refused(f"{name}: more has arrived than was announced; the upload was dropped")
        return False


def _is_count(value: object) -> bool:
    """Tell whether a number from a browser can count something."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def size_message(source: str, size: float, most_bytes: int) -> str:
    """Say that a file is too large."""
    limit = most_bytes / 2**20
    return f"{source} is {size / 2**20:.1f} MB large; expected a scene file of at most {limit:g} MB"


def size_script(button: Any, carrier: Any, most_bytes: int) -> str:
    """Write the script that refuses a file that is too large before it is sent.

    Parameters
    ----------
    button : viser upload button
    carrier : viser text widget
        Gets name and size of a refused file.
    most_bytes : int
    """
    return f"""(() => {{
  addEventListener("change", event => {{
    const input = event.target, file = input && input.files && input.files[0];
    if (!file || input.id !== "file_upload_{dom_id(button)}" || file.size <= {most_bytes})
      return;
    event.stopImmediatePropagation();
    input.value = "";
    __viserMutable.sendMessage({{ type: "GuiUpdateMessage", uuid: "{dom_id(carrier)}",
      updates: {{ value: performance.now() + ":" + file.size + ":" + file.name }} }});
  }}, true);
}})();"""
