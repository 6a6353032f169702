"""The errors panel: a slider with number box, solo, mute and curve per parameter, by axis.

The search box narrows it down to the parameters that are meant; the folders then stand open.
"""

from collections import deque
from collections.abc import Callable
from itertools import groupby
from typing import Any

from warpspace.app.browser.clicks import Clicks
from warpspace.app.browser.handles import Input
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.readouts.exclusions import CURVE, exclusion_buttons, with_switched
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.ranges import Span
from warpspace.app.state.search import find_parameters
from warpspace.machine.axes import axis_order
from warpspace.machine.errors import Constant
from warpspace.machine.parameters import Parameter, parameter
from warpspace.scene.model import Scene


def _hint(state: AppState, row: Parameter) -> str:
    """Say what a slider moves."""
    function = state.scene.errors.functions.get(row.key)
    meaning = (function or Constant((0.0, 0.0))).slider_words(row.axis)
    span = state.spans[row.key]
    return (
        f"{row.name}, {row.kind.value}: {meaning}. "
        f"{span.low:g} to {span.high:g} {row.unit}, in the scene {state.start[row.key]:g}."
    )


class ErrorsPanel:
    """Sliders of all parameters; rebuilt when another scene is shown.

    At first only those of the first axis are there; `add_axes` adds the others.

    Parameters
    ----------
    context : PanelContext
    state : AppState
    show_curve : callable
        Shows the panel of the chosen error, should it be minimized; called by the session.
    """

    def __init__(
        self, context: PanelContext, state: AppState, show_curve: Callable[[], None]
    ) -> None:
        self._context, self._show_curve = context, show_curve
        self._found: tuple[str, ...] = ()
        self._looks: tuple[Identity, ...] = ()
        self._search: Input[str] = Input(
            context.gui.add_text(
                "Find an error",
                "",
                hint="Key, symbol, plain name or axis: EAX, squareness, roll x, γ.",
            ),
            context.changed,
        )
        self._scene: Scene | None = None
        self._bound: dict[str, Input[float]] = {}
        self._buttons: dict[str, Any] = {}
        self._parts: list[Any] = []
        self._clicks = Clicks(context.gui, self._clicked)
        buttons = context.gui.add_button_group(
            "All errors",
            ("Reset", "All zero", "Hear all"),
            hint="Reset: the values of the scene. All zero: the nominal machine. Hear all: end all"
            " solo and mute.",
        )
        updates = {
            "Reset": AppState.reset,
            "All zero": AppState.zeroed,
            "Hear all": edits.include_all,
        }
        buttons.on_click(lambda event: context.post(updates[event.target.value]))
        self._home: Any = context.gui.add_folder(None)
        self._missing: deque[tuple[Parameter, ...]] = deque()
        self._begin(state, tuple(state.amplitudes))
        self._add_axis(state)

    def _build(self, state: AppState, keys: tuple[str, ...]) -> None:
        """Lay out the folders of a scene's axes with the parameters that were asked for."""
        self._begin(state, keys)
        self.add_axes(state)

    def _begin(self, state: AppState, keys: tuple[str, ...]) -> None:
        """Clear all folders and note which are to be laid out."""
        for part in self._parts:
            part.remove()
        self._scene, self._bound, self._buttons, self._parts = state.origin, {}, {}, []
        self._found, self._looks = keys, (Identity(state.exclusions), Identity(state.spans))
        if not keys:
            with self._home:
                self._parts.append(self._context.gui.add_markdown("No error goes by this name."))
        rows = sorted(map(parameter, keys), key=_by_axis)
        self._missing = deque(tuple(own) for _, own in groupby(rows, key=lambda row: row.axis))

    def add_axes(self, state: AppState) -> None:
        """Lay out all folders that are still missing."""
        while self._missing:
            self._add_axis(state)

    def _add_axis(self, state: AppState) -> None:
        """Lay out the folder of the next axis."""
        gui, own = self._context.gui, self._missing.popleft()
        axis = own[0].axis
        narrowed = len(self._found) < len(state.amplitudes)
        used = narrowed or any(state.amplitudes[row.key] for row in own)
        title = f"{axis} axis · {len(own)} error{'s' if len(own) > 1 else ''}"
        with self._home:
            folder = gui.add_folder(title, expand_by_default=used)
        self._parts.append(folder)
        with folder:
            for row in own:
                self._buttons[row.key] = gui.add_html(
                    exclusion_buttons(row, state.exclusions, self._clicks.button)
                )
                self._bound[row.key] = Input(self._slider(state, row), self._context.changed)
            button = gui.add_button(
                f"Reset {axis}",
                color="gray",
                hint=f"Give all errors of {axis} the values of the scene again.",
            )
            button.on_click(lambda _, axis=axis: self._context.post(lambda s: s.reset(axis)))

    def _slider(self, state: AppState, row: Parameter) -> Any:
        """Add the slider of one parameter."""
        span = state.spans[row.key]
        return self._context.gui.add_slider(
            row.label,
            min=span.low,
            max=span.high,
            step=span.step,
            initial_value=state.amplitudes[row.key],
            marks=_marks(span),
            hint=_hint(state, row),
        )

    def _clicked(self, word: str) -> None:
        """Take note of a click of solo, mute or curve."""
        what, _, key = word.partition(" ")
        if what == CURVE:
            self._context.post(lambda state: state.with_chosen_error(key))
            self._context.act(self._show_curve)
        else:
            self._context.post(lambda state: with_switched(state, word))

    def read(self, state: AppState) -> AppState:
        """Take over the sliders that a browser has moved."""
        for key, bound in self._bound.items():
            value = bound.poll()
            if value is not None:
                state = state.with_amplitude(key, value).with_chosen_error(key)
        query = self._search.poll()
        if query is not None:
            found = find_parameters(query, tuple(state.amplitudes))
            if len(found) == 1:
                state = state.with_chosen_error(found[0])
            if found != self._found:
                # after the state has been dealt with, since widgets come and go
                self._context.act(lambda: self._build(self._context.store.state, found))
        return state

    def show(self, picture: LivePicture) -> None:
        """Put the sliders where the state has them."""
        state = picture.state
        if state.origin is not self._scene:
            self._search.show("")
            self._build(state, tuple(state.amplitudes))
        looks = (Identity(state.exclusions), Identity(state.spans))
        if looks != self._looks:
            self._looks = looks
            for key, bound in self._bound.items():
                _refresh(bound.handle, state.spans[key])
            for key, handle in self._buttons.items():
                text = exclusion_buttons(parameter(key), state.exclusions, self._clicks.button)
                if handle.content != text:
                    handle.content = text
        for key, bound in self._bound.items():
            bound.show(state.amplitudes[key])


def _marks(span: Span) -> tuple[tuple[float, str], ...]:
    """Mark both ends and zero."""
    return ((span.low, f"{span.low:g}"), (0.0, "0"), (span.high, f"{span.high:g}"))


def _refresh(slider: Any, span: Span) -> None:
    """Follow a changed range; what is the same already is not sent."""
    if (slider.min, slider.max) != (span.low, span.high):
        slider.min, slider.max, slider.step = span.low, span.high, span.step
        slider.marks = _marks(span)


def _by_axis(row: Parameter) -> int:
    """Sort by axis; within an axis the order of the table stays."""
    return axis_order(row.axis)
