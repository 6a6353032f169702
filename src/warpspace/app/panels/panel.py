"""What a part of the page is, and what the parts of one page share.

A part is pieces of HTML that follow the picture, and what its events do: the server writes pieces
into named places; the page sends back events, ``part:word`` with a value (`browser/incoming.py`).
A part knows neither widgets nor threads, and no other part.

What they share is page, camera and state of a tab, and queues for its session. Other threads only
take note (`take`, `post`, `act`); the one thread of the session takes everything in. Long work has
threads of its own.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from enum import Enum, auto
from functools import partial
from typing import ClassVar

from markupsafe import Markup
from viser import ClientHandle, ViserServer

from warpspace.analysis.description import Result
from warpspace.app.browser.html import EMPTY, button, fold, join, number, tag
from warpspace.app.browser.incoming import LONGEST_VALUE, Event, Events, event_of
from warpspace.app.browser.page import Page
from warpspace.app.documents.output_services import CancelledError, Services
from warpspace.app.documents.scene_file import MOST_OPENED, SceneList
from warpspace.app.drawing.camera import CameraMemory, TabCamera, focus
from warpspace.app.drawing.moving import MovingLayer
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.state.leaf import Identity
from warpspace.app.state.store import StateStore, Update
from warpspace.exceptions import WarpspaceError

MOST_FILES = 16  # that may wait for the session
PAUSE_S = 0.1
"""Pause in the changes after which parts follow: longer than between two moves of a drag."""


class Context:
    """What a part of the page may use of its tab."""

    def __init__(
        self,
        server: ViserServer,
        client: ClientHandle,
        store: StateStore,
        scenes: SceneList,
        services: Services,
    ) -> None:
        self.client, self.page, self.camera = client, Page(server, client), TabCamera(client)
        self.notify = self.page.notify
        self.events: deque[Event] = deque()
        self.store, self.scenes, self.services = store, scenes, services
        self.shown: LivePicture | None = None
        self.stage: MovingLayer | None = None
        # of the display, for the session: write a part anew, at once; what the page has closed by
        # itself may be opened again; what follows at rest, and these parts, are due once nothing
        # has happened for a while
        self.renew: Callable[[Panel], None] = lambda _: None
        self.closed: Callable[[], None] = lambda: None
        self.rest_again: Callable[..., None] = lambda *_: None
        self.jobs: set[threading.Event] = set()  # work that goes on; set when the page has gone
        self.reported: list[tuple[str, Result]] = []  # what is to stand in the report
        # what has been applied last: the state before it, and what it was in words
        self.decided: tuple[AppState, str] | None = None
        self.offer_import: Callable[[str, bytes], None] = lambda _name, _content: None
        self.changed_at = time.monotonic()
        self.unfolded = store.state.page  # of this page, also where the state is shared
        # what a step of a story shows in place of the present state, which it does not change
        self.telling: AppState | None = None
        self.notes: list[str] = []  # what updates of the state had to clamp
        self._own: tuple[object, AppState] = (None, store.state)
        self._wake = threading.Event()
        self.actions: deque[Callable[[], None]] = deque()

    @property
    def state(self) -> AppState:
        """The present state, with what is unfolded on this page; or that of a step of a story."""
        if self.telling is not None:
            return self.telling
        shared = self.store.state
        if shared.page is self.unfolded:
            return shared
        of = Identity(shared), Identity(self.unfolded)
        if self._own[0] != of:
            self._own = of, replace(shared, page=self.unfolded)
        return self._own[1]

    def apply(self, update: Update) -> None:
        """Apply a pure update to the present state. For the session."""

        def own(state: AppState) -> AppState:
            page = self.unfolded
            found = update(state if state.page is page else replace(state, page=page))
            self.unfolded = found.page
            return found

        self.notes += self.store.apply(own, by=self.changed, at=self.changed_at)

    def wake(self) -> None:
        """Have the session look what there is to be done; returns at once."""
        self._wake.set()

    def take(self, message: Events) -> None:
        """Take note of what the page says; returns at once."""
        found = [event_of(*event) for event in message.events]
        if len([*filter(_is_file, self.events), *filter(_is_file, found)]) > MOST_FILES:
            self.notify("Not taken", f"more than {MOST_FILES} files at once; try again", "problem")
            return
        self.events.extend(found)
        self.changed()

    def changed(self) -> None:
        """Take note that something has been set; returns at once."""
        self.changed_at = time.monotonic()
        self._wake.set()

    @property
    def is_still(self) -> bool:
        """Whether changes pause, so that work may follow them."""
        return time.monotonic() - self.changed_at >= PAUSE_S

    def send(self, event: str, value: str = "") -> None:
        self.take(Events([(event, value)]))

    def post(self, update: Update) -> None:
        """Queue a pure update of the state; returns at once."""
        self.act(partial(self.apply, update))
        self.changed()

    def act(self, action: Callable[[], None]) -> None:
        """Queue something that the session does; it shows what that raises; returns at once."""
        self.actions.append(action)
        self._wake.set()

    def wait(self, seconds: float | None) -> bool:
        """Wait for a change, at most so long; tell whether there was one. For the session."""
        woken = self._wake.wait(seconds)
        if woken:  # else what has come since the wait ended would be lost
            self._wake.clear()
        return woken

    def save_file(self, name: str, content: str | bytes) -> None:
        data = content.encode() if isinstance(content, str) else content
        self.client.send_file_download(name, data, save_immediately=True)

    def look_from(self, memory: CameraMemory) -> None:
        """Put the camera somewhere with what is shown next."""
        self.camera.wanted = memory
        self._wake.set()

    def fly(self, memory: CameraMemory | None, long_ms: int) -> None:
        """Have camera and box go to what is shown next in a time, on the page."""
        if memory and self.shown and focus(self.shown.state) != focus(self.state):
            memory, self.camera.wanted = None, memory  # of another machine: at once, with it
        if memory is not None:
            self.camera.expect(memory)
        self.page.call("step", long_ms, memory and asdict(memory))
        self._wake.set()

    def show_opened(
        self, opened: AppState, camera: CameraMemory | None, *, whole: bool = True
    ) -> None:
        """Show an opened state from its camera; beside a plain scene the comparison stays."""
        # here, since not every opened scene is drawn where many follow each other
        _, dropped = self.scenes.add(opened.origin)
        if dropped:
            kept = f"The newest {MOST_OPENED} opened scenes are kept"
            self.notify("Scenes", f"{kept}; {dropped} left the list.")

        def update(now: AppState) -> AppState:
            if camera is not None:
                # with this change, not before it: another scene places the camera anew
                self.look_from(camera)
            return opened if whole else replace(opened, comparison=now.comparison)

        self.post(update)

    def fit_view(self, view: str | None = None, lens: bool | None = None) -> None:
        """Put the camera to a named view (the last one by default), or change its lens."""
        if self.shown is not None:
            self.camera.choose(self.shown, view, lens)


def _is_file(event: Event) -> bool:
    return len(event.value) > LONGEST_VALUE


# --- Parts ----------------------------------------------------------------------------------------


class Refresh(Enum):
    """When a panel is rendered after a change of the picture."""

    IMMEDIATE = auto()  # with every picture of a drag
    THROTTLED = auto()  # a few times a second, and when the first of its dependencies changes
    DEBOUNCED = auto()  # when changes pause
    IDLE = auto()  # when nothing has happened for a while


class Panel:
    name: str = ""  # its events begin with it
    refresh: ClassVar[Refresh] = Refresh.DEBOUNCED

    def __init__(self, context: Context) -> None:
        self.context = context

    def is_seen(self, state: AppState) -> bool:
        """Tell whether it is on the screen; what is not is neither computed nor sent."""
        return True

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Give what its pieces are made of; as long as that is equal they are not made anew."""
        return (id(picture),)

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        """Give HTML by the name of its place."""
        return {}

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Do what an event says; word and value come from a browser and may be anything."""
        return state

    def renew(self) -> None:
        """Have its pieces made anew, whatever they depend on. For the session."""
        self.context.renew(self)


class Section(Panel):
    """A section of a task; folded it is neither computed nor sent."""

    task = ""
    title = ""
    sentence = ""  # what it is for: below the title where it is unfolded, else its hint

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Give what its body is made of."""
        return (id(picture),)

    def body(self, picture: LivePicture) -> Markup:
        """Write what stands below the title."""
        raise NotImplementedError

    def heading(self, picture: LivePicture) -> str:
        """Give the title of the unfolded section."""
        return self.title

    def is_open(self, state: AppState) -> bool:
        return self.name in state.page.open

    def is_seen(self, state: AppState) -> bool:
        return state.page.task == self.task

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        return (True, *self.concerns(picture)) if self.is_open(picture.state) else (False,)

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        opened = self.is_open(picture.state)
        body = self.body(picture) if opened else EMPTY
        title = self.heading(picture) if opened else self.title
        section = fold(self.name, title, body, opens="page:fold", open_=opened, hint=self.sentence)
        return {f"section.{self.name}": section}


