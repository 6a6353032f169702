"""Keeps the state of a tab in its page, and takes it back after a restart of the server."""

import threading
from typing import Any

from warpspace.app.browser.lost_server import back_script, keep_script, say_script, watch_script
from warpspace.app.browser.viser_private import dom_id
from warpspace.app.documents.kept_tab import kept_text, read_kept
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.state.app_state import AppState
from warpspace.exceptions import WarpspaceError

RESTORED_TITLE = "This tab is restored"
RESTORED = (
    "Its server was restarted, or had forgotten it after ten minutes. What the tab had kept is"
    " back: scene, errors, view, camera, the point asked about, and what is compared unless named"
    " below. Undo goes to what the server was started with."
)
MISSING = "Not restored: {}."
REFUSED_TITLE = "This tab could not be restored"
REFUSED = (
    "Its server was restarted, or had forgotten it after ten minutes. It begins anew, since what it"
    " had kept cannot be used here: {}"
)
JOINED_TITLE = "You are in the shared review as it is now"
JOINED = (
    "The server was restarted, and somebody has changed the review since. What this tab had kept"
    " was not brought back."
)
CAMERA_PAUSE_S = 1.0  # how long after a move the camera is kept: not with each of its steps


class TabKeeper:
    """The memory of a tab that is in its page."""

    def __init__(self, context: PanelContext, *, shared: bool) -> None:
        self._context, self._shared = context, shared
        self._kept: AppState | None = None
        self._may_keep, self._asked = False, False
        self._due = threading.Lock()
        self._carrier: Any = context.gui.add_text("", "", visible=False)

        @self._carrier.on_update
        async def _(event: Any) -> None:  # a plain function would take a thread of a pool
            if event.client is not None:
                text = str(self._carrier.value)
                context.act(lambda: self._restore(text))

        @context.client.camera.on_update
        async def _(_: object) -> None:
            self._keep_camera_soon()

        context.page.run_script(watch_script())

    def begin(self, *, known: bool) -> None:
        """Find out what the page has kept, once the server knows whether it knows the tab."""
        self._may_keep, self._asked = True, not known
        self._context.page.run_script(back_script(dom_id(self._carrier), known=known))

    def read(self, state: AppState) -> AppState:
        """Nothing of the state is chosen here."""
        return state

    def show(self, picture: LivePicture) -> None:
        """Nothing that must follow at once."""

    def settle(self, picture: LivePicture) -> None:
        """Have the page keep what is shown."""
        if picture.state is not self._kept:
            self._keep(picture.state)

    def _keep(self, state: AppState) -> None:
        if not self._may_keep:
            return
        self._kept = state
        context = self._context
        text = kept_text(state, context.camera.remember(), context.scenes.fixed)
        context.page.run_script(keep_script(text))

    def _keep_camera_soon(self) -> None:
        if self._kept is None or not self._due.acquire(blocking=False):
            return
        timer = threading.Timer(CAMERA_PAUSE_S, self._context.act, [self._keep_camera])
        timer.name, timer.daemon = "warpspace-keep-camera", True
        timer.start()

    def _keep_camera(self) -> None:
        self._due.release()
        if self._context.shown is not None and self._context.page.is_open:
            self._keep(self._context.shown.state)

    def _restore(self, text: str) -> None:
        if not self._asked:
            return
        self._asked = False
        if self._shared and self._context.store.history.past:
            self._say(JOINED_TITLE, JOINED)
            return
        try:
            found = read_kept(text, self._context.scenes.fixed)
        except WarpspaceError as error:
            self._say(REFUSED_TITLE, REFUSED.format(error))
            return
        self._context.show_opened(found.state, found.camera)
        self._say(RESTORED_TITLE, RESTORED, MISSING.format("; ".join(found.missing)))

    def _say(self, title: str, *lines: str) -> None:
        self._context.page.run_script(say_script(title, lines))
