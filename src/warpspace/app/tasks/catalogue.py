"""The parts that a page consists of, in the order in which they are written."""

from warpspace.app.tasks.analysis import sections
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.controls import ComparePart, ControlsPart
from warpspace.app.tasks.conventions import ConventionsSection
from warpspace.app.tasks.errors import ErrorsPart
from warpspace.app.tasks.files import FilesWindow, ReportWindow
from warpspace.app.tasks.importing import ImportSection, ImportWindow
from warpspace.app.tasks.improve import BestPart
from warpspace.app.tasks.machine import PositionsSection, RotarySection
from warpspace.app.tasks.machine_editor import EditorSection, MachinesWindow
from warpspace.app.tasks.measure import TestsPart
from warpspace.app.tasks.over import HeadPart, OrderPart, RoomPart
from warpspace.app.tasks.parts import Part
from warpspace.app.tasks.tasks import TASKS, TasksPart
from warpspace.app.tasks.top import HelpWindow, PagePart, ScenesWindow, StatePart, TopPart
from warpspace.app.tasks.understand import VolumePart, WorstPart

FIRST = ("compensate", "concepts", "allocate")
"""Sections that stand first in their task, short ones before long ones."""


def _place(name: str) -> int:
    return FIRST.index(name) if name in FIRST else len(FIRST)


def build_parts(context: Context) -> list[Part]:
    """Build the parts of a page."""
    machine = (PositionsSection, ConventionsSection, RotarySection, EditorSection)
    found = [WorstPart(context), VolumePart(context), TestsPart(context), *sections(context),
             *(section(context) for section in machine)]  # fmt: skip
    tasks = TasksPart(context)
    tasks.sections = {
        task: tuple(part.name for part in found if part.task == task) for task in TASKS
    }
    for task, names in tasks.sections.items():
        tasks.sections[task] = tuple(sorted(names, key=_place))
    tasks.sections["measure"] = (ImportSection.name, *tasks.sections["measure"])
    return [
        TopPart(context),
        HeadPart(context),
        OrderPart(context),
        ControlsPart(context),
        ComparePart(context),
        ErrorsPart(context),
        tasks,
        *found,
        BestPart(context),
        RoomPart(context),
        StatePart(context),
        PagePart(context),
        ScenesWindow(context),
        MachinesWindow(context),
        FilesWindow(context),
        ImportSection(context),
        ImportWindow(context),
        ReportWindow(context),
        HelpWindow(context),
    ]
