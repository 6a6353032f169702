"""Private parts of viser that the app uses: why, and the public interface that would replace them.

Nothing else in the app touches a private part of viser. A test names each of them, so that a new
version of viser that lacks one fails there with a clear message and not somewhere in a page.
"""

import asyncio
import contextlib
import threading
from collections.abc import Callable, Generator
from typing import Any

import websockets.asyncio.server
from viser import ClientHandle, ViserServer
from viser import _messages as messages
from websockets.asyncio.server import ServerConnection


def _connection(target: ClientHandle | ViserServer) -> Any:
    is_server = isinstance(target, ViserServer)
    return getattr(target, "_websock_server" if is_server else "_websock_connection")


def send_script(target: ClientHandle | ViserServer, source: str) -> None:
    """Run JavaScript in the page of one tab, or in every page as soon as it connects.

    viser has a message for it and no method; a public `run_javascript` would replace this.
    """
    _connection(target).queue_message(messages.RunJavascriptMessage(source=source))


def connection_of(server: ViserServer, client: ClientHandle) -> ServerConnection | None:
    """Return the connection of a client; None where it is closed.

    Our scripts in the page talk to us by it. A public `client.connection` would replace this.
    """
    return _connection(server)._live_connections.get(client.client_id)  # noqa: SLF001


_STARTING = threading.Lock()


@contextlib.contextmanager
def serve_with(change: Callable[[dict[str, Any]], dict[str, Any]]) -> Generator[list[bool]]:
    """Start a viser server created in the context with other options.

    viser starts a server of the package `websockets` with options of its own: it checks no request,
    and takes messages of any kind and rate. A parameter of `ViserServer` for these options would
    replace this.
    """
    library: Any = websockets.asyncio.server
    with _STARTING:
        original, used = library.serve, list[bool]()

        def serve(*args: Any, **options: Any) -> Any:
            used.append(True)
            return original(*args, **change(options))

        library.serve = serve
        try:
            yield used
        finally:
            library.serve = original


BARE_STYLE = """<style>
  #root button, [data-portal], .mantine-Notifications-root { display: none !important; }
</style>"""
"""Hides button and messages of an exported page; an option of `as_html` would replace this."""


def message_buffer(client: ClientHandle) -> Any:
    return _connection(client).get_message_buffer()


def send_at_once(client: ClientHandle) -> None:
    """Send messages to a client at once, in the thread that queues them.

    viser collects messages for a sixtieth of a second; ours belong together by `client.atomic`.
    It also sets an event of asyncio from the thread that assigns to a handle. That is not
    allowed, and once in ten thousand assignments it raises "deque mutated during iteration". What
    viser then asks of the event loop is enough. A viser without either would replace this.
    """
    buffer = message_buffer(client)
    buffer.window_duration_sec = 0.0
    event = buffer.message_event
    original: Callable[[], None] = event.set

    def set_on_loop() -> None:
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return
        original()

    event.set = set_on_loop


def queued(client: ClientHandle) -> int:
    """Count the messages that wait for a client that reads slowly or not at all.

    viser keeps all of it. A limit of viser's own would replace this.
    """
    return len(message_buffer(client).message_from_id)
