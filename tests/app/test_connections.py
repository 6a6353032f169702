"""Host and port, arrivals, the memory of tabs."""

import errno
import gc
import socket
import threading
import time
import weakref
from collections import deque
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from app.wire import Wire, dial, end_work
from warpspace.app.browser import actions as do
from warpspace.app.browser.incoming import Events
from warpspace.app.panels.panel import MOST_FILES, Context
from warpspace.app.server import tab_keeper, viewer
from warpspace.app.server.viewer import free_port, is_local, page_url, resolve_host
from warpspace.app.state.app_state import start_state
from warpspace.app.state.store import StateStore
from warpspace.exceptions import OptionError
from warpspace.parts.workpiece import Workpiece
from warpspace.scene.library import load_scene


def test_a_busy_port_is_an_error_where_it_was_asked_for_else_the_next_is_taken(monkeypatch):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        busy = taken.getsockname()[1]
        with pytest.raises(OptionError, match=f"--port {busy} is in use"):
            free_port("127.0.0.1", busy)
        monkeypatch.setattr(viewer, "DEFAULT_PORT", busy)
        assert free_port("127.0.0.1", None) > busy


@pytest.mark.parametrize(
    ("host", "port", "problem"),
    [
        *(("127.0.0.1", port, "expected 1 to 65535") for port in (-1, 0, 65536, 10**9)),
        ("127.0.0.1", 80, "above 1023"),
        ("192.0.2.1", None, "not an address of this machine"),
        *((host, None, "cannot be resolved")
          for host in ("no such host", "256.1.1.1", "", "a" * 300, "host\0")),
    ],
)  # fmt: skip
def test_host_and_port_that_cannot_be(monkeypatch, host, port, problem):
    if port == 80:
        monkeypatch.setattr(viewer, "_bind_error", lambda *_: errno.EACCES)
    with pytest.raises(OptionError, match=problem):
        free_port(resolve_host(host), port)


def test_local_addresses():
    assert [is_local(host) for host in ("127.0.0.1", "::1", "0.0.0.0")] == [True, True, False]
    assert page_url("0.0.0.0", 8080) == "http://127.0.0.1:8080"
    assert page_url("::1", 8080) == "http://[::1]:8080"


def test_public_tunnel_is_off_and_a_second_app_takes_another_port():
    scene = load_scene("dvf5000_nominal")
    with viewer.Viewer(scene) as first, viewer.Viewer(scene) as second:
        assert first.port != second.port
        assert first.server.request_share_url() is None


def test_a_connection_that_is_gone_takes_nothing_from_the_tab_that_comes_back():
    scene = load_scene("dvf5000_nominal")
    token, left = tab_keeper.new_token(), tab_keeper.TabRecord(StateStore(start_state(scene)), None)
    gone: Any = SimpleNamespace(token="")
    with viewer.Viewer(scene) as running:
        running.memory.keep(token, left)
        assert running.claim(gone, token) is None
        assert running.memory.take(token) is left


def test_a_page_says_once_which_tab_it_is():
    token = tab_keeper.new_token()
    with viewer.Viewer(load_scene("dvf5000_nominal")) as running, dial(running) as socket:
        wire = Wire(socket, token)
        wire.say(do.TabHere(tab_keeper.new_token()))  # only the first counts
        assert wire.read_until(lambda: wire.is_open, seconds=60.0)
        (session,) = running.sessions
        assert session.token == token
        end_work(running)


STATE = start_state(load_scene("dvf5000_first"))


def test_what_is_kept_is_bounded_in_time_and_number():
    now = [0.0]
    memory = tab_keeper.TabMemory(clock=lambda: now[0])
    tokens = [tab_keeper.new_token() for _ in range(tab_keeper.MAX_CLOSED_TABS + 10)]
    for token in tokens:
        memory.keep(token, tab_keeper.TabRecord(StateStore(STATE), None))
    assert len(memory) == tab_keeper.MAX_CLOSED_TABS
    assert memory.take(tokens[0]) is None
    assert memory.take(tokens[-2]) is not None
    assert memory.take(tokens[-2]) is None  # given back once
    now[0] = tab_keeper.RETENTION_S + 1.0
    assert memory.take(tokens[-1]) is None
    assert len(memory) == 0


