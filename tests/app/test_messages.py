"""Messages of clients, honest or hostile, and the private parts of viser they pass."""

import asyncio
import importlib
import logging
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec.msgpack
import psutil
import pytest
import viser
from viser import _messages as messages

from app.raw_client import App, connected, dial, nonsense, until, update
from app.wire import Wire
from app.wire import dial as dial_viewer
from page_protocol import CAMERA, pack
from reliability.outcome import Lag
from warpspace.app.browser.incoming import may_pass, may_set, moved
from warpspace.app.browser.viser_private import (
    dom_id,
    listen_to_all,
    serve_with,
    show_marks,
    wake_sender_on_its_thread,
)
from warpspace.app.server.network import RepeatedLines
from warpspace.app.server.session import Turns
from warpspace.app.server.viewer import Viewer
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
    " gui._release_cross_scope_nesting gui._handle_file_transfer_start"
    " gui._handle_file_transfer_part gui._current_file_upload_states"
    " gui._websock_interface.register_handler gui._websock_interface.unregister_handler"
    " gui._handle_gui_updates gui._gui_input_handle_from_uuid",
    "_gui_api": "print_threadpool_errors",
    "_scene_api": "print_threadpool_errors print_awaited_callback_error",
    "_viser": "print_threadpool_errors",
}
FIELDS = {
    "RunJavascriptMessage": "source",
    "GuiUpdateMessage": "uuid updates",
    "FileTransferStartUpload": "source_component_uuid transfer_uuid filename part_count size_bytes",
    "FileTransferPart": "transfer_uuid content",
    "FileTransferPartAck": "source_component_uuid transfer_uuid transferred_bytes total_bytes",
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


def test_widgets_have_ids_and_marks_and_a_connection_an_event_that_wakes_its_sender(client):
    widget = client[1].gui.add_text("", "")
    assert look_up(widget, "_impl.uuid") == dom_id(widget)
    slider = client[1].gui.add_slider("", 0.0, 1.0, 0.1, 0.0, marks=((0.0, "0"),))
    show_marks(slider, ((0.0, "0"), (1.0, "1")))
    look_up(messages, "GuiSliderMark")
    assert look_up(slider, "_impl.props._marks") == (
        messages.GuiSliderMark(0.0, "0"),
        messages.GuiSliderMark(1.0, "1"),
    )
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
    app, lag = App(viewer.url.replace("http", "ws", 1), psutil.Process(), Path()), Lag()

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
        {"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": [1, 2.5, 3]}},
        {"type": "ScenePointerMessage", "event_type": "click", "ray_origin": [1, 2, 3.5],
         "ray_direction": [0, 0, 1], "screen_pos": [[0.5, 0.5]], "modifier": None},
        {"type": "CommandTriggerMessage", "uuid": "a"},
        {"type": "FileTransferStartUpload", "source_component_uuid": "a", "transfer_uuid": "b",
         "filename": "s.toml", "mime_type": "", "part_count": 1, "size_bytes": 900},
        {"type": "FileTransferPart", "source_component_uuid": "a", "transfer_uuid": "b",
         "part_index": 0, "content": b"title"},
    ):  # fmt: skip
        assert may_pass(pack(message)), message


def test_what_makes_no_sense_does_not_pass():
    fine = [message for message in nonsense(["a"]) if may_pass(message)]
    # what kind a widget has is known later, and so is which widgets and uploads there are
    assert len(fine) < 10
    assert all(b"GuiUpdateMessage" in message and b"\xa5value" in message for message in fine)


@pytest.mark.parametrize(
    ("present", "update", "fine"),
    [
        (1.5, {"value": 2}, True),
        (3, {"value": 2.5}, True),
        (True, {"value": False}, True),
        ((1.0, 2.0), {"value": [3, 4]}, True),
        ((), {"value": []}, True),
        (1.5, {"value": True}, False),
        (1.5, {"value": "2"}, False),
        (True, {"value": 1}, False),
        ("a", {"value": 1.0}, False),
        ((1.0, 2.0), {"value": [3.0]}, False),
        ((1.0,), {"value": ["a"]}, False),
        ((1.0,), {"value": 1.0}, False),
        (None, {"value": "a"}, False),
        (3, {"value": float("nan")}, False),
        (3, {"value": 1e300}, False),
        ("a", {"value": "b"}, True),
        ("a", {"value": "b", "uuid": "c"}, False),
        ("a", {"uuid": "c"}, False),
        ("a", {}, False),
    ],
)
def test_only_the_value_of_a_widget_may_be_set_and_only_to_one_of_its_kind(present, update, fine):
    assert may_set(present, update) is fine
    if present == "a" and fine:  # an option that there is
        assert may_set("a", update, ("a", "b"))
        assert not may_set("a", update, ("a", "c"))


def test_only_moves_are_put_together():
    assert moved(update("a", {"value": 2.5})) == moved(update("a", {"value": 3})) is not None
    assert moved(update("a", {"value": [1, 2]})) != moved(update("b", {"value": [1, 2]}))
    assert moved(pack(CAMERA)) is not None
    click = pack({"type": "CommandTriggerMessage", "uuid": "a"})
    for message in (update("a", {"value": True}), update("a", {"value": "Undo"}), click, b"", "x"):
        assert moved(message) is None


def test_of_a_page_in_haste_each_widget_gets_the_last_value_in_order():
    seen: list[tuple[str, object]] = []
    with Viewer(load_scene("dvf5000_nominal")) as viewer:
        listen_to_all(viewer._server, lambda _, uuid, said: seen.append((uuid, said["value"])))
        app = App(viewer.url.replace("http", "ws", 1), psutil.Process(), Path())

        async def run():
            async with connected(app) as socket:
                for number in range(600):
                    await socket.send(update(f"slider {number % 3}", {"value": float(number)}))
                    if number % 100 == 99:
                        await socket.send(update("button", {"value": True}))
                await until(lambda: ("slider 2", 599.0) in seen, 60.0)

        asyncio.run(run())
    assert len(seen) < 300
    assert [value for uuid, value in seen if uuid == "button"] == [True] * 6
    values = [value for uuid, value in seen if uuid != "button"]
    assert values == sorted(values)
    assert values[-3:] == [597.0, 598.0, 599.0]


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
