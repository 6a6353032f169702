"""The server of the app: its address, the sessions of its tabs, its log and its end."""

import asyncio
import contextlib
import errno
import io
import ipaddress
import logging
import os
import socket
import sys
import threading
import time
import warnings
import webbrowser
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import viser

from warpspace.app.browser.page import page_script
from warpspace.app.browser.templates import compile_all
from warpspace.app.browser.viser_private import connection_of, send_script, serve_with
from warpspace.app.documents.output_services import Services
from warpspace.app.documents.scene_file import SceneList
from warpspace.app.drawing.box import surface
from warpspace.app.drawing.shapes import light_scene
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.panels.panel import Context
from warpspace.app.server.connection_guard import Guard, TabConnection
from warpspace.app.server.request_policy import Access, RequestPolicy, plain_address
from warpspace.app.server.session import Session
from warpspace.app.server.tab_keeper import RETENTION_S, TAB_TOKEN, TabMemory, TabRecord, new_token
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.store import StateStore
from warpspace.exceptions import OptionError
from warpspace.scene.model import Scene

DEFAULT_PORT = 8080
PORTS_TRIED = 100
MAX_PORT = 65535
NOBODY = 65534
LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})


def resolve_host(host: str) -> str:
    try:
        addresses = socket.getaddrinfo(host or " ", None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError, ValueError):
        raise OptionError(
            f"--host {host!r} cannot be resolved; expected an address of this machine,"
            " for instance 127.0.0.1 (this machine only) or 0.0.0.0 (all networks)"
        ) from None
    return str(addresses[0][4][0])


def is_local(address: str) -> bool:
    return ipaddress.ip_address(address.partition("%")[0]).is_loopback


def is_everywhere(address: str) -> bool:
    return ipaddress.ip_address(address.partition("%")[0]).is_unspecified


def served_names(host: str, address: str) -> frozenset[str]:
    names = {host.lower(), plain_address(address)}
    if is_local(address):
        return frozenset(names | LOOPBACK_NAMES)
    hostname = socket.gethostname()
    if is_everywhere(address):
        return frozenset(names | LOOPBACK_NAMES | {hostname.lower()})
    with contextlib.suppress(OSError, UnicodeError):
        if address in {str(found[4][0]) for found in socket.getaddrinfo(hostname, None)}:
            names.add(hostname.lower())
    return frozenset(names)


def has_other_users() -> bool:
    """Return whether others have an account on this machine, or are logged in to it."""
    if sys.platform == "win32":
        return False
    import pwd

    first = 501 if sys.platform == "darwin" else 1000
    people = {
        entry.pw_uid
        for entry in pwd.getpwall()
        if not entry.pw_shell.endswith(("/nologin", "/false"))
    }
    with contextlib.suppress(OSError):
        people |= {int(at.name) for at in Path("/run/user").iterdir() if at.name.isdecimal()}
    return any(first <= uid != NOBODY for uid in people - {os.getuid()})


def reachable_address(address: str) -> str:
    """Return the address at which other machines most likely reach a wildcard address."""
    if not is_everywhere(address):
        return address
    family, far = (
        (socket.AF_INET6, "2001:db8::1") if ":" in address else (socket.AF_INET, "192.0.2.1")
    )
    # no packet is sent: connecting a datagram socket only chooses the way out
    with contextlib.suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.connect((far, 9))
        return str(probe.getsockname()[0])
    return address


def draw_code(link: str) -> str:
    import segno

    drawn = io.StringIO()
    segno.make_qr(link).terminal(drawn, compact=True)
    return drawn.getvalue().rstrip("\n")


def free_port(address: str, port: int | None) -> int:
    if port is not None and not 1 <= port <= MAX_PORT:
        raise OptionError(f"--port {port}: expected 1 to {MAX_PORT}")
    first = DEFAULT_PORT if port is None else port
    last = first + PORTS_TRIED - 1 if port is None else first
    for candidate in range(first, last + 1):
        error = _bind_error(address, candidate)
        if error is None:
            return candidate
        if error == errno.EADDRNOTAVAIL:
            raise OptionError(f"--host {address}: not an address of this machine")
        if error == errno.EACCES:
            raise OptionError(
                f"--port {candidate} needs administrator rights; expected one above 1023"
            )
        if error != errno.EADDRINUSE:
            raise OptionError(f"--port {candidate} on {address}: {os.strerror(error)}")
    if port is None:
        raise OptionError(f"ports {first} to {last} are all in use; free one of them")
    raise OptionError(
        f"--port {port} is in use by another program; leave --port out to take the next free one"
    )


