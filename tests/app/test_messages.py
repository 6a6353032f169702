"""Messages of clients, honest or hostile, and the private parts of viser they pass."""

import asyncio
import importlib
import json
import logging
import threading
import time
from types import SimpleNamespace
from typing import Any

import msgspec.msgpack
import psutil
import pytest
import viser
from viser import _messages as messages

from app.hostile import camera, connected, events, nonsense, upload
from app.wire import Wire, opened
from app.wire import dial as dial_viewer
from page_client import CAMERA, App, dial, pack, until, update
from reliability.outcome import Lag
from warpspace.app.browser.events import MOST_EVENTS, Event, read_events
from warpspace.app.browser.incoming import may_pass, may_set
from warpspace.app.browser.page import Page
from warpspace.app.browser.viser_private import (
    dom_id,
    listen_to_all,
    serve_with,
    wake_sender_on_its_thread,
)
from warpspace.app.server.network import RepeatedLines
from warpspace.app.server.session import Turns
from warpspace.app.server.viewer import Viewer
from warpspace.cli.services import build_services
from warpspace.scene.library import load_scene


def look_up(owner, path):
    """Follow a dotted name; say what is missing and what to do about it."""
    found = owner
    for name in path.split("."):
        assert hasattr(found, name), (
            f"viser {viser.__version__} lacks {type(owner).__name__}.{path}, which"
            f" warpspace.app.browser.viser_private uses: read there what it is for, and replace it"
        )
        found = getattr(found, name)
    return found


@pytest.fixture(scope="module")
def client():
    with Viewer(load_scene("dvf5000_nominal")) as running, dial_viewer(running) as socket:
        server = running._server
        assert Wire(socket).read_until(lambda: bool(server.get_clients()))
        (handle,) = server.get_clients().values()
        yield server, handle


USED = {
    "server": "_websock_server.register_handler _websock_server.queue_message",
    "client": "_websock_connection.queue_message _websock_connection.register_handler"
    " _websock_connection.unregister_handler _websock_connection.get_message_buffer"
    " gui._websock_interface.register_handler gui._websock_interface.unregister_handler"
    " gui._handle_gui_updates gui._gui_input_handle_from_uuid",
    "_gui_api": "print_threadpool_errors",
    "_scene_api": "print_threadpool_errors print_awaited_callback_error",
    "_viser": "print_threadpool_errors",
}
FIELDS = {
    "RunJavascriptMessage": "source",
    "GuiUpdateMessage": "uuid updates",
    "ReplayDoneMessage": "",
}


@pytest.mark.parametrize("owner", USED)
def test_viser_has_what_is_used_of_it(client, owner):
    owners = dict(zip(("server", "client"), client, strict=True))
    found = owners.get(owner) or importlib.import_module(f"viser.{owner}")
    for path in USED[owner].split():
        look_up(found, path)


@pytest.mark.parametrize("name", FIELDS)
def test_messages_have_the_fields_that_are_used(name):
    missing = set(FIELDS[name].split()) - set(look_up(messages, name).__annotations__)
    assert not missing, f"viser {viser.__version__}: {name} lacks {sorted(missing)}"


def test_widgets_have_ids_and_a_connection_an_event_that_wakes_its_sender(client):
    widget = client[1].gui.add_text("", "")
    assert look_up(widget, "_impl.uuid") == dom_id(widget)
    buffer = look_up(client[1], "_websock_connection.get_message_buffer")()
    look_up(buffer, "message_event.set")


def test_a_server_starts_with_the_options_that_are_changed():
    """test_doors.py asks a running app with foreign names and pages, and is refused."""
    seen: list[dict[str, Any]] = []

    def change(options):
        seen.append(options)
        return options

    with serve_with(change) as used:
        server = viser.ViserServer(host="127.0.0.1", verbose=False)
    server.stop()
    assert used, (
        f"viser {viser.__version__} does not start its server by websockets.asyncio.server.serve,"
        " which warpspace.app.browser.viser_private.serve_with relies on"
    )
    assert callable(seen[0]["process_request"])
    assert seen[0].keys().isdisjoint({"process_response", "create_connection", "origins"})


def test_messages_of_a_page_are_checked_before_they_are_read(client):
    assert look_up(client[0], "_websock_server._message_class") is messages.Message
    raw = msgspec.msgpack.encode({"type": "GuiFormDirtyMessage", "uuid": "a"})
    assert type(messages.Message.deserialize(raw)) is messages.ReplayDoneMessage
    assert type(messages.Message.deserialize(msgspec.msgpack.encode(CAMERA))) is (
        messages.ViewerCameraMessage
    )
    handlers = look_up(client[0], "_websock_server._incoming_handlers")
    assert messages.ReplayDoneMessage not in handlers


def test_updates_of_widgets_are_checked_on_server_and_client(client):
    for owner in client:
        handlers = owner.gui._websock_interface._incoming_handlers[messages.GuiUpdateMessage]
        assert owner.gui._handle_gui_updates not in handlers


