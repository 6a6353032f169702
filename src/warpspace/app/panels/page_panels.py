"""The top bar, all commands with their keys, the tasks, and the list of all panels."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from textwrap import shorten

from markupsafe import Markup

from warpspace.analysis.registry import entries
from warpspace.app.browser import actions as do
from warpspace.app.browser.templates import Templates
from warpspace.app.drawing.player import EXAGGERATION
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import machine_editor, overlay
from warpspace.app.panels.analysis_panel import AnalysisPanel
from warpspace.app.panels.conventions import ConventionsSection
from warpspace.app.panels.design import AcceptancePanel, ConceptsPanel, TolerancesPanel
from warpspace.app.panels.error_list import ErrorsPanel
from warpspace.app.panels.explanation import DistancePanel, VolumePanel, WorstPanel
from warpspace.app.panels.file_dialogs import FilesDialog, ReportDialog, accepted_endings
from warpspace.app.panels.improve import AdjustPanel, BestPanel, CompensatePanel
from warpspace.app.panels.measurement import CalibratePanel, DiagnosePanel, TestsPanel
from warpspace.app.panels.note_panels import NoteNumbersPanel, NotesPanel, StoryPanel
from warpspace.app.panels.panel import Context, Dialog, Panel, Refresh, Section, on, with_section
from warpspace.app.panels.playback import PlaybackPanel
from warpspace.app.panels.upload_panels import ImportPanel, PartPanel, ProgramPanel
from warpspace.app.state.app_state import AppState, Exclusions
from warpspace.app.state.look import TASKS
from warpspace.app.state.tree import put, toggled
from warpspace.bench.base import bench_names, find_test
from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_UPLOAD_BYTES

HTML = Templates("page")
LONGEST_SENTENCE = 130


class TopPanel(Panel):
    """Scene, open, save, share, report, help; notes, undo and redo if there are any."""

    name = "top"

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        store, state = self.context.store, picture.state
        steps = (("Undo", "↶", store.undoes, "Ctrl+Z"), ("Redo", "↷", store.redoes, "Ctrl+Shift+Z"))
        count = sum(note.status == "open" for note in state.review)
        notes = f"Notes ({count})" if count else "Notes"
        return {"top": HTML.top(
            state.scene.title or state.scene.name, accepted_endings(), MAX_UPLOAD_BYTES,
            notes if state.review or state.page.notes else "", steps,
        )}  # fmt: skip


class ScenesDialog(Dialog):
    """The list of scenes: picture, title, machine, description."""

    name, title = "scenes", "Select a scene"

    def body(self, picture: LivePicture) -> Markup:
        bundled = {id(scene): scene.name for scene in self.context.scenes.fixed}
        return HTML.scenes(
            (title, bundled.get(id(scene), ""), scene.machine.title,
             shorten(re.split(r"\.\s", scene.description)[0].rstrip(" .\n"), LONGEST_SENTENCE,
                     placeholder=" …"), scene is picture.state.origin)
            for title, scene in self.context.scenes.items()
        )  # fmt: skip

    @on(do.Input.CHOOSE_SCENE)
    def choose(self, state: AppState, title: str) -> AppState | None:
        scene = self.context.scenes.get(title)
        if scene is None:
            return None
        # selecting the current scene resets it
        return self.closed(replace(state.with_scene(scene), page=state.page))


# --- Table of all commands, for the keys of the page and the help ---------------------------------


@dataclass(frozen=True, slots=True)
class Command:
    """A command of the help and the keyboard."""

    label: str
    action: do.AnyAction
    keys: tuple[str, ...] = ()  # in the notation of page.js, the most common one first
    search_terms: str = ""  # further words by which it is found

    @property
    def key_label(self) -> str:
        if not self.keys:
            return ""
        *modifiers, key = self.keys[0].split("+")
        return "+".join((*(word.capitalize() for word in modifiers), key.upper()))


# Keys that change the model need a modifier. viser's camera uses A S D Q E.
COMMANDS = (
    Command("Undo", do.Signal.UNDO, keys=("ctrl+z",)),
    Command("Redo", do.Signal.REDO, keys=("ctrl+shift+z", "ctrl+y")),
    Command("Open a file", do.Signal.CHOOSE_FILES, ("ctrl+o",)),
    Command("Select a scene", do.Input.OPEN_DIALOG("scenes")),
    Command("Save the scene", do.Signal.SAVE_SCENE, keys=("ctrl+s",)),
    Command("Save and export", do.Input.OPEN_DIALOG("files")),
    Command("Copy a link to this view", do.Share()),
    Command("Write a report", do.Input.OPEN_DIALOG("report")),
    Command("Play the story", do.Signal.START_STORY),
    Command("Pin a note", do.Input.PIN_NOTE(), keys=("n",)),
    Command("Notes", do.Signal.OPEN_NOTES),
    Command("Compare two scenes", do.Signal.OPEN_COMPARISON, (), "difference before after"),
    Command("Find an error", do.Signal.FIND_ERROR, keys=("/",)),
    Command("Fit the view", do.Signal.FIT_VIEW, keys=("f",)),
    Command("Component: magnitude of the error", do.SetLeaf("component", "norm"), ("1",)),
    Command("Component: along x", do.SetLeaf("component", "x"), ("2",)),
    Command("Component: along y", do.SetLeaf("component", "y"), ("3",)),
    Command("Component: along z", do.SetLeaf("component", "z"), ("4",)),
    Command("Exaggeration: automatic", do.SetLeaf("exaggeration", "auto"), ("x",)),
    Command("Exaggeration: true scale", do.SetLeaf("exaggeration", "1"), ("t",)),
    Command("Grid lines on or off", do.Input.TOGGLE_DISPLAY("grid_lines"), ("g",)),
    Command("Nominal box on or off", do.Input.TOGGLE_DISPLAY("ghost"), ("b",)),
    Command("Draw the volume", do.ShowDrawing("volume"), ("v",)),
    Command("Draw the rotary axes", do.ShowDrawing("rotary"), ("r",), "table traces"),
    Command("Play or pause", do.Input.PLAY(), ("p",), "table program animate"),
    Command("Play the exaggeration", do.Input.PLAY(EXAGGERATION), (), "true scale animate"),
    Command("Rotary traces on or off", do.Input.TOGGLE_DISPLAY("traces"), ("c",)),
    Command("Dark mode on or off", do.Input.TOGGLE_DISPLAY("dark"), ("m",)),
    Command("Set all errors to zero", do.Signal.ZERO_ERRORS, keys=("ctrl+alt+0",)),
    Command("Reset all errors to the scene", do.Signal.RESET_ERRORS, keys=("ctrl+alt+r",)),
    Command("Include all errors", do.Signal.INCLUDE_ERRORS, keys=("ctrl+alt+l",)),
    Command("Help and all commands", do.Input.OPEN_DIALOG("help"), ("ctrl+k", "h", "?", "shift+?")),
    Command("Show the hints", do.Signal.SHOW_HINTS, search_terms="first steps tour"),
)


def key_actions() -> Mapping[str, str]:
    return {key: str(command.action) for command in COMMANDS for key in command.keys}


IN_PAGE = do.Signal.FIND_ERROR, do.Signal.CHOOSE_FILES
"""Commands that a script of the page carries out."""


def _section_commands(sections: Iterable[Section]) -> Iterator[Command]:
    """List the commands that open a section of a task, or choose a standard test."""
    for section in sections:
        label = f"{TASKS[section.task]}: {section.title.lower()}"
        place, terms = (section.task, section.name), f"{section.name} {section.sentence}"
        yield Command(label, do.OpenSection(*place), search_terms=terms.lower())
    for test in map(find_test, bench_names()):
        label = f"Standard test: {test.title.lower()}"
        terms = f"{test.name} {test.standard} {test.description}"
        yield Command(label, do.Input.CHOOSE_TEST(test.name), search_terms=terms.lower())


class HelpDialog(Dialog):
    """All commands with a search box; mouse and keyboard; legend of the drawing."""

    name, title = "help", "Help"

    def __init__(self, context: Context, sections: Iterable[Section]) -> None:
        super().__init__(context)
        self.sections = tuple(sections)

    def _find_commands(self, query: str) -> list[Command]:
        """Find commands by all words of a query; sections and tests only by a query."""
        search_words = query.lower().split()
        commands = (*COMMANDS, *_section_commands(self.sections)) if search_words else COMMANDS

        def matches(text: str) -> bool:
            return all(word in text for word in search_words)

        matching = [c for c in commands if matches(f"{c.label.lower()} {c.search_terms}")]
        return sorted(matching, key=lambda command: not matches(command.label.lower()))

    def body(self, picture: LivePicture) -> Markup:
        query = picture.state.page.command
        return HTML.help(query, self._find_commands(query), IN_PAGE, picture.state.scene)

    @on(do.Input.RUN_COMMAND, do.Input.RUN_FIRST_COMMAND)
    def run(self, state: AppState, action: do.InputValue) -> AppState | None:
        """Run a command of the list, or the first one that a query finds."""
        is_first = action.input is do.Input.RUN_FIRST_COMMAND
        query = action.value if is_first else state.page.command
        commands = [c for c in self._find_commands(query) if c.action not in IN_PAGE]
        if not is_first:
            commands = [c for c in commands if c.label == action.value]
        if not commands or (is_first and not query):
            return None
        self.context.send(commands[0].action)
        return self.closed(state)


class PagePanel(Panel):
    """Actions of the whole page: any leaf of the state, sections, dialogs, undo, all errors."""

    name = "page"
    refresh = Refresh.IMMEDIATE

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        context.page.call("keys", key_actions())

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        # an open dialog renders its own content
        return {} if picture.state.page.window else {"window": ""}

    @on(do.SetLeaf)
    def set_leaf(self, state: AppState, action: do.SetLeaf) -> AppState:
        return put(state, action.path, action.value)

    @on(do.Signal.UNDO, do.Signal.REDO, later=True)
    def step(self, signal: do.Signal) -> None:
        is_undo, store = signal is do.Signal.UNDO, self.context.store
        try:
            description = store.undo() if is_undo else store.redo()
        except OptionError as error:
            self.context.notes.append(str(error))
            return
        done = f"{'Undone' if is_undo else 'Redone'}: {description}"
        self.context.notify(done if description else f"Nothing to {signal}")

    @on(do.Signal.CLOSE_DIALOG, do.Signal.SHOW_HINTS)
    def close_dialog(self, state: AppState, signal: do.Signal) -> AppState:
        show_hints = partial(self.context.page.call, "hints", True)
        is_close = signal is do.Signal.CLOSE_DIALOG
        self.context.call_soon(self.context.dialog_closed if is_close else show_hints)
        return put(state, "page.window", "")

    @on(do.Input.OPEN_DIALOG)
    def open_dialog(self, state: AppState, name: str) -> AppState:
        return put(put(state, "page.command", ""), "page.window", name)

    @on(do.Input.FOLD_SECTION)
    def fold_section(self, state: AppState, section: str) -> AppState:
        return toggled(state, "page.open", section)

    @on(do.OpenSection)
    def open_section(self, state: AppState, action: do.OpenSection) -> AppState:
        state = put(state, "page.task", action.task)
        return with_section(state, state.page.task, action.section)

    @on(do.Input.TOGGLE_DISPLAY)
    def toggle_display(self, state: AppState, option: str) -> AppState | None:
        is_on = getattr(state.shown, option, None)
        if not isinstance(is_on, bool):
            return None
        return replace(state, shown=replace(state.shown, **{option: not is_on}))

    @on(do.Signal.INCLUDE_ERRORS, do.Signal.ZERO_ERRORS, do.Signal.RESET_ERRORS)
    def set_all_errors(self, state: AppState, signal: do.Signal) -> AppState:
        if signal is do.Signal.INCLUDE_ERRORS:
            return replace(state, exclusions=Exclusions())
        return state.zeroed() if signal is do.Signal.ZERO_ERRORS else state.reset()


# --- The tasks, and all panels --------------------------------------------------------------------

PANELS: dict[str, type[AnalysisPanel]] = {
    "calibrate": CalibratePanel, "adjust": AdjustPanel, "compensate": CompensatePanel,
    "allocate": TolerancesPanel, "concepts": ConceptsPanel, "distance": DistancePanel,
    "part": PartPanel, "program": ProgramPanel, "acceptance": AcceptancePanel,
    "diagnose": DiagnosePanel,
}  # fmt: skip
"""Panels with features beyond the description of the analysis, by name of the analysis."""
FIRST = ("compensate", "concepts", "allocate")  # sections at the top of their task
RARE = frozenset({
    "volume", "gains", "line", "distance", "conformance", "uncertainty", "form", "convert",
    "contributions",
})  # fmt: skip
"""Sections under "More analyses"."""


class TasksPanel(Panel):
    """The column at the right: tabs of five tasks, each a list of sections."""

    name = "tasks"

    def __init__(self, context: Context, sections: Iterable[Section]) -> None:
        super().__init__(context)
        names = {section.name: section.task for section in sections}
        names = {name: names[name] for name in (*FIRST, *names)}
        self.sections = {
            task: [name for name, section_task in names.items() if section_task == task]
            for task in TASKS
        }

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        page = picture.state.page
        names = self.sections.get(page.task, ())
        rare = [name for name in names if name in RARE]
        is_open = not page.open.isdisjoint(rare)
        return {"tasks": HTML.tasks(page.task, TASKS, names, rare, is_open)}


def build_panels(context: Context) -> list[Panel]:
    kinds_before = (WorstPanel, VolumePanel, ImportPanel, TestsPanel)
    kinds_after = (machine_editor.PositionsSection, ConventionsSection,
                   machine_editor.RotarySection, machine_editor.EditorSection)  # fmt: skip
    sections: list[Section] = [
        *(kind(context) for kind in kinds_before),
        *(PANELS.get(entry.name, AnalysisPanel)(context, entry) for entry in entries()),
        *(kind(context) for kind in kinds_after),
    ]
    kinds = (
        TopPanel, overlay.HeadPanel, overlay.LegendPanel, overlay.OrderPanel,
        overlay.ControlsPanel, PlaybackPanel, overlay.ComparePanel, ErrorsPanel,
        overlay.OverlayPanel, PagePanel, NotesPanel, NoteNumbersPanel, ScenesDialog,
        machine_editor.MachinesDialog, FilesDialog, ReportDialog, StoryPanel,
    )  # fmt: skip
    panels = [kind(context) for kind in kinds]
    help_dialog, tasks = HelpDialog(context, sections), TasksPanel(context, sections)
    return [*panels, help_dialog, tasks, *sections, BestPanel(context)]