class Window(Panel):
    """A window over the page, in its one dialog: open while `state.page.window` is its name."""

    title = ""

    def is_seen(self, state: AppState) -> bool:
        return state.page.window == self.name

    def closed(self, state: AppState) -> AppState:
        return replace(state, page=replace(state.page, window=""))

    def body(self, picture: LivePicture) -> Markup:
        raise NotImplementedError

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        cross = button("✕", "page:close", kind="quiet", hint="Close (Esc)", aria_label="Close")
        head = tag("header", tag("h2", self.title, id="ws-window-title") + cross)
        body = tag("div", self.body(picture), class_="ws-body", data_key=f"window-{self.name}")
        return {"window": head + body}


def actions(*buttons: Markup) -> Markup:
    return tag("div", join(buttons), class_="ws-actions")


# --- Long work of a part beside its session: one at a time, with progress, and cancellable --------

logger = logging.getLogger(__name__)
TICK_S = 0.25  # how often progress is shown


class Job(threading.Event):
    """One piece of work; set once nobody waits for it any more."""

    def __init__(self, name: str, again: Callable[[], None]) -> None:
        super().__init__()
        self.name, self.share = name, 0.0
        self._again, self._told_at = again, time.monotonic()

    def tell(self, share: float) -> None:
        """Say how much is done; raises where nobody waits for it any more."""
        if self.is_set():
            raise CancelledError(f"{self.name}: cancelled")
        self.share = share
        if time.monotonic() - self._told_at > TICK_S:
            self._told_at = time.monotonic()
            self._again()


