"""Host and port, arrivals, the memory of tabs, uploads."""

import errno
import socket
from types import SimpleNamespace
from typing import Any

import pytest
import viser
from viser import _messages as messages

from warpspace.app.browser.arrivals import CARRIER, MOST_KNOWN, Arrivals
from warpspace.app.browser.uploads import MOST_AT_ONCE, MOST_PARTS, Uploads
from warpspace.app.server import network, viewer
from warpspace.app.server.network import free_port, is_local, page_url, resolve_host
from warpspace.app.server.tab_memory import (
    KEPT_SECONDS,
    KEPT_TABS,
    TabMemory,
    TabRecord,
    is_token,
    new_token,
)
from warpspace.app.state.app_state import start_state
from warpspace.app.state.store import StateStore
from warpspace.exceptions import OptionError
from warpspace.scene.library import load_scene


@pytest.fixture
def busy_port():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        yield taken.getsockname()[1]


def test_busy_port_that_was_asked_for_is_an_error(busy_port):
    with pytest.raises(OptionError, match=f"--port {busy_port} is in use"):
        free_port("127.0.0.1", busy_port)


def test_without_a_port_the_next_free_one_is_taken(busy_port, monkeypatch):
    monkeypatch.setattr(network, "DEFAULT_PORT", busy_port)
    assert free_port("127.0.0.1", None) > busy_port


@pytest.mark.parametrize("port", [-1, 0, 65536, 10**9])
def test_port_out_of_range(port):
    with pytest.raises(OptionError, match="expected 1 to 65535"):
        free_port("127.0.0.1", port)


def test_privileged_port(monkeypatch):
    refused = OSError(errno.EACCES, "Permission denied")
    monkeypatch.setattr(network, "_bind_error", lambda *_: refused)
    with pytest.raises(OptionError, match="above 1023"):
        free_port("127.0.0.1", 80)


@pytest.mark.parametrize("host", ["no such host", "256.1.1.1", "", "a" * 300, "host\0"])
def test_host_that_is_none(host):
    with pytest.raises(OptionError, match="cannot be resolved"):
        resolve_host(host)


def test_host_of_another_machine():
    with pytest.raises(OptionError, match="not an address of this machine"):
        free_port("192.0.2.1", None)


def test_local_addresses():
    assert is_local("127.0.0.1")
    assert is_local("::1")
    assert not is_local("0.0.0.0")
    assert resolve_host("127.0.0.1") == "127.0.0.1"
    assert page_url("0.0.0.0", 8080) == "http://127.0.0.1:8080"
    assert page_url("::1", 8080) == "http://[::1]:8080"


def test_public_tunnel_is_off_and_a_second_app_takes_another_port():
    scene = load_scene("dvf5000_nominal")
    with viewer.Viewer(scene) as first, viewer.Viewer(scene) as second:
        assert first.port != second.port
        assert first._server.request_share_url() is None


def test_a_connection_that_is_gone_takes_nothing_from_the_tab_that_comes_back():
    scene = load_scene("dvf5000_nominal")
    token, left = new_token(), TabRecord(StateStore(start_state(scene)), None)
    gone: Any = SimpleNamespace(token="")
    with viewer.Viewer(scene) as running:
        running._memory.keep(token, left)
        assert running._claim(gone, token) is None
        assert running._memory.take(token) is left


class Connections:
    """Stands for viser's connections."""

    def __init__(self):
        self.handler: Any = None
        self.sent: list[Any] = []

    def register_handler(self, _, handler):
        self.handler = handler

    def queue_message(self, message):
        self.sent.append(message)

    def say(self, client, uuid, value):
        self.handler(client, messages.GuiUpdateMessage(uuid, {"value": value}))


@pytest.fixture
def connections():
    return Connections()


@pytest.fixture
def arrivals(connections):
    return Arrivals(SimpleNamespace(_websock_server=connections))


def test_a_token_is_known_before_and_after_a_page_is_expected(arrivals, connections):
    assert CARRIER in connections.sent[0].source
    connections.say(3, CARRIER, "early")
    woken: list[int] = []
    early, late = arrivals.expect(3), arrivals.expect(4)
    assert early.wait(0.0, lambda: woken.append(3))
    assert early.token == "early"
    assert not late.wait(0.0, lambda: woken.append(4))
    connections.say(4, CARRIER, "late")
    connections.say(4, CARRIER, "later")  # only the first counts
    assert late.is_there
    assert late.token == "late"
    assert woken == [4]


@pytest.mark.parametrize("value", [None, 1, ["a"], {"a": 1}])
def test_what_is_no_text_is_not_taken(arrivals, connections, value):
    connections.say(1, CARRIER, value)
    connections.say(1, "some-widget", "text")
    connections.handler(1, messages.GuiUpdateMessage(CARRIER, [1]))
    assert not arrivals.expect(1).is_there


@pytest.mark.parametrize(
    ("width", "believed"),
    [(1280, 1280.0), (911.5, 911.5), (None, None), ("wide", None), (-1, None), (1e9, None)],
)
def test_a_page_says_how_wide_it_is(arrivals, connections, width, believed):
    said = {"value": "token", "width": width}
    connections.handler(1, messages.GuiUpdateMessage(CARRIER, said))
    assert arrivals.expect(1).width == believed


