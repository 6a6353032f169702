"""The panels of the page, in the order of rendering."""

from collections.abc import Iterable, Mapping

from markupsafe import Markup

from warpspace.analysis.registry import entries
from warpspace.app.browser.html import join, tag
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import machine_editor
from warpspace.app.panels.analysis_panel import AnalysisPanel
from warpspace.app.panels.conventions import ConventionsSection
from warpspace.app.panels.design import ConceptsPanel, TolerancesPanel
from warpspace.app.panels.error_list import ErrorsPanel
from warpspace.app.panels.explanation import DistancePanel, VolumePanel, WorstPanel
from warpspace.app.panels.file_dialogs import FilesDialog, ReportDialog
from warpspace.app.panels.import_panel import ImportPanel
from warpspace.app.panels.improve import AdjustPanel, BestPanel, CompensatePanel
from warpspace.app.panels.measurement import CalibratePanel, TestsPanel
from warpspace.app.panels.note_panels import NoteNumbersPanel, NotesPanel, StoryPanel
from warpspace.app.panels.overlay import HeadPanel, LegendPanel, OrderPanel, OverlayPanel
from warpspace.app.panels.panel import Context, Panel, Section, details
from warpspace.app.panels.part_panels import PartPanel, ProgramPanel
from warpspace.app.panels.toolbar import ComparePanel, ControlsPanel
from warpspace.app.panels.top_bar import HelpDialog, PagePanel, ScenesDialog, StatePanel, TopPanel
from warpspace.app.state.app_state import TASKS

PANELS: dict[str, type[AnalysisPanel]] = {
    "calibrate": CalibratePanel, "adjust": AdjustPanel, "compensate": CompensatePanel,
    "allocate": TolerancesPanel, "concepts": ConceptsPanel, "distance": DistancePanel,
    "part": PartPanel, "program": ProgramPanel,
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
        """Render the tabs, and an empty place for each section."""
        task = picture.state.page.task
        tabs = join(
            tag(
                "span", words, role="tab", id=f"ws-task-{name}", class_="ws-tab",
                data_do="page:task", data_value=name, tabindex=0 if name == task else -1,
                aria_selected=str(name == task).lower(), aria_controls="ws-task",
            )
            for name, words in TASKS.items()
        )  # fmt: skip
        names = self.sections.get(task, ())
        places = _places(name for name in names if name not in RARE)
        rare = _places(name for name in names if name in RARE)
        if rare:
            places += details("More analyses", rare, kind="more", data_key=f"more.{task}")
        return {
            "tasks": tag("h2", "Tasks", class_="ws-heard")
            + tag("div", tabs, role="tablist", aria_label="Tasks", class_="ws-tabs")
            + tag("div", places, id="ws-task", role="tabpanel", aria_labelledby=f"ws-task-{task}",
                  data_key=f"task-{task}")
        }  # fmt: skip


def _places(names: Iterable[str]) -> Markup:
    return join(tag("div", "", data_piece=f"section.{name}") for name in names)


def build_panels(context: Context) -> list[Panel]:
    of_tasks = (WorstPanel, VolumePanel, ImportPanel, TestsPanel)
    of_machine = (
        machine_editor.PositionsSection,
        ConventionsSection,
        machine_editor.RotarySection,
        machine_editor.EditorSection,
    )
    sections: list[Section] = [
        *(kind(context) for kind in of_tasks),
        *(PANELS.get(entry.name, AnalysisPanel)(context, entry) for entry in entries()),
        *(kind(context) for kind in of_machine),
    ]
    kinds = (
        TopPanel, HeadPanel, LegendPanel, OrderPanel, ControlsPanel, ComparePanel, ErrorsPanel,
        OverlayPanel, StatePanel, PagePanel, NotesPanel, NoteNumbersPanel, ScenesDialog,
        machine_editor.MachinesDialog, FilesDialog, ReportDialog, HelpDialog, StoryPanel,
    )  # fmt: skip
    panels = [kind(context) for kind in kinds]
    return [*panels, TasksPanel(context, sections), *sections, BestPanel(context)]
