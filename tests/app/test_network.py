"""Host and port are checked before anything is served."""

import errno
import socket
import threading
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from warpspace.app.server import network, run, viewer
from warpspace.app.server.network import free_port, is_local, page_url, resolve_host
from warpspace.app.server.tab_memory import TabRecord, new_token
from warpspace.app.state.app_state import start_state
from warpspace.app.state.store import StateStore
from warpspace.exceptions import OptionError
from warpspace.scene.library import load_scene


@pytest.fixture
def busy_port() -> Iterator[int]:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        yield taken.getsockname()[1]


def test_busy_port_that_was_asked_for_is_an_error(busy_port: int) -> None:
    with pytest.raises(OptionError, match=f"--port {busy_port} is in use"):
        free_port("127.0.0.1", busy_port)


def test_without_a_port_the_next_free_one_is_taken(
    busy_port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(network, "DEFAULT_PORT", busy_port)
    assert free_port("127.0.0.1", None) > busy_port


@pytest.mark.parametrize("port", [-1, 0, 65536, 10**9])
def test_port_out_of_range(port: int) -> None:
    with pytest.raises(OptionError, match="expected 1 to 65535"):
        free_port("127.0.0.1", port)


def test_privileged_port(monkeypatch: pytest.MonkeyPatch) -> None:
    refused = OSError(errno.EACCES, "Permission denied")
    monkeypatch.setattr(network, "_bind_error", lambda *_: refused)
    with pytest.raises(OptionError, match="above 1023"):
        free_port("127.0.0.1", 80)


@pytest.mark.parametrize("host", ["no such host", "256.1.1.1", "", "a" * 300, "host\0"])
def test_host_that_is_none(host: str) -> None:
    with pytest.raises(OptionError, match="cannot be resolved"):
        resolve_host(host)


def test_host_of_another_machine() -> None:
    with pytest.raises(OptionError, match="not an address of this machine"):
        free_port("192.0.2.1", None)


def test_local_addresses() -> None:
    assert is_local("127.0.0.1")
    assert is_local("::1")
    assert not is_local("0.0.0.0")
    assert resolve_host("127.0.0.1") == "127.0.0.1"
    assert page_url("0.0.0.0", 8080) == "http://127.0.0.1:8080"
    assert page_url("::1", 8080) == "http://[::1]:8080"


def test_public_tunnel_is_off_and_a_second_app_takes_another_port() -> None:
    scene = load_scene("dvf5000_nominal")
    with viewer.Viewer(scene) as first, viewer.Viewer(scene) as second:
        assert first.port != second.port
        assert first._server.request_share_url() is None


def test_a_connection_that_is_gone_takes_nothing_from_the_tab_that_comes_back() -> None:
    scene = load_scene("dvf5000_nominal")
    token, left = new_token(), TabRecord(StateStore(start_state(scene)), None)
    gone: Any = SimpleNamespace(token="")
    with viewer.Viewer(scene) as running:
        running._memory.keep(token, left)
        assert running._claim(gone, token) is None
        assert running._memory.take(token) is left


def test_run_warns_of_a_public_address_and_ends_on_ctrl_c(monkeypatch: pytest.MonkeyPatch) -> None:
    class Interrupted(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            raise KeyboardInterrupt

    class Shown:
        link = network_link = "http://x"
        is_local, token = False, None

        def __init__(self, *_: object, **__: object) -> None: ...
        def __enter__(self) -> "Shown":
            return self

        def __exit__(self, *_: object) -> None: ...

    said: list[str] = []
    warned: list[str] = []
    monkeypatch.setattr(run, "Viewer", Shown)
    monkeypatch.setattr(run, "open_browser", lambda _: False)
    monkeypatch.setattr(run.threading, "Event", Interrupted)
    run.run_viewer(
        load_scene("dvf5000_nominal"),
        {},
        host="0.0.0.0",
        port=None,
        browser=True,
        say=said.append,
        warn=warned.append,
    )
    assert "http://x" in said[0]
    assert "open http://x yourself" in said[-2]
    assert "password" in warned[0]
