"""A story that is told: note after note, each with what was on the screen, and back to before."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from markupsafe import Markup

from warpspace.analysis.reviewing import note_numbers, said_stale
from warpspace.app.browser.html import button
from warpspace.app.documents.scene_file import reopened
from warpspace.app.documents.story_page import step_words
from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.parts import Part, actions
from warpspace.exceptions import WarpspaceError
from warpspace.scene.notes import Note, story

GLIDE_MS = 600  # from step to step


@dataclass(frozen=True)
class Told:
    """A story while it is told."""

    notes: Sequence[Note]
    stale: Sequence[str]
    camera: CameraMemory  # before it
    number: int = 0
    problem: str = ""  # why the drawing is that of another step


class StoryPart(Part):
    """Tells the story of a scene's notes; the state is not changed by it, only what is shown."""

    name = "story"
    follows = "at once"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._told: Told | None = None

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        return (id(self._told),)

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        return {"story": _html(self._told) if self._told else ""}

    def take(self, state: AppState, word: str, value: str) -> AppState:
        doing = {"start": self._start, "on": partial(self._go, 1), "back": partial(self._go, -1),
                 "end": self._end}  # fmt: skip
        if word in doing:
            self.context.act(doing[word])
        return state

    def _start(self) -> None:
        state = self.context.store.state
        notes = story(state.review)
        if self._told or not notes:
            if not notes:
                self.context.notify("No story yet", "Give notes a place in the story first")
            return
        found = note_numbers(state.resulting_scene(), notes)
        stale = [said_stale(*one) for one in zip(notes, found, strict=True)]
        self._told = Told(notes, stale, self.context.camera.remember())
        self.context.page.call("story", True)
        self._go(0)

    def _go(self, way: int) -> None:
        told, context = self._told, self.context
        if told is None or not 0 <= told.number + way < len(told.notes):
            return
        told = replace(told, number=told.number + way, problem="")
        note, now = told.notes[told.number], context.store.state
        camera = None
        try:
            found = now
            if note.view:
                found, camera = reopened(now, note, context.scenes.fixed)
            context.notes += found.notes
        except WarpspaceError as error:
            found, told = context.telling or now, replace(told, problem=str(error))
        telling = context.telling  # the page stays the same thing, so that little is written anew
        page = telling.page if telling else replace(context.unfolded, window="")
        context.telling, self._told = replace(found.without_notes(), page=page), told
        context.fly(camera, GLIDE_MS)

    def _end(self) -> None:
        if self._told is None:
            return
        camera, self._told = self._told.camera, None
        self.context.telling = None
        self.context.page.call("story", False)
        self.context.fly(camera, 0)


def _html(told: Told) -> Markup:
    number, count = told.number, len(told.notes)
    words = step_words(told.notes[number], number, count, told.stale[number], told.problem)
    return words + actions(
        button("←", "story:back", hint="Back (←)", aria_label="Back", disabled=number == 0),
        button("→", "story:on", kind="main", hint="On (→)", aria_label="On",
               disabled=number == count - 1),
        button("End", "story:end", hint="Back to what was shown before (Esc)"),
    )  # fmt: skip
