"""One browser tab: its state, its widgets, its drawing, and the one thread that joins them.

Widget callbacks only mark that something changed. The worker thread wakes, reads every widget,
applies what buttons have posted, evaluates once and mutates handles in place: the last position of
a slider is always what is shown, however fast it was moved.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial

from viser import ClientHandle

from warpspace.app.browser.arrivals import Arrival
from warpspace.app.browser.page import Page, is_passing
from warpspace.app.documents.scene_list import SceneList
from warpspace.app.documents.services import Services
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext, Update
from warpspace.app.panels.layout import Places, apply_theme
from warpspace.app.server.followers import TURN, Followers, make_draft
from warpspace.app.server.page_steps import PageSteps
from warpspace.app.server.tab_context import TabContext
from warpspace.app.server.tab_memory import CameraMemory, TabRecord, new_token, rename_script
from warpspace.app.state.app_state import AppState
from warpspace.app.state.store import StateStore, apply_each
from warpspace.app.viewport.tab_camera import TabCamera, focus

logger = logging.getLogger(__name__)
TOKEN_WAIT_S = 0.25
"""How long the first picture waits for a tab that may have been here before."""


class Session:
    """The app of one browser tab.

    Parameters
    ----------
    client : viser.ClientHandle
    live : LiveModel
        Shared by all sessions.
    scenes : SceneList
        Scenes to choose from.
    store : StateStore
        What is shown: the tab's own, or that of a shared review.
    places : Places
    arrival : Arrival
        Tells which tab it is.
    claim : callable, optional
        Takes the session and the token its page has handed over; gives what the tab left behind
        when its connection was dropped.
    services : Services, optional
        Draw figures and write exports.
    """

    def __init__(
        self,
        client: ClientHandle,
        live: LiveModel,
        scenes: SceneList,
        store: StateStore,
        places: Places,
        arrival: Arrival,
        claim: "Callable[[Session, str], TabRecord | None] | None" = None,
        services: Services | None = None,
    ) -> None:
        self._client, self._live, self._scenes = client, live, scenes
        self._services = services or Services()
        self.store, self._places = store, places
        self.token = new_token()
        self._arrival: Arrival | None = arrival
        self._page_width: float | None = None
        self._claim = claim
        self._eye, self._page = TabCamera(client), Page(client)
        self._camera: CameraMemory | None = None
        self._actions: deque[Callable[[], None]] = deque()
        self._shown: LivePicture | None = None
        self._posted: deque[Update] = deque()
        self._wake, self._changed_at = threading.Event(), time.monotonic()
        self._stopped = threading.Event()
        self._parts = Followers()
        self._opening: PageSteps | None = None
        self._worker = threading.Thread(
            target=self._run, name=f"warpspace-session-{client.client_id}", daemon=True
        )

    @property
    def state(self) -> AppState:
        """What is shown, or about to be."""
        return self.store.state

    def start(self) -> None:
        """Build page and drawing, then follow the widgets."""
        self._worker.start()

    def stop(self) -> None:
        """End the worker; nothing is sent any more."""
        self._stopped.set()
        self._wake.set()
        if self._opening is not None:
            self._opening.stop()
        self.store.unsubscribe(self.changed)

    def changed(self) -> None:
        """Take note that a widget has changed; returns at once."""
        self._changed_at = time.monotonic()
        self._wake.set()

    def post(self, update: Update) -> None:
        """Queue a pure update of the state; returns at once."""
        self._posted.append(update)
        self.changed()

    def act(self, action: Callable[[], None]) -> None:
        """Queue something to be done beside the state, guarded; returns at once."""
        self._actions.append(action)
        self._wake.set()

    def _run(self) -> None:
        """Wait, take everything in, show once; let charts follow when it settles; until stopped."""
        self.store.subscribe(self.changed)
        try:
            self._guarded(self._build)
            while not self._stopped.is_set():
                self._turn()
        finally:
            self.store.unsubscribe(self.changed)
            self._guarded(self._page.leave)
            # what is large is let go at once, not when cycles happen to be looked for
            self._parts, self._opening, self._shown = Followers(), None, None

    def _turn(self) -> None:
        """Wait for one change, or for a pause in them, and follow."""
        waits = (self._parts.pause_s, self._opening and self._opening.remaining_s())
        woken = self._wake.wait(min((wait for wait in waits if wait is not None), default=None))
        if woken:  # else what has come since the wait ended would be lost
            self._wake.clear()
        if woken and not self._stopped.is_set():
            self._guarded(self._step)
        if self._opening is not None and self._opening.is_due and self._shown is not None:
            self._guarded(partial(self._opening.advance, self._shown))
        if self._parts.is_due(paused=not woken):
            self._guarded(self._settle)

    def _guarded(self, step: Callable[[], object]) -> None:
        """Run a step; what it raises is logged and shown to this user, and the session goes on."""
        try:
            step()
        except Exception as error:
            if self._stopped.is_set() or not self._page.is_open:
                return  # nobody is there to be told, and its widgets are gone
            if is_passing(error):
                self._wake.set()
                return
            logger.exception("session %d", self._client.client_id)
            self._page.report(error)

    def _adopt(self, arrival: Arrival) -> None:
        """Take over what the tab has left behind, if it was here before."""
        self._arrival, self._page_width = None, arrival.width
        left = self._claim(self, arrival.token) if self._claim is not None else None
        if left is not None:
            self.store.unsubscribe(self.changed)
            self.store, self._camera = left.store, left.camera
            self.store.subscribe(self.changed)

    def renamed(self, token: str) -> None:
        """Give page and session another token, since two tabs came with one."""
        self.token = token
        self._page.run_script(rename_script(token))

    def left(self) -> TabRecord:
        """Give what is worth keeping of the tab."""
        return TabRecord(self.store, self._eye.remember())

    def _build(self) -> None:
        """Show map, sliders and numbers; line up all else."""
        if self._arrival is not None and self._arrival.wait(TOKEN_WAIT_S, self._wake.set):
            self._adopt(self._arrival)
        picture = self._live.evaluate(self.state)
        context = PanelContext(
            self._client.gui,
            self.changed,
            self.post,
            self.act,
            lambda: self.store,
            self._page.notify,
        )
        tab = TabContext(
            self._client,
            self._scenes,
            self._eye.remember,
            self._look_from,
            self._page.run_script,
            self._services,
            lambda: self._shown,
        )
        self._opening = PageSteps(context, tab, self._places, self.fit_view, self._wake.set)
        with self._client.atomic():
            if picture.state.shown.dark != self._places.dark:
                apply_theme(self._client.gui, dark=picture.state.shown.dark)
            self._page.set_title(picture.state.scene.title)
            self._restore_camera(picture)
            self._parts = self._opening.begin(picture)
        self._client.flush()
        self._shown = picture
        self._parts.unsettle()

    def _step(self) -> None:
        """Take in what has changed and show the outcome."""
        if self._arrival is not None and self._arrival.is_there:
            self._adopt(self._arrival)
            if self._camera is not None and self._shown is not None:
                self._restore_camera(self._shown)
        notes = self.store.apply(self._take_in, by=self.changed, at=self._changed_at)
        while self._actions:
            self._guarded(self._actions.popleft())
        state = self.store.state
        shown = self._shown
        if self._camera and shown is not None and focus(shown.state) == focus(state):
            self._restore_camera(shown)
        if not notes and state is self._parts.state:
            return
        # what is slow the first time is done before it is this tab's turn
        self._live.response(state)
        if self._parts.takes_draft(state) and not notes:
            self._show_draft(state)
            return
        asked = time.monotonic()
        with TURN:
            self._parts.waited(time.monotonic() - asked)
            self._show(self._live.evaluate(state), notes)

    def _take_in(self, state: AppState) -> AppState:
        """Apply what widgets and buttons have changed to a state."""
        updates: list[Update] = [panel.read for panel in self._parts.panels]
        while self._posted:
            updates.append(self._posted.popleft())
        return apply_each(state, updates, self._guarded)

    def _show(self, picture: LivePicture, notes: tuple[str, ...]) -> None:
        """Make page and drawing show a picture; on a busy server map and numbers first."""
        before = self._shown
        with self._client.atomic():
            self._parts.show(picture, anew=bool(notes))
            if before is not None and focus(before.state) != focus(picture.state):
                self._page.set_title(picture.state.scene.title)
                self._restore_camera(picture)
            if before is not None and before.state.shown.dark != picture.state.shown.dark:
                apply_theme(self._client.gui, dark=picture.state.shown.dark)
        self._shown = picture
        if notes:
            self._page.notify("Clamped", "\n".join(notes), "yellow")

    def _show_draft(self, state: AppState) -> None:
        """Show for now what matters most; all else follows when it settles."""
        draft = make_draft(self._live, state)
        with self._client.atomic():
            self._parts.show_draft(state, draft)
        self._client.flush()

    def _settle(self) -> None:
        """Let all follow that has been put off."""
        if self._parts.state is None:
            return
        if self._shown is None or self._shown.state is not self._parts.state:
            with TURN:
                self._shown = self._live.evaluate(self._parts.state)
        picture = self._shown
        with self._client.atomic():
            self._parts.settle(picture, self._guarded)
        self._client.flush()

    def fit_view(self, view: str | None = None, lens: bool | None = None) -> None:
        """Put the camera to a named view (the last one by default), or change its lens."""
        if self._shown is not None:
            self._eye.choose(self._shown, view, lens)
            self._client.flush()

    def _look_from(self, memory: CameraMemory) -> None:
        """Put the camera somewhere with what is shown next."""
        self._camera = memory
        self._wake.set()

    def _restore_camera(self, picture: LivePicture) -> None:
        """Put the camera where the tab left it, else where all of the box is seen."""
        memory, self._camera = self._camera, None
        if memory is not None:
            self._eye.restore(memory)
        else:
            self._eye.fit(picture, docked=self._shown is not None, page_width=self._page_width)
