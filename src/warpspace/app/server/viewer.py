"""The server of the app: starts it, gives each browser tab a session, ends it cleanly."""

import contextlib
import importlib
import io
import logging
import threading
import warnings
import webbrowser
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Self

import viser

from warpspace.app.browser.arrivals import Arrivals
from warpspace.app.browser.incoming import guard_server, guard_widgets
from warpspace.app.documents.scene_list import SceneList
from warpspace.app.documents.services import Services
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.server.layout import lay_out
from warpspace.app.server.network import free_port, is_local, page_url, resolve_host
from warpspace.app.server.repeated_lines import limit_log
from warpspace.app.server.session import Session
from warpspace.app.server.tab_memory import TabMemory, TabRecord, is_token, new_token
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.store import StateStore
from warpspace.app.viewport.layers.box import surface_glb
from warpspace.app.viewport.layers.lights import light_scene
from warpspace.exceptions import OptionError
from warpspace.scene.model import Scene

logger = logging.getLogger(__name__)
Say = Callable[[str], None]
WATCH_S = 2.0
"""How often sessions are looked for whose connection is gone."""
NO_AUTHENTICATION = (
    "warning: {host} can be reached from other machines, and the app asks nobody for a password;"
    " whoever reaches it can use it"
)


class Viewer:
    """A running app.

    Parameters
    ----------
    scene : Scene
        Shown first.
    scenes : mapping of str to Scene
        Scenes to choose from, by the title shown.
    start : AppState, optional
        How the scene is first shown; by default as `start_state` has it.
    host : str, optional
    port : int or None, optional
        None takes the next free one from 8080.
    services : Services, optional
        Draw figures and write exports.
    shared : bool, optional
        Whether all tabs see and steer one state; by default each has its own.

    Raises
    ------
    OptionError
        If host or port cannot be used.
    """

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
    ) -> None:
        self._services = services
        self.address = resolve_host(host)
        self.port = free_port(self.address, port)
        self._start = start or start_state(scene)
        self._scenes = _with(scene, scenes or {})
        self._live = LiveModel()
        self._sessions: dict[int, Session] = {}
        self._lock = threading.Lock()
        self._memory = TabMemory()
        self._shared = StateStore(self._start) if shared else None
        self._server = _serve(self.address, self.port)
        light_scene(self._server.scene)
        self._arrivals = Arrivals(self._server)
        self._places = lay_out(self._server.gui, dark=self._start.shown.dark)
        self._server.on_client_connect(self._connect)
        self._server.on_client_disconnect(self._disconnect)
        # the first tab need not wait for it
        self._warming = threading.Thread(target=self._warm, name="warpspace-warm", daemon=True)
        self._warming.start()
        self._ended = threading.Event()
        self._watch = threading.Thread(target=self._end_left, name="warpspace-watch", daemon=True)
        self._watch.start()

    @property
    def url(self) -> str:
        """Address to open in a browser."""
        return page_url(self.address, self.port)

    @property
    def is_local(self) -> bool:
        """Whether only this machine can reach it."""
        return is_local(self.address)

    @property
    def sessions(self) -> tuple[Session, ...]:
        """Sessions of the tabs that are open."""
        with self._lock:
            return tuple(self._sessions.values())

    def _warm(self) -> None:
        """Do before the first tab what it would have to wait for."""
        surface_glb(self._live.evaluate(self._start))
        importlib.import_module("warpspace.app.evaluation.probability")

    def _connect(self, client: viser.ClientHandle) -> None:
        """Give a new tab its session."""
        guard_widgets(client)
        store = self._shared or StateStore(self._start)
        session = Session(
            self._server,
            client,
            self._live,
            SceneList(self._scenes),
            store,
            self._places,
            self._arrivals.expect(client.client_id),
            self._claim,
            self._services,
        )
        with self._lock:
            self._sessions[client.client_id] = session
        session.start()
        if client.client_id not in self._server.get_clients():
            self._end(client.client_id)

    def _claim(self, session: Session, token: str) -> TabRecord | None:
        """Find what the tab whose page hands over a token has left behind."""
        if not is_token(token):
            return None
        with self._lock:
            if session not in self._sessions.values():
                return None  # its connection is gone already: it must not take what it left
            twins = [s for s in self._sessions.values() if s is not session and s.token == token]
            left = self._memory.take(token)
            if not twins:
                session.token = token
        if twins:
            # a duplicated tab, or one whose old connection is not yet known to be dead
            left = TabRecord(twins[0].context.store.copy(), None)
            session.rename(new_token())
        if left is not None and self._shared is not None:
            return TabRecord(self._shared, left.camera)
        return left

    def _disconnect(self, client: viser.ClientHandle) -> None:
        """End the session of a tab that is gone."""
        self._end(client.client_id)

    def _end_left(self) -> None:
        """End the sessions whose connection is gone, should viser fail to say so."""
        while not self._ended.wait(WATCH_S):
            connected = self._server.get_clients()
            with self._lock:
                left = self._sessions.keys() - connected.keys()
            for client_id in left:
                self._end(client_id)

    def _end(self, client_id: int) -> None:
        """End a session, and keep what its tab leaves for a while."""
        self._arrivals.forget(client_id)
        with self._lock:
            session = self._sessions.pop(client_id, None)
            if session is None:
                return
            try:
                self._memory.keep(session.token, session.record())
            finally:
                session.stop()

    def stop(self) -> None:
        """End all sessions and the server."""
        self._ended.set()
        for session in self.sessions:
            session.stop()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()


