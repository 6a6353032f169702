"""What can be done by key, palette and button: undo, reset, view, tabs, help, tour."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from warpspace.app.browser.page import find_script, tab_script
from warpspace.app.browser.tour import tour_script, tour_stops
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext, Update
from warpspace.app.readouts.help import spell_help
from warpspace.app.state import edits
from warpspace.app.state.app_state import TRUE_SCALE, AppState
from warpspace.machine.axes import PARAMETERS
from warpspace.picture.words import spell_factor

# A S D Q E belong to viser's camera; W is taken from it, see browser/copying.py.
WORDS = {
    "amplitudes": "errors",
    "positions": "rotary position",
    "exaggeration": "exaggeration",
    "loop": "loop",
    "placed": "placement of the workpiece",
    "nodes": "grid density",
    "exclusions": "which errors are included",
    "rotary": "rotary traces",
    "bench": "test",
    "tolerances": "tolerance",
    "specification": "specification",
    "scene": "scene",
    "loaded": "scene",
    "left_behind": "scene",
    "controller": "table of compensation",
    "comparison": "comparison",
    "dark": "dark mode",
    "ghost": "nominal box",
    "grid_lines": "grid lines",
}


@dataclass(frozen=True, slots=True)
class Command:
    """One entry of the palette."""

    label: str
    description: str
    key: str | None  # hotkey
    modifier: str | None  # what is held with it, in viser's words
    run: Callable[[], None]  # called by the session's worker

    @property
    def keys(self) -> str:
        """Spell the keys for people; empty where there are none."""
        if self.key is None:
            return ""
        held = {"cmd/ctrl": "Ctrl", "shift": "Shift", "alt": "Alt"}
        parts = [held[part] for part in (self.modifier or "").split("+") if part]
        return " + ".join((*parts, self.key.capitalize() if len(self.key) > 1 else self.key))


class CommandsPanel:
    """Undo and redo buttons, the palette with its keys, help and tour."""

    def __init__(self, context: PanelContext, tabs: Sequence[str] = ()) -> None:
        self._context, self._tabs = context, tabs
        self._help: Any = None
        buttons = context.gui.add_button_group(
            "History",
            ("Undo", "Redo", "Help"),
            hint="Undo takes the latest change back (Ctrl+Z), Redo does it again (Ctrl+Shift+Z),"
            " Help lists all keys (H).",
        )
        actions = {"Undo": self._undo, "Redo": self._redo, "Help": self._toggle_help}
        buttons.on_click(lambda event: context.act(actions[event.target.value]))
        self.commands = self._commands()
        for command in self.commands:
            handle = context.gui.add_command(
                command.label,
                description=command.description,
                hotkey=command.key,  # pyright: ignore[reportArgumentType]
                modifier=command.modifier,  # pyright: ignore[reportArgumentType]
            )
            handle.on_trigger(lambda _, run=command.run: context.act(run))

    def _commands(self) -> tuple[Command, ...]:
        def does(update: Update) -> Callable[[], None]:
            return lambda: self._context.post(update)

        return (
            Command("Undo", "Take the latest change back", "Z", "cmd/ctrl", self._undo),
            Command("Redo", "Do it again", "Z", "cmd/ctrl+shift", self._redo),
            Command("Fit view", "Camera to the operator's side", "F", None, self._context.fit_view),
            Command("Reset errors", "Values of the scene", "R", None, does(AppState.reset)),
            Command("All errors zero", "The nominal machine", "0", None, does(AppState.zeroed)),
            Command(
                "Include all errors", "End only and exclude", "L", None, does(edits.include_all)
            ),
            Command(
                "Exaggeration: auto",
                "A round number that shows the error",
                "X",
                None,
                does(lambda state: state.with_exaggeration(None)),
            ),
            Command(
                "Exaggeration: ×1, true scale",
                "Errors drawn as large as they are",
                "T",
                None,
                does(lambda state: state.with_exaggeration(TRUE_SCALE)),
            ),
            *self._component_commands(),
            Command("Grid lines", "Show or hide", "G", None, does(_toggled("grid_lines"))),
            Command("Nominal box", "Show or hide", "B", None, does(_toggled("ghost"))),
            Command("Rotary traces", "Show or hide", "C", None, does(_toggled("traces"))),
            Command("Dark mode", "Dark or light page", "M", None, does(_toggled("dark"))),
            Command("Help", "All keys, and what is drawn", "H", None, self._toggle_help),
            Command("Tour", "Five steps: what there is", None, None, self.show_tour),
            Command("Find an error", "Cursor into the search box (/)", None, None, self._find),
            *(
                Command(f"Tab: {name}", "Open this tab", None, None, partial(self._open, name))
                for name in self._tabs
            ),
        )

    def _component_commands(self) -> tuple[Command, ...]:
        def coloured(component: str) -> Callable[[], None]:
            return lambda: self._context.post(lambda state: state.with_component(component))

        return (
            Command("Component: length", "Of the error, or the tilt", "1", None, coloured("norm")),
            *(
                Command(
                    f"Component: {name}",
                    f"Colours show the error along {name}, or the tilt about {name}",
                    key,
                    None,
                    coloured(name),
                )
                for key, name in zip("234", "xyz", strict=True)
            ),
        )

    def _find(self) -> None:
        self._context.page.run_script(find_script())

    def _open(self, tab: str) -> None:
        self._context.page.run_script(tab_script(tab))

    def _undo(self) -> None:
        self._say("Undone", self._context.store.undo())

    def _redo(self) -> None:
        self._say("Done again", self._context.store.redo())

    def _say(self, done: str, what: str) -> None:
        if what:
            self._context.notify(f"{done}: {spell_change(what)}", "", "gray")
        else:
            self._context.notify(f"Nothing to be {done.lower()}", "", "gray")

    def _toggle_help(self) -> None:
        opened, self._help = self._help, None
        if opened is not None:
            opened.close()
            return
        gui, state = self._context.gui, self._context.store.state
        self._help = gui.add_modal("Keys and help")
        with self._help:
            tour = gui.add_button(
                "Take the tour", color="gray", hint="Five steps: what there is, and how it is used."
            )
            tour.on_click(lambda _: self._context.act(self.show_tour))
            gui.add_html(help_text(self.commands, state.scene.title, state.scene.description))
            close = gui.add_button("Close", hint="Close this window; H and Esc do the same.")
            close.on_click(lambda _: self._context.act(self._toggle_help))

    def show_tour(self, *, asked: bool = True) -> None:
        """Show the tour of what is drawn."""
        if self._help is not None:
            self._toggle_help()
        shown, scene = self._context.shown, self._context.store.state.scene
        factor = "" if shown is None else spell_factor(shown.exaggeration)
        stops = tour_stops(scene.title, scene.description, factor)
        self._context.page.run_script(tour_script(stops, asked=asked))

    def read(self, state: AppState) -> AppState:
        """Nothing to take over."""
        return state

    def show(self, picture: LivePicture) -> None:
        """Nothing to show."""


def _toggled(name: str) -> Update:
    return lambda state: state.with_shown(**{name: not getattr(state.shown, name)})


def spell_change(what: str) -> str:
    """Say in words what `describe_change` has found."""
    words: list[str] = []
    paths = what.split(", ")
    parts_of_machine = ("scene.model.machine", "scene.workspace")
    if "scene.name" not in paths and any(path.startswith(parts_of_machine) for path in paths):
        return "machine"
    if "controller" in paths:
        return WORDS["controller"]  # what it is compared with has changed with it
    for path in paths:
        parts = [part.lstrip("+-") for part in path.split(".")]
        name = next((part for part in reversed(parts) if part in PARAMETERS), "")
        place = WORDS.get(parts[0], parts[-1].replace("_", " "))
        word = PARAMETERS[name].name if name and parts[0] != "scene" else place
        if parts[0] == "positions" and len(parts) > 1:
            word = f"position of {parts[1]}"
        elif parts[0] == "shown":
            word = WORDS.get(parts[-1], parts[-1].replace("_", " "))
        elif parts[0] == "exclusions" and name:
            word = f"{'only' if parts[1] == 'only' else 'exclusion of'} {word}"
        words.append(f"tolerance of {word}" if parts[0] == "tolerances" and name else word)
    unique = list(dict.fromkeys(words))
    if "scene" in unique:
        errors = [parts for parts in unique if parts in {row.name for row in PARAMETERS.values()}]
        unique = errors if len(errors) == 1 else ["scene"]
    return unique[0] if len(unique) == 1 else f"{unique[0]} and {len(unique) - 1} more"


def help_text(commands: Sequence[Command], title: str = "", description: str = "") -> str:
    """Write the help: what is drawn, what the mouse does, and all keys."""
    keys = [(command.keys, command.label, command.description) for command in commands]
    return spell_help([key for key in keys if key[0]], title, description)
