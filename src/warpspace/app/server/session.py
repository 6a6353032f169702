"""The session of one browser tab: a thread that connects its page, its state and its drawing.

The path of a slider move:

1. `browser/page.js` sends an action (`browser/actions.py`); the connection of the tab
   (`server/connection_guard.py`) queues it;
2. `Session._follow` passes it to its panel (`panels/`), which returns the changed state;
3. the state is stored (`state/store.py`) and
4. evaluated (`evaluation/live_model.py`);
5. `Display` updates what shows the picture: layers (`drawing/`) change viser's nodes in place,
   panels render HTML; unchanged parts are not sent.

The session evaluates the latest position of a slider only, however fast it is moved.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import partial
from typing import Any

import numpy as np

from warpspace.app.browser import actions as do
from warpspace.app.browser.viser_private import queued
from warpspace.app.drawing.box import BoxLayer, rise_script
from warpspace.app.drawing.camera import focus
from warpspace.app.drawing.moving import MovingLayer
from warpspace.app.drawing.player import EXAGGERATION
from warpspace.app.drawing.shapes import SCENE_PER_MM
from warpspace.app.evaluation.live_model import DrawnScale, LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.point_explanation import pick, pick_line, with_clicked
from warpspace.app.panels.note_panels import StoryPanel
from warpspace.app.panels.overlay import PointerPanel, Tabs
from warpspace.app.panels.page_panels import build_panels
from warpspace.app.panels.panel import Context, Dialog, Panel, Refresh
from warpspace.app.server.refresh_scheduler import RefreshScheduler
from warpspace.app.server.tab_keeper import TabKeeper, TabRecord, new_token
from warpspace.app.state.app_state import AppState, Comparison, PartLook
from warpspace.app.state.look import Look
from warpspace.app.state.store import Checkpoint, StateStore
from warpspace.exceptions import WarpspaceError

Guarded = Callable[[object, Callable[[], object]], None]
"""Runs a step of a panel or a layer and handles its exceptions."""


class Display:
    """Layers and panels of one tab; none at first."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self.scheduler = RefreshScheduler()
        context.rerender, context.dialog_closed = self._renew, self._closed
        context.restart_idle = self.scheduler.restart_idle
        self.layers: tuple[BoxLayer | MovingLayer, ...] = ()
        self.panels: dict[str, Panel] = {}
        self._rendered: dict[Panel, object] = {}  # dependencies on the page; None where hidden

    def add(
        self,
        picture: LivePicture,
        layers: Sequence[BoxLayer | MovingLayer] = (),
        panels: Sequence[Panel] = (),
    ) -> None:
        self.layers = (*self.layers, *layers)
        self.panels |= {panel.name: panel for panel in panels}
        self._write(panels, picture)
        self._record(picture)

    def show(self, picture: LivePicture, *, force: bool = False) -> None:
        """Show a picture; slow panels follow when the changes pause."""
        for layer in self.layers:
            layer.show(picture)
        if force:
            self._rendered.clear()
        # panels come into sight where the look of the page changes
        before = self._context.picture
        same_page = before is not None and before.state.page is picture.state.page and not force
        classes = (Refresh.IMMEDIATE, Refresh.THROTTLED) if same_page else tuple(Refresh)
        panels = [panel for panel in self.panels.values() if panel.refresh in classes]
        self._write([panel for panel in panels if self._is_due(panel, picture)], picture)
        self._record(picture)

    def _is_due(self, panel: Panel, picture: LivePicture) -> bool:
        # panels appear and disappear at once
        was_visible = self._rendered.get(panel) is not None
        is_changed = panel.is_visible(picture.state) != was_visible
        return is_changed or self.scheduler.is_due(panel, picture)

    def _record(self, picture: LivePicture) -> None:
        self._context.picture = picture
        self.scheduler.record_picture()

    def _renew(self, panel: Panel) -> None:
        if self._context.picture is not None:
            self._rendered[panel] = None  # whatever it depends on
            self._write([panel], self._context.picture)

    def _closed(self) -> None:
        self._context.page.forget("window")
        windows = [panel for panel in self.panels.values() if isinstance(panel, Dialog)]
        self._rendered |= dict.fromkeys(windows)

    def _write(self, panels: Iterable[Panel], picture: LivePicture) -> None:
        pieces: dict[str, str] = {}
        for panel in panels:
            key = _key(panel, picture)
            if key != self._rendered.get(panel):
                self._rendered[panel] = key
                if key is not None:
                    pieces |= panel.render(picture)
        self._context.page.put(pieces)

    def settle(self, picture: LivePicture, guarded: Guarded) -> None:
        """Render the next panel that is due; one at a time, so that a slider never waits long."""
        queue = self.scheduler.queue
        if not queue:
            forced = self.scheduler.start_pass(self.panels.values())
            if forced is not None:
                self._rendered |= dict.fromkeys(forced)
                for layer in self.layers:
                    if isinstance(layer, BoxLayer):
                        guarded(layer, partial(layer.synchronise, picture))
        while queue:
            panel = queue.popleft()
            if _key(panel, picture) != self._rendered.get(panel):
                guarded(panel, partial(self._write, [panel], picture))
                break


