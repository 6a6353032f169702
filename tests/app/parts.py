"""Parts of the page without a page."""

import time
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

from warpspace.analysis.registry import entries
from warpspace.app.browser.actions import AnyAction, Input, Upload
from warpspace.app.documents.output_services import Services
from warpspace.app.documents.scene_file import SceneList
from warpspace.app.drawing.player import Player, Track, find_tracks
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.state.app_state import AppState
from warpspace.app.state.store import StateStore
from warpspace.exceptions import WarpspaceError
from warpspace.scene.notes import story

LIVE = LiveModel()


class Nobody(SimpleNamespace):
    """The context of a page that is not there; what it posts and tells a user goes into lists."""

    is_paused, picture = True, None

    def __init__(self, **given: Any) -> None:
        posted, told = [], []
        super().__init__(
            jobs=set(), scenes=SceneList({}), services=Services(), posted=posted, told=told,
            offers={},
            call_soon=lambda do: do(), rerender=lambda _: None, post=posted.append,
            notify=lambda *words: told.append(words), save_file=lambda *file: told.append(file),
        )  # fmt: skip
        vars(self).update(given)
        self.player = Player(self.find_tracks)

    def find_tracks(self, picture: Any = None) -> Mapping[str, Track]:
        picture = picture or self.picture
        return {} if picture is None else find_tracks(picture, len(story(self.state.review)))

    def __getattr__(self, name: str) -> Any:  # the state is that of its store, unless one is set
        if name == "state":
            return self.store.state
        raise AttributeError(name)


class Alone:
    """One part on a page that is not there, with what it has the page do."""

    def __init__(self, kind: Any, state: AppState, *more: Any, **given: Any) -> None:
        self.said, self.sent, self.saved, self.called = [], [], [], []
        self.store = StateStore(state)
        self.context = Nobody(
            call_soon=self._call, store=self.store, picture=LIVE.evaluate(state),
            notify=lambda *words: self.said.append(words), post=self.store.apply, report_results=[],
            send=self.sent.append, dialog_closed=lambda: None,
            save_file=lambda *file: self.saved.append(file), fit_view=lambda *_: None,
            offers={}, page=SimpleNamespace(
                report=lambda error: self.said.append(("", str(error))),
                call=lambda *what: self.called.append(what),
            ),
            camera=SimpleNamespace(remember=lambda: None),
            client=SimpleNamespace(flush=lambda: None), **given,
        )  # fmt: skip
        self.part = kind(self.context, *more)

    def _call(self, action: Callable[[], None]) -> None:
        try:
            action()
        except WarpspaceError as error:  # as the session says it
            self.said.append(("", str(error)))

    def do(self, action: AnyAction) -> Any:
        """Do what an action says; give what is shown then."""
        self.store.apply(lambda state: self.part.handle(state, action))
        reads = isinstance(action, Upload) or getattr(action, "input", "") == Input.ADD_READINGS
        while reads and self.context.jobs:
            time.sleep(0.01)  # files are parsed beside the session
        self.context.picture = LIVE.evaluate(self.store.state)
        return self.store.state

    @property
    def html(self) -> str:
        """What it shows."""
        (found,) = self.part.render(LIVE.evaluate(self.store.state)).values()
        return str(found)


def lone_part(kind: Any, name: str = "") -> Any:
    """Build a part for nobody, of an analysis where one is named."""
    return kind(Nobody(), *(one for one in entries() if one.name == name))


def wait(part: Any) -> None:
    """Wait until nothing is computed for a part."""
    while part.context.jobs:
        time.sleep(0.01)


def body_of(kind: Any, state: AppState) -> str:
    """Give what a section or a window shows of a state."""
    return str(lone_part(kind).body(LIVE.evaluate(state)))


def answer_of(part: Any, state: AppState) -> Any:
    """Run the analysis of a part here."""
    (values, scenes) = part.values(state), part.scenes(state)
    return part.build_analysis(state, values, scenes[0]).run_all(scenes, lambda _: None)


def section(part: Any, state: AppState) -> str:
    """Give what stands below the title of a section."""
    return str(part.body(SimpleNamespace(state=state, other_title="")))