class Jobs:
    """Runs the work of a part in threads of its own; what is called back runs in the session."""

    def __init__(
        self, part: Panel, again: Callable[[], None], failed: Callable[[Exception], None]
    ) -> None:
        self._part, self._failed = part, failed
        self._again = partial(part.context.act, again)
        self._job: Job | None = None
        self._waiting: deque[tuple[str, Callable[[Job], None]]] = deque()

    @property
    def busy(self) -> bool:
        return self._job is not None

    def queue(self, name: str, work: Callable[[Job], None]) -> None:
        """Start work once there is room. For the session."""
        if not self.start(name, work):
            self._waiting.append((name, work))

    def start(self, name: str, work: Callable[[Job], None]) -> bool:
        """Start work; give whether there was room. For the session, as all but the work itself."""
        if self._job is not None:
            return False
        self._job = job = Job(name, self._again)
        self._part.context.jobs.add(job)
        run = partial(self._run, job, work)
        threading.Thread(target=run, name="warpspace-work", daemon=True).start()
        self._again()
        return True

    def cancel(self) -> None:
        """Cancel what runs; its result is not delivered any more."""
        if self._job is not None:
            self._job.set()
            self._end(self._job, None)

    def html(self) -> Markup:
        """Say what runs, and how much of it is done where that is known."""
        job = self._job
        if job is None:
            return EMPTY
        share = number(100.0 * job.share, 0) if job.share else None
        bar = tag("progress", "", max=100, value=share, aria_label=job.name)
        words = tag("span", f"{job.name}: {share} %" if share else f"{job.name} …")
        cancel = button("Cancel", f"{self._part.name}:cancel")
        return tag("div", join((bar, words, cancel)), class_="ws-actions ws-run")

    def _run(self, job: Job, work: Callable[[Job], None]) -> None:
        error = None
        try:
            work(job)
        except Exception as raised:  # noqa: BLE001 - handed to the session, which shows it
            error = raised
        self._part.context.act(partial(self._end, job, error))

    def _end(self, job: Job, error: Exception | None) -> None:
        if self._job is not job:  # it has been cancelled, and there may be another
            return
        self._job = None
        if self._waiting:
            self.start(*self._waiting.popleft())
        self._again()
        if error is not None and not isinstance(error, CancelledError):
            if not isinstance(error, WarpspaceError):
                logger.error("%s", job.name, exc_info=error)
            self._failed(error)
        self._part.context.jobs.discard(job)
