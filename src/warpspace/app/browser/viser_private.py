"""Every private part of viser that the app uses: why, and which public thing would replace it.

Nothing else in the app touches a private part of viser. A test names each of them, so that a new
version of viser that lacks one fails there with a clear message and not somewhere in a page.
"""

import asyncio
import contextlib
import threading
from collections.abc import Callable, Generator
from concurrent.futures import Future
from importlib import import_module
from typing import Any, TypeAlias

import websockets.asyncio.server
from viser import ClientHandle, ViserServer
from viser import _messages as messages

Take: TypeAlias = Callable[[int, str, Any], None]
"""Takes the number of a client, the id of a widget and what a page says its properties are."""


def dom_id(handle: Any) -> str:
    """Give the id of a widget in the page.

    Style sheets and scripts find a widget by it. A public `handle.uuid` would replace this.
    """
    return str(handle._impl.uuid)  # noqa: SLF001


def send_script(client: ClientHandle, source: str) -> None:
    """Run JavaScript in the page of one tab.

    viser has a message for it and no method; a public `client.run_javascript` would replace this.
    """
    connection: Any = client._websock_connection  # noqa: SLF001 # pyright: ignore[reportPrivateUsage]
    connection.queue_message(messages.RunJavascriptMessage(source=source))


def send_script_to_all(server: ViserServer, source: str) -> None:
    """Run JavaScript in every page as soon as it connects.

    As for one tab; a public `server.run_javascript` would replace this.
    """
    connections: Any = server._websock_server  # noqa: SLF001 # pyright: ignore[reportPrivateUsage]
    connections.queue_message(messages.RunJavascriptMessage(source=source))


def listen_to_all(server: ViserServer, take: Take) -> None:
    """Have what pages say of their widgets passed on from the moment they connect.

    `on_update` of a widget is called only once a page has sent its camera, by when a session has
    begun to build. Callbacks that are called before, or a way to give a page's address or cookie to
    `on_client_connect`, would replace this.
    """

    def pass_on(client_id: int, message: messages.GuiUpdateMessage) -> None:
        take(client_id, message.uuid, message.updates)

    connections: Any = server._websock_server  # noqa: SLF001 # pyright: ignore[reportPrivateUsage]
    connections.register_handler(messages.GuiUpdateMessage, pass_on)


_STARTING = threading.Lock()


@contextlib.contextmanager
def serve_with(change: Callable[[dict[str, Any]], dict[str, Any]]) -> Generator[list[bool]]:
    """Have a server of viser that is created meanwhile started with other options.

    viser starts a server of the package `websockets` with options of its own: it checks no request,
    and takes messages of any rate. A parameter of `ViserServer` for these options would replace
    this.
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


def wake_sender_on_its_thread(client: ClientHandle) -> None:
    """Have the sender of a connection woken by its own thread only.

    viser also sets an event of asyncio from the thread that assigns to a handle. That is not
    allowed, and once in ten thousand assignments it raises "deque mutated during iteration". What
    viser then asks of the event loop is enough. A viser that leaves this to the event loop would
    replace it.
    """
    connection: Any = client._websock_connection  # noqa: SLF001 # pyright: ignore[reportPrivateUsage]
    event = connection.get_message_buffer().message_event
    original: Callable[[], None] = event.set

    def set_on_loop() -> None:
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return
        original()

    event.set = set_on_loop


def check_messages(may_pass: Callable[[bytes], bool]) -> None:
    """Have every message of every client checked before viser makes anything of it.

    viser makes an object of whatever kind a message names, and what it cannot read ends the
    connection with a traceback. A check of incoming messages, given to the server, would replace
    this; it has to be there before the server is, which answers from its first moment.
    """
    read: Any = super(messages.Message, messages.Message).deserialize

    def deserialize(_: type[messages.Message], raw: bytes) -> Any:
        # nobody listens to a client that says it has replayed all
        return read(raw) if may_pass(raw) else messages.ReplayDoneMessage()

    messages.Message.deserialize = classmethod(deserialize)  # pyright: ignore[reportAttributeAccessIssue]


def check_updates(
    owner: ViserServer | ClientHandle,
    may_set: Callable[[object, dict[str, Any]], bool],
) -> None:
    """Have what a page sets of a widget checked against the value the widget has.

    viser sets any attribute that a message names, its own bookkeeping included, and fails later
    where it relies on it. A viser that sets nothing but `value` would replace this.
    """
    gui: Any = owner.gui
    connection: Any = gui._websock_interface  # noqa: SLF001
    theirs = gui._handle_gui_updates  # noqa: SLF001

    async def ours(client_id: int, message: messages.GuiUpdateMessage) -> None:
        handle = gui._gui_input_handle_from_uuid.get(message.uuid)  # noqa: SLF001
        if handle is None:
            return
        if may_set(handle.value, message.updates):
            await theirs(client_id, message)

    connection.unregister_handler(messages.GuiUpdateMessage, theirs)
    connection.register_handler(messages.GuiUpdateMessage, ours)


def log_failures(log: Callable[[BaseException], object]) -> None:
    """Have what a callback raises logged, where viser prints its traceback every time.

    A logger of viser's own would replace this.
    """

    def of_future(future: Future[Any]) -> None:
        if not future.cancelled() and (error := future.exception()) is not None:
            log(error)

    for module in map(import_module, ("viser._gui_api", "viser._scene_api", "viser._viser")):
        for name, replaced in (
            ("print_threadpool_errors", of_future),
            ("print_awaited_callback_error", log),
        ):
            if hasattr(module, name):
                setattr(module, name, replaced)