def _with(scene: Scene, scenes: Mapping[str, Scene]) -> dict[str, Scene]:
    """Add the scene shown first to those to choose from, under a title of its own."""
    if any(known is scene for known in scenes.values()):
        return dict(scenes)
    title = scene.title or scene.name
    if title in scenes:
        title = f"{title} ({scene.name})"
    return {title: scene, **{name: known for name, known in scenes.items() if name != title}}


def _serve(address: str, port: int) -> viser.ViserServer:
    """Start viser's server without its banner and without its public tunnel."""
    guard_server()
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=address, port=port, verbose=False)
    if server.get_port() != port:
        server.stop()
        raise OptionError(f"--port {port} has just been taken by another program; try again")
    guard_widgets(server)
    # any tab could ask for a tunnel through a public relay
    server.request_share_url = lambda *_args, **_kwargs: None
    return server


def open_browser(url: str) -> bool:
    """Open a page in a graphical browser.

    Returns
    -------
    bool
        False where there is none.
    """
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
    start: AppState | None = None,
    host: str,
    port: int | None,
    shared: bool = False,
    services: Services | None = None,
    browser: bool,
    say: Say,
    warn: Say,
) -> None:
    """Serve the app until it is interrupted.

    Parameters
    ----------
    scene : Scene
    scenes : mapping of str to Scene
    start : AppState, optional
        How the scene is first shown.
    host : str
    port : int or None
    services : Services, optional
        Draw figures and write exports.
    shared : bool, optional
        Whether all tabs see and steer one state.
    browser : bool
        Whether to open the page.
    say, warn : callable
        Print a line for the user.
    """
    # a tab may close while something is on its way to it
    warnings.filterwarnings("ignore", message="Queued an? .* on a closed connection")
    limit_log()
    with Viewer(
        scene, scenes, start=start, host=host, port=port, shared=shared, services=services
    ) as viewer:
        try:
            say(f"{scene.title} is shown at {viewer.url} (Ctrl-C ends it)")
            if not viewer.is_local:
                warn(NO_AUTHENTICATION.format(host=host))
            if browser and not open_browser(viewer.url):
                say(f"no browser could be opened; open {viewer.url} yourself")
            threading.Event().wait()
        except KeyboardInterrupt:
            say("\nended")
