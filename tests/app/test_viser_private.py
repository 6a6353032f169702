"""Private parts of viser: each is still there, and only one module of the app touches them."""

import ast
import asyncio
import importlib
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec.msgpack
import pytest
import viser
from viser import _messages as messages

from app.wire import dial
from page_protocol import CAMERA
from warpspace.app import browser
from warpspace.app.browser.viser_private import (
    dom_id,
    serve_with,
    show_marks,
    wake_sender_on_its_thread,
)
from warpspace.app.server.viewer import Viewer
from warpspace.scene.library import load_scene

APP = Path(browser.__file__).parents[1]
ONLY = APP / "browser" / "viser_private.py"
SERVER = ("_websock_server.register_handler", "_websock_server.queue_message")
CLIENT = (
    "_websock_connection.queue_message",
    "_websock_connection.register_handler",
    "_websock_connection.unregister_handler",
    "_websock_connection.get_message_buffer",
    "gui._release_cross_scope_nesting",
    "gui._handle_file_transfer_start",
    "gui._handle_file_transfer_part",
    "gui._current_file_upload_states",
    "gui._websock_interface.register_handler",
    "gui._websock_interface.unregister_handler",
    "gui._handle_gui_updates",
    "gui._gui_input_handle_from_uuid",
)
MESSAGES = {
    "RunJavascriptMessage": {"source"},
    "GuiUpdateMessage": {"uuid", "updates"},
    "FileTransferStartUpload": {
        "source_component_uuid",
        "transfer_uuid",
        "filename",
        "part_count",
        "size_bytes",
    },
    "FileTransferPart": {"transfer_uuid", "content"},
    "FileTransferPartAck": {
        "source_component_uuid",
        "transfer_uuid",
        "transferred_bytes",
        "total_bytes",
    },
    "ReplayDoneMessage": set(),
}
PRINTS = {
    "_gui_api": {"print_threadpool_errors"},
    "_scene_api": {"print_threadpool_errors", "print_awaited_callback_error"},
    "_viser": {"print_threadpool_errors"},
}


def look_up(owner: Any, path: str) -> Any:
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
def client() -> Iterator[tuple[viser.ViserServer, viser.ClientHandle]]:
    with (
        Viewer(load_scene("dvf5000_nominal")) as running,
        dial(running) as socket,
    ):
        socket.send(msgspec.msgpack.encode(CAMERA))
        while not running._server.get_clients():
            socket.recv(timeout=20.0)
        (handle,) = running._server.get_clients().values()
        yield running._server, handle


@pytest.mark.parametrize("path", SERVER)
def test_a_server_has_what_is_used_of_it(client: Any, path: str) -> None:
    look_up(client[0], path)


def test_a_server_starts_with_the_options_that_are_changed() -> None:
    """test_doors.py asks a running app with foreign names and pages, and is refused."""
    seen: list[dict[str, Any]] = []

    def change(options: dict[str, Any]) -> dict[str, Any]:
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


@pytest.mark.parametrize("path", CLIENT)
def test_a_client_has_what_is_used_of_it(client: Any, path: str) -> None:
    look_up(client[1], path)


def test_a_widget_has_an_id_in_the_page(client: Any) -> None:
    widget = client[1].gui.add_text("", "")
    assert look_up(widget, "_impl.uuid") == dom_id(widget)


def test_the_marks_of_a_slider_can_be_changed(client: Any) -> None:
    slider = client[1].gui.add_slider("", 0.0, 1.0, 0.1, 0.0, marks=((0.0, "0"),))
    show_marks(slider, ((0.0, "0"), (1.0, "1")))
    look_up(messages, "GuiSliderMark")
    assert look_up(slider, "_impl.props._marks") == (
        messages.GuiSliderMark(0.0, "0"),
        messages.GuiSliderMark(1.0, "1"),
    )


def test_a_connection_has_an_event_that_wakes_its_sender(client: Any) -> None:
    buffer = look_up(client[1], "_websock_connection.get_message_buffer")()
    look_up(buffer, "message_event.set")


@pytest.mark.parametrize(("name", "fields"), MESSAGES.items())
def test_messages_have_the_fields_that_are_used(name: str, fields: set[str]) -> None:
    look_up(messages, name)
    missing = fields - set(getattr(messages, name).__annotations__)
    assert not missing, f"viser {viser.__version__}: {name} lacks {sorted(missing)}"


@pytest.mark.parametrize(("name", "functions"), PRINTS.items())
def test_modules_have_the_functions_that_print_what_fails(name: str, functions: set[str]) -> None:
    for function in functions:
        look_up(importlib.import_module(f"viser.{name}"), function)


def test_messages_of_a_page_are_checked_before_they_are_read(client: Any) -> None:
    assert look_up(client[0], "_websock_server._message_class") is messages.Message
    raw = msgspec.msgpack.encode({"type": "GuiFormDirtyMessage", "uuid": "a"})
    assert type(messages.Message.deserialize(raw)) is messages.ReplayDoneMessage
    assert type(messages.Message.deserialize(msgspec.msgpack.encode(CAMERA))) is (
        messages.ViewerCameraMessage
    )
    handlers = look_up(client[0], "_websock_server._incoming_handlers")
    assert messages.ReplayDoneMessage not in handlers


def test_updates_of_widgets_are_checked_on_server_and_client(client: Any) -> None:
    for owner in client:
        handlers = owner.gui._websock_interface._incoming_handlers[messages.GuiUpdateMessage]
        assert owner.gui._handle_gui_updates not in handlers


def test_only_its_own_thread_wakes_a_sender() -> None:
    """viser does it from ours, too, where it may meet the sender itself."""

    async def run() -> list[bool]:
        event = asyncio.Event()
        buffer = SimpleNamespace(message_event=event)
        connection = SimpleNamespace(get_message_buffer=lambda: buffer)
        wake_sender_on_its_thread(SimpleNamespace(_websock_connection=connection))  # pyright: ignore[reportArgumentType]
        other = threading.Thread(target=event.set)
        other.start()
        other.join()
        found = [event.is_set()]
        event.set()
        return [*found, event.is_set()]

    assert asyncio.run(run()) == [False, True]


def private_uses(path: Path) -> list[str]:
    """List what a module takes of others' private parts: attributes, and modules of viser."""
    found: list[str] = []
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Attribute) and node.attr.startswith("_"):
            own = isinstance(node.value, ast.Name) and node.value.id in {"self", "cls"}
            if not own and not node.attr.startswith("__"):
                found.append(f"{path.name}:{node.lineno} .{node.attr}")
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("viser"):
            names = [*(node.module or "").split("."), *(alias.name for alias in node.names)]
            if any(name.startswith("_") for name in names):
                found.append(f"{path.name}:{node.lineno} from {node.module}")
        elif isinstance(node, ast.Import) and any("viser._" in alias.name for alias in node.names):
            found.append(f"{path.name}:{node.lineno} import viser._…")
    return found


def test_private_parts_of_viser_are_used_in_one_module_only() -> None:
    assert private_uses(ONLY), "the search finds nothing any more"
    elsewhere = [
        use
        for path in sorted(APP.rglob("*.py"))
        if path != ONLY
        for use in private_uses(path)
        # a store copies its own history
        if "store.py" not in use
    ]
    assert elsewhere == []
