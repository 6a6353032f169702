"""What a page consists of, in the order it is built: what matters most first."""

from collections.abc import Callable, Sequence
from typing import TypeAlias

from warpspace.app.browser.arrangement import split_script
from warpspace.app.browser.clicks import SCRIPT
from warpspace.app.browser.page import style_script
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import Panel, PanelContext
from warpspace.app.panels.appearance import CameraPanel, LooksPanel
from warpspace.app.panels.budget import WhyPanel
from warpspace.app.panels.commands import CommandsPanel
from warpspace.app.panels.compare import ComparePanel
from warpspace.app.panels.conventions import ConventionsPanel
from warpspace.app.panels.error_curve import ShapePanel
from warpspace.app.panels.errors import ErrorsPanel
from warpspace.app.panels.files import FilesPanel
from warpspace.app.panels.machine import MachinePanel
from warpspace.app.panels.rotary_axes import RotaryPanel
from warpspace.app.panels.sensitivities import GainsPanel
from warpspace.app.panels.summary import heading_panel, summary_panel
from warpspace.app.panels.tolerances import ChancePanel
from warpspace.app.panels.view import ViewPanel
from warpspace.app.readouts.html import style_sheet
from warpspace.app.server.layout import Places
from warpspace.app.server.pointing import Pointing
from warpspace.app.viewport.layers import Layer
from warpspace.app.viewport.layers.box import BoxLayer
from warpspace.app.viewport.layers.stage import StageLayer, draw_around

Built: TypeAlias = tuple[Sequence[Layer], Sequence[Panel]]
Build: TypeAlias = Callable[[LivePicture], Built]


class PageContents:
    """Layers and panels of one tab.

    Parameters
    ----------
    context : PanelContext
    places : Places
    """

    def __init__(self, context: PanelContext, places: Places) -> None:
        self._context, self._places = context, places
        self._errors: ErrorsPanel | None = None
        self._expand: Callable[[], None] | None = None
        self.stage: StageLayer | None = None

    @property
    def steps(self) -> tuple[Build, ...]:
        """Builders in their order; what is seen at the start comes first."""
        return self._build_first, self._draw_around, self._build_front, self._build_behind

    def _build_first(self, picture: LivePicture) -> Built:
        """Build what a page cannot be without: the map, its sliders, numbers and heading."""
        context = self._context
        box = BoxLayer(context.client.scene, picture)
        context.page.run_script(SCRIPT)
        context.page.run_script(style_script("readouts", style_sheet()))
        commands = CommandsPanel(context)
        self._errors = errors = ErrorsPanel(context, picture.state, self._expand_curve)
        with self._places.at("Result"):
            summary = summary_panel(context)
        with self._places.at("heading"):
            heading = heading_panel(context)
        return [box], [errors, commands, summary, heading]

    def _draw_around(self, picture: LivePicture) -> Built:
        """Draw what lies on and around the map."""
        client = self._context.client
        self.stage = StageLayer(client, picture, self._context.act)
        return [*draw_around(client.scene, picture), self.stage], []

    def _build_front(self, picture: LivePicture) -> Built:
        """Build the panels that are in front, and the other sliders."""
        context, state = self._context, picture.state
        if self._errors is not None:
            self._errors.add_axes(state)
        below = context.gui.add_panel()
        with below.add_tab("One error"):
            curve = ShapePanel(context, state)
        below.dock_below(context.gui.main_panel)
        self._expand = below.expand
        context.page.run_script(split_script())
        with self._places.at("View"):
            view = ViewPanel(context, state)
            looks = LooksPanel(context, state)
            camera = CameraPanel(context)
        return [], [curve, view, looks, camera]

    def _build_behind(self, picture: LivePicture) -> Built:
        """Build the tabs behind the numbers and behind the view."""
        context, state = self._context, picture.state
        with self._places.at("Why"):
            why = WhyPanel(context)
        with self._places.at("Gains"):
            gains = GainsPanel(context)
        with self._places.at("Compare"):
            compare = ComparePanel(context)
        with self._places.at("Files"):
            files = FilesPanel(context)
        with self._places.at("Machine"):
            machine = MachinePanel(context, state)
        with self._places.at("Table"):
            rotary = RotaryPanel(context, state, self.stage)
        with self._places.at("Chance"):
            chance = ChancePanel(context, state)
        with self._places.at("Conventions"):
            conventions = ConventionsPanel(context, state)
        Pointing(context, conventions)
        return [], [why, gains, compare, files, machine, rotary, chance, conventions]

    def _expand_curve(self) -> None:
        """Show the panel of one error, should it be minimized."""
        if self._expand is not None:
            self._expand()