def _bind_error(address: str, port: int) -> int | None:
    with socket.socket(socket.AF_INET6 if ":" in address else socket.AF_INET) as probe:
        if os.name == "posix":
            # as the server does: a port in TIME_WAIT is free
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((address, port))
        except OSError as error:
            return error.errno or errno.EINVAL
    return None


def page_url(address: str, port: int) -> str:
    wildcard = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(address)  # noqa: S104
    host = wildcard or (f"[{address}]" if ":" in address else address)
    return f"http://{host}:{port}"


# --- A log that a client cannot fill --------------------------------------------------------------
# Of lines of one kind the first is written, the others are counted.

EVERY_S = 60.0
MOST_KINDS = 256
LONGEST_LINE = 300
OURS = "warpspace"


class RepeatedLines(logging.Filter):
    """Filter that passes one line of a kind per minute and counts the others.

    A kind is a logger, the first line of a message template, and the type of the exception.
    Tracebacks of libraries are shortened to one line, those of the app are not.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._clock = clock
        self._lock = threading.Lock()
        self._known: dict[tuple[str, str, str], tuple[float, int]] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a line is written; shorten it and add the count of omitted lines."""
        raised = record.exc_info[0] if record.exc_info else None
        name = raised.__name__ if raised is not None else ""
        kind = (record.name, str(record.msg).partition("\n")[0], name)
        now = self._clock()
        with self._lock:
            since, left_out = self._known.get(kind, (-EVERY_S, 0))
            if now - since < EVERY_S:
                self._known[kind] = (since, left_out + 1)
                return False
            if len(self._known) >= MOST_KINDS:
                self._known.clear()
            self._known[kind] = (now, 0)
        if not record.name.startswith(OURS):
            line = record.getMessage().partition("\n")[0]
            record.msg, record.args = line[:LONGEST_LINE] + (f" ({name})" if name else ""), ()
            record.exc_info = record.exc_text = record.stack_info = None
        if left_out:
            record.msg, record.args = f"{record.getMessage()} ({left_out} more before it)", ()
        return True


def limit_log() -> None:
    limit = RepeatedLines()
    for handler in (logging.lastResort, *logging.getLogger().handlers):
        if handler is not None:
            handler.addFilter(limit)


NO_AUTHENTICATION = (
    "WARNING: {host} can be reached from other machines, and with --no-token the app requires no"
    " token: anyone who reaches it can view and change its scenes"
)
OTHER_USERS = (
    "Other users of this machine can open the app without a token; --token TEXT requires one"
)


