"""The bar at the top, the scenes, all commands with their keys, and what all parts share."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from textwrap import shorten

from markupsafe import Markup

from warpspace.app.browser.html import EMPTY, button, join, rows, tag, text_box, upload_button
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.file_dialogs import accepted_endings
from warpspace.app.panels.panel import Context, Panel, Refresh, Window
from warpspace.app.state.app_state import AppState, Exclusions
from warpspace.app.state.tree import put, toggled
from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_UPLOAD_BYTES

LONGEST_SENTENCE = 110


class StatePanel(Panel):
    """Sets a field of the state to what the page says: ``state:set.PATH``."""

    name = "state"

    def take(self, state: AppState, word: str, value: str) -> AppState:
        return put(state, word.removeprefix("set."), value)


class TopPanel(Panel):
    """Scene, open, save, share, report, help; notes, undo and redo where there are any."""

    name = "top"

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        store = self.context.store
        travel = (
            button(sign, f"page:{word.lower()}", kind="quiet", aria_label=word, data_key=word,
                   hint=f"{word}: {what} ({keys})")
            for word, sign, what, keys in (("Undo", "↶", store.undoes, "Ctrl+Z"),
                                           ("Redo", "↷", store.redoes, "Ctrl+Shift+Z")) if what
        )  # fmt: skip
        hint = "Open a scene, measured errors, or a controller's table (Ctrl+O)"
        title = picture.state.origin.title or picture.state.origin.name
        state = picture.state
        count = sum(note.status == "open" for note in state.review)
        notes = [
            button(f"Notes ({count})" if count else "Notes", "notes:open", kind="quiet",
                   data_key="notes", hint="Notes of the review; N pins one")
        ] if state.review or state.page.notes else []  # fmt: skip
        return {
            "top": join((
                tag("strong", "warpspace", class_="ws-brand"),
                button(title, "page:open", "scenes", kind="ws-scene",
                       hint="Choose another scene"),
                upload_button("Open", "files", MAX_UPLOAD_BYTES, accepted_endings(), kind="quiet",
                              hint=hint),
                button("Save", "page:open", "files", kind="quiet",
                       hint="Save the scene, pictures, exports"),
                button("Share", "files:share", kind="quiet", hint="Copy a link to what is shown"),
                button("Report", "page:open", "report", kind="quiet"),
                *notes,
                tag("span", "", class_="ws-fill"),
                *travel,
                button("?", "page:open", "help", kind="quiet", aria_label="Help", hint="Help (H)"),
            ))
        }  # fmt: skip


class ScenesDialog(Window):
    """The scenes there are: title, machine, what each shows."""

    name, title = "scenes", "Choose a scene"

    def body(self, picture: LivePicture) -> Markup:
        found = (
            tag("button", join((
                tag("b", title),
                tag("small", scene.machine.title) if scene.machine.title != title else EMPTY,
                tag("small", shorten(re.split(r"\.\s", scene.description)[0].rstrip(" .\n"),
                                     LONGEST_SENTENCE, placeholder=" …"))
                if scene.description else EMPTY,
            )), type="button", data_do="scenes:choose", data_value=title,
                aria_current="true" if scene is picture.state.origin else None)
            for title, scene in self.context.scenes.items()
        )  # fmt: skip
        words = "A file is opened with Open at the top, or dropped anywhere on the page."
        return tag("div", join(found), class_="ws-list", data_list=True) + tag(
            "p", words, class_="ws-quiet"
        )

    def take(self, state: AppState, word: str, value: str) -> AppState:
        if word != "choose" or value not in self.context.scenes:
            return state
        # what is chosen again is reset
        return self.closed(replace(state.with_scene(self.context.scenes[value]), page=state.page))


# --- All commands in one table: the page's keys, and the help ------------------------------------


@dataclass(frozen=True, slots=True)
class Command:
    """Something that a key or the help does: an event of the page, with its value."""

    label: str
    event: str
    value: str = ""
    keys: tuple[str, ...] = ()  # as page.js spells them, the usual one first

    @property
    def spelt(self) -> str:
        """Spell its usual keys for people."""
        if not self.keys:
            return ""
        *held, key = self.keys[0].split("+")
        return "+".join((*(word.capitalize() for word in held), key.upper()))


# What changes the model needs a modifier. A S D Q E belong to viser's camera.
COMMANDS = (
    Command("Undo", "page:undo", keys=("ctrl+z",)),
    Command("Redo", "page:redo", keys=("ctrl+shift+z", "ctrl+y")),
    Command("Open a file", "upload", "files", ("ctrl+o",)),
    Command("Choose a scene", "page:open", "scenes"),
    Command("Save the scene", "files:save", keys=("ctrl+s",)),
    Command("Save and export", "page:open", "files"),
    Command("Copy a link to what is shown", "files:share"),
    Command("Write a report", "page:open", "report"),
    Command("Tell the story", "story:start"),
    Command("Pin a note", "notes:pin", keys=("n",)),
    Command("Notes", "notes:open"),
    Command("Find an error", "find", keys=("/",)),
    Command("Fit the view", "page:fit", keys=("f",)),
    Command("Component: length of the error", "state:set.component", "norm", ("1",)),
    Command("Component: along x", "state:set.component", "x", ("2",)),
    Command("Component: along y", "state:set.component", "y", ("3",)),
    Command("Component: along z", "state:set.component", "z", ("4",)),
    Command("Exaggeration: automatic", "state:set.exaggeration", "auto", ("x",)),
    Command("Exaggeration: true scale", "state:set.exaggeration", "1", ("t",)),
    Command("Grid lines on or off", "page:toggle", "grid_lines", ("g",)),
    Command("Nominal box on or off", "page:toggle", "ghost", ("b",)),
    Command("Rotary traces on or off", "page:toggle", "traces", ("c",)),
    Command("Dark or light page", "page:toggle", "dark", ("m",)),
    Command("Set all errors to zero", "page:zero", keys=("ctrl+alt+0",)),
    Command("Reset all errors to the scene", "page:reset", keys=("ctrl+alt+r",)),
    Command("Include all errors again", "page:include", keys=("ctrl+alt+l",)),
    Command("Help, and all commands", "page:open", "help", ("ctrl+k", "h", "?", "shift+?")),
    Command("First steps", "page:tour"),
)


def key_events() -> Mapping[str, str]:
    """Give the event, and its value, that the page sends for each key."""
    return {key: f"{one.event}={one.value}".rstrip("=") for one in COMMANDS for key in one.keys}


FIRST_HELP = (
    ("Turn, move, zoom", "drag, drag with the right button, wheel"),
    ("Why is a point off", "click it on the volume"),
    ("Type an exact number", "type digits while a slider has the focus"),
    ("Next control, press it", "Tab, then Enter or Space"),
    ("Fly through the drawing", "A S D Q E"),
)
MEANINGS = (
    ("Solid box", "the working volume, each point moved by its error × exaggeration"),
    ("Dashed box", "the nominal working volume, without errors"),
    ("Exaggeration", "how much larger than true errors are drawn; numbers stay true"),
    ("Colours", "the error, or its part along x, y or z, in the unit of the colour bar"),
    ("Error", "actual − nominal; a correction has the opposite sign"),
    ("Mean, P95, max", "of the length of the error over the whole working volume"),
)


def _found(query: str) -> list[Command]:
    words = query.lower().split()
    return [one for one in COMMANDS if all(word in one.label.lower() for word in words)]


class HelpDialog(Window):
    """All commands, found by their words; what the mouse does, and what is drawn."""

    name, title = "help", "Help"

    def body(self, picture: LivePicture) -> Markup:
        query, scene = picture.state.page.command, picture.state.scene
        words = "Find a command"
        box = text_box("state:set.page.command", query, label=words, placeholder=words, live=True,
                       data_enter="help:first", autofocus=True)  # fmt: skip
        found = join(
            tag("button", tag("kbd", one.spelt) + one.label, type="button", data_do="help:run",
                data_value=one.label)
            if ":" in one.event else tag("p", tag("kbd", one.spelt) + one.label)
            for one in _found(query)
        )  # fmt: skip
        about = " ".join(scene.description.split())
        return join((
            tag("div", box + tag("div", found, class_="ws-list ws-columns"), data_list=True),
            tag("h3", "Mouse and keyboard"), rows(FIRST_HELP, "ws-keys"),
            tag("h3", "What is drawn"), rows(MEANINGS, "ws-keys"),
            tag("p", "Keys act everywhere except in a text box. After a dropped connection the tab"
                " finds its state again for ten minutes.", class_="ws-quiet"),
            *((tag("h3", scene.title), tag("p", about)) if about else ()),
        ))  # fmt: skip

    def take(self, state: AppState, word: str, value: str) -> AppState:
        query = state.page.command
        found = [one for one in _found(query) if ":" in one.event]
        runs = found[: bool(query)] if word == "first" else [o for o in found if o.label == value]
        if word not in ("first", "run") or not runs:
            return state
        self.context.send(runs[0].event, runs[0].value)
        return self.closed(state)


class PagePanel(Panel):
    """What acts on the page as a whole: tasks, sections, windows, undo, redo, and all errors."""

    name = "page"
    refresh = Refresh.IMMEDIATE

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        context.page.call("keys", key_events())

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        # the part of a window that is open fills it
        return {} if picture.state.page.window else {"window": ""}

    def take(self, state: AppState, word: str, value: str) -> AppState:
        context = self.context
        actions: dict[str, Callable[[], None]] = {
            "undo": partial(self._travel, "Undone", context.store.undo),
            "redo": partial(self._travel, "Done again", context.store.redo),
            "fit": context.fit_view,
            "tour": partial(context.page.call, "tour", True),
            "close": context.closed,
        }
        if word in actions:
            context.act(actions[word])
        updates: dict[str, Callable[[], AppState]] = {
            "task": partial(put, state, "page.task", value),
            "fold": partial(toggled, state, "page.open", value),
            "open": partial(put, put(state, "page.command", ""), "page.window", value),
            **dict.fromkeys(("close", "tour"), partial(put, state, "page.window", "")),
            "include": partial(replace, state, exclusions=Exclusions()),
            "zero": state.zeroed,
            "reset": state.reset,
        }
        if word == "toggle" and isinstance(on := getattr(state.shown, value, None), bool):
            return replace(state, shown=replace(state.shown, **{value: not on}))
        return updates[word]() if word in updates else state

    def _travel(self, done: str, travel: Callable[[], str]) -> None:
        try:
            what = travel()
        except OptionError as error:
            self.context.notes.append(str(error))
            return
        words = f"{done}: {what}" if what else f"Nothing to be {done.lower()}"
        self.context.notify(words)
