"""What stands in the places of a page, built step by step, the most important first."""

from collections.abc import Callable, Sequence

from warpspace.app.browser.clicks import SCRIPT
from warpspace.app.browser.page import style_script
from warpspace.app.panels import Panel, PanelContext
from warpspace.app.panels.appearance import CameraPanel, Choose, LooksPanel
from warpspace.app.panels.budget import WhyPanel
from warpspace.app.panels.commands import CommandsPanel
from warpspace.app.panels.compare import ComparePanel
from warpspace.app.panels.conventions import ConventionsPanel
from warpspace.app.panels.error_curve import ShapePanel
from warpspace.app.panels.errors import ErrorsPanel
from warpspace.app.panels.files import FilesPanel
from warpspace.app.panels.layout import Places, split_script
from warpspace.app.panels.machine import MachinePanel
from warpspace.app.panels.rotary_axes import Play, RotaryPanel
from warpspace.app.panels.sensitivities import GainsPanel
from warpspace.app.panels.summary import heading_panel, summary_panel
from warpspace.app.panels.tolerances import ChancePanel
from warpspace.app.panels.view import ViewPanel
from warpspace.app.readouts.html import style_sheet
from warpspace.app.server.pointing import Pointing
from warpspace.app.server.tab_context import TabContext
from warpspace.app.state.app_state import AppState

Build = Callable[[AppState], Sequence[Panel]]


class PanelBuilder:
    """The panels of one tab.

    Parameters
    ----------
    context : PanelContext
    tab : TabContext
        Camera, page and files of the tab.
    places : Places
    fit_view : callable
        Puts the camera to a named view, or changes its lens.
    play : callable
        Turns the table.
    """

    def __init__(
        self, context: PanelContext, tab: TabContext, places: Places, fit_view: Choose, play: Play
    ) -> None:
        self._context, self._tab, self._places = context, tab, places
        self._fit_view, self._play = fit_view, play
        self._errors: ErrorsPanel | None = None
        self._shape: ShapePanel | None = None
        self._wanted = ""
        self._expand: Callable[[], None] = lambda: None

    def build_first(self, state: AppState) -> Sequence[Panel]:
        """Build what a page cannot be without: sliders, numbers, heading."""
        self._tab.run_script(SCRIPT)
        self._tab.run_script(style_script("readouts", style_sheet()))
        commands = CommandsPanel(self._context, lambda: self._fit_view(None, None))
        self._errors = errors = ErrorsPanel(self._context, state, self._choose, self._open_curve)
        with self._places.at("Result"):
            summary = summary_panel(self._context)
        with self._places.at("heading"):
            heading = heading_panel(self._context)
        return [errors, commands, summary, heading]

    def others(self) -> tuple[Build, ...]:
        """Give what builds all else, in this order; what is seen at the start comes first."""
        return (self._build_seen, self._build_behind)

    def _choose(self, key: str) -> None:
        """Show the curve of an error, as soon as there is a panel for it."""
        self._wanted = key
        if self._shape is not None:
            self._shape.choose(key)

    def _open_curve(self, key: str) -> None:
        """Show the curve of an error, should its panel be minimized."""
        self._choose(key)
        self._expand()

    def _build_seen(self, state: AppState) -> Sequence[Panel]:
        """Build what is in front, and the other sliders."""
        if self._errors is not None:
            self._errors.add_axes(state)
        gui = self._context.gui
        curve = gui.add_panel()
        with curve.add_tab("One error"):
            self._shape = ShapePanel(self._context, state)
        if self._wanted:
            self._shape.choose(self._wanted)
        curve.dock_below(gui.main_panel)
        self._tab.run_script(split_script())
        self._expand = curve.expand
        with self._places.at("View"):
            view = ViewPanel(self._context, state, self._tab.scenes)
            looks = LooksPanel(self._context, state)
            camera = CameraPanel(self._context, self._fit_view)
        return [self._shape, view, looks, camera]

    def _build_behind(self, state: AppState) -> Sequence[Panel]:
        """Build the tabs behind the numbers and behind the view."""
        with self._places.at("Why"):
            why = WhyPanel(self._context, self._tab)
        with self._places.at("Gains"):
            gains = GainsPanel(self._context)
        with self._places.at("Compare"):
            compare = ComparePanel(self._context, self._tab.scenes)
        with self._places.at("Files"):
            files = FilesPanel(self._context, self._tab)
        with self._places.at("Machine"):
            machine = MachinePanel(self._context, state)
        with self._places.at("Table"):
            rotary = RotaryPanel(self._context, state, self._play)
        with self._places.at("Chance"):
            chance = ChancePanel(self._context, state)
        with self._places.at("Conventions"):
            conventions = ConventionsPanel(self._context, state)
        Pointing(self._tab, self._context, conventions)
        return [why, gains, compare, files, machine, rotary, chance, conventions]