def test_what_is_kept_is_bounded_in_memory_and_released_once_it_is_too_old():
    now, meshes = [0.0], []
    memory = tab_keeper.TabMemory(clock=lambda: now[0])
    for _ in range(tab_keeper.MAX_HISTORY_BYTES // 48_000_000 + 4):
        store = StateStore(STATE)
        mesh = Workpiece("x", np.zeros((2_000_000, 3)), np.zeros((1, 3), "i4"))
        look = replace(STATE.part, mesh=mesh)
        store.apply(lambda state, look=look: replace(state, part=look))
        memory.keep(tab_keeper.new_token(), tab_keeper.TabRecord(store, None))
        meshes.append(weakref.ref(mesh))
        del store, mesh, look
    gc.collect()
    most = tab_keeper.MAX_HISTORY_BYTES // 48_000_000
    assert 1 < sum(mesh() is not None for mesh in meshes) <= most
    now[0] = tab_keeper.RETENTION_S + 1.0
    memory.forget()
    gc.collect()
    assert not any(mesh() for mesh in meshes)


def test_a_tab_that_is_closed_leaves_only_its_record():
    with viewer.Viewer(load_scene("part_on_dvf5000")) as running:
        with dial(running) as socket:
            wire = Wire(socket)
            assert wire.read_until(lambda: wire.is_open, seconds=60.0)
            (session,) = running.sessions
            left = [*map(weakref.ref, (session, session.context, session.display))]
            end_work(running)
            del session
        end = time.monotonic() + 20.0
        while any(one() is not None for one in left) and time.monotonic() < end:
            gc.collect()
            time.sleep(0.1)
        assert [one() for one in left] == [None] * len(left)


@pytest.mark.parametrize(
    "text", ["", "abc", "x" * 32, "0" * 33, "A" * 32, "../" * 10, "<script>", "0" * 31 + "\n"]
)
def test_what_is_no_token_is_refused(text):
    assert tab_keeper.TAB_TOKEN.fullmatch(text) is None


def test_only_so_many_files_wait_at_once():
    context: Any = object.__new__(Context)
    said: list[tuple[str, ...]] = []
    context.events, context._wake = deque(), threading.Event()
    context.notify = lambda *words: said.append(words)
    file = Events([do.Upload("files", "x", 9, "x")])
    for _ in range(MOST_FILES + 3):
        context.receive(file)
        context.receive(Events([do.SetError("EXX", "1")]))
    assert len(context.events) == 2 * MOST_FILES + 3
    assert "at once" in said[0][1]


def test_tabs_share_the_responses_of_a_scene_and_are_edited_apart():
    app = viewer.Viewer(load_scene("dvf5000_first"))
    with app, dial(app) as socket, dial(app) as other_socket:
        wire, other_wire = Wire(socket), Wire(other_socket)
        assert wire.read_until(lambda: wire.is_open, seconds=60.0)
        assert other_wire.read_until(lambda: other_wire.is_open, seconds=60.0)
        wire.say(do.SetError("EA0Z", "77"))
        stores = [session.context.store for session in app.sessions]
        assert wire.read_until(lambda: any(store.is_edited for store in stores))
        wire.read_until(lambda: "77" in wire.pieces["error.EA0Z"])
        pictures = [session.context.picture for session in app.sessions]
        edited, idle = sorted(pictures, key=lambda of: of.state.amplitudes["EA0Z"] != 77.0)
        assert edited.state.amplitudes["EA0Z"] == 77.0
        assert idle.state.amplitudes == idle.state.start
        assert idle.grid is edited.grid
        assert all(a.group is b.group for a, b in zip(idle.traces, edited.traces, strict=True))
        assert idle.field.error_um is not edited.field.error_um
        end_work(app)