def test_pages_that_never_show_anything_are_forgotten(arrivals, connections):
    first = arrivals.expect(0)
    for client in range(1, MOST_KNOWN + 1):
        connections.say(client, CARRIER, "x")
    assert arrivals.expect(0) is not first
    arrivals.forget(5)
    assert not arrivals.expect(5).is_there


STATE = start_state(load_scene("dvf5000_first"))


def test_what_is_kept_is_bounded_in_time_and_number():
    now = [0.0]
    memory = TabMemory(clock=lambda: now[0])
    tokens = [new_token() for _ in range(KEPT_TABS + 10)]
    for token in tokens:
        memory.keep(token, TabRecord(StateStore(STATE), None))
    assert len(memory) == KEPT_TABS
    assert memory.take(tokens[0]) is None
    assert memory.take(tokens[-2]) is not None
    assert memory.take(tokens[-2]) is None  # given back once
    now[0] = KEPT_SECONDS + 1.0
    assert memory.take(tokens[-1]) is None
    assert len(memory) == 0


@pytest.mark.parametrize(
    "text", ["", "abc", "x" * 32, "0" * 33, "A" * 32, "../" * 10, "<script>", "0" * 31 + "\n"]
)
def test_what_is_no_token_is_refused(text):
    assert not is_token(text)
    memory = TabMemory()
    memory.keep(text, TabRecord(StateStore(STATE), None))
    assert len(memory) == 0


LIMIT = 1000
BUTTON = "the-button"
OTHER, OTHER_LIMIT = "another-button", 100


class Connection:
    """Stands for viser's connection of a client."""

    def __init__(self):
        self.handlers: dict[type, Any] = {}
        self.sent: list[Any] = []

    def register_handler(self, kind, handler):
        self.handlers[kind] = handler

    def unregister_handler(self, kind, handler):
        assert self.handlers.pop(kind) == handler

    def queue_message(self, message):
        self.sent.append(message)


class Client:
    """A client with viser's own handling of uploads, and what came of them."""

    def __init__(self):
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
        uploads = Uploads(self)
        for uuid, limit in ((BUTTON, LIMIT), (OTHER, OTHER_LIMIT)):
            button = SimpleNamespace(_impl=SimpleNamespace(uuid=uuid), on_upload=lambda _: None)
            uploads.watch(button, limit, lambda *_: None, self.refused.append, "measurement")

    def _finish(self, client, transfer, widget):
        state = self.gui._current_file_upload_states.pop(transfer)
        self.finished.append(b"".join(state["parts"].values()))

    def start(self, size, parts=1, name="a", widget=BUTTON):
        message = messages.FileTransferStartUpload(widget, name, "a.toml", "", parts, size)
        self._websock_connection.handlers[type(message)](0, message)

    def part(self, content, number=0, name="a", widget=BUTTON):
        message = messages.FileTransferPart(widget, name, number, content)
        self._websock_connection.handlers[type(message)](0, message)

    @property
    def held(self):
        states = self.gui._current_file_upload_states.values()
        return sum(len(part) for state in states for part in state["parts"].values())


@pytest.fixture
def client():
    return Client()


def test_a_file_within_the_limit_arrives(client):
    client.start(4, 2)
    client.part(b"ab")
    client.part(b"cd", 1)
    assert client.finished == [b"abcd"]
    assert client.refused == []


@pytest.mark.parametrize(
    ("size", "parts"),
    [(LIMIT + 1, 1), (10**12, 1), (-1, 1), (None, 1), ("9", 1), (True, 1), (9, MOST_PARTS + 1)],
)
def test_what_is_announced_too_large_or_as_nonsense_is_not_begun(client, size, parts):
    client.start(size, parts)
    client.part(b"x" * 10)
    assert client.held == 0
    assert len(client.refused) == 1
    assert isinstance(client._websock_connection.sent[0], messages.FileTransferPartAck)


def test_more_than_was_announced_is_dropped(client):
    client.start(4, 2)
    client.part(b"ab")
    client.part(b"x" * 10, 1)
    assert client.held == 0
    assert client.finished == []
    assert "more has arrived" in client.refused[0]


def test_other_widgets_take_no_files(client):
    client.start(4, widget="a-slider")
    client.part(b"abcd")
    assert client.finished == []


def test_each_button_has_a_limit_of_its_own(client):
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
def test_a_file_cannot_change_its_button_on_the_way(client, widget):
    client.start(LIMIT, 2)
    client.part(b"x" * (LIMIT - 1))
    client.part(b"x", 1, widget=widget)
    assert client.finished == []
    assert client.held == 0
    assert "not sent to where it was announced" in client.refused[0]


def test_all_buttons_together_take_only_so_many_at_once(client):
    for number in range(MOST_AT_ONCE + 1):
        client.start(4, 2, name=f"{number}", widget=(BUTTON, OTHER)[number % 2])
    assert len(client.gui._current_file_upload_states) == MOST_AT_ONCE
    assert "at once" in client.refused[0]
