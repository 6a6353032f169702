"""Uploads with limits: viser itself takes files of any size, under any name, into memory."""

from collections.abc import Callable
from typing import Any

from viser import ClientHandle
from viser import _messages as messages

from warpspace.app.browser.handles import dom_id
from warpspace.app.documents.received_files import size_message
from warpspace.scene.files import MAX_SCENE_BYTES

MOST_AT_ONCE = 16
MOST_PARTS = 64
LONGEST_NAME = 80
Received = Callable[[str, bytes], None]
Refused = Callable[[str], None]


class Uploads:
    """Takes over the uploads of one tab.

    A file that is too large is refused before it is sent (by a script in the page), before it is
    kept (when a page announces it) and while it arrives (when a page has announced less).

    Parameters
    ----------
    client : viser.ClientHandle
    received : callable
        Gets name and content of a file within the limit, in the order they are complete. It is
        called in the server's event loop and must only take note.
    refused : callable
        Gets the message about one that is not.
    """

    def __init__(self, client: ClientHandle, received: Received, refused: Refused) -> None:
        self._gui: Any = client.gui
        self._received, self._refused = received, refused
        owner: Any = client
        connection = owner._websock_connection  # noqa: SLF001 - viser has no public way
        start, part = messages.FileTransferStartUpload, messages.FileTransferPart
        self._start = self._gui._handle_file_transfer_start  # noqa: SLF001
        self._part = self._gui._handle_file_transfer_part  # noqa: SLF001
        connection.unregister_handler(start, self._start)
        connection.unregister_handler(part, self._part)
        connection.register_handler(start, self._announced)
        connection.register_handler(part, self._arrived)
        self._gui._finish_file_upload = self._finished  # noqa: SLF001
        self._connection = connection

    @property
    def _open(self) -> dict[str, Any]:
        """Transfers under way, by their identifier."""
        return self._gui._current_file_upload_states  # noqa: SLF001

    def _announced(self, client_id: int, message: messages.FileTransferStartUpload) -> None:
        """Let a transfer begin, or refuse it."""
        name = str(message.filename)[:LONGEST_NAME]
        size, parts = message.size_bytes, message.part_count
        counts = _is_count(size) and _is_count(parts)
        if not counts or (size <= MAX_SCENE_BYTES and parts > MOST_PARTS):
            self._refuse(message, f"{name}: the upload makes no sense; try again")
        elif size > MAX_SCENE_BYTES:
            self._refuse(message, size_message(name, size))
        elif len(self._open) >= MOST_AT_ONCE:
            self._refuse(message, f"{name}: more than {MOST_AT_ONCE} uploads at once; try again")
        else:
            self._start(client_id, message)

    def _refuse(self, message: messages.FileTransferStartUpload, text: str) -> None:
        """Say no, and let the page's progress bar end."""
        self._connection.queue_message(
            messages.FileTransferPartAck(
                source_component_uuid=message.source_component_uuid,
                transfer_uuid=message.transfer_uuid,
                transferred_bytes=message.size_bytes,
                total_bytes=message.size_bytes,
            )
        )
        self._refused(text)

    def _arrived(self, client_id: int, message: messages.FileTransferPart) -> None:
        """Keep a part, unless more arrives than was announced."""
        transfer = self._open.get(message.transfer_uuid)
        if transfer is None:
            return
        arrived = transfer["transferred_bytes"] + len(message.content)
        if arrived > min(transfer["total_bytes"], MAX_SCENE_BYTES):
            self._open.pop(message.transfer_uuid, None)
            name = str(transfer["filename"])[:LONGEST_NAME]
            self._refused(f"{name}: more has arrived than was announced; the upload was dropped")
            return
        self._part(client_id, message)

    def _finished(self, _client_id: int, transfer_uuid: str, _widget: str | None) -> None:
        """Hand over a complete file; nothing of it is kept here."""
        transfer = self._open.pop(transfer_uuid, None)
        if transfer is None:
            return
        content = b"".join(transfer["parts"][i] for i in range(transfer["part_count"]))
        self._received(str(transfer["filename"]), content)


def _is_count(value: object) -> bool:
    """Tell whether a number from a browser can count something."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def size_script(button: Any, carrier: Any) -> str:
    """Write the script that refuses a file that is too large before it is sent.

    Parameters
    ----------
    button : viser upload button
    carrier : viser text widget
        Gets name and size of a refused file.
    """
    return f"""(() => {{
  addEventListener("change", event => {{
    const input = event.target, file = input && input.files && input.files[0];
    if (!file || input.id !== "file_upload_{dom_id(button)}" || file.size <= {MAX_SCENE_BYTES})
      return;
    event.stopImmediatePropagation();
    input.value = "";
    __viserMutable.sendMessage({{ type: "GuiUpdateMessage", uuid: "{dom_id(carrier)}",
      updates: {{ value: performance.now() + ":" + file.size + ":" + file.name }} }});
  }}, true);
}})();"""
