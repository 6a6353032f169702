"""Review notes: the list beside the drawing, and the story."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

from warpspace.analysis import note_tables
from warpspace.app.browser import actions as do
from warpspace.app.browser.html import EMPTY, text
from warpspace.app.browser.templates import Templates
from warpspace.app.documents.offline_page import step_words
from warpspace.app.documents.scene_file import reopened, view_of
from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.drawing.player import STORY
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.point_explanation import explain_point, pick_worst, with_picked
from warpspace.app.panels.panel import Context, Panel, Refresh, on, setting
from warpspace.app.state.app_state import AppState, Picked
from warpspace.app.state.leaf import Identity
from warpspace.app.state.tree import leaves, set_leaf, stored
from warpspace.exceptions import WarpspaceError
from warpspace.machine.limits import MAX_NOTE_TEXT, MAX_NOTES, MAX_REPLIES
from warpspace.scene.notes import TOLERANCES, Note, NoteAnchor, Pair, Reply, story, with_note
from warpspace.scene.text_files import one_line
from warpspace.units import spell_short

HTML = Templates("notes")
LIST, NEW = "list", "new"
"""Values of `PageLook.notes` beside the id of an edited note."""
MOST_AUTHOR = 100  # characters of a name, as in a file
AMPLITUDES = "amplitudes."  # prefix of the key of an error in a path of the state
NOTE_FACTS = note_tables.spell_place, note_tables.spell_numbers, note_tables.spell_change
SAME = 1e-6  # µm or µrad; tolerance for values that a decision has set


def clean(text: str) -> str:
    """Remove characters that a file cannot contain."""
    lines = text.replace("\r\n", "\n").strip()
    return "".join(sign for sign in lines if sign in "\n\t" or sign.isprintable())


class NotesPanel(Panel):
    """The list of notes, in place of the tasks."""

    name = "notes"
    _before_decision: AppState | None = None  # of the decision that is being written
    # the restored view of a note: title, id of the note, state and camera before it
    _restored: tuple[str, str, AppState, CameraMemory] | None = None

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        state, restored, notes = picture.state, self._restored_view(picture.state), EMPTY
        if state.page.notes:
            facts = [" · ".join(filter(None, (spell(note) for spell in NOTE_FACTS)))
                     for note in state.review]  # fmt: skip
            notes = HTML.notes(partial(setting, state), state.review, state.page.notes,
                               story(state.review), facts, MAX_NOTE_TEXT)  # fmt: skip
        bar = EMPTY if restored is None else HTML.reopened(*restored[:2])
        return {"notes": notes, "reopened": bar}

    def _restored_view(self, state: AppState) -> tuple[str, str, AppState, CameraMemory] | None:
        """Return the restored view; None after it has been undone."""
        if self._restored and state.amplitudes is self._restored[2].amplitudes:
            self._restored = None
        return self._restored

    # --- actions ---------------------------------------------------------------------------------

    @on(do.Signal.OPEN_NOTES, do.Signal.CLOSE_NOTES)
    def open(self, state: AppState, signal: do.Signal) -> AppState:
        return _opened(state, LIST if signal is do.Signal.OPEN_NOTES else "")

    @on(do.Input.PIN_NOTE)
    def pin(self, state: AppState, text: str) -> AppState:
        self._before_decision = None
        # a given text, such as a measured distance, refers to the whole volume
        return _opened(state, NEW, place="whole" if text else "point", text=text)

    @on(do.Signal.RECORD_DECISION)
    def record_decision(self, state: AppState) -> AppState:
        """Open the form with a description of the last applied change."""
        if self.context.last_decision is None:
            return self.pin(state, "")
        self._before_decision, description = self.context.last_decision
        return _opened(state, NEW, "decision", "whole", f"{description}\nReason: ")

    @on(do.Signal.LEAVE_NOTE_VIEW)
    def leave_view(self, state: AppState) -> AppState | None:
        if self._restored is None:
            return None
        (*_, before, camera), self._restored = self._restored, None
        self.context.move_camera(camera)
        return replace(before, review=state.review, page=state.page, forms=state.forms)

    @on(do.RevealNote)
    def reveal(self, state: AppState, action: do.RevealNote) -> AppState | None:
        if not 0 < action.number <= len(state.review):
            return None
        self.context.page.call("reveal", f"note-{state.review[action.number - 1].id}")
        return _opened(state, LIST)

    @on(do.EditNote)
    def edit(self, state: AppState, action: do.EditNote) -> AppState | None:
        note = _find_note(state, action.note)
        if note is None:
            return None
        match action.edit:
            case "delete":
                return replace(state, review=tuple(n for n in state.review if n is not note))
            case "edit":
                return _opened(state, note.id, note.kind, text=note.text)
            case "revert":
                return _revert_decision(state, note)
            case "status":
                changed = note.edited(status="done" if note.status == "open" else "open")
                return replace(state, review=with_note(state.review, changed))
            case move:
                return _move_step(state, note, move)

    @on(do.ChooseVersion)
    def choose_version(self, state: AppState, action: do.ChooseVersion) -> AppState | None:
        note = _find_note(state, action.note)
        if note is None or action.index > len(note.versions):
            return None
        version, present = (note, *note.versions)[action.index], note.edited()
        chosen = replace(version, replaces=present.replaces, versions=(), replies=note.replies)
        return replace(state, review=with_note(state.review, chosen))

    @on(do.ReplyToNote)
    def reply(self, state: AppState, action: do.ReplyToNote) -> AppState | None:
        note, text = _find_note(state, action.note), clean(action.value)
        if note is None or not text:
            return None
        answered = note.answered(Reply(text[:MAX_NOTE_TEXT], _author(state)))
        return replace(state, review=with_note(state.review, answered))

    @on(do.Input.SAVE_NOTE)
    def save(self, state: AppState, note_id: str) -> AppState:
        """Save an edit; or a new note with the current view and its numbers."""
        edited = _find_note(state, note_id)
        text, kind = clean(state.page.note_text), state.page.note_kind
        if not 0 < len(text) <= MAX_NOTE_TEXT:
            return state.noted(f"a note needs a text of 1 to {MAX_NOTE_TEXT} characters")
        note = edited and edited.edited(kind=kind, text=text)
        if note is None:
            (at, on), view = self._place(state), view_of(state, self.context.camera.remember())
            note = Note(kind=kind, text=text, author=_author(state), at=at, on=on, view=view,
                        loop=state.loop.value)  # fmt: skip
            decided = self._before_decision
            if decided is not None and kind == "decision":
                (before,) = note_tables.note_numbers(decided.resulting_scene(), [note])
                note = replace(note, before=before, change=_changes(decided, state))
            (numbers,) = note_tables.note_numbers(state.resulting_scene(), [note])
            note = replace(note, numbers=numbers)
        return _opened(replace(state, review=with_note(state.review, note)), LIST)

    def _place(self, state: AppState) -> tuple[Mapping[str, float], NoteAnchor | None]:
        picture, place = self.context.picture, state.page.note_place
        if place in state.scene.machine.axes:
            return {}, NoteAnchor(body=place)
        if place != "point" or picture is None or picture.is_difference:
            return {}, None
        picked = state.picked or pick_worst(picture)
        at = explain_point(state, picked, 1.0).at
        on = picked.point_mm and NoteAnchor(str(picked.loop or state.loop), picked.point_mm)
        return at, on or None

    @on(do.Input.SHOW_NOTE)
    def restore_view(self, state: AppState, note_id: str) -> AppState | None:
        note = _find_note(state, note_id)
        if note is None:
            return None
        if not note.view:
            return with_picked(state, Picked.of_note(note))
        reopened_state, camera = reopened(state, note, self.context.scenes.fixed)
        present = "", "", state, self.context.camera.remember()
        *_, before, before_camera = self._restored_view(state) or present
        number = state.review.index(note) + 1
        title = f"{note.kind.capitalize()} {number}, state of {note.date:%d %b %Y} "
        self._restored = title, note.id, before, before_camera
        if camera is not None:
            self.context.move_camera(camera)
        return reopened_state


# --- Changes of a note ----------------------------------------------------------------------------


def _opened(
    state: AppState, notes: str, kind: str = "note", place: str = "point", text: str = ""
) -> AppState:
    page = replace(state.page, notes=notes, note_kind=kind, note_place=place, note_text=text)
    return replace(state, page=page)


def _author(state: AppState) -> str:
    return one_line(clean(state.page.author))[:MOST_AUTHOR]


def _find_note(state: AppState, note_id: str) -> Note | None:
    return next((note for note in state.review if note.id == note_id), None)


def _move_step(state: AppState, note: Note, move: str) -> AppState:
    """Move a note "up" or "down" in the story, "add" it at the end, or take it "out"."""
    order = story(state.review)
    if any(n.versions for n in (note, *order)):
        return state.noted("resolve the conflicting versions of the note first")
    place = order.index(note) if note.step else len(order)
    order = [n for n in order if n is not note]
    if move != "out":
        order.insert(max(place + {"up": -1, "down": 1}.get(move, 0), 0), note)
    steps = {n.id: number for number, n in enumerate(order, 1)}
    for other in state.review:
        step = steps.get(other.id, 0)
        if other.step != step:
            state = replace(state, review=with_note(state.review, other.edited(step=step)))
    return state


def _revert_decision(state: AppState, note: Note) -> AppState:
    """Restore the values that a decision changed, unless they were changed again."""
    unchanged, paths = list[str](), leaves(state)
    for key, (old, new) in note.change.items():
        name = key.removeprefix(TOLERANCES)
        path = AMPLITUDES + key if name == key else key
        now = stored(state, path)
        if path not in paths:
            unchanged.append(f"{name} no longer exists")
        elif math.isclose(now, new, abs_tol=SAME):
            state = set_leaf(state, paths[path], repr(old))
        else:
            values = f"now {spell_short(now)} instead of {spell_short(new)}"
            unchanged.append(f"{name} not reverted: {values}")
    if len(unchanged) < len(note.change):
        note = note.edited(status="open")
        if len(note.replies) < MAX_REPLIES:
            reply = "; ".join(("Reverted", *unchanged))[:MAX_NOTE_TEXT]
            note = note.answered(Reply(reply, _author(state)))
    return replace(state, review=with_note(state.review, note)).noted(*unchanged)


def _changes(before: AppState, after: AppState) -> dict[str, Pair]:
    pairs = {
        path.removeprefix(AMPLITUDES): (stored(before, path) or 0.0, stored(after, path))
        for path in leaves(after)
        if path.startswith((AMPLITUDES, TOLERANCES))
    }
    return {key: pair for key, pair in pairs.items() if pair[0] != pair[1]}


# --- Remarks --------------------------------------------------------------------------------------


class NoteNumbersPanel(Panel):
    """Remarks on notes whose numbers have changed."""

    name = "note-numbers"
    refresh = Refresh.IDLE

    def is_visible(self, state: AppState) -> bool:
        return bool(state.review)

    def dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        state = picture.state
        return (Identity(state.review), Identity(state.scene), tuple(state.amplitudes.items()),
                tuple(state.positions.items()), state.placed)  # fmt: skip

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        review, scene = picture.state.review, picture.state.resulting_scene()
        remarks = [*map(note_tables.stale_remark, review, note_tables.note_numbers(scene, review))]
        stale = [str(number) for number, remark in enumerate(remarks, 1) if remark]
        self.context.page.call("overlay.show", {"stale": stale})
        return {
            f"note.{note.id}{place}": text(remark)
            for note, remark in zip(review, remarks, strict=True)
            for place in ("", ".bar")
        }


# --- The story: the views of the notes, one after the other ---------------------------------------

GLIDE_MS = 600  # from step to step
MOVES = {
    do.Signal.NEXT_STEP: 1, do.Signal.PREVIOUS_STEP: -1,
    do.Signal.FIRST_STEP: -MAX_NOTES, do.Signal.LAST_STEP: MAX_NOTES,
}  # fmt: skip


class StoryPanel(Panel):
    """The steps of a story, as the player moves it; they change the displayed state only."""

    name = "story"
    refresh = Refresh.IMMEDIATE
    _number: int | None = None  # of the present step; None while no story is shown
    _step_html = EMPTY
    _camera: CameraMemory | None = None  # before the story

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        context.player.followers[self.name] = self._follow

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        return {"story": self._step_html}

    @on(do.Signal.START_STORY, later=True)
    def start(self) -> None:
        if not story(self.context.store.state.review):
            self.context.notify("No story", "Add notes to the story first")
        elif self._number is None:
            self.context.player.move(STORY, 0.0)

    @on(*MOVES, later=True)
    def move(self, signal: do.Signal) -> None:
        if self._number is not None:
            self.context.player.move(STORY, float(self._number + MOVES[signal]))

    @on(do.Signal.END_STORY)
    def end(self, state: AppState) -> None:
        self.context.player.stop(STORY)

    def _follow(self) -> None:
        context, number, before = self.context, self.context.player.step_of(STORY), self._number
        if number == before:
            return
        self._number = number
        if number is None:
            self._step_html, context.story_state = EMPTY, None
            context.page.call("story", False)
            context.fly(self._camera, 0)
            return
        if before is None:
            self._camera = context.camera.remember()
            context.page.call("story", True)
        now = context.store.state if context.story_state else context.state
        self._show_step(now, story(now.review), number)

    def _show_step(self, now: AppState, notes: Sequence[Note], number: int) -> None:
        context, note, camera, problem = self.context, notes[number], None, ""
        # the page look is the same in all steps, so that little is rendered again
        before = context.story_state or replace(now, page=replace(now.page, window=""))
        story_state = now
        try:
            if note.view:
                story_state, camera = reopened(now, note, context.scenes.fixed)
        except WarpspaceError as error:
            story_state, problem = before, str(error)
        context.notes += story_state.notes
        context.story_state = replace(story_state.without_notes(), page=before.page)
        self._step_html = step_words(now.resulting_scene(), notes, number, problem)
        context.fly(camera, GLIDE_MS)
