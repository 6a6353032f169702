"""The bar at the top, the scenes, and what all parts share: what is set, undone, opened, closed."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace

from markupsafe import Markup

from warpspace.app.browser.html import EMPTY, button, join, tag, upload_button
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.state.ranges import Exclusions
from warpspace.app.state.store import change_words
from warpspace.app.state.tree import put, toggled
from warpspace.app.tasks.commands import key_events
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.files import accepted_endings
from warpspace.app.tasks.parts import Part
from warpspace.app.tasks.window import Window
from warpspace.machine.limits import MAX_SCENE_BYTES

LONGEST_SENTENCE = 110


class StatePart(Part):
    """Sets a field of the state to what the page says: ``state:set.PATH``."""

    name = "state"

    def is_seen(self, state: AppState) -> bool:
        """Give no: it shows nothing itself."""
        return False

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Set it, within its range."""
        return put(state, word.removeprefix("set."), value)


class TopPart(Part):
    """Scene, open, save, share, report, help; undo and redo where there is something to undo."""

    name = "top"

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow the scene, and what can be undone."""
        history = self.context.store.history
        return (Identity(picture.state.origin), tuple(self.context.scenes), history.undoes,
                history.redoes)  # fmt: skip

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        """Write the bar."""
        history = self.context.store.history
        travel = (
            button(sign, f"page:{word.lower()}", kind="quiet", aria_label=word, data_key=word,
                   hint=f"{word}: {change_words(what)} ({keys})")
            for word, sign, what, keys in (("Undo", "↶", history.undoes, "Ctrl+Z"),
                                           ("Redo", "↷", history.redoes, "Ctrl+Shift+Z")) if what
        )  # fmt: skip
        hint = "Open a scene, measured errors, or a controller's table (Ctrl+O)"
        title = picture.state.origin.title or picture.state.origin.name
        return {
            "top": join((
                tag("strong", "warpspace", class_="ws-brand"),
                button(title, "page:open", "scenes", kind="ws-scene",
                       hint="Choose another scene"),
                upload_button("Open", "files", MAX_SCENE_BYTES, accepted_endings(), kind="quiet",
                              hint=hint),
                button("Save", "page:open", "files", kind="quiet",
                       hint="Save the scene, pictures, exports"),
                button("Share", "files:share", kind="quiet", hint="Copy a link to what is shown"),
                button("Report", "page:open", "report", kind="quiet"),
                tag("span", "", class_="ws-fill"),
                *travel,
                button("?", "page:open", "help", kind="quiet", aria_label="Help", hint="Help (H)"),
            ))
        }  # fmt: skip


class ScenesWindow(Window):
    """The scenes there are: title, machine, what each shows."""

    name, title = "scenes", "Choose a scene"

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow the list, and which one is shown."""
        return (Identity(picture.state.origin), tuple(self.context.scenes))

    def body(self, picture: LivePicture) -> Markup:
        """List them."""
        rows = (
            tag("button", join((
                tag("b", title),
                tag("small", scene.machine.title) if scene.machine.title != title else EMPTY,
                tag("small", _first_sentence(scene.description)) if scene.description else EMPTY,
            )), type="button", data_do="scenes:choose", data_value=title,
                aria_current="true" if scene is picture.state.origin else None)
            for title, scene in self.context.scenes.items()
        )  # fmt: skip
        words = "A file is opened with Open at the top, or dropped anywhere on the page."
        return tag("div", join(rows), class_="ws-list", data_list=True) + tag(
            "p", words, class_="ws-quiet"
        )

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Show another scene; what is chosen again is reset."""
        if word != "choose" or value not in self.context.scenes:
            return state
        return self.closed(replace(state.with_scene(self.context.scenes[value]), page=state.page))


def _first_sentence(text: str) -> str:
    found = " ".join(text.split()).split(". ", 1)[0].rstrip(".")
    if len(found) > LONGEST_SENTENCE:
        found = re.split(r":| \(", found, maxsplit=1)[0]
    return found if len(found) <= LONGEST_SENTENCE else f"{found[:LONGEST_SENTENCE]} …"


class PagePart(Part):
    """What acts on the page as a whole: tasks, sections, windows, undo, redo, and all errors."""

    name = "page"
    follows = "at once"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        context.page.tell(keys=key_events())

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow the window that is open."""
        return (picture.state.page.window,)

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        """Take the window away where none is open; its own part fills it."""
        return {} if picture.state.page.window else {"window": ""}

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Do it."""
        if word == "task":
            return put(state, "page.task", value)
        if word == "fold":
            return toggled(state, "page.open", value)
        if word == "open":
            return put(state, "page.window", value)
        if word == "close":
            self.context.act(self.context.closed)
            return put(state, "page.window", "")
        if word == "toggle" and isinstance(on := getattr(state.shown, value, None), bool):
            return replace(state, shown=replace(state.shown, **{value: not on}))
        if word == "include":
            return replace(state, exclusions=Exclusions())
        if word in ("zero", "reset"):
            return state.zeroed() if word == "zero" else state.reset()
        actions: dict[str, Callable[[], None]] = {
            "undo": self._undo,
            "redo": self._redo,
            "fit": self.context.fit_view,
            "tour": lambda: self.context.page.call("tour", True),
        }
        if word in actions:
            self.context.act(actions[word])
        if word == "tour":
            return put(state, "page.window", "")
        return state

    def _undo(self) -> None:
        self._say("Undone", self.context.store.undo())

    def _redo(self) -> None:
        self._say("Done again", self.context.store.redo())

    def _say(self, done: str, what: str) -> None:
        words = f"{done}: {change_words(what)}" if what else f"Nothing to be {done.lower()}"
        self.context.notify(words)
