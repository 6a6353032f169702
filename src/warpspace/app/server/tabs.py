"""The tabs of the page: one entry here, and one module with a panel for it."""

import threading
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import Literal

from viser import GuiApi, GuiTabHandle

from warpspace.app.browser.room import NARROW_PX, column_widths
from warpspace.app.panels import Panel, PanelContext
from warpspace.app.state.app_state import AppState
from warpspace.exceptions import OptionError
from warpspace.plugins import load_plugins

Place = Literal["results", "settings"]
Step = Literal["first", "front", "behind"]
Build = Callable[[PanelContext, AppState], Panel]


@dataclass(frozen=True, slots=True)
class Tab:
    """A tab of the page."""

    name: str  # the word on it
    place: Place  # which of the two groups at the right it stands in: "results" or "settings"
    # what stands in it, one panel below the other: ``"module:Class"``, imported when the first page
    # is built, or callables that take context and state
    build: Sequence[str | Build]
    # when it is built: "first" with the map, "front" for what is seen at the start, else "behind"
    step: Step = "behind"

    def load(self) -> list[Build]:
        """Give what builds its panels."""
        return [resolve_name(build) if isinstance(build, str) else build for build in self.build]


_HERE = "warpspace.app.panels"
_NOTE = f"{_HERE}.summary:TableNote"
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


# --- Where the panels stand: errors on the left, colour bar and view on the right -----------------
# The places are the server's, the same for every tab, and on their way as soon as a page connects;
# what stands in them belongs to each tab.

BRAND = (38, 70, 112)
BRAND_ON_DARK = (122, 162, 214)


def apply_theme(gui: GuiApi, *, dark: bool) -> None:
    """Set the colours of the page."""
    gui.configure_theme(
        dark_mode=dark,
        show_logo=False,
        show_share_button=False,
        brand_color=BRAND_ON_DARK if dark else BRAND,
    )


class Places:
    """Where a tab puts its panels."""

    def __init__(self, tabs: Mapping[str, GuiTabHandle], *, dark: bool) -> None:
        self._tabs = dict(tabs)
        self.dark = dark
        self._lock = threading.Lock()

    def __contains__(self, name: str) -> bool:
        """Tell whether there is a tab of a name."""
        return name in self._tabs

    @contextmanager
    def at(self, name: str) -> Generator[None]:
        """Build within a tab; pages that open at once take turns, as viser's handles want it."""
        with self._lock, self._tabs[name]:
            yield


def lay_out(gui: GuiApi, *, dark: bool) -> Places:
    """Divide the page, for all tabs of a server."""
    apply_theme(gui, dark=dark)
    gui.set_panel_label("Errors")
    gui.main_panel.dock_left()
    left, right = column_widths(NARROW_PX)  # a page that is narrower or wider changes them
    gui.main_panel.set_width(left)

    results, settings = gui.add_panel(), gui.add_panel()
    groups = {"results": results, "settings": settings}
    handles = {tab.name: groups[tab.place].add_tab(tab.name) for tab in tabs()}
    results.dock_right()
    results.set_width(right)
    settings.dock_below(results)
    return Places(handles, dark=dark)
