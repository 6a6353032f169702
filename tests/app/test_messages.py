"""Messages of clients, honest or hostile, and the private parts of viser they pass."""

import asyncio
import logging
import re
import threading
import time
from importlib.resources import files
from types import SimpleNamespace
from typing import get_args

import psutil
import pytest
from viser import _messages as messages

from app.hostile import FIELDS, actions, camera, nonsense, upload
from app.wire import Wire, opened
from app.wire import dial as dial_viewer
from page_client import CAMERA, App, dial, pack, said, until
from reliability.outcome import Lag
from warpspace.app.browser import actions as do
from warpspace.app.browser.incoming import MOST_EVENTS, read_message
from warpspace.app.browser.page import Page
from warpspace.app.browser.viser_private import connection_of, message_buffer, send_at_once
from warpspace.app.server import session
from warpspace.app.server.connection_guard import TabConnection
from warpspace.app.server.session import turn
from warpspace.app.server.viewer import RepeatedLines, Viewer
from warpspace.cli.services import build_services
from warpspace.scene.library import load_scene

PANEL_KINDS = {*do.PanelAction.__subclasses__()}


@pytest.fixture(scope="module")
def client():
    with Viewer(load_scene("dvf5000_nominal")) as running, dial_viewer(running) as socket:
        server = running.server
        assert Wire(socket).read_until(lambda: bool(server.get_clients()))
        (handle,) = server.get_clients().values()
        yield server, handle


def test_its_connections_are_ours_and_send_at_once(client):
    buffer = message_buffer(client[1])
    assert callable(buffer.message_event.set)
    assert buffer.message_from_id is not None
    assert buffer.window_duration_sec == 0.0
    assert "source" in messages.RunJavascriptMessage.__annotations__
    assert isinstance(connection_of(*client), TabConnection)


def test_only_its_own_thread_wakes_a_sender():
    """viser does it from ours, too, where it may meet the sender itself."""

    async def run():
        event = asyncio.Event()
        buffer = SimpleNamespace(message_event=event)
        connection = SimpleNamespace(get_message_buffer=lambda: buffer)
        send_at_once(SimpleNamespace(_websock_connection=connection))
        other = threading.Thread(target=event.set)
        other.start()
        other.join()
        found = [event.is_set()]
        event.set()
        return [*found, event.is_set()]

    assert asyncio.run(run()) == [False, True]


def test_clients_that_read_nothing_do_not_hold_up_the_end():
    viewer = Viewer(load_scene("dvf5000_first"))
    app, lag = App(viewer.url.replace("http", "ws", 1), psutil.Process()), Lag()

    async def run():
        sockets = [await dial(app) for _ in range(3)]
        for socket in sockets:
            await socket.send(pack(CAMERA))
            socket.transport.pause_reading()
        await until(lambda: len(viewer.sessions) == 3, 60.0)
        await asyncio.sleep(1.0)  # the pages are on their way to them
        began = time.monotonic()
        viewer.stop()
        taken = time.monotonic() - began
        lag.measure()
        for socket in sockets:
            socket.transport.abort()
            await socket.wait_closed()
        return taken

    assert lag.judge(asyncio.run(run()), 4.0) == []  # viser would wait for 6 s


def test_what_a_page_really_says_passes():
    for message in (
        CAMERA,
        {"type": "ScenePointerMessage", "event_type": "click", "ray_origin": [1, 2, 3.5],
         "ray_direction": [0, 0, 1], "screen_pos": [[0.5, 0.5]], "modifier": None},
        {"type": "TransformControlsUpdateMessage", "name": "/part/gizmo", "wxyz": [1, 0, 0, 0],
         "position": [1, 2, 3.5], "owner": ""},
        {"type": "TransformControlsDragEndMessage", "name": "/part/gizmo", "owner": ""},
        said(do.Signal.UNDO, do.Input.FIND_ERRORS("x")),
        said(upload("x.csv", b"1" * 100_000)),
    ):  # fmt: skip
        assert read_message(pack(message)) is not None, message
    sent = [do.SetLeaf("look.surface", "x"), do.Signal.UNDO, do.Input.EXPORT(".stl")]
    assert read_message(pack(said(*sent))).events == sent
    assert all(read_message(pack(said(action))) is not None for action in actions())


def test_what_makes_no_sense_does_not_pass():
    assert [message for message in nonsense() if read_message(message) is not None] == []
    assert read_message("text") is None


