"""Uploads: what is too large, or makes no sense, is refused before it is held in memory."""

from types import SimpleNamespace
from typing import Any

import pytest
import viser
from viser import _messages as messages

from warpspace.app.browser.uploads import MOST_AT_ONCE, MOST_PARTS, Uploads, read_refusal

LIMIT = 1000
BUTTON = "the-button"
OTHER, OTHER_LIMIT = "another-button", 100


class Connection:
    """Stands for viser's connection of a client."""

    def __init__(self) -> None:
        self.handlers: dict[type, Any] = {}
        self.sent: list[Any] = []

    def register_handler(self, kind: type, handler: Any) -> None:
        self.handlers[kind] = handler

    def unregister_handler(self, kind: type, handler: Any) -> None:
        assert self.handlers.pop(kind) == handler

    def queue_message(self, message: Any) -> None:
        self.sent.append(message)


class Client:
    """A client with viser's own handling of uploads, and what came of them."""

    def __init__(self) -> None:
        self._websock_connection = Connection()
        self.gui: Any = object.__new__(viser.GuiApi)
        self.gui._current_file_upload_states = {}
        self.gui._websock_interface = self._websock_connection
        self.gui._gui_input_handle_from_uuid = {BUTTON: None, OTHER: None, "a-slider": None}
        handlers = self._websock_connection.handlers
        handlers[messages.FileTransferStartUpload] = self.gui._handle_file_transfer_start
        handlers[messages.FileTransferPart] = self.gui._handle_file_transfer_part
        self.finished: list[bytes] = []
        self.gui._finish_file_upload = self._finish
        self.refused: list[str] = []
        uploads = Uploads(self)  # pyright: ignore[reportArgumentType]
        for uuid, limit in ((BUTTON, LIMIT), (OTHER, OTHER_LIMIT)):
            button = SimpleNamespace(_impl=SimpleNamespace(uuid=uuid), on_upload=lambda _: None)
            uploads.watch(button, limit, lambda *_: None, self.refused.append, "measurement")

    def _finish(self, client: int, transfer: str, widget: str) -> None:
        state = self.gui._current_file_upload_states.pop(transfer)
        self.finished.append(b"".join(state["parts"].values()))

    def start(self, size: Any, parts: Any = 1, name: str = "a", widget: str = BUTTON) -> None:
        message = messages.FileTransferStartUpload(widget, name, "a.toml", "", parts, size)
        self._websock_connection.handlers[type(message)](0, message)

    def part(
        self, content: bytes, number: int = 0, name: str = "a", widget: str | None = BUTTON
    ) -> None:
        message = messages.FileTransferPart(widget, name, number, content)
        self._websock_connection.handlers[type(message)](0, message)

    @property
    def held(self) -> int:
        states = self.gui._current_file_upload_states.values()
        return sum(len(part) for state in states for part in state["parts"].values())


@pytest.fixture
def client() -> Client:
    return Client()


def test_a_file_within_the_limit_arrives(client: Client) -> None:
    client.start(4, 2)
    client.part(b"ab")
    client.part(b"cd", 1)
    assert client.finished == [b"abcd"]
    assert client.refused == []


@pytest.mark.parametrize(
    ("size", "parts"),
    [(LIMIT + 1, 1), (10**12, 1), (-1, 1), (None, 1), ("9", 1), (True, 1), (9, MOST_PARTS + 1)],
)
def test_what_is_announced_too_large_or_as_nonsense_is_not_begun(
    client: Client, size: Any, parts: Any
) -> None:
    client.start(size, parts)
    client.part(b"x" * 10)
    assert client.held == 0
    assert len(client.refused) == 1
    assert isinstance(client._websock_connection.sent[0], messages.FileTransferPartAck)


def test_more_than_was_announced_is_dropped(client: Client) -> None:
    client.start(4, 2)
    client.part(b"ab")
    client.part(b"x" * 10, 1)
    assert client.held == 0
    assert client.finished == []
    assert "more has arrived" in client.refused[0]


def test_only_so_many_at_once(client: Client) -> None:
    for number in range(MOST_AT_ONCE + 1):
        client.start(4, 2, name=f"{number}")
    assert len(client.gui._current_file_upload_states) == MOST_AT_ONCE
    assert "at once" in client.refused[0]


def test_other_widgets_take_no_files(client: Client) -> None:
    client.start(4, widget="a-slider")
    client.part(b"abcd")
    assert client.finished == []


def test_each_button_has_a_limit_of_its_own(client: Client) -> None:
    client.start(OTHER_LIMIT + 1, widget=OTHER)
    client.part(b"x" * (OTHER_LIMIT + 1), widget=OTHER)
    assert client.held == 0
    assert client.finished == []
    assert "expected a measurement of at most" in client.refused[0]
    client.start(OTHER_LIMIT + 1, name="b")
    client.part(b"x" * (OTHER_LIMIT + 1), name="b")
    client.start(OTHER_LIMIT, widget=OTHER, name="c")
    client.part(b"y" * OTHER_LIMIT, name="c", widget=OTHER)
    assert client.finished == [b"x" * (OTHER_LIMIT + 1), b"y" * OTHER_LIMIT]


@pytest.mark.parametrize("widget", [OTHER, "a-slider", None])
def test_a_file_cannot_change_its_button_on_the_way(client: Client, widget: str | None) -> None:
    client.start(LIMIT, 2)
    client.part(b"x" * (LIMIT - 1))
    client.part(b"x", 1, widget=widget)
    assert client.finished == []
    assert client.held == 0
    assert "not sent to where it was announced" in client.refused[0]


def test_all_buttons_together_take_only_so_many_at_once(client: Client) -> None:
    for number in range(MOST_AT_ONCE + 1):
        client.start(4, 2, name=f"{number}", widget=(BUTTON, OTHER)[number % 2])
    assert len(client.gui._current_file_upload_states) == MOST_AT_ONCE
    assert "at once" in client.refused[0]


@pytest.mark.parametrize(
    ("told", "name", "size"),
    [
        ("12.5:3000000:a:b.toml", "a:b.toml", 3e6),
        ("", "", 0.0),
        ("1:²:a", "a", 0.0),
        ("1:-5:a", "a", 0.0),
        ("1:" + "9" * 400 + ":a", "a", 0.0),
    ],
)
def test_what_a_page_tells_of_a_refused_file_may_be_anything(
    told: str, name: str, size: float
) -> None:
    assert read_refusal(told) == (name, size)