def _key(panel: Panel, picture: LivePicture) -> object:
    return panel.dependencies(picture) if panel.is_visible(picture.state) else None


logger = logging.getLogger(__name__)
TOKEN_WAIT_S = 0.25  # the first picture waits for the token of a tab that reconnects
MOST_QUEUED, BEHIND_S = 4, 0.02  # messages to a slow page, and the wait for it to read them
RESCALE_MS, FOLLOW_MS = 250, 600  # animations: of the box after a drag, of the camera to a box
OUT_OF_VIEW = "The box is larger than the view"
ANSWER_S = 1.0  # after which a page that does not report its drawing is sent the surroundings
_TURNS: deque[object] = deque()  # of tabs whose picture is being made, or waits
_CHANGED = threading.Condition()


@contextmanager
def turn() -> Generator[None]:
    """Wait until no other tab makes a picture; made at the same time, all would be late."""
    ticket = object()
    with _CHANGED:
        _TURNS.append(ticket)
        _CHANGED.wait_for(lambda: _TURNS[0] is ticket)
    try:
        yield
    finally:
        with _CHANGED:
            _TURNS.popleft()
            _CHANGED.notify_all()


SCALED_BY = ("exaggeration", "component", "look", "loop", "placed", "comparison", "specification")
"""Fields of the state that choose exaggeration and colours; they end the scales of a drag."""


def same_scales(before: AppState, after: AppState) -> bool:
    same = all(getattr(before, name) is getattr(after, name) for name in SCALED_BY)
    return same and focus(before) == focus(after)


