"""Review notes on the page: the list beside the drawing, pin, show again, answer, take back."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from markupsafe import Markup

from warpspace.analysis.reviewing import (
    Numbers,
    note_numbers,
    said_stale,
    spell_change,
    spell_numbers,
    spell_place,
)
from warpspace.app.browser.html import (
    EMPTY,
    button,
    choice,
    field,
    fill,
    join,
    linked,
    tag,
    text_box,
)
from warpspace.app.browser.incoming import index_of
from warpspace.app.documents.scene_file import reopened, view_of
from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.evaluation.budget import answer, pick_worst, with_picked
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AMPLITUDE, AppState, Picked
from warpspace.app.state.edits import half_width_of, with_half_widths
from warpspace.app.state.leaf import Identity
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.parts import Part, actions
from warpspace.kinematics.model import Loop
from warpspace.machine.limits import MAX_NOTE_TEXT, MAX_NOTES, MAX_REPLIES
from warpspace.scene.notes import KINDS, TOLERANCES, Mark, Note, Pair, Reply, story, told, with_note
from warpspace.units import spell_short

LIST, NEW = "list", "new"
"""What `PageLook.notes` says beside the identity of the note that is edited."""
MOST_AUTHOR = 100  # characters of a name, as in a file
BODY = "body "
SAME = 1e-6  # µm or µrad; a value that a decision has set is still there


@dataclass(frozen=True, slots=True)
class Draft:
    """What has been typed of a note that is not kept yet."""

    kind: str = "note"
    text: str = ""
    where: str = "point"
    before: AppState | None = None  # of a decision: what was shown before it


def clean(text: str, longest: int = MAX_NOTE_TEXT) -> str:
    """Give what somebody has typed as a file can hold it."""
    lines = text.replace("\r\n", "\n").strip()
    return "".join(sign for sign in lines if sign in "\n\t" or sign.isprintable())[:longest]


class NotesPart(Part):
    """The list of notes, in the column of the tasks."""

    name = "notes"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._author, self._draft = "", Draft()
        # where one was before notes were shown again, and the one that is shown
        self._before: tuple[AppState, CameraMemory] | None = None
        self._shown = ""

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        state = picture.state
        return (Identity(state.review), state.page.notes, self._draft, Identity(state.picked),
                self._is_elsewhere(state))  # fmt: skip

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        state = picture.state
        return {"notes": self._panel(state) if state.page.notes else EMPTY,
                "reopened": self._bar(state)}  # fmt: skip

    def _is_elsewhere(self, state: AppState) -> str:
        """Give the note that is shown as it was; none after its reopening has been undone."""
        if self._before and state.amplitudes is self._before[0].amplitudes:
            self._before = None
        return self._shown if self._before else ""

    def _bar(self, state: AppState) -> Markup:
        own = self._is_elsewhere(state)
        number = next((i for i, one in enumerate(state.review, 1) if own and one.id == own), 0)
        if not number:
            return EMPTY
        note = state.review[number - 1]
        back = button("Back", "notes:back", kind="chip", hint="Back to where you were before")
        words = f"{note.kind.capitalize()} {number} as it was on {note.date:%d %b %Y} "
        changed = tag("span", "", class_="ws-changed", data_piece=f"note.{own}.bar")
        return tag("p", join((words, back, changed)), role="status", class_="ws-reopened")

    # --- the list --------------------------------------------------------------------------------

    def _panel(self, state: AppState) -> Markup:
        cross = button("✕", "notes:close", kind="quiet", hint="Close (Esc)",
                       aria_label="Close the notes", data_go="[data-do='notes:open']")  # fmt: skip
        pin = button("Pin a note", "notes:pin", kind="main", hint="Pin a note (N)")
        name = text_box("notes:set.author", self._author, data_kept="warpspace-author",
                        placeholder="Kept in this browser", maxlength=MOST_AUTHOR)  # fmt: skip
        edited = state.page.notes
        entries = [
            self._form(state, edited) if note.id == edited else _entry(number, note)
            for number, note in enumerate(state.review, 1)
        ]
        return join((
            tag("header", join((tag("h2", "Notes"), pin, cross))),
            field("Your name", name, "notes:set.author"),
            button("Tell the story", "story:start") if story(state.review) else EMPTY,
            self._form(state, "") if edited == NEW else EMPTY,
            *(entries or [tag("p", "No notes yet.", class_="ws-quiet")]),
        ))  # fmt: skip

    def _form(self, state: AppState, edited: str) -> Markup:
        draft = self._draft
        place = "the point asked about" if state.picked else "the worst point"
        places = {"point": place, "whole": "the whole",
                  **{BODY + axis: f"body {axis}" for axis in state.scene.machine.axes}}  # fmt: skip
        where = choice("notes:set.where", draft.where, places)
        return tag("div", join((
            field("Kind", choice("notes:set.kind", draft.kind, {k: k for k in KINDS}),
                  "notes:set.kind"),
            EMPTY if edited else field("About", where, "notes:set.where"),
            tag("textarea", draft.text, class_="ws-box", id="ws-notes-set-text", rows=3,
                data_set="notes:set.text", data_focus=edited or NEW, aria_label="Text",
                placeholder="What is to be seen here?", maxlength=MAX_NOTE_TEXT),
            actions(button("Keep", "notes:keep", edited, kind="main"),
                    button("Cancel", "notes:open", kind="quiet")),
        )), class_="ws-card", data_key=f"note-{edited or NEW}")  # fmt: skip

    # --- events ----------------------------------------------------------------------------------

    def take(self, state: AppState, word: str, value: str) -> AppState:
        do, _, name = word.partition(".")
        if do == "set":
            return self._set(state, name, value)
        if do == "close":
            return _opened(state, "")
        if do in ("pin", "decide"):
            return self._begin(state, is_decision=do == "decide")
        if do == NEW:  # what somebody has measured, say, is its text
            self._draft = Draft(text=value[:MAX_NOTE_TEXT], where="whole")
            return _opened(state, NEW)
        if do == "back" and self._before is not None:
            (before, camera), self._before = self._before, None
            self.context.look_from(camera)
            return replace(before, review=state.review, page=state.page, forms=state.forms)
        if do == "at" and (index := index_of(value, len(state.review) + 1)):
            self.context.page.call("reveal", f"note-{state.review[index - 1].id}")
            return _opened(state, LIST)
        if do == "keep" and not value:
            return self._kept(state)
        if do == "open":
            return _opened(state, LIST)
        known = name or value.partition(" ")[0]
        note = next((one for one in state.review if one.id == known), None)
        return state if note is None else self._about(state, note, do, value)

    def _about(self, state: AppState, note: Note, do: str, value: str) -> AppState:
        """Do what is asked of one note."""
        if do == "delete":
            return replace(state, review=tuple(one for one in state.review if one is not note))
        if do == "edit":
            self._draft = Draft(note.kind, note.text)
            return _opened(state, note.id)
        if do == "show":
            return self._reopened(state, note)
        if do == "take-back":
            return self._taken_back(state, note)
        changed = note
        if do == "keep" and (text := clean(self._draft.text)):
            changed = note.edited(kind=self._draft.kind, text=text)
            state = _opened(state, LIST)
        elif do == "status":
            changed = note.edited(status="done" if note.status == "open" else "open")
        elif do == "choose":
            index = index_of(value.partition(" ")[2], 1 + len(note.versions))
            changed = note if index is None else _chosen(note, index)
        elif do == "reply" and (text := clean(value)):
            changed = self._answered(note, text)
        return replace(state, review=with_note(state.review, changed))

    def _answered(self, note: Note, text: str) -> Note:
        if len(note.replies) >= MAX_REPLIES:
            self.context.notify("Not added", f"a note has at most {MAX_REPLIES} replies", "problem")
            return note
        return note.answered(Reply(text, self._author))

    def _set(self, state: AppState, name: str, value: str) -> AppState:
        what, _, known = name.partition(".")
        if what == "author":
            self._author = clean(value, MOST_AUTHOR)
        elif what == "kind" and value in KINDS:
            self._draft = replace(self._draft, kind=value)
        elif what in ("text", "where"):
            self._draft = replace(self._draft, **{what: value[:MAX_NOTE_TEXT]})
        elif what == "step":
            step = index_of(value or "0", MAX_NOTES + 1)
            note = next((one for one in state.review if one.id == known), None)
            if note is not None and step is not None and step != note.step:
                return replace(state, review=with_note(state.review, note.edited(step=step)))
        return state

    def _begin(self, state: AppState, *, is_decision: bool) -> AppState:
        """Open the form; for a decision filled in with what has just been applied."""
        if not is_decision:
            self._draft = Draft()
        elif (decided := self.context.decided) is not None:
            self._draft = Draft("decision", f"{decided[1]}\nReason: ", "whole", decided[0])
        return _opened(state, NEW)

    def _kept(self, state: AppState) -> AppState:
        draft, camera = self._draft, self.context.camera.remember()
        text = clean(draft.text)
        if not text:
            return state.noted("a note needs a text")
        at, on = self._place(state, draft.where)
        note = Note(kind=draft.kind, text=text, author=self._author, at=at, on=on,
                    loop=state.loop.value, view=view_of(state, camera))  # fmt: skip
        if draft.before is not None and draft.kind == "decision":
            before = note_numbers(draft.before.resulting_scene(), [note])[0]
            note = replace(note, before=before, change=_changed(draft.before, state))
        note = replace(note, numbers=note_numbers(state.resulting_scene(), [note])[0])
        review = with_note(state.review, note)
        self._draft = Draft()
        return _opened(replace(state, review=review), LIST)

    def _place(self, state: AppState, where: str) -> tuple[Mapping[str, float], Mark | None]:
        picture, body = self.context.shown, where.removeprefix(BODY)
        if where.startswith(BODY) and body in state.scene.machine.axes:
            return {}, Mark(body=body)
        if where != "point" or picture is None or picture.is_difference:
            return {}, None
        picked = state.picked or pick_worst(picture)
        at = answer(state, picked, 1.0).at
        on = picked.point_mm and Mark(str(picked.loop or state.loop), picked.point_mm)
        return at, on or None

    # --- shown again, taken back -----------------------------------------------------------------

    def _reopened(self, state: AppState, note: Note) -> AppState:
        if not note.view:
            return with_picked(state, _picked(state, note))
        found, camera = reopened(state, note, self.context.scenes.fixed)
        self._is_elsewhere(state)
        self._before = self._before or (state, self.context.camera.remember())
        self._shown = note.id
        if camera is not None:
            self.context.look_from(camera)
        return found

    def _taken_back(self, state: AppState, note: Note) -> AppState:
        """Set what a decision changed back, where it is still as decided."""
        stayed: list[str] = []
        for key, (old, new) in note.change.items():
            own = key.removeprefix(TOLERANCES)
            is_own = own == key
            if own not in state.amplitudes:
                stayed.append(f"{own} is not there any more")
                continue
            now = state.amplitudes[own] if is_own else half_width_of(state, own)
            if not math.isclose(now, new, abs_tol=SAME):
                stayed.append(f"{own} is {spell_short(now)} now, not {spell_short(new)}: it stays")
            elif is_own:
                state = state.with_amplitude(own, AMPLITUDE.clamp(old, now))
            else:
                state = with_half_widths(state, {own: abs(old)})
        words = "; ".join(("Taken back", *stayed)) if len(stayed) < len(note.change) else ""
        if words:
            note = self._answered(note.edited(status="open"), words[:MAX_NOTE_TEXT])
        return replace(state, review=with_note(state.review, note)).noted(*stayed)


def _opened(state: AppState, what: str) -> AppState:
    return replace(state, page=replace(state.page, notes=what))


def _picked(state: AppState, note: Note) -> Picked | None:
    """Give the point of a note; none for the whole or a body."""
    at = {axis: where for axis, where in note.at.items() if axis in state.scene.machine.axes}
    mark = note.on or Mark()
    loop = Loop(mark.loop) if mark.loop and mark.point_mm else None
    return Picked(at, loop, mark.point_mm if loop else None) if at and not mark.body else None


def _changed(before: AppState, after: AppState) -> dict[str, Pair]:
    """Give from and to of each error and tolerance that differs."""
    found: dict[str, Pair] = {}
    for key, now in after.amplitudes.items():
        pair = before.amplitudes.get(key, 0.0), now
        widths = half_width_of(before, key), half_width_of(after, key)
        found |= {key: pair} if pair[0] != now else {}
        found |= {TOLERANCES + key: widths} if widths[0] != widths[1] else {}
    return found


def _chosen(note: Note, index: int) -> Note:
    """Give one of the versions that stand side by side in place of all of them."""
    kept = (note, *note.versions)[index]
    names = ("kind", "at", "on", "text", "author", "date", "status", "loop", "numbers", "before",
             "change", "step", "view")  # fmt: skip
    said: dict[str, Any] = {name: getattr(kept, name) for name in names}
    return note.edited(**said)


# --- An entry of the list -------------------------------------------------------------------------


def _said(words: str) -> Markup:
    """Give what somebody has written, a paragraph a line."""
    return join(tag("p", linked(line)) for line in words.splitlines() if line.strip())


def _by(author: str, date: str) -> Markup:
    return tag("small", f"{author or 'somebody'}, {date}", class_="ws-quiet")


def _entry(number: int, note: Note) -> Markup:
    texts = [_said(note.text)]
    if note.versions:
        heads = (note, *note.versions)
        texts = [tag("p", "Edited by several: which is to stay?", class_="ws-stale")]
        texts += [
            _said(one.text) + _by(one.author, f"{one.date:%d %b %Y}")
            + button("Keep this one", "notes:choose", f"{note.id} {index}")
            for index, one in enumerate(heads)
        ]  # fmt: skip
    replies = (_said(one.text) + _by(one.author, f"{one.date:%d %b %Y}") for one in note.replies)
    facts = " · ".join(filter(None, (spell_place(note), spell_numbers(note), spell_change(note))))
    was = told(note.before, note.numbers)
    reply = f"notes:set.reply.{note.id}"
    step = f"notes:set.step.{note.id}"
    does = [("Show", "show", "As it was on the screen, errors and camera too"),
            ("Edit", "edit", ""), ("Delete", "delete", "Undo brings it back")]  # fmt: skip
    if note.change:
        does.append(("Take back", "take-back", "Set what it changed back to what it was before"))
    is_done = note.status == "done"
    return tag("article", join((
        tag("h3", f"{number} · {note.kind}"), _by(note.author, f"{note.date:%d %b %Y}"), *texts,
        tag("p", facts + (f" · max {was}" if was else ""), class_="ws-tiny"),
        tag("p", "", class_="ws-changed", data_piece=f"note.{note.id}"),
        *(tag("blockquote", one) for one in replies),
        text_box(reply, "", label=f"Reply to note {number}", placeholder="Reply",
                 data_enter=f"notes:reply.{note.id}", maxlength=MAX_NOTE_TEXT),
        actions(button("Done", "notes:status", note.id, pressed=is_done,
                       hint="Mark as open" if is_done else "Mark as done"),
                *(button(words, f"notes:{do}", note.id, kind="link", hint=hint)
                  for words, do, hint in does)),
        field("Step in the story", text_box(step, str(note.step or ""), size="short"), step),
    )), class_=f"ws-note {note.status}", data_key=f"note-{note.id}", id=f"note-{note.id}",
        tabindex=-1)  # fmt: skip


class NoteNumbersPart(Part):
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
        found: list[Numbers] = note_numbers(scene, review)
        said = [said_stale(note, now) for note, now in zip(review, found, strict=True)]
        stale = [str(number) for number, words in enumerate(said, 1) if words]
        self.context.page.call("room.show", {"stale": stale})
        return {
            f"note.{note.id}{place}": fill("{}", words)
            for note, words in zip(review, said, strict=True)
            for place in ("", ".bar")
        }
