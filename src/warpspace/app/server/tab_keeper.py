"""Identity of browser tabs, and their recovery from the server or from a copy in the page.

viser numbers connections, not tabs: a page that reconnects is a new client. The page therefore
stores a random token in its `sessionStorage`, which belongs to one tab and survives a reload, and
sends it after connecting. The record of a closed tab is stored for a while under its token. A page
whose browser forbids `sessionStorage`, and a tab that was closed and opened again, start afresh.
After a restart of the server, the tab is restored from the copy in its page.
"""

import re
import secrets
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import msgspec

from warpspace.app.browser import actions as do
from warpspace.app.documents import scene_file
from warpspace.app.documents.transfers import safe_name
from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.evaluation.compare import without_table
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.panel import Context, Panel, Refresh, on
from warpspace.app.state.app_state import AppState, Comparison
from warpspace.app.state.leaf import Identity
from warpspace.app.state.store import StateStore
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.machine.limits import MAX_KEPT_TEXT
from warpspace.scene.model import Scene

# --- In the server --------------------------------------------------------------------------------

RETENTION_S = 600.0
MAX_CLOSED_TABS = 64
MAX_HISTORY_BYTES = 256 * 2**20  # held by the histories of all of them
TAB_TOKEN = re.compile(r"[0-9a-f]{32}")


def new_token() -> str:
    return secrets.token_hex(16)


@dataclass(frozen=True, slots=True)
class TabRecord:
    store: StateStore  # state and history
    camera: CameraMemory | None


class TabMemory:
    """Records of closed tabs, limited in time, number and memory."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._records: OrderedDict[str, tuple[float, TabRecord]] = OrderedDict()

    def __len__(self) -> int:
        return len(self._records)

    def keep(self, token: str, record: TabRecord) -> None:
        self._records.pop(token, None)
        self._records[token] = (self._clock() + RETENTION_S, record)
        self.forget()

    def forget(self) -> None:
        now = self._clock()
        size = sum(left.store.size_bytes for _, left in self._records.values())
        while self._records:
            until, oldest = next(iter(self._records.values()))
            if until >= now and len(self._records) <= MAX_CLOSED_TABS and size <= MAX_HISTORY_BYTES:
                break
            size -= oldest.store.size_bytes
            self._records.popitem(last=False)

    def take(self, token: str) -> TabRecord | None:
        """Return and delete the record of a tab; None where there is none."""
        self.forget()
        return self._records.pop(token, (0.0, None))[1]


# --- In the page ----------------------------------------------------------------------------------

NEVER_RESTORED = (
    "the history of Undo and Redo",
    "other scenes opened in this tab",
    "the selected error curve",
    "a file in preparation",
)
COMPARISON = "the comparison, which was too large"
NO_TABLE = "the applied compensation table and its comparison"
START_VALUES = "the values of Reset, which now returns to the restored ones"


class PageCopy(msgspec.Struct, omit_defaults=True):
    file: str = ""
    name: str = ""
    link: str = ""  # where there is one: it holds the values of Reset
    missing: tuple[str, ...] = ()  # omitted parts, as texts


def page_copy_text(state: AppState, camera: CameraMemory | None, scenes: Sequence[Scene]) -> str:
    """Write the copy of a state that its page stores."""
    bare = without_table(state)
    missing = () if bare is state else (NO_TABLE,)
    single = replace(bare, comparison=Comparison())
    for candidate in (bare,) if single == bare else (bare, single):
        with suppress(OptionError):
            file = scene_file.state_to_toml(candidate, camera)
            link = scene_file.named_link(candidate, camera, scenes)
            left_out = missing if candidate is bare else (*missing, COMPARISON)
            short = link if link and len(link) <= scene_file.MAX_LINK else ""
            copy = PageCopy(file, candidate.scene.name, short, left_out)
            text = msgspec.json.encode(copy).decode()
            if len(text) <= MAX_KEPT_TEXT:
                return text
    return ""


def read_page_copy(
    text: str, scenes: Sequence[Scene]
) -> tuple[AppState, CameraMemory | None, tuple[str, ...]]:
    """Build state and camera from the copy in a page; also list the parts that are missing."""
    try:
        copy = msgspec.json.decode(text[: MAX_KEPT_TEXT + 1], type=PageCopy)
    except (ValueError, RecursionError):
        raise OptionError("the copy in this tab is damaged") from None
    missing = (*NEVER_RESTORED, *copy.missing)
    with suppress(WarpspaceError):
        state, camera = scene_file.open_link(copy.link, scenes)
        if scene_file.state_to_toml(state, camera) == copy.file:
            return state, camera, missing
    name = safe_name(copy.name, "kept")
    state, camera = scene_file.open_text(copy.file, name, "the copy in this tab")
    return state, camera, (*missing, START_VALUES)


RESTORED = (
    "The server was restarted, or the tab was disconnected for more than ten minutes. Scene,"
    " errors, view, camera, picked point and comparison are restored unless named below. Undo"
    " returns to the scene that the server was started with."
)
REFUSED = (
    "The server was restarted, or the tab was disconnected for more than ten minutes. The tab"
    " starts afresh, since its copy cannot be used here: {}"
)
JOINED = (
    "The server was restarted, and the review has been changed since. The copy in this tab was not"
    " restored."
)


class TabKeeper(Panel):
    """Stores a copy of the state in the page, and restores it after a restart of the server."""

    name = "keeper"
    refresh = Refresh.IDLE

    def __init__(self, context: Context, *, shared: bool) -> None:
        super().__init__(context)
        self._shared = shared
        self._may_keep, self._awaits_copy = False, False

        @context.client.camera.on_update
        async def _(_: object) -> None:
            context.call_soon(context.restart_idle)

        context.page.call("server.watch")

    def begin(self, *, is_known: bool) -> None:
        """Request the copy in the page unless the server knows the tab."""
        self._may_keep, self._awaits_copy = True, not is_known
        self.context.restart_idle()
        self.context.page.call("server.back", is_known)

    def is_visible(self, state: AppState) -> bool:  # noqa: ARG002
        return self._may_keep and self.context.story_state is None

    def dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        return (Identity(picture.state), self.context.camera.remember())

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        context = self.context
        text = page_copy_text(picture.state, context.camera.remember(), context.scenes.fixed)
        context.page.call("server.keep", text)
        return {}

    @on(do.StoredCopy, later=True)
    def restore(self, action: do.StoredCopy) -> None:
        if not self._awaits_copy:
            return
        self._awaits_copy = False
        context, say = self.context, partial(self.context.page.call, "server.say")
        if self._shared and context.store.is_edited:
            say("You are in the shared review as it is now", [JOINED])
            return
        try:
            state, camera, missing = read_page_copy(action.text, context.scenes.fixed)
        except WarpspaceError as error:
            say("This tab could not be restored", [REFUSED.format(error)])
            return
        context.show_opened(state, camera)
        say("This tab is restored", [RESTORED, f"Not restored: {'; '.join(missing)}."])
