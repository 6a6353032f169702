"""All commands with their keys, in one table: the page's keys, the palette, and the help."""

from collections.abc import Mapping
from dataclasses import dataclass

from markupsafe import Markup

from warpspace.app.browser.html import attributes, button, fill, join, rows, tag
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.window import Window, actions


@dataclass(frozen=True, slots=True)
class Command:
    """Something that a key or the palette does: an event of the page, with its value."""

    label: str
    event: str
    value: str = ""
    keys: tuple[str, ...] = ()  # as page.js spells them, the usual one first
    in_palette: bool = True

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
    Command("Open a file", "upload", "files", ("ctrl+o",), in_palette=False),
    Command("Choose a scene", "page:open", "scenes"),
    Command("Save the scene", "files:save", keys=("ctrl+s",)),
    Command("Save and export", "page:open", "files"),
    Command("Copy a link to what is shown", "files:share"),
    Command("Write a report", "page:open", "report"),
    Command("Find an error", "find", keys=("/",), in_palette=False),
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
    Command("All commands", "page:open", "palette", ("ctrl+k",), in_palette=False),
    Command("Help", "page:open", "help", ("h", "?", "shift+?")),
    Command("First steps", "page:tour"),
)


def key_events() -> Mapping[str, str]:
    """Give the event, and its value, that the page sends for each key."""
    return {
        key: f"{one.event}={one.value}" if one.value else one.event
        for one in COMMANDS
        for key in one.keys
    }


class PaletteWindow(Window):
    """All commands by their words."""

    name, title = "palette", "All commands"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._query = ""

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow what is typed."""
        return (self._query,)

    def is_seen(self, state: AppState) -> bool:
        """Only while it is open; closed, it forgets what was typed."""
        if not super().is_seen(state):
            self._query = ""
        return super().is_seen(state)

    def _found(self) -> list[Command]:
        words = self._query.lower().split()
        return [
            one for one in COMMANDS
            if one.in_palette and all(word in one.label.lower() for word in words)
        ]  # fmt: skip

    def body(self, picture: LivePicture) -> Markup:
        """Give the box and the commands that have its words."""
        box = fill("<input{rest}>", rest=attributes(
            type="text", id="ws-palette", class_="ws-box", value=self._query, autocomplete="off",
            data_live="palette:find", data_set="palette:find", data_enter="palette:first",
            aria_label="Find a command", placeholder="Find a command", autofocus=True,
        ))  # fmt: skip
        found = join(
            tag("button", tag("kbd", one.spelt) + one.label, type="button", data_do="palette:run",
                data_value=one.label)
            for one in self._found()
        )  # fmt: skip
        return tag("div", box + tag("div", found, class_="ws-list"), data_list=True)

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Find commands, or run one."""
        if word == "find":
            self._query = value[:80]
            self.context.act(lambda: self.context.renew(self))
            return state
        label = next((one.label for one in self._found()), "") if word == "first" else value
        command = next((one for one in COMMANDS if one.label == label), None)
        if command is None:
            return state
        self._query = ""
        self.context.send(command.event, command.value)
        return self.closed(state)


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


class HelpWindow(Window):
    """What is drawn, what the mouse does, all keys."""

    name, title = "help", "Help"

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow the scene, of which it says something."""
        return (picture.state.scene.title, picture.state.scene.description)

    def body(self, picture: LivePicture) -> Markup:
        """Write it."""
        scene = picture.state.scene
        keys = ((tag("kbd", one.spelt), one.label) for one in COMMANDS if one.keys)
        about = " ".join(scene.description.split())
        return join((
            actions(button("First steps", "page:tour"),
                    button("All commands", "page:open", "palette", hint="Ctrl+K")),
            tag("h3", "Mouse and keyboard"), rows(FIRST_HELP, "ws-keys"),
            tag("h3", "What is drawn"), rows(MEANINGS, "ws-keys"),
            tag("h3", "Keys"), rows(((label, key) for key, label in keys), "ws-keys"),
            tag("p", "Keys act everywhere except in a text box. After a dropped connection the tab"
                " finds its state again for ten minutes.", class_="ws-quiet"),
            *((tag("h3", scene.title), tag("p", about)) if about else ()),
        ))  # fmt: skip
