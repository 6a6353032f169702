"""The panel "Compare": two scenes, or the states before and after; A, B or the change."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from warpspace.app.browser.handles import Input
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.compare import scene_side, with_pin, with_sides
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext, Update
from warpspace.app.readouts.summary import MARK, NOTHING, comparison_html, marked
from warpspace.app.state.app_state import AppState
from warpspace.app.state.comparison import NOBODY, PRESENT, SHOWN, Side
from warpspace.scene.model import Scene


class ComparePanel:
    """Who is compared with whom, what is drawn, and the numbers of both."""

    def __init__(self, context: PanelContext, _state: AppState) -> None:
        gui, scenes = context.gui, context.scenes
        self._scenes: Mapping[str, Scene] = scenes
        self._options: tuple[str, ...] = tuple(scenes)
        pin = gui.add_button(
            "Pin as before",
            color="gray",
            hint="Keep the present errors as A, before; what you change from then on is B, after.",
        )
        pin.on_click(lambda _: context.post(with_pin))
        self._a: Input[str] = Input(
            gui.add_dropdown(
                "A",
                (PRESENT, *scenes),
                initial_value=PRESENT,
                hint="Before. Present errors: what the sliders say.",
            ),
            context.changed,
        )
        self._b: Input[str] = Input(
            gui.add_dropdown(
                "B",
                (NOBODY, PRESENT, *scenes),
                initial_value=NOBODY,
                hint="After. Scenes are taken as opened, at the present rotary positions.",
            ),
            context.changed,
        )
        self._shown: Any = gui.add_button_group(
            "Drawn",
            marked("a"),
            visible=False,
            hint="What is drawn. The change B − A is taken node by node.",
        )
        self._shown.on_click(lambda event: context.post(_drawn(event.target.value)))
        self._ghost: Input[bool] = Input(
            gui.add_checkbox(
                "Wireframe of the other",
                initial_value=True,
                hint="Edges of the box that is not drawn, dotted.",
            ),
            context.changed,
        )
        self._text: Any = gui.add_html(NOTHING)

    def read(self, state: AppState) -> AppState:
        """Take over what a browser has chosen."""
        a, b, ghost = self._a.poll(), self._b.poll(), self._ghost.poll()
        comparison = state.comparison
        if a is not None or b is not None:
            one = self._side(state, a) if a is not None else comparison.a
            two = self._side(state, b) if b is not None else comparison.b
            state = with_sides(state, one or Side(), two)
        if ghost is not None:
            state = replace(state, comparison=replace(state.comparison, ghost=bool(ghost)))
        return state

    def _side(self, state: AppState, title: str) -> Side[AppState] | None:
        """Find the side of a title that a browser has sent; None for nothing or nonsense."""
        if title == PRESENT:
            return Side()
        used = (state.comparison.pinned, state.comparison.a, state.comparison.b)
        for side in used:
            if side is not None and title == side.title:
                return side
        scene = self._scenes.get(title)
        return None if scene is None else replace(scene_side(scene), title=title)

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Give what the widgets show: the comparison, its numbers, the scenes there are."""
        return Identity(picture.state.comparison), Identity(picture.compared), *self._scenes

    def show(self, picture: LivePicture) -> None:
        """Make the widgets show the comparison."""
        comparison = picture.state.comparison
        used = (comparison.pinned, comparison.a, comparison.b)
        own = (side.title for side in used if side is not None and side.state is not None)
        # a title twice would end the page's dropdown
        options = tuple(dict.fromkeys((*own, *self._scenes)))
        if options != self._options:
            self._options = options
            self._a.handle.options = (PRESENT, *options)
            self._b.handle.options = (NOBODY, PRESENT, *options)
        self._a.show(comparison.a.title)
        self._b.show(NOBODY if comparison.b is None else comparison.b.title)
        self._ghost.show(comparison.ghost)
        self._shown.visible = comparison.b is not None
        words = marked(comparison.shown)
        if self._shown.options != words:
            self._shown.options = words
        self._text.content = comparison_html(picture)


def _drawn(text: str) -> Update:
    wanted = text.removeprefix(MARK)
    word = next((word for word, shown in SHOWN.items() if shown == wanted), "")
    return lambda s: replace(s, comparison=s.comparison.with_shown(word))