class Viewer:
    def __init__(
        self,
        scene: Scene,
        scenes: Mapping[str, Scene] | None = None,
        *,
        start: AppState | None = None,
        host: str = "127.0.0.1",
        port: int | None = None,
        shared: bool = False,
        services: Services | None = None,
        access: Access | None = None,
    ) -> None:
        self.address = resolve_host(host)
        self.is_local = is_local(self.address)
        access = access or Access()
        self.token = access.choose_token(local=self.is_local)
        self._services = replace(services or Services(), token=self.token)
        self.port = free_port(self.address, port)
        self.url = page_url(self.address, self.port)
        query = "" if self.token is None else f"/?token={self.token}"
        self.link = self.url + query  # for a browser of this machine
        self.network_link = page_url(reachable_address(self.address), self.port) + query
        policy = RequestPolicy(
            served_names(host, self.address),
            self.port,
            everywhere=is_everywhere(self.address),
            allow_hosts=access.allow_hosts,
            token=self.token,
        )
        start = start or start_state(scene)
        self._start, self._notes = start.without_notes(), start.notes
        self._scenes = _with(scene, scenes or {})
        self._live = LiveModel()
        self._sessions: dict[int, Session] = {}
        self._lock = threading.Lock()
        self.memory = TabMemory()
        self._shared = StateStore(self._start) if shared else None
        self.server = _serve(self.address, self.port, Guard(policy))
        light_scene(self.server.scene)
        send_script(self.server, f"{page_script()}\nwarpspacePage.arrive();")
        self.server.on_client_connect(self._connect)
        self.server.on_client_disconnect(self._disconnect)
        # so that the first tab does not wait for it
        self._warming = threading.Thread(target=self._warm, name="warpspace-warm", daemon=True)
        self._warming.start()

    @property
    def sessions(self) -> tuple[Session, ...]:
        with self._lock:
            return tuple(self._sessions.values())

    def _warm(self) -> None:
        with contextlib.suppress(Exception):  # reported by the first tab
            surface(self._live.evaluate(self._start))
            compile_all()

    async def _connect(self, client: viser.ClientHandle) -> None:
        connection = connection_of(self.server, client)
        if not isinstance(connection, TabConnection):
            return  # closed meanwhile
        store = self._shared.joined() if self._shared else StateStore(self._start)
        context = Context(self.server, client, store, SceneList(self._scenes), self._services)
        context.notes += self._notes
        tabs = (lambda: [tab.context for tab in self.sessions]) if self._shared else None
        session = Session(context, self._live, self.claim, review_tabs=tabs)
        with self._lock:
            self._sessions[client.client_id] = session
        connection.listen(context.receive)
        session.worker.start()

    def claim(self, session: Session, token: str) -> TabRecord | None:
        if TAB_TOKEN.fullmatch(token) is None:
            return None
        with self._lock:
            if session not in self._sessions.values():
                return None  # already closed: it must not take its own record
            twins = [s for s in self._sessions.values() if s is not session and s.token == token]
            record = self.memory.take(token)
            if not twins:
                session.token = token
        if twins:
            # a duplicated tab, or one whose previous connection is not closed yet
            twin = twins[0].context.store
            record = TabRecord(twin.joined() if self._shared else twin.copy(), None)
            session.token = new_token()
            session.context.page.call("rename", session.token)
        return record

    async def _disconnect(self, client: viser.ClientHandle) -> None:
        with self._lock:
            session = self._sessions.pop(client.client_id, None)
            if session is None:
                return
            try:
                context = session.context
                record = TabRecord(context.store, context.camera.remember())
                self.memory.keep(session.token, record)
            finally:
                session.stop()
        asyncio.get_running_loop().call_later(RETENTION_S + 1.0, self._forget)

    def _forget(self) -> None:
        with self._lock:
            self.memory.forget()

    def stop(self) -> None:
        for session in self.sessions:
            session.stop()
        with contextlib.redirect_stdout(io.StringIO()):
            self.server.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def _with(scene: Scene, scenes: Mapping[str, Scene]) -> dict[str, Scene]:
    if any(known is scene for known in scenes.values()):
        return dict(scenes)
    title = scene.title or scene.name
    if title in scenes:
        title = f"{title} ({scene.name})"
    return {title: scene, **{name: known for name, known in scenes.items() if name != title}}


def _serve(address: str, port: int, guard: Guard) -> viser.ViserServer:
    with contextlib.redirect_stdout(io.StringIO()), serve_with(guard.options) as guarded:
        server = viser.ViserServer(host=address, port=port, verbose=False)
    problem = ""
    if not guarded:
        problem = (
            f"viser {viser.__version__} starts its server in an unknown way; install the version"
            " given in the constraints file"
        )
    elif server.get_port() != port:
        problem = f"--port {port} has just been taken by another program; try again"
    if problem:
        server.stop()
        raise OptionError(problem)
    # any tab could open a tunnel through a public relay
    server.request_share_url = lambda *_args, **_kwargs: None
    return server


def open_browser(url: str) -> bool:
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return False
    if type(browser) is webbrowser.GenericBrowser:  # one that takes over the terminal
        return False
    return browser.open(url)


def run_viewer(
    scene: Scene,
    scenes: Mapping[str, Scene],
    *,
    code: bool = False,
    browser: bool,
    say: Callable[[str], None],
    warn: Callable[[str], None],
    **options: Any,
) -> None:
    """Serve the app until it is interrupted; `options` are those of `Viewer`."""
    # a tab may close while a message is sent to it
    warnings.filterwarnings("ignore", message="Queued an? .* on a closed connection")
    limit_log()
    with Viewer(scene, scenes, **options) as viewer:
        try:
            say(f"{scene.title} is shown at {viewer.link} (Ctrl-C stops the server)")
            if not viewer.is_local:
                say(f"from other machines: {viewer.network_link}")
                if code:
                    say(draw_code(viewer.network_link))
                if viewer.token is None:
                    warn(NO_AUTHENTICATION.format(host=options["host"]))
            elif viewer.token is None and has_other_users():
                warn(OTHER_USERS)
            if browser and not open_browser(viewer.link):
                say(f"no browser found; open {viewer.link}")
            while True:  # signals to other threads are handled within a second
                time.sleep(1.0)
        except KeyboardInterrupt:
            say("\nstopped")
