"""The tabs of the page: one entry here, and one module with a panel for it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import Literal

from warpspace.app.panels import Panel, PanelContext
from warpspace.app.state.app_state import AppState
from warpspace.exceptions import OptionError
from warpspace.plugins import load_plugins

Place = Literal["results", "settings"]
Step = Literal["first", "front", "behind"]
Build = Callable[[PanelContext, AppState], Panel]


@dataclass(frozen=True, slots=True)
class Tab:
    """A tab of the page.

    Attributes
    ----------
    name : str
        The word on it.
    place : str
        Which of the two groups at the right it stands in: "results" or "settings".
    build : sequence of str or callable
        What stands in it, one panel below the other: ``"module:Class"``, imported when the first
        page is built, or callables that take context and state.
    step : str
        When it is built: "first" with the map, "front" for what is seen at the start, else
        "behind".
    """

    name: str
    place: Place
    build: Sequence[str | Build]
    step: Step = "behind"

    def load(self) -> list[Build]:
        """Give what builds its panels."""
        return [resolve_name(build) if isinstance(build, str) else build for build in self.build]


_HERE = "warpspace.app.panels"
_NOTE = f"{_HERE}.table_note:TableNote"
"""Heads the tabs whose numbers a table of compensation, with which the box is drawn, leaves out."""
_TABS: dict[str, Tab] = {}


def register_tab(tab: Tab) -> None:
    """Add a tab behind those of its group; pages of servers started from now on have it."""
    if tab.name in _TABS:
        raise OptionError(f"a tab {tab.name!r} is there already")
    _TABS[tab.name] = tab


def unregister_tab(name: str) -> None:
    """Take a tab away again."""
    del _TABS[name]


def tabs() -> tuple[Tab, ...]:
    """List the tabs, group by group in their order."""
    load_plugins()
    return tuple(_TABS.values())


for _tab in (
    Tab("Volumetric error", "results", [f"{_HERE}.summary:summary_panel"], "first"),
    Tab("Error budget", "results", [_NOTE, f"{_HERE}.budget:BudgetPanel"]),
    Tab("Repair", "results", [_NOTE, f"{_HERE}.repair:RepairPanel"]),
    Tab("Sensitivities", "results", [_NOTE, f"{_HERE}.sensitivities:SensitivitiesPanel"]),
    Tab("Tests", "results", [_NOTE, f"{_HERE}.bench:TestsPanel"]),
    Tab("Compare", "results", [f"{_HERE}.compare:ComparePanel"]),
    Tab("Calibrate", "results", [_NOTE, f"{_HERE}.calibrate:CalibratePanel"]),
    Tab("Files", "results", [f"{_HERE}.files:FilesPanel"]),
    Tab(
        "View",
        "settings",
        [
            f"{_HERE}.view:ViewPanel",
            f"{_HERE}.appearance:AppearancePanel",
            f"{_HERE}.appearance:CameraPanel",
        ],
        "front",
    ),
    Tab("Machine", "settings", [_NOTE, f"{_HERE}.machine:MachinePanel"]),
    Tab("Machine editor", "settings", [f"{_HERE}.machine_editor:MachineEditorPanel"]),
    Tab("Rotary axes", "settings", [_NOTE, f"{_HERE}.rotary_axes:RotaryAxesPanel"]),
    Tab("Tolerances", "settings", [_NOTE, f"{_HERE}.tolerances:TolerancesPanel"]),
    Tab("Compensate", "settings", [f"{_HERE}.compensate:CompensatePanel"]),
    Tab("Concepts", "settings", [_NOTE, f"{_HERE}.concepts:ConceptsPanel"]),
    Tab("Conventions", "settings", [_NOTE, f"{_HERE}.conventions:ConventionsPanel"]),
):
    register_tab(_tab)
