"""Panels, the parts of the page, and the context that the panels of one tab share.

A panel renders HTML for named places of the page and handles actions (`browser/actions.py`) in
methods with `@on(do.Action)`. It knows neither widgets nor threads, and no other panel.

The context holds page, camera and state of a tab, and the queues of its session. Other threads only
add to the queues (`receive`, `post`, `call_soon`); the thread of the session works them off. Long
jobs run in threads of their own.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from enum import Enum, auto
from functools import partial
from typing import Any, ClassVar, TypeAlias, TypeVar

from markupsafe import Markup
from viser import ClientHandle, ViserServer

from warpspace.analysis.description import Result
from warpspace.app.browser import actions as do
from warpspace.app.browser import html
from warpspace.app.browser.html import EMPTY, tag
from warpspace.app.browser.incoming import Events
from warpspace.app.browser.page import Page
from warpspace.app.browser.templates import Templates
from warpspace.app.documents.output_services import CancelledError, Services
from warpspace.app.documents.scene_file import MOST_OPENED, SceneList
from warpspace.app.drawing.camera import CameraMemory, TabCamera, focus
from warpspace.app.drawing.player import Player, Track, find_tracks
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.state.leaf import Identity
from warpspace.app.state.store import StateStore, Update
from warpspace.app.state.tree import LONGEST, leaves, spell, value
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.scene.notes import story

HTML = Templates("panel")
MOST_FILES = 16  # that may wait for the session; likewise jobs
PAUSE_S = 0.1  # without changes: longer than between two moves of a drag


class Context:
    """Page, camera, state and queues of one tab, shared by its panels."""

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
        self.events: deque[do.AnyAction] = deque()
        self.store, self.scenes, self.services = store, scenes, services
        self.picture: LivePicture | None = None
        self.player = Player(self.find_tracks)
        # set by the display, to be called in the session: render a panel again at once; note that
        # the page has closed its dialog; restart the idle time, with panels to render after it
        self.rerender: Callable[[Panel], None] = lambda _: None
        self.dialog_closed: Callable[[], None] = lambda: None
        self.restart_idle: Callable[..., None] = lambda *_: None
        self.jobs: set[threading.Event] = set()  # running jobs; each is set when the page closes
        self.report_results: list[tuple[str, Result]] = []  # added to the report
        # the last applied change: the state before it, and its description
        self.last_decision: tuple[AppState, str] | None = None
        self.offer_import: Callable[[str, bytes], None] = lambda _name, _content: None
        self.changed_at = time.monotonic()
        self.held_since: float | None = None  # while a slider is held: its changes are one step
        self.page_look = store.state.page  # of this tab, also where the state is shared
        # state of the present step of a story; replaces the state on the page without changing it
        self.story_state: AppState | None = None
        self.notes: list[str] = []  # values that updates of the state clamped
        self._merged: tuple[object, AppState] = (None, store.state)
        self._wake = threading.Event()
        self.wake = self._wake.set
        self.actions: deque[Callable[[], None]] = deque()

    @property
    def state(self) -> AppState:
        """The present state with the page look of this tab; or that of a step of a story."""
        if self.story_state is not None:
            return self.story_state
        shared = self.store.state
        if shared.page is self.page_look:
            return shared
        key = Identity(shared), Identity(self.page_look)
        if self._merged[0] != key:
            self._merged = key, replace(shared, page=self.page_look)
        return self._merged[1]

    def apply(self, update: Update) -> None:
        """Apply a pure update to the present state. For the session."""

        def update_tab(state: AppState) -> AppState:
            page = self.page_look
            updated = update(state if state.page is page else replace(state, page=page))
            self.page_look = updated.page
            return updated

        at = self.changed_at if self.held_since is None else self.held_since
        self.notes += self.store.apply(update_tab, by=self.mark_changed, at=at)

    def find_tracks(self, picture: LivePicture | None = None) -> Mapping[str, Track]:
        """List what the player can play in a picture, by default the present one."""
        picture = picture or self.picture
        steps = story(self.store.state.review)
        return {} if picture is None else find_tracks(picture, len(steps))

    def receive(self, message: Events) -> None:
        actions = (*self.events, *message.events)
        if sum(isinstance(action, do.Upload) for action in actions) > MOST_FILES:
            text = f"More than {MOST_FILES} files at once; select fewer and try again"
            self.notify("Files not opened", text, "problem")
            return
        self.events.extend(message.events)
        self.mark_changed()

    def mark_changed(self) -> None:
        """Record the time of a change and wake the session up."""
        self.changed_at = time.monotonic()
        self._wake.set()

    @property
    def is_paused(self) -> bool:
        """True while no changes arrive, so that work may start."""
        return time.monotonic() - self.changed_at >= PAUSE_S

    def send(self, action: do.AnyAction) -> None:
        self.receive(Events([action]))

    def post(self, update: Update) -> None:
        """Queue a pure update of the state."""
        self.call_soon(partial(self.apply, update))
        self.mark_changed()

    def call_soon(self, action: Callable[[], None]) -> None:
        """Queue a call in the session, which reports its exceptions on the page."""
        self.actions.append(action)
        self._wake.set()

    def wait(self, seconds: float | None) -> bool:
        """Wait for a change; return False after a timeout. For the session."""
        woken = self._wake.wait(seconds)
        if woken:  # otherwise a change since the end of the wait would be lost
            self._wake.clear()
        return woken

    def save_file(self, name: str, content: str | bytes) -> None:
        data = content.encode() if isinstance(content, str) else content
        self.client.send_file_download(name, data, save_immediately=True)

    def move_camera(self, memory: CameraMemory) -> None:
        """Place the camera together with the next picture."""
        self.camera.wanted = memory
        self._wake.set()

    def fly(self, memory: CameraMemory | None, duration_ms: int) -> None:
        """Animate camera and box towards the next picture."""
        if memory and self.picture and focus(self.picture.state) != focus(self.state):
            memory, self.camera.wanted = None, memory  # another machine: not animated
        if memory is not None:
            self.camera.expect(memory)
        self.page.call("step", duration_ms, memory and asdict(memory))
        self._wake.set()

    def show_opened(
        self, opened: AppState, camera: CameraMemory | None, *, keeps_comparison: bool = False
    ) -> None:
        """Show an opened state from its camera; optionally the comparison stays."""
        # here, since not every opened scene is drawn if many arrive in a row
        _, dropped = self.scenes.add(opened.origin)
        if dropped:
            text = f"{dropped} removed; the list holds the last {MOST_OPENED} opened scenes."
            self.notify("Scene list", text)

        def update(now: AppState) -> AppState:
            if camera is not None:
                # with this change, not before it: another scene resets the camera
                self.move_camera(camera)
            return replace(opened, comparison=now.comparison) if keeps_comparison else opened

        self.post(update)

    def fit_view(self, view: str | None = None, lens: bool | None = None) -> None:
        """Move the camera to a named view (default: the last one), or change its projection."""
        if self.picture is not None:
            self.camera.choose(self.picture, view, lens)


# --- Panels ---------------------------------------------------------------------------------------


class Refresh(Enum):
    """When a panel is rendered after a change of the picture."""

    IMMEDIATE = auto()  # with every picture of a drag
    THROTTLED = auto()  # a few times a second, and when the first of its dependencies changes
    DEBOUNCED = auto()  # when changes pause
    IDLE = auto()  # when nothing has happened for a while


ActionKind: TypeAlias = type[do.Action] | do.Signal | do.Input
F = TypeVar("F", bound=Callable[..., AppState | None])
T = TypeVar("T")


def on(*kinds: ActionKind, later: bool = False) -> Callable[[F], F]:
    """Mark the handler of actions: ``method(state, action)`` returns the changed state, or None.

    A later one, ``method(action)``, leaves the state alone and is called after it is updated. That
    of a single `Signal` is called without the action, that of a single `Input` with its text.
    """

    def mark(method: F) -> F:
        vars(method).update(kinds=kinds, is_later=later)
        return method

    return mark


class Panel:
    name: str = ""  # also in the `PanelAction`s for it
    # method, kinds of its actions, and whether it is called later, by kind of action
    handlers: ClassVar[Mapping[object, tuple[str, tuple[object, ...], bool]]] = {}
    refresh: ClassVar[Refresh] = Refresh.DEBOUNCED

    def __init__(self, context: Context) -> None:
        self.context = context

    def is_visible(self, state: AppState) -> bool:
        """Check if it is on the screen; otherwise it is neither computed nor sent."""
        return True

    def dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        """Return the inputs of its HTML; while they are equal it is not rendered again."""
        return (picture.serial,)

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        """Render HTML by the name of its place."""
        return {}

    def __init_subclass__(cls) -> None:
        own = {kind: (name, method.kinds, method.is_later) for name, method in vars(cls).items()
               for kind in getattr(method, "kinds", ())}  # fmt: skip
        cls.handlers = {**cls.handlers, **own}

    def handles(self, action: do.AnyAction) -> bool:
        return (
            do.kind_of(action) in self.handlers and getattr(action, "panel", self.name) == self.name
        )

    def handle(self, state: AppState, action: do.AnyAction) -> AppState:
        """Handle an action; those of other panels change nothing."""
        if not self.handles(action):
            return state
        name, kinds, is_later = self.handlers[do.kind_of(action)]
        method: Any = getattr(self, name)
        values: tuple[object, ...] = (action,)
        if len(kinds) == 1 and isinstance(action, do.Signal | do.InputValue):
            values = (action.value,) if isinstance(action, do.InputValue) else ()
        if not is_later:
            return method(state, *values) or state
        self.context.call_soon(partial(method, *values))
        return state

    def rerender(self) -> None:
        """Render it again whatever its dependencies. For the session."""
        self.context.rerender(self)


def with_section(state: AppState, task: str, name: str) -> AppState:
    """Open a section of a task."""
    page = replace(state.page, task=task, open=state.page.open | {name}, window="")
    return replace(state, page=page)


class Section(Panel):
    """A section of a task; a folded one is neither computed nor sent."""

    task = ""
    title = ""
    sentence = ""  # its purpose, shown as a hint of the title

    def body_dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        return (picture.serial,)

    def body(self, picture: LivePicture) -> Markup:
        raise NotImplementedError

    def heading(self, picture: LivePicture) -> str:
        return self.title

    def is_open(self, state: AppState) -> bool:
        return self.name in state.page.open

    def is_visible(self, state: AppState) -> bool:
        return state.page.task == self.task

    def dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        return (True, *self.body_dependencies(picture)) if self.is_open(picture.state) else (False,)

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        is_open = self.is_open(picture.state)
        body = self.body(picture) if is_open else EMPTY
        title = self.heading(picture) if is_open else self.title
        return {f"section.{self.name}": HTML.section(self, title, body, is_open)}


class Dialog(Panel):
    """A modal dialog: open while `state.page.window` is its name."""

    title = ""

    def is_visible(self, state: AppState) -> bool:
        return state.page.window == self.name

    def closed(self, state: AppState) -> AppState:
        return replace(state, page=replace(state.page, window=""))

    def body(self, picture: LivePicture) -> Markup:
        raise NotImplementedError

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        return {"window": HTML.dialog(self.name, self.title, self.body(picture))}


def alert(text: object) -> Markup:
    return tag("p", text, class_="ws-problem", role="alert")


def setting(state: AppState, path: str, *, text: str = "", bar: bool = False) -> Markup:
    """Render the control of a leaf of the state: a switch, a list, a text box or a slider."""
    leaf, present = leaves(state)[path], value(state, path)
    if leaf.kind != "number":
        text = spell(state, path)
    elif not text and present is not None:
        text = f"{present:.6g}"
    bar = bar and leaf.span is not None and present is not None
    return HTML.setting(leaf, do.SetLeaf(path), present, text, bar, LONGEST)


# --- Jobs: long computations in threads of their own, with progress, cancellable ------------------

logger = logging.getLogger(__name__)
TICK_S = 0.25  # between two updates of the progress


class Job(threading.Event):
    """One computation; the event is set when it is cancelled."""

    def __init__(self, name: str, on_progress: Callable[[], None]) -> None:
        super().__init__()
        self.name, self.share = name, 0.0
        self._on_progress, self._reported_at = on_progress, time.monotonic()

    def report_progress(self, share: float) -> None:
        """Record the share that is done; raise `CancelledError` if it was cancelled."""
        if self.is_set():
            raise CancelledError(f"{self.name}: cancelled")
        self.share = share
        if time.monotonic() - self._reported_at > TICK_S:
            self._reported_at = time.monotonic()
            self._on_progress()


class Jobs:
    """The jobs of a panel, one after the other; callbacks run in the session."""

    def __init__(
        self, panel: Panel, on_progress: Callable[[], None], on_failure: Callable[[Exception], None]
    ) -> None:
        self._panel, self._on_failure = panel, on_failure
        self._on_progress = partial(panel.context.call_soon, on_progress)
        self._job: Job | None = None
        self._waiting: deque[tuple[str, Callable[[Job], Any], Callable[[Any], None]]] = deque()

    @property
    def busy(self) -> bool:
        return self._job is not None

    def start(self, name: str, compute: Callable[[Job], T], accept: Callable[[T], None]) -> None:
        """Start a job, now or after those before it; the session accepts what it computes."""
        if self._job is not None:
            if len(self._waiting) == MOST_FILES:
                raise OptionError(f"{name}: {MOST_FILES} jobs are waiting; try again later")
            self._waiting.append((name, compute, accept))
            self._on_progress()
            return
        self._job = job = Job(name, self._on_progress)
        self._panel.context.jobs.add(job)
        run = partial(self._run, job, compute, accept)
        threading.Thread(target=run, name="warpspace-work", daemon=True).start()
        self._on_progress()

    def cancel(self) -> None:
        if self._job is not None:
            self._job.set()
            self._end(self._job, None)

    def html(self) -> Markup:
        job = self._job
        if job is None:
            return EMPTY
        share = html.number(100.0 * job.share, 0) if job.share else ""
        return HTML.progress(
            job.name, share, [name for name, *_ in self._waiting], self._panel.name
        )

    def _run(self, job: Job, compute: Callable[[Job], T], accept: Callable[[T], None]) -> None:
        error = None
        try:
            product = compute(job)
            if not job.is_set():
                self._panel.context.call_soon(partial(accept, product))
        except Exception as raised:  # noqa: BLE001 - reported by the session
            error = raised
        self._panel.context.call_soon(partial(self._end, job, error))

    def _end(self, job: Job, error: Exception | None) -> None:
        if self._job is not job:  # cancelled; another one may be running
            return
        self._job = None
        if self._waiting:
            self.start(*self._waiting.popleft())
        self._on_progress()
        if error is not None and not isinstance(error, CancelledError):
            if not isinstance(error, WarpspaceError):
                logger.error("%s", job.name, exc_info=error)
            self._on_failure(error)
        self._panel.context.jobs.discard(job)
