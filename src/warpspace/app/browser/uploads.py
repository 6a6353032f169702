"""Uploads with limits: viser itself takes files of any size, under any name, into memory."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from viser import ClientHandle

from warpspace.app.browser.viser_private import StartUpload, UploadMessages, UploadPart, dom_id

MOST_AT_ONCE = 16
MOST_PARTS = 64
LONGEST_NAME = 80
Received = Callable[[str, bytes], None]
Refused = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class _Watched:
    """An upload button: its largest file, and who is told."""

    button: str
    most_bytes: int
    refused: Refused
    what: str


class Uploads:
    """Watches over the uploads of one client, each button with a limit of its own.

    A file that is too large is refused before it is sent (by a script in the page), before it is
    kept (when a page announces it) and while it arrives (when a page has announced less). Only so
    many files are under way at once, whatever their buttons, and a file goes to the button that
    it was announced for.
    """

    def __init__(self, client: ClientHandle) -> None:
        self._watched: dict[str, _Watched] = {}
        self._owners: dict[str, _Watched] = {}
        self._messages = UploadMessages(client)
        self._messages.check(self._may_start, self._may_keep)

    def watch(
        self,
        button: Any,
        most_bytes: int,
        received: Received,
        refused: Refused,
        what: str = "scene file",
    ) -> None:
        """Take files from a button."""
        self._watched[dom_id(button)] = _Watched(dom_id(button), most_bytes, refused, what)

        @button.on_upload
        async def _(_: object) -> None:  # in order, which a plain function would not be
            received(str(button.value.name), bytes(button.value.content))

    def _may_start(self, message: StartUpload) -> bool:
        """Tell whether an upload may begin; say so where it may not."""
        owner = self._watched.get(message.source_component_uuid)
        if owner is None:
            return False
        under_way = self._messages.under_way
        name = str(message.filename)[:LONGEST_NAME]
        size, parts = message.size_bytes, message.part_count
        counts = _is_count(size) and _is_count(parts)
        if not counts or (size <= owner.most_bytes and parts > MOST_PARTS):
            problem = f"{name}: the upload makes no sense; try again"
        elif size > owner.most_bytes:
            problem = size_message(name, size, owner.most_bytes, owner.what)
        elif len(under_way) >= MOST_AT_ONCE:
            problem = f"{name}: more than {MOST_AT_ONCE} uploads at once; try again"
        else:
            self._owners = {one: of for one, of in self._owners.items() if one in under_way}
            self._owners[message.transfer_uuid] = owner
            return True
        self._messages.acknowledge(message)
        owner.refused(problem)
        return False

    def _may_keep(self, message: UploadPart) -> bool:
        """Tell whether a part may be kept; an upload that is not as announced is dropped."""
        transfer = self._messages.under_way.get(message.transfer_uuid)
        owner = self._owners.get(message.transfer_uuid)
        if transfer is None or owner is None:
            return False
        arrived = transfer["transferred_bytes"] + len(message.content)
        if message.source_component_uuid != owner.button:
            problem = "it is not sent to where it was announced"
        elif arrived > min(transfer["total_bytes"], owner.most_bytes):
            problem = "more has arrived than was announced"
        else:
            return True
        self._messages.under_way.pop(message.transfer_uuid, None)
        name = str(transfer["filename"])[:LONGEST_NAME]
        owner.refused(f"{name}: {problem}; the upload was dropped")
        return False


def _is_count(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def size_message(source: str, size: float, most_bytes: int, what: str = "scene file") -> str:
    """Say that a file is too large."""
    limit = most_bytes / 2**20
    return f"{source} is {size / 2**20:.1f} MB large; expected a {what} of at most {limit:g} MB"
