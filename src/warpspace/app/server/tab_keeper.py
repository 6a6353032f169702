"""Keeps the state of a tab in its page, and takes it back after a restart of the server."""

import json
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

from warpspace.app.documents.files import safe_name
from warpspace.app.documents.scene_file import (
    MAX_LINK,
    named_link,
    open_link,
    open_text,
    state_to_toml,
)
from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState, Comparison
from warpspace.app.state.table import without_table
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.parts import Part
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.machine.limits import MAX_KEPT_TEXT
from warpspace.scene.model import Scene

LINK, FILE, NAME, ALONE, TABLE = "link", "file", "name", "alone", "table"
NEVER_KEPT = (
    "what Undo and Redo could go back to",
    "other scenes that were opened in this tab",
    "which error's curve was shown",
    "a file that was being made",
)
COMPARISON = "the comparison, which was too large to keep"
NO_TABLE = "the table of compensation that the box was drawn with, and its comparison"
START_VALUES = "the values that Reset goes back to: it goes back to those restored"
UNREADABLE = "what this tab has kept cannot be read"


@dataclass(frozen=True, slots=True)
class Restored:
    """What has come back."""

    state: AppState
    camera: CameraMemory | None
    missing: tuple[str, ...]  # what has not, in words


def kept_text(state: AppState, camera: CameraMemory | None, known: Sequence[Scene]) -> str:
    """Spell a state for its page to keep."""
    bare = without_table(state)
    table, state = bare is not state, bare
    alone = replace(state, comparison=Comparison())
    for whole in (state,) if alone == state else (state, alone):
        with suppress(OptionError):
            kept = {NAME: whole.scene.name, FILE: state_to_toml(whole, camera)}
            link = named_link(whole, camera, known)
            if link and len(link) <= MAX_LINK:
                kept[LINK] = link
            if whole is not state:
                kept[ALONE] = "yes"
            if table:
                kept[TABLE] = "yes"
            text = json.dumps(kept)
            if len(text) <= MAX_KEPT_TEXT:
                return text
    return ""


def read_kept(text: str, known: Sequence[Scene]) -> Restored:
    """Build what a page has kept."""
    kept = _parse(text)
    file, link = kept.get(FILE, ""), kept.get(LINK, "")
    lost = {ALONE: COMPARISON, TABLE: NO_TABLE}
    missing = (*NEVER_KEPT, *(words for key, words in lost.items() if key in kept))
    with suppress(WarpspaceError):
        state, camera = open_link(link, known)
        if state_to_toml(state, camera) == file:
            return Restored(state, camera, missing)
    state, camera = open_text(file, safe_name(kept.get(NAME, ""), "kept"), "what this tab has kept")
    return Restored(state, camera, (*missing, START_VALUES))


def _parse(text: str) -> dict[str, str]:
    if len(text) > MAX_KEPT_TEXT:
        raise OptionError(UNREADABLE)
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        raise OptionError(UNREADABLE) from None
    if not isinstance(found, dict):
        raise OptionError(UNREADABLE)
    return {str(key): value for key, value in found.items() if isinstance(value, str)}  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]


# --- The memory of a tab --------------------------------------------------------------------------

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


class TabKeeper(Part):
    """The memory of a tab that is in its page."""

    name = "keeper"
    follows = "at rest"

    def __init__(self, context: Context, *, shared: bool) -> None:
        self._context, self._shared = context, shared
        self._kept: AppState | None = None
        self._may_keep, self._asked = False, False
        self._due = threading.Lock()

        @context.client.camera.on_update
        async def _(_: object) -> None:
            self._keep_camera_soon()

        context.page.call("server.watch")

    def begin(self, *, known: bool) -> None:
        """Find out what the page has kept, once the server knows whether it knows the tab."""
        self._may_keep, self._asked = True, not known
        self._context.page.call("server.back", known)

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Keep every state."""
        return (id(picture.state),)

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        """Have the page keep what is shown; nothing is written."""
        if picture.state is not self._kept:
            self._keep(picture.state)
        return {}

    def _keep(self, state: AppState) -> None:
        if not self._may_keep:
            return
        self._kept = state
        context = self._context
        text = kept_text(state, context.camera.remember(), context.scenes.fixed)
        context.page.call("server.keep", text)

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

    def take(self, state: AppState, word: str, value: str) -> AppState:
        if word == "kept":
            self._context.act(partial(self._restore, value))
        return state

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
        self._context.page.call("server.say", title, lines)