class Session:
    def __init__(
        self,
        context: Context,
        live: LiveModel,
        claim: "Callable[[Session, str], TabRecord | None]",
        *,
        review_tabs: Tabs | None = None,  # the tabs of a shared review
    ) -> None:
        self.context, self._live, self._claim = context, live, claim
        self._client = context.client
        self.token = new_token()
        self._review_tabs = review_tabs
        self._keeper = TabKeeper(context, shared=review_tabs is not None)
        self.display = Display(context)
        # latest states that the map, and all panels, have been evaluated for
        self._shown = self._settled = self._checkpoint()
        # scales of the drawing where they are not those of its state; the picture as a drag began
        self._scale: DrawnScale | None = None
        self._drag_start: LivePicture | None = None
        self._in_view: LivePicture | None = None  # the latest that `_keep_in_view` has checked
        self._rejected: list[str] = []  # controls that still show a value that was not taken
        self._failing = set[object]()  # panels and layers that fail in any state
        self._is_identified = False  # whether the page has sent its token
        self._surroundings_due_at: float | None = None  # at the latest
        self._stopped = threading.Event()
        self.worker = threading.Thread(
            target=self._run, name=f"warpspace-session-{self._client.client_id}", daemon=True
        )

    @property
    def state(self) -> AppState:
        return self.context.state

    def stop(self) -> None:
        self._stopped.set()
        for job in tuple(self.context.jobs):
            job.set()
        self.context.wake()
        self.context.store.unsubscribe(self.context.mark_changed)

    def use(self, store: StateStore) -> None:
        self.context.store.unsubscribe(self.context.mark_changed)
        self.context.store, self.context.page_look = store, store.state.page
        store.subscribe(self.context.mark_changed)

    def _run(self) -> None:
        self.use(self.context.store)
        self.context.player.followers["session"] = self.context.wake
        try:
            self.run_guarded(self._build)
            while not self._stopped.is_set():
                self._turn()
        finally:
            self.context.store.unsubscribe(self.context.mark_changed)
            pointer = self.display.panels.get(PointerPanel.name)
            if isinstance(pointer, PointerPanel):
                pointer.hide()

    def _turn(self) -> None:
        due_at, player = self._surroundings_due_at, self.context.player
        waits = (
            self.display.scheduler.due_in_s,
            None if due_at is None else max(0.0, due_at - time.monotonic()),
            player.wait_s,
        )
        changed = self.context.wait(min((wait for wait in waits if wait is not None), default=None))
        while queued(self._client) > MOST_QUEUED and not self._stopped.wait(BEHIND_S):
            pass  # unread pictures would fill the memory
        if changed and not self._stopped.is_set():
            self.run_guarded(self._follow)
        picture = self.context.picture
        if picture is None:
            return
        due_at = self._surroundings_due_at
        if due_at is not None and time.monotonic() >= due_at:
            self.run_guarded(partial(self.draw_surroundings, picture))
        if player.wait_s == 0.0:
            self.run_guarded(player.turn)
        if self.display.scheduler.due_in_s == 0.0:
            self.run_guarded(partial(self._settle, picture))

    def run_guarded(self, step: Callable[[], object]) -> None:
        """Run a step; log its exceptions and report them on the page."""
        try:
            step()
        except Exception as error:  # noqa: BLE001 - logged and shown
            self._report(error, [self.context])

    def _report(self, error: Exception, tabs: Iterable[Context], **title: str) -> None:
        if self._stopped.is_set() or not self.context.page.is_open:
            return  # a closed page has no widgets any more
        if not isinstance(error, WarpspaceError):
            logger.error("session %d", self._client.client_id, exc_info=error)
        for tab in tabs:
            tab.page.report(error, **title)

    # --- States that cannot be evaluated ----------------------------------------------------------

    def _checkpoint(self) -> Checkpoint:
        return self.context.store.checkpoint(self.context.page_look)

    def _revert(
        self, error: Exception, failed: Checkpoint, target: Checkpoint,
        title: str = "The change was reverted",
    ) -> bool:  # fmt: skip
        """Replace a state that cannot be evaluated; return False where that changes nothing."""
        context, tabs = self.context, self._review_tabs
        if context.story_state is not None:
            tabs, story = None, self.display.panels[StoryPanel.name]
            self.run_guarded(partial(story.handle, self.state, do.Signal.END_STORY))
        elif failed.state is target.state and failed.page is target.page:
            return False
        else:
            if failed.state is context.store.state:
                context.page_look = target.page
            if not context.store.restore(target, failed.state):
                return True  # another tab has replaced it
        self._report(error, [context] if tabs is None else tabs(), title=title)
        context.wake()
        return True

    def _reduce(self, error: Exception) -> bool:
        """Remove overlays and comparison from a scene that cannot be opened; False without any."""
        state, now = self.context.store.state, self._checkpoint()
        reduced = replace(state, part=PartLook(), look=Look(), comparison=Comparison(),
                          controller=None, picked=None, lever="", forms={})  # fmt: skip
        target = Checkpoint(state if reduced == state else reduced, (), (), now.page)
        return self._revert(error, now, target, "Parts of the scene cannot be shown")

    # --- The page opens: first the map and the panels, then the surroundings ----------------------

    def _build(self) -> None:
        context = self.context
        if not context.events:
            context.wait(TOKEN_WAIT_S)
        if context.events and isinstance(context.events[0], do.TabHere):
            self._handle_page_action(context.events.popleft())
        context.wake()  # for the other events
        try:
            self._open(self._live.evaluate(self.state))
        except Exception as error:
            if not self._reduce(error):
                raise
            self.display = Display(context)
            self._open(self._live.evaluate(self.state))

    def _open(self, picture: LivePicture) -> None:
        context = self.context
        self._shown = self._settled = self._checkpoint()
        self._in_view = picture
        with context.page.batch():
            self._set_theme(picture)
            context.page.call("title", picture.state.scene.title)
            context.camera.place(picture)
            context.page.call("stage", "opening")
            layers = [BoxLayer(self._client.scene, context.page, picture)]
            pointer = [PointerPanel(context, self._review_tabs)] if self._review_tabs else []
            self.display.add(picture, layers, [*build_panels(context), self._keeper, *pointer])
            context.page.call("drawn")
        # a page draws a batch before it answers
        self._surroundings_due_at = time.monotonic() + ANSWER_S

    def draw_surroundings(self, picture: LivePicture) -> None:
        """Add what lies around the map, and answer clicks from now on."""
        self._surroundings_due_at = None
        context = self.context
        try:
            with context.page.batch():
                layer = MovingLayer(self._client, context.page, picture, context.player)
                layer.clamp = lambda place: context.send(do.SetLeaf("part.place", place))
                self.display.add(picture, [layer])
                context.page.call("stage", "open")
        except Exception as error:
            if not self._reduce(error):
                raise
            self._surroundings_due_at = time.monotonic()
            return

        @self._client.scene.on_click()
        def _(event: Any) -> None:
            context.call_soon(partial(self._clicked, event.ray_origin, event.ray_direction))

    def _clicked(self, origin: object, direction: object) -> None:
        context, picture = self.context, self.context.picture
        if picture is None or context.story_state is not None:
            return
        ray = np.array([origin, direction], dtype=float)
        line = pick_line(picture, ray[0] / SCENE_PER_MM, ray[1])
        if line:
            context.send(do.SetOption("program", "at_line", str(line)))
            return
        hit = pick(picture, ray[0] / SCENE_PER_MM, ray[1])
        if hit is not None:
            context.post(lambda state: with_clicked(state, hit[0]))

    def _handle_page_action(self, action: do.AnyAction) -> None:
        """Handle an action of the page itself, not of a panel."""
        if action is do.Signal.DRAWN and self._surroundings_due_at is not None:
            self._surroundings_due_at = 0.0
        if action in (do.Signal.HOLD, do.Signal.RELEASE):
            is_held, context = action is do.Signal.HOLD, self.context
            self._drag_start = context.picture if is_held else None
            context.held_since = context.changed_at if is_held else None
        if action is do.Signal.RISE and (picture := self.context.picture) is not None:
            views = self.context.camera.approach(picture)
            self.context.page.run_script(rise_script(picture, views))
        if not isinstance(action, do.TabHere) or self._is_identified:
            return
        self._is_identified = True
        record = self._claim(self, action.token)
        if record is not None:
            self.use(record.store)
            self.context.camera.wanted = record.camera
        self._keeper.begin(is_known=record is not None)

    # --- The page follows changes -----------------------------------------------------------------

    def _follow(self) -> None:
        context = self.context
        actions = [context.events.popleft() for _ in range(len(context.events))]
        for action in actions:
            self._handle_page_action(action)
            kind = do.kind_of(action)
            for panel in self.display.panels.values():
                if kind in panel.handlers and panel.handles(action):
                    take = partial(panel.handle, action=action)
                    self.run_guarded(partial(context.apply, take))
        while context.actions:
            self.run_guarded(context.actions.popleft())
        notes, context.notes = context.notes, []
        now, state, picture = self._checkpoint(), self.state, context.picture
        if picture is None:  # the page could not be built
            return
        context.player.follow(picture.state, state)
        before, self._scale, is_rejected = self._scale, self._drawn_scale(state), bool(notes)
        if context.camera.wanted and focus(picture.state) == focus(state):
            context.camera.place(picture)
        is_same = not notes and state is picture.state and self._scale == before
        if not is_same:
            if before is not None and before.colours is not None and self._scale is None:
                context.page.run_script(f"warpspaceMesh.next = {RESCALE_MS};")
            try:
                with turn():
                    evaluated = self._live.evaluate(state, self._scale)
                    self._show(evaluated, picture, force=bool(notes))
            except Exception as error:
                if not self._revert(error, now, self._shown):
                    raise
                self.run_guarded(partial(self._show, picture, picture, force=True))
                now, notes, is_rejected = self._shown, list[str](), True
            else:
                self._keep_in_view(evaluated)
            self._shown = now
        if is_rejected or is_same:
            self._rejected += [str(action) for action in actions if hasattr(action, "value")]
        if is_rejected or self.display.scheduler.due_in_s is None:  # else a panel may show the past
            self._reset_rejected()
        if notes:
            context.notify("Please note", "\n".join(notes), "warning")

    def _reset_rejected(self) -> None:
        """Show the present values of rejected controls."""
        if self._rejected:
            self.context.page.call("settle", self._rejected)
            self._rejected = []

    def _drawn_scale(self, state: AppState) -> DrawnScale | None:
        """Return the scales of the drawing; None where they are those of the state."""
        start = self._drag_start
        if start is not None and same_scales(start.state, state):
            return DrawnScale(start.exaggeration, start.scale, start.state.amplitudes)
        factor = self.context.player.at.get(EXAGGERATION)
        return None if factor is None else DrawnScale(factor)

    def _keep_in_view(self, picture: LivePicture) -> None:
        """Move the camera back where the box leaves the picture; ask where it was set by hand."""
        context, camera = self.context, self.context.camera
        if self._scale is not None or context.story_state is not None:
            return
        before, self._in_view = self._in_view or picture, picture
        if focus(before.state) != focus(picture.state):
            return
        is_lost, is_moved = camera.loses(before, picture), camera.is_moved
        is_rescaled = picture.exaggeration != before.exaggeration
        if not is_moved and (is_lost or (camera.has_followed and is_rescaled)):
            context.page.call("fly", asdict(camera.follow(picture)), FOLLOW_MS)
        elif is_lost:
            context.page.call("toast", "warning", OUT_OF_VIEW, "", ["Fit view", do.Signal.FIT_VIEW])

    def _show(self, picture: LivePicture, before: LivePicture, *, force: bool) -> None:
        context = self.context
        with context.page.batch():
            self.display.show(picture, force=force)
            if focus(before.state) != focus(picture.state):
                context.page.call("title", picture.state.scene.title)
                context.camera.place(picture)
            if before.state.shown.dark != picture.state.shown.dark:
                self._set_theme(picture)

    def _set_theme(self, picture: LivePicture) -> None:
        dark = picture.state.shown.dark
        self._client.gui.configure_theme(dark_mode=dark, show_logo=False, show_share_button=False)
        self.context.page.call("dark", dark)

    def _settle(self, picture: LivePicture) -> None:
        with turn(), self.context.page.batch():
            self.display.settle(picture, self._render)
        if self.display.scheduler.due_in_s is None:
            self._settled = self._shown
            self._reset_rejected()

    def _render(self, part: object, step: Callable[[], object]) -> None:
        try:
            step()
            self._failing.discard(part)
        except Exception as error:  # noqa: BLE001 - logged and shown
            if part in self._failing or not self._revert(error, self._shown, self._settled):
                self._failing.add(part)
                self._report(error, [self.context])
