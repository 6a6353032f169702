"""How the page of a tab comes to be: what matters most first, all else while it is in use.

A page draws what it gets in one go before it answers anybody, and two hundred widgets take it
nearly a second. The map and the first sliders are sent first; every further step when the page has
drawn the one before, so that a hand at a slider is not kept waiting for long.
"""

import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

from warpspace.app.browser.clicks import SCRIPT
from warpspace.app.browser.page import (
    COPY_SCRIPT,
    access_script,
    access_style,
    drawn_script,
    front_script,
    split_script,
    stage_script,
    style_script,
)
from warpspace.app.browser.room import width_script
from warpspace.app.browser.viser_private import dom_id
from warpspace.app.evaluation.budget import pick, with_picked
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import Panel, PanelContext
from warpspace.app.panels.commands import CommandsPanel
from warpspace.app.panels.error_curve import ErrorCurvePanel
from warpspace.app.panels.errors import ErrorsPanel
from warpspace.app.panels.room import RoomPanel
from warpspace.app.readouts.html import style_sheet
from warpspace.app.server.display import Display
from warpspace.app.server.tabs import Places, Step, tabs
from warpspace.app.state.app_state import AppState
from warpspace.app.viewport.layers import SCENE_PER_MM, Layer
from warpspace.app.viewport.layers.box import BoxLayer
from warpspace.app.viewport.layers.moving import MovingLayer, draw_around

# --- What a click in the drawing means ------------------------------------------------------------
# A question why, or the choice of a reference point.


class Pointing:
    """Listens to clicks in the drawing of one tab."""

    def __init__(self, context: PanelContext) -> None:
        self._context = context

        @context.client.scene.on_click()
        def _(event: Any) -> None:
            origin, direction = event.ray_origin, event.ray_direction
            context.act(lambda: self._clicked(origin, direction))

    def _clicked(self, origin: Any, direction: Any) -> None:
        picture = self._context.shown
        if picture is None:
            return
        try:
            ray = np.array([origin, direction], dtype=float)
        except (TypeError, ValueError):
            return
        if ray.shape != (2, 3):
            return
        picked = pick(picture, ray[0] / SCENE_PER_MM, ray[1])
        if picked is None:
            return
        if self._context.next_click is not None and picked.point_mm is None:
            self._context.next_click(picked)
            return
        self._context.page.run_script(front_script("Error budget"))
        self._context.post(lambda state: with_picked(state, picked))


# --- What a page consists of, in the order it is built: what matters most first -------------------

ERROR_CURVE = "Error curve"  # the tab below the sliders

Built: TypeAlias = tuple[Sequence[Layer], Sequence[Panel]]
Build: TypeAlias = Callable[[LivePicture], Built]


class PageContents:
    """Layers and panels of one tab."""

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
        client = self._context.client
        stage = self._context.stage = MovingLayer(client, picture, self._context.act)
        return [*draw_around(client.scene, picture), stage], []

    def _build_front(self, picture: LivePicture) -> Built:
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
        panels = self._build_tabs("behind", picture.state)
        Pointing(self._context)
        self._context.page.run_script(access_script())
        return [], panels

    def _build_tabs(self, step: Step, state: AppState) -> list[Panel]:
        panels: list[Panel] = []
        for tab in tabs():
            if tab.step == step and tab.name in self._places:
                with self._places.at(tab.name):
                    panels += [build(self._context, state) for build in tab.load()]
        return panels

    def _tab_names(self) -> tuple[str, ...]:
        return (ERROR_CURVE, *(tab.name for tab in tabs() if tab.name in self._places))

    def show_tour(self, *, asked: bool) -> None:
        """Show the tour if it was asked for, or if this is the browser's first visit."""
        if self._commands is not None:
            self._commands.show_tour(asked=asked)

    def _expand_curve(self) -> None:
        if self._expand is not None:
            self._expand()


ANSWER_S = 1.0
"""How long a page may take for one step; one that does not answer gets the rest at once."""


class PageSteps:
    """Builds the page of one tab; every step is one atomic change."""

    def __init__(self, context: PanelContext, places: Places, display: Display) -> None:
        self._context, self._display = context, display
        self.contents = PageContents(context, places)
        self._steps: deque[Build] = deque()
        self._answer: Any = None
        self._asked, self._patient, self._asked_at = 0, True, 0.0

    def begin(self, picture: LivePicture) -> None:
        """Draw the map, its sliders and numbers; the session has begun an atomic change."""
        self._answer = self._context.gui.add_text("", "", visible=False)

        @self._answer.on_update
        async def _(_: object) -> None:  # a plain function would take a thread of a pool
            self._context.wake()

        self._steps.extend(self.contents.steps)
        self._context.page.run_script(stage_script("opening"))
        self._build(picture)

    def stop(self) -> None:
        """Take no further step, and let nothing move by itself."""
        self._steps.clear()
        if self._context.stage is not None:
            self._context.stage.stop()

    def remaining_s(self) -> float | None:
        """Give how long to wait for the page at most; None where nothing is left to be done."""
        if not self._steps:
            return None
        if not self._patient:
            return 0.0
        return max(0.0, self._asked_at + ANSWER_S - time.monotonic())

    @property
    def is_due(self) -> bool:
        """Whether the page has drawn the last step, or does not say."""
        left = self.remaining_s()
        return left == 0.0 or (left is not None and self._answer.value == str(self._asked))

    def advance(self, picture: LivePicture) -> None:
        """Take the next step."""
        self._patient = self._patient and self.remaining_s() != 0.0
        with self._context.client.atomic():
            self._build(picture)
        self._context.client.flush()

    def _build(self, picture: LivePicture) -> None:
        layers, panels = self._steps.popleft()(picture)
        self._display.add(picture, layers, panels)
        page = self._context.page
        if self._steps:
            self._asked += 1
            self._asked_at = time.monotonic()
            page.run_script(drawn_script(dom_id(self._answer), self._asked))
        else:
            self._answer.remove()
            page.run_script(stage_script("open"))
            self.contents.show_tour(asked=False)
