"""The parts that a page consists of, in the order in which they are written."""

from collections.abc import Iterable, Mapping

from markupsafe import Markup

from warpspace.analysis.registry import entries
from warpspace.app.browser.html import join, tag
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.analysis_panel import AnalysisPart
from warpspace.app.panels.conventions import ConventionsSection
from warpspace.app.panels.design import ConceptsPart, TolerancesPart
from warpspace.app.panels.error_list import ErrorsPart
from warpspace.app.panels.explanation import DistancePart, VolumePart, WorstPart
from warpspace.app.panels.file_dialogs import FilesWindow, ReportWindow
from warpspace.app.panels.import_panel import ImportPart
from warpspace.app.panels.improve import BestPart, CompensatePart, RepairPart
from warpspace.app.panels.machine_editor import (
    EditorSection,
    MachinesWindow,
    PositionsSection,
    RotarySection,
)
from warpspace.app.panels.measurement import CalibratePart, TestsPart
from warpspace.app.panels.note_panels import NoteNumbersPart, NotesPart, StoryPart
from warpspace.app.panels.overlay import HeadPart, LegendPart, OrderPart, RoomPart
from warpspace.app.panels.panel import Context, Panel, Section
from warpspace.app.panels.part_panels import PartPart, ProgramPart
from warpspace.app.panels.toolbar import ComparePart, ControlsPart
from warpspace.app.panels.top_bar import HelpWindow, PagePart, ScenesWindow, StatePart, TopPart
from warpspace.app.state.app_state import TASKS

HOOKS: dict[str, type[AnalysisPart]] = {
    "calibrate": CalibratePart, "repair": RepairPart, "compensate": CompensatePart,
    "allocate": TolerancesPart, "concepts": ConceptsPart, "distance": DistancePart,
    "part": PartPart, "program": ProgramPart,
}  # fmt: skip
"""Parts of analyses that do more than their description says, by name."""
FIRST = ("compensate", "concepts", "allocate")
"""Sections that stand first in their task, short ones before long ones."""
RARE = frozenset(
    {"volume", "gains", "line", "distance", "reach", "trust", "certify", "convert", "contributions"}
)
"""Sections that stand under "More analyses", so that a task is calm at first sight."""


class TasksPart(Panel):
    """The column at the right: five tasks, one open, each a list of sections that unfold."""

    name = "tasks"

    def __init__(self, context: Context, found: Iterable[Section]) -> None:
        super().__init__(context)
        names = {one.name: one.task for one in found}
        names = {name: names[name] for name in (*FIRST, *names)}
        self.sections = {task: [name for name, of in names.items() if of == task] for task in TASKS}

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        """Write the tabs, and an empty place for each section."""
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
        if rare := _places(name for name in names if name in RARE):
            places += tag("details", tag("summary", "More analyses") + rare, class_="ws-more",
                          data_key=f"more.{task}")  # fmt: skip
        return {
            "tasks": tag("h2", "Tasks", class_="ws-heard")
            + tag("div", tabs, role="tablist", aria_label="Tasks", class_="ws-tabs")
            + tag("div", places, id="ws-task", role="tabpanel", aria_labelledby=f"ws-task-{task}",
                  data_key=f"task-{task}")
        }  # fmt: skip


def _places(names: Iterable[str]) -> Markup:
    return join(tag("div", "", data_piece=f"section.{name}") for name in names)


def build_parts(context: Context) -> list[Panel]:
    of_tasks = (WorstPart, VolumePart, ImportPart, TestsPart)
    of_machine = (PositionsSection, ConventionsSection, RotarySection, EditorSection)
    found: list[Section] = [
        *(kind(context) for kind in of_tasks),
        *(HOOKS.get(one.name, AnalysisPart)(context, one) for one in entries()),
        *(kind(context) for kind in of_machine),
    ]
    kinds = (
        TopPart, HeadPart, LegendPart, OrderPart, ControlsPart, ComparePart, ErrorsPart, RoomPart,
        StatePart, PagePart, NotesPart, NoteNumbersPart, ScenesWindow, MachinesWindow,
        FilesWindow, ReportWindow, HelpWindow, StoryPart,
    )  # fmt: skip
    others = [kind(context) for kind in kinds]
    return [*others, TasksPart(context, found), *found, BestPart(context)]
