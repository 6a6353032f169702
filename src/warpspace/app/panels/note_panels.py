"""Review notes on the page: listed beside the drawing, and told as a story."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from markupsafe import Markup

from warpspace.analysis.note_tables import (
    note_numbers,
    spell_change,
    spell_numbers,
    spell_place,
    stale_remark,
)
from warpspace.app.browser.html import EMPTY, button, fill, join, linked, tag, text_box
from warpspace.app.browser.incoming import index_of
from warpspace.app.documents.offline_page import step_words
from warpspace.app.documents.scene_file import reopened, view_of
from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.point_explanation import answer, pick_worst, with_picked
from warpspace.app.panels.form_controls import setting
from warpspace.app.panels.panel import Context, Panel, actions
from warpspace.app.state.app_state import AppState, Picked
from warpspace.app.state.leaf import Identity
from warpspace.app.state.tree import leaves, set_leaf, stored
from warpspace.exceptions import WarpspaceError
from warpspace.machine.limits import MAX_NOTE_TEXT, MAX_REPLIES
from warpspace.scene.notes import TOLERANCES, Note, NoteAnchor, Pair, Reply, story, with_note
from warpspace.scene.text_files import one_line
from warpspace.units import spell_short

LIST, NEW = "list", "new"
"""What `PageLook.notes` says beside the identity of the note that is edited."""
MOST_AUTHOR = 100  # characters of a name, as in a file
AMPLITUDES = "amplitudes."  # before the key of an error, in a path of the state
SAME = 1e-6  # µm or µrad; a value that a decision has set is still there


def clean(text: str) -> str:
    """Give what somebody has typed without signs that a file cannot hold."""
    lines = text.replace("\r\n", "\n").strip()
    return "".join(sign for sign in lines if sign in "\n\t" or sign.isprintable())


class NotesPanel(Panel):
    """The list of notes, in the column of the tasks."""

    name = "notes"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._decided: AppState | None = None  # before the decision that is being written
        # the words of the bar over what is shown again, the note, and where one was before
        self._again: tuple[str, str, AppState, CameraMemory] | None = None

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        state, bar = picture.state, EMPTY
        if again := self._shown_again(state):
            words, own, *_ = again
            back = button("Back", "notes:back", kind="chip", hint="Back to where you were before")
            changed = tag("span", "", class_="ws-changed", data_piece=f"note.{own}.bar")
            bar = tag("p", join((words, back, changed)), role="status", class_="ws-reopened")
        return {"notes": _panel(state) if state.page.notes else EMPTY, "reopened": bar}

    def _shown_again(self, state: AppState) -> tuple[str, str, AppState, CameraMemory] | None:
        """Give what is shown again; none after that has been undone."""
        if self._again and state.amplitudes is self._again[2].amplitudes:
            self._again = None
        return self._again

    # --- events ----------------------------------------------------------------------------------

    def take(self, state: AppState, word: str, value: str) -> AppState:
        do, _, own = word.partition(".")
        match do, next((one for one in state.review if one.id == own), None):
            case "open" | "close", None:
                return _opened(state, LIST if do == "open" else "")
            case "pin" | "decide", None:
                return self._begun(state, value, decided=do == "decide")
            case "keep", edited:
                return self._kept(state, edited)
            case "back", None if self._again:
                (*_, before, camera), self._again = self._again, None
                self.context.look_from(camera)
                return replace(before, review=state.review, page=state.page, forms=state.forms)
            case "at", None if index := index_of(value, len(state.review) + 1):
                self.context.page.call("reveal", f"note-{state.review[index - 1].id}")
                return _opened(state, LIST)
            case "show", note if note:
                return self._reopened(state, note)
            case _, None:
                return state
            case _, note:
                return _about(state, note, do, value)

    def _begun(self, state: AppState, text: str, *, decided: bool) -> AppState:
        """Open the form; for a decision filled in with what has just been applied."""
        self._decided, words = (self.context.decided if decided else None) or (None, "")
        if words:
            return _opened(state, NEW, "decision", "whole", f"{words}\nReason: ")
        # what somebody has measured, say, is about the whole
        return _opened(state, NEW, place="whole" if text else "point", text=text)

    def _kept(self, state: AppState, edited: Note | None) -> AppState:
        """Keep an edit; or a note of what is on the screen, with the numbers that it rests on."""
        text, kind = clean(state.page.note_text), state.page.note_kind
        if not 0 < len(text) <= MAX_NOTE_TEXT:
            return state.noted(f"a note needs a text, of at most {MAX_NOTE_TEXT} characters")
        note = edited and edited.edited(kind=kind, text=text)
        if note is None:
            (at, on), view = self._place(state), view_of(state, self.context.camera.remember())
            note = Note(kind=kind, text=text, author=_author(state), at=at, on=on, view=view,
                        loop=state.loop.value)  # fmt: skip
            if self._decided is not None and kind == "decision":
                before = note_numbers(self._decided.resulting_scene(), [note])[0]
                note = replace(note, before=before, change=_changed(self._decided, state))
            note = replace(note, numbers=note_numbers(state.resulting_scene(), [note])[0])
        return _opened(replace(state, review=with_note(state.review, note)), LIST)

    def _place(self, state: AppState) -> tuple[Mapping[str, float], NoteAnchor | None]:
        picture, place = self.context.shown, state.page.note_place
        if place in state.scene.machine.axes:
            return {}, NoteAnchor(body=place)
        if place != "point" or picture is None or picture.is_difference:
            return {}, None
        picked = state.picked or pick_worst(picture)
        at = answer(state, picked, 1.0).at
        on = picked.point_mm and NoteAnchor(str(picked.loop or state.loop), picked.point_mm)
        return at, on or None

    def _reopened(self, state: AppState, note: Note) -> AppState:
        if not note.view:
            return with_picked(state, Picked.of_note(note))
        found, camera = reopened(state, note, self.context.scenes.fixed)
        here = "", "", state, self.context.camera.remember()
        *_, before, at = self._shown_again(state) or here
        number = state.review.index(note) + 1
        words = f"{note.kind.capitalize()} {number} as it was on {note.date:%d %b %Y} "
        self._again = words, note.id, before, at
        if camera is not None:
            self.context.look_from(camera)
        return found


# --- What is done with a note ---------------------------------------------------------------------


def _opened(
    state: AppState, what: str, kind: str = "note", place: str = "point", text: str = ""
) -> AppState:
    page = replace(state.page, notes=what, note_kind=kind, note_place=place, note_text=text)
    return replace(state, page=page)


def _author(state: AppState) -> str:
    return one_line(clean(state.page.author))[:MOST_AUTHOR]


def _about(state: AppState, note: Note, do: str, value: str) -> AppState:
    heads, changed = (note, *note.versions), note
    match do:
        case "delete":
            return replace(state, review=tuple(one for one in state.review if one is not note))
        case "edit":
            return _opened(state, note.id, note.kind, text=note.text)
        case "take-back":
            return _taken_back(state, note)
        case "step":
            return _in_order(state, note, value)
        case "status":
            changed = note.edited(status="done" if note.status == "open" else "open")
        case "choose" if (index := index_of(value, len(heads))) is not None:
            known = note.edited().replaces
            changed = replace(heads[index], replaces=known, versions=(), replies=note.replies)
        case "reply" if text := clean(value):
            changed = note.answered(Reply(text[:MAX_NOTE_TEXT], _author(state)))
        case _:
            pass
    return replace(state, review=with_note(state.review, changed))


def _in_order(state: AppState, note: Note, way: str) -> AppState:
    """Move a note "up" or "down" in the story, "add" it at the end, or take it "out"."""
    order = story(state.review)
    if any(one.versions for one in (note, *order)):
        return state.noted("choose first which of the versions side by side is to stay")
    place = order.index(note) if note.step else len(order)
    order = [one for one in order if one is not note]
    if way != "out":
        order.insert(max(place + {"up": -1, "down": 1}.get(way, 0), 0), note)
    steps = {one.id: number for number, one in enumerate(order, 1)}
    for one in state.review:
        if one.step != (step := steps.get(one.id, 0)):
            state = replace(state, review=with_note(state.review, one.edited(step=step)))
    return state


def _taken_back(state: AppState, note: Note) -> AppState:
    """Set what a decision changed back, where it is still as decided."""
    stayed, known = list[str](), leaves(state)
    for key, (old, new) in note.change.items():
        name = key.removeprefix(TOLERANCES)
        path = AMPLITUDES + key if name == key else key
        now = stored(state, path)
        if path not in known:
            stayed.append(f"{name} is not there any more")
        elif math.isclose(now, new, abs_tol=SAME):
            state = set_leaf(state, known[path], repr(old))
        else:
            stayed.append(f"{name} is {spell_short(now)} now, not {spell_short(new)}: it stays")
    if len(stayed) < len(note.change):
        note = note.edited(status="open")
        if len(note.replies) < MAX_REPLIES:
            words = "; ".join(("Taken back", *stayed))[:MAX_NOTE_TEXT]
            note = note.answered(Reply(words, _author(state)))
    return replace(state, review=with_note(state.review, note)).noted(*stayed)


def _changed(before: AppState, after: AppState) -> dict[str, Pair]:
    found = {
        path.removeprefix(AMPLITUDES): (stored(before, path) or 0.0, stored(after, path))
        for path in leaves(after)
        if path.startswith((AMPLITUDES, TOLERANCES))
    }
    return {key: pair for key, pair in found.items() if pair[0] != pair[1]}


# --- The list -------------------------------------------------------------------------------------


def _panel(state: AppState) -> Markup:
    cross = button("✕", "notes:close", kind="quiet", hint="Close (Esc)",
                   aria_label="Close the notes", data_go="[data-do='notes:open']")  # fmt: skip
    pin = button("Pin a note", "notes:pin", kind="main", hint="Pin a note (N)")
    edited, steps = state.page.notes, story(state.review)
    return join((
        tag("header", join((tag("h2", "Notes"), pin, cross))),
        setting(state, "page.author"),
        button("Tell the story", "story:start") if steps else EMPTY,
        _form(state, "") if edited == NEW else EMPTY,
        *(_form(state, edited) if note.id == edited else _entry(number, note, steps)
          for number, note in enumerate(state.review, 1)),
        EMPTY if state.review else tag("p", "No notes yet.", class_="ws-quiet"),
    ))  # fmt: skip


def _form(state: AppState, edited: str) -> Markup:
    names = ("kind", "text") if edited else ("kind", "place", "text")
    return tag("div", join((
        *(setting(state, f"page.note_{name}") for name in names),
        actions(button("Keep", f"notes:keep.{edited}", kind="main"),
                button("Cancel", "notes:open", kind="quiet")),
    )), class_="ws-card", data_key=f"note-{edited or NEW}")  # fmt: skip


def _said(one: Note | Reply) -> Markup:
    lines = (tag("p", linked(line)) for line in one.text.splitlines() if line.strip())
    by = f"{one.author or 'somebody'}, {one.date:%d %b %Y}"
    return join((*lines, tag("small", by, class_="ws-quiet")))


def _entry(number: int, note: Note, steps: Sequence[Note]) -> Markup:
    facts, texts = [spell_place(note), spell_numbers(note), spell_change(note)], [_said(note)]
    if note.versions:
        texts = [tag("p", "Edited by several: which is to stay?", class_="ws-stale")]
        texts += [_said(one) + actions(button("Keep this one", f"notes:choose.{note.id}", index))
                  for index, one in enumerate((note, *note.versions))]  # fmt: skip
    reply = f"notes:set.reply.{note.id}"
    place = f" · step {steps.index(note) + 1}" if note.step else ""
    return tag("article", join((
        tag("h3", f"{number} · {note.kind}{place}"), *texts,
        tag("p", " · ".join(filter(None, facts)), class_="ws-tiny"),
        tag("p", "", class_="ws-changed", data_piece=f"note.{note.id}"),
        *(tag("blockquote", _said(one)) for one in note.replies),
        text_box(reply, "", label=f"Reply to note {number}", placeholder="Reply",
                 data_enter=f"notes:reply.{note.id}", maxlength=MAX_NOTE_TEXT),
        _buttons(note, steps),
    )), class_=f"ws-note {note.status}", data_key=f"note-{note.id}", id=f"note-{note.id}",
        tabindex=-1)  # fmt: skip


def _buttons(note: Note, steps: Sequence[Note]) -> Markup:
    """Give what can be done with a note; while versions stand side by side, nothing changes it."""
    is_done, free = note.status == "done", not note.versions
    place = steps.index(note) if note.step else 0
    rows = (
        ("Done", "status", "", "Mark as open" if is_done else "Mark as done", free),
        ("Show", "show", "", "As it was on the screen, errors and camera too", True),
        ("Edit", "edit", "", "", free),
        ("Delete", "delete", "", "Undo brings it back", True),
        ("Take back", "take-back", "", "Set what it changed back", free and note.change),
        ("Add to the story", "step", "add", "", free and not note.step),
        ("↑", "step", "up", "Earlier in the story", free and place > 0),
        ("↓", "step", "down", "Later in the story", free and note.step and note != steps[-1]),
        ("Take out of the story", "step", "out", "", free and note.step),
    )
    return actions(*(
        button(words, f"notes:{do}.{note.id}", value, hint=hint,
               kind="" if do == "status" else "link",
               pressed=is_done if do == "status" else None,
               aria_label=hint if words in "↑↓" else None)
        for words, do, value, hint, can_be_done in rows if can_be_done
    ))  # fmt: skip


class NoteNumbersPanel(Panel):
    """What the numbers of notes have become."""

    name = "note-numbers"
    follows = "at rest"

    def is_seen(self, state: AppState) -> bool:
        return bool(state.review)

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        state = picture.state
        return (Identity(state.review), Identity(state.scene), tuple(state.amplitudes.items()),
                tuple(state.positions.items()), state.placed)  # fmt: skip

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        review, scene = picture.state.review, picture.state.resulting_scene()
        said = [*map(stale_remark, review, note_numbers(scene, review))]
        stale = [str(number) for number, words in enumerate(said, 1) if words]
        self.context.page.call("room.show", {"stale": stale})
        return {
            f"note.{note.id}{place}": fill("{}", words)
            for note, words in zip(review, said, strict=True)
            for place in ("", ".bar")
        }


# --- A story: note after note with what was on the screen, and back to before ---------------------

GLIDE_MS = 600  # from step to step


class StoryPanel(Panel):
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
