"""A story that is told: note after note, each with what was on the screen, and back to before."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from warpspace.app.browser.html import EMPTY, button
from warpspace.app.documents.offline_page import step_words
from warpspace.app.documents.scene_file import reopened
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.parts import Part, actions
from warpspace.exceptions import WarpspaceError
from warpspace.scene.notes import Note, story

GLIDE_MS = 600  # from step to step


class StoryPart(Part):
    """Tells the story of a scene's notes; the state is not changed by it, only what is shown."""

    name = "story"
    follows = "at once"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._number, self._words = 0, EMPTY  # of the step that is told; empty while none is
        self._camera = context.camera.remember()  # before it

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        return {"story": self._words}

    def take(self, state: AppState, word: str, value: str) -> AppState:
        context, notes = self.context, story(state.review)
        to = self._number + {"on": 1, "back": -1}.get(word, len(notes))
        if word == "start" and not notes:
            context.notify("No story yet", "Give notes a place in the story first")
        elif word == "start" and not self._words:
            self._camera = context.camera.remember()
            context.page.call("story", True)
            self._tell(state, notes, 0)
        elif self._words and word == "end":
            self._words, context.telling = EMPTY, None
            context.page.call("story", False)
            context.fly(self._camera, 0)
        elif self._words and 0 <= to < len(notes):
            self._tell(state, notes, to)
        return state

    def _tell(self, now: AppState, notes: Sequence[Note], number: int) -> None:
        context, note, camera, problem = self.context, notes[number], None, ""
        # the page stays the same thing, so that little is written anew
        found, before = now, context.telling or replace(now, page=replace(now.page, window=""))
        try:
            if note.view:
                found, camera = reopened(now, note, context.scenes.fixed)
        except WarpspaceError as error:
            found, problem = before, str(error)
        context.notes += found.notes
        context.telling = replace(found.without_notes(), page=before.page)
        self._number = number
        self._words = step_words(now.resulting_scene(), notes, number, problem) + actions(
            button("←", "story:back", hint="Back (←)", aria_label="Back", disabled=number == 0),
            button("→", "story:on", kind="main", hint="On (→)", aria_label="On",
                   disabled=number == len(notes) - 1),
            button("End", "story:end", hint="Back to what was shown before (Esc)"),
        )  # fmt: skip
        context.fly(camera, GLIDE_MS)