def test_only_its_own_thread_wakes_a_sender():
    """viser does it from ours, too, where it may meet the sender itself."""

    async def run():
        event = asyncio.Event()
        buffer = SimpleNamespace(message_event=event)
        connection = SimpleNamespace(get_message_buffer=lambda: buffer)
        wake_sender_on_its_thread(SimpleNamespace(_websock_connection=connection))
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
        {"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": "t", "width": 1280}},
        {"type": "ScenePointerMessage", "event_type": "click", "ray_origin": [1, 2, 3.5],
         "ray_direction": [0, 0, 1], "screen_pos": [[0.5, 0.5]], "modifier": None},
    ):  # fmt: skip
        assert may_pass(pack(message)), message


def test_what_makes_no_sense_does_not_pass():
    fine = [message for message in nonsense(["a"]) if may_pass(message)]
    # what kind a widget has is known later, and so is which widgets there are
    assert len(fine) < 10
    assert all(b"GuiUpdateMessage" in message and b"\xa5value" in message for message in fine)


@pytest.mark.parametrize(
    ("present", "updates", "fine"),
    [
        ("a", {"value": "b"}, True),
        ("a", {"value": 1.0}, False),
        (1.5, {"value": 2.0}, False),
        (None, {"value": "a"}, False),
        ("a", {"value": "b", "uuid": "c"}, False),
        ("a", {"uuid": "c"}, False),
        ("a", {}, False),
    ],
)
def test_only_the_value_of_a_widget_may_be_set_and_only_to_a_text(present, updates, fine):
    assert may_set(present, updates) is fine


def test_of_a_page_in_haste_the_last_camera_counts_and_every_text():
    seen: list[tuple[str, object]] = []
    with Viewer(load_scene("dvf5000_nominal")) as viewer:
        listen_to_all(viewer._server, lambda _, uuid, said: seen.append((uuid, said["value"])))
        app = App(viewer.url.replace("http", "ws", 1), psutil.Process())

        async def run():
            async with connected(app) as socket:
                for number in range(600):
                    await socket.send(camera(fov=0.3 + number / 1e4))
                    if number % 100 == 99:
                        await socket.send(pack(update("carrier", {"value": str(number)})))
                await until(lambda: ("carrier", "599") in seen, 60.0)

                (client,) = viewer._server.get_clients().values()
                return client.camera.fov

        assert asyncio.run(run()) == pytest.approx(0.3 + 599 / 1e4)
    assert [value for _, value in seen] == [f"{number}99" for number in ("", *range(1, 6))]


@pytest.mark.parametrize(
    "text",
    [
        "", "{}", "null", "[[]]", '[["1", "a:b", ""]]', '[[1, "a:b", null]]', '[[NaN, "a:b", ""]]',
        '[[-1, "a:b", ""]]', '[[0, "a:b", ""]]', '[[1, "no colon", ""]]', "[" * 100_000,
        json.dumps([[1, "a:" + "b" * 200, ""]]), json.dumps([[1, "a:b", "9" * 20_001]]),
    ],
    ids=range(13),
)  # fmt: skip
def test_what_is_no_event_is_left_out(text):
    assert read_events(text) == ()


def test_events_are_numbered_and_at_most_so_many():
    found = read_events(json.dumps([[n, f"state:set.a:{n}", "x"] for n in range(1, 100)]))
    assert len(found) == MOST_EVENTS
    assert found[0] == (1, Event("state", "set.a:1", "x"))
    assert len(read_events(json.dumps([[1, *upload("x.csv", b"1" * 100_000)]]))) == 1


def test_events_that_no_page_sends_are_refused_in_words_and_the_page_goes_on(caplog):
    with opened(load_scene("dvf5000_first"), services=build_services()) as (wire, session):
        sent = events(sorted(session.display.parts))
        for at in range(0, len(sent), MOST_EVENTS):
            wire.say_all(sent[at : at + MOST_EVENTS])
            time.sleep(0.01)  # no faster than a page may
        wire.say_all([("page:reset", ""), ("errors:set.EAX", "17"), ("page:close", "")])
        assert wire.read_until(lambda: session.state.amplitudes["EAX"] == 17.0, 60.0)
        assert wire.read_until(lambda: 'data-text="17"' in wire.pieces["error.EAX"])
        assert wire.toasts
        assert not [text for _, title, text in wire.toasts if title == "That did not work"]
        assert "<img" not in "".join(wire.pieces.values())
    assert [record.getMessage() for record in caplog.records if record.levelname == "ERROR"] == []


def test_texts_stay_texts_within_a_script():
    page, sent, evil = object.__new__(Page), list[str](), 'x"</script><script>alert(1)//\u2028'
    page._sent, page.run_script = {}, sent.append
    page.notify(evil, evil)
    page.set_title(evil)
    page.put({"head": evil})
    for script in sent:
        assert "</script>" not in script
        assert "\u2028" not in script


def test_who_has_kept_the_server_busy_stands_back():
    turns, order = Turns(), []

    def work(name):
        with turns.take(name):
            order.append(name)

    with turns.take("busy"):
        time.sleep(0.05)
    with turns.take("other"):
        waiting = [threading.Thread(target=work, args=(name,)) for name in ("busy", "idle")]
        for thread in waiting:
            thread.start()
        while len(turns._waiting) < 2:
            time.sleep(0.01)
    for thread in waiting:
        thread.join()
    assert order == ["idle", "busy"]


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
