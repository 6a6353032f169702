"""The column at the right: five tasks, one open, each a list of sections that unfold."""

from collections.abc import Mapping

from markupsafe import Markup

from warpspace.app.browser.html import join, tag
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import TASKS
from warpspace.app.tasks.parts import Part

RARE = frozenset({"volume", "gains", "line", "reach", "certify", "convert", "contributions"})
"""Sections that stand under "More analyses", so that a task is calm at first sight."""


class TasksPart(Part):
    """The tasks, and the places of the sections of the one that is open."""

    name = "tasks"
    sections: dict[str, tuple[str, ...]]

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow the task that is open."""
        return (picture.state.page.task,)

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
        places = join(_place(name) for name in names if name not in RARE)
        if rare := join(_place(name) for name in names if name in RARE):
            places += tag("details", tag("summary", "More analyses") + rare, class_="ws-more",
                          data_key=f"more.{task}")  # fmt: skip
        return {
            "tasks": tag("h2", "Tasks", class_="ws-heard")
            + tag("div", tabs, role="tablist", aria_label="Tasks", class_="ws-tabs")
            + tag("div", places, id="ws-task", role="tabpanel", aria_labelledby=f"ws-task-{task}",
                  data_key=f"task-{task}")
        }  # fmt: skip


def _place(name: str) -> Markup:
    return tag("div", "", data_piece=f"section.{name}")
