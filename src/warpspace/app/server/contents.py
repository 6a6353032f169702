"""What a page consists of, in the order it is built: what matters most first."""

from collections.abc import Callable, Sequence
from typing import TypeAlias

from warpspace.app.browser.accessible import access_script, access_style
from warpspace.app.browser.arrangement import split_script
from warpspace.app.browser.clicks import SCRIPT
from warpspace.app.browser.copying import COPY_SCRIPT
from warpspace.app.browser.page import style_script
from warpspace.app.browser.room import width_script
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import Panel, PanelContext
from warpspace.app.panels.commands import CommandsPanel
from warpspace.app.panels.error_curve import ErrorCurvePanel
from warpspace.app.panels.errors import ErrorsPanel
from warpspace.app.panels.room import RoomPanel
from warpspace.app.readouts.html import style_sheet
from warpspace.app.server.layout import Places
from warpspace.app.server.pointing import Pointing
from warpspace.app.server.tabs import Step, tabs
from warpspace.app.state.app_state import AppState
from warpspace.app.viewport.layers import Layer
from warpspace.app.viewport.layers.box import BoxLayer
from warpspace.app.viewport.layers.moving import MovingLayer, draw_around

ERROR_CURVE = "Error curve"
"""The tab below the sliders."""

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
        self._commands: CommandsPanel | None = None

    @property
    def steps(self) -> tuple[Build, ...]:
        """Builders in their order; what is seen at the start comes first."""
        return self._build_first, self._draw_around, self._build_front, self._build_behind

    def _build_first(self, picture: LivePicture) -> Built:
        """Build what a page cannot be without: the map, its sliders, numbers and heading."""
        context = self._context
        box = BoxLayer(context.client.scene, picture)
        context.page.run_script(width_script())
        context.page.run_script(SCRIPT)
        context.page.run_script(COPY_SCRIPT)
        context.page.run_script(style_script("readouts", style_sheet()))
        context.page.run_script(style_script("accessible", access_style()))
        room = RoomPanel(context)
        self._commands = commands = CommandsPanel(context, self._tab_names())
        self._errors = errors = ErrorsPanel(context, picture.state, self._expand_curve)
        return [box], [errors, commands, *self._build_tabs("first", picture.state), room]

    def _draw_around(self, picture: LivePicture) -> Built:
        """Draw what lies on and around the map."""
        client = self._context.client
        stage = self._context.stage = MovingLayer(client, picture, self._context.act)
        return [*draw_around(client.scene, picture), stage], []

    def _build_front(self, picture: LivePicture) -> Built:
        """Build the panels that are in front, and the other sliders."""
        context, state = self._context, picture.state
        if self._errors is not None:
            self._errors.add_axes(state)
        below = context.gui.add_panel()
        with below.add_tab("Error curve"):
            curve = ErrorCurvePanel(context, state)
        below.dock_below(context.gui.main_panel)
        self._expand = below.expand
        context.page.run_script(split_script())
        return [], [curve, *self._build_tabs("front", state)]

    def _build_behind(self, picture: LivePicture) -> Built:
        """Build the tabs behind the numbers and behind the view."""
        panels = self._build_tabs("behind", picture.state)
        Pointing(self._context)
        self._context.page.run_script(access_script())
        return [], panels

    def _build_tabs(self, step: Step, state: AppState) -> list[Panel]:
        """Build what stands in the tabs of a step."""
        panels: list[Panel] = []
        for tab in tabs():
            if tab.step == step and tab.name in self._places:
                with self._places.at(tab.name):
                    panels += [build(self._context, state) for build in tab.load()]
        return panels

    def _tab_names(self) -> tuple[str, ...]:
        """List the words on the tabs of the page."""
        return (ERROR_CURVE, *(tab.name for tab in tabs() if tab.name in self._places))

    def show_tour(self, *, asked: bool) -> None:
        """Show the tour if it was asked for, or if this is the browser's first visit."""
        if self._commands is not None:
            self._commands.show_tour(asked=asked)

    def _expand_curve(self) -> None:
        """Show the panel of one error, should it be minimized."""
        if self._expand is not None:
            self._expand()