def test_only_what_viser_is_to_know_reaches_it(monkeypatch):
    seen: list[bytes] = []
    read = messages.Message.deserialize
    monkeypatch.setattr(messages.Message, "deserialize", lambda raw: seen.append(raw) or read(raw))
    with opened(load_scene("dvf5000_nominal")) as (wire, session):
        seen.clear()
        for message in (*nonsense(), pack(said(do.SetError("EXX", "7"))), camera(fov=0.5)):
            wire.socket.send(message)
        assert wire.read_until(lambda: session.state.amplitudes["EXX"] == 7.0)
        assert wire.read_until(lambda: bool(seen))
    assert seen == [camera(fov=0.5)]


def test_every_action_is_decoded_and_handled_by_one_panel_or_by_the_session():
    with opened(load_scene("dvf5000_first"), services=build_services(), shared=True) as (
        _,
        session,
    ):
        panels = session.display.panels.values()
        handled = [kind for panel in panels for kind in {*panel.handlers} - PANEL_KINDS]
        in_page = {do.Signal.FIND_ERROR, do.Signal.CHOOSE_FILES}
        in_session = {
            do.TabHere,
            do.Signal.DRAWN,
            do.Signal.RISE,
            do.Signal.HOLD,
            do.Signal.RELEASE,
        }
        kinds = {*do.Signal, *do.Input, *get_args(do.AnyAction)} - {do.Signal, do.InputValue}
        assert len(handled) == len({*handled})
        assert {*handled} == kinds - PANEL_KINDS - in_page - in_session
        assert {kind for panel in panels for kind in panel.handlers} >= PANEL_KINDS


def test_actions_without_meaning_are_refused_in_words_and_the_page_goes_on(caplog):
    with opened(load_scene("dvf5000_first"), services=build_services()) as (wire, session):
        sent = actions([*session.display.panels, *FIELDS["panel"]])
        for at in range(0, len(sent), MOST_EVENTS):
            wire.send(said(*sent[at : at + MOST_EVENTS]))
            time.sleep(0.01)  # no faster than a page may
        reset = do.Signal.END_STORY, do.Signal.RESET_ERRORS
        wire.send(said(*reset, do.SetError("EAX", "17"), do.Signal.CLOSE_DIALOG))
        assert wire.read_until(lambda: session.state.amplitudes["EAX"] == 17.0, 60.0)
        assert wire.read_until(lambda: 'data-text="17"' in wire.pieces["error.EAX"])
        assert wire.toasts
        assert not [text for *_, text in wire.toasts if re.match(r"\w+Error: ", text)]
        assert "<img" not in "".join(wire.pieces.values())
    assert [record.getMessage() for record in caplog.records if record.levelname == "ERROR"] == []


def test_one_script_names_the_private_parts_of_viser():
    folder = files("warpspace.app")
    scripts = [
        path
        for room in ("browser", "documents")
        for path in folder.joinpath(room).iterdir()
        if path.name.endswith(".js")
    ]
    named = [path.name for path in scripts if "__viser" in path.read_text("utf-8")]
    assert (len(scripts) > 9, named) == (True, ["viser_private.js"])


def test_texts_stay_texts_within_a_script(client, monkeypatch):
    page, sent, evil = Page(*client), list[str](), 'x"</script><script>alert(1)//\u2028'
    monkeypatch.setattr(page, "run_script", sent.append)
    page.notify(evil, evil)
    page.call("title", evil)
    page.put({"head": evil})
    for script in sent:
        assert "</script>" not in script
        assert "\u2028" not in script


def test_tabs_that_wait_get_their_picture_in_turn():
    order: list[int] = []

    def work(who):
        with turn():
            order.append(who)

    with turn():
        waiting = [threading.Thread(target=work, args=(who,)) for who in range(3)]
        for at, thread in enumerate(waiting, start=2):
            thread.start()
            while len(session._TURNS) < at:
                time.sleep(0.01)
    for thread in waiting:
        thread.join()
    assert order == [0, 1, 2]


def test_lines_of_one_kind_are_counted():
    now = [0.0]
    limit = RepeatedLines(lambda: now[0])

    def lines(name, message, *args, raised=False):
        info = (ValueError, ValueError("x"), None) if raised else None
        record = logging.LogRecord(name, logging.ERROR, "", 0, message, args, info)
        return [record.getMessage()] if limit.filter(record) else []

    assert lines("warpspace.a", "session %d", 1) == ["session 1"]
    assert lines("warpspace.a", "session %d", 2) == lines("warpspace.a", "session %d", 3) == []
    assert lines("warpspace.b", "session %d", 4) == ["session 4"]
    now[0] = 61.0
    assert lines("warpspace.a", "session %d", 5) == ["session 5 (2 more before it)"]
    # a library's traceback is one line
    assert lines("asyncio", "never retrieved\nfuture: 1", raised=True) == [
        "never retrieved (ValueError)"
    ]
    assert lines("asyncio", "never retrieved\nfuture: 2", raised=True) == []
