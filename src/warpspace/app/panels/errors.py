"""The errors panel: a slider with number box, only, exclude and curve per parameter.

The search box narrows it down to the parameters that are meant, of all there are; without a search
those that are zero can be hidden. What is listed, and in which order, stays while sliders move:
nothing slips away from under the pointer.
"""

from collections import Counter, deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from itertools import groupby
from typing import Any

import numpy as np

from warpspace.app.browser.clicks import Clicks
from warpspace.app.browser.handles import Input
from warpspace.app.browser.page import reveal_script
from warpspace.app.browser.viser_private import show_marks
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.readouts.error_controls import (
    CURVE,
    VALUE,
    error_controls,
    refusal,
    slider_hint,
    with_switched,
)
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.listing import Listing, is_mostly_zero, listed_keys, used_keys
from warpspace.app.state.ranges import Span
from warpspace.app.state.typed_numbers import read_typed
from warpspace.machine.axes import PARAMETERS, Parameter, axis_order, parameter
from warpspace.scene.model import grid_basis

# --- How much each error does in the whole volume, taken alone ------------------------------------


def effects_alone(picture: LivePicture, state: AppState) -> dict[str, float]:
    """Give the effect of every error: RMS of the volume, with this error alone.

    It is the RMS that the page shows when the error's "only" is pressed. It does not depend on the
    other errors, with which the error may add up or cancel.
    """
    basis = grid_basis(state.scene, picture.grid, picture.view)
    amplitudes = np.array([state.amplitudes[key] for key in basis.keys])
    squares = np.sum(basis.position**2, axis=-1).reshape(len(basis.keys), -1)
    rms = np.sqrt(squares @ picture.grid.weights.reshape(-1)) * np.abs(amplitudes)
    return dict(zip(basis.keys, rms.tolist(), strict=True))


BY_EFFECT = "by effect"


class ErrorsPanel:
    """Sliders of all parameters; rebuilt when another scene is shown.

    At first only those of the first axis are there; `add_axes` adds the others.
    """

    def __init__(
        self, context: PanelContext, state: AppState, show_curve: Callable[[], None]
    ) -> None:
        self._context, self._show_curve = context, show_curve
        self._listing = Listing(not_zero=is_mostly_zero(state))
        self._effects: Mapping[str, float] | None = None
        self._found: tuple[str, ...] = ()
        self._looks: tuple[Identity, ...] = ()
        self._attempts: Counter[str] = Counter()
        self._spelt: dict[str, tuple[object, ...]] = {}
        self._search: Input[str] = Input(
            context.gui.add_text(
                "Find an error",
                "",
                hint="Key, symbol, plain name or axis: EAX, squareness, roll x, γ.",
            ),
            context.changed,
        )
        self._not_zero: Input[bool] = Input(
            context.gui.add_checkbox(
                "Hide errors that are zero",
                self._listing.not_zero,
                hint="Errors that are zero now, and were in the scene as opened. A search finds"
                " them all the same.",
            ),
            context.changed,
        )
        self._by_effect: Input[bool] = Input(
            context.gui.add_checkbox(
                "Sort by effect",
                initial_value=False,
                hint="Effect: RMS of the volume with this error alone, as its button only shows it;"
                " the largest first. The order stays while sliders move; check again to sort anew.",
            ),
            context.changed,
        )
        self._built_for: tuple[object, ...] = ()
        self._bound: dict[str, Input[float]] = {}
        self._buttons: dict[str, Any] = {}
        self._parts: list[Any] = []
        self._clicks = Clicks(context.gui, self._clicked)
        buttons = context.gui.add_button_group(
            "All errors",
            ("Reset", "All zero", "Include all"),
            hint="Reset: the values of the scene. All zero: the nominal machine. Include all: end"
            " every only and exclude.",
        )
        updates = {
            "Reset": AppState.reset,
            "All zero": AppState.zeroed,
            "Include all": edits.include_all,
        }
        buttons.on_click(lambda event: context.post(updates[event.target.value]))
        self._home: Any = context.gui.add_folder(None)
        self._missing: deque[tuple[Parameter, ...]] = deque()
        self._begin(state)
        if self._missing:
            self._add_axis(state)
        context.reveal_error = self._reveal

    def _build(self, state: AppState, picture: LivePicture | None = None) -> None:
        """Lay out the folders with the parameters that were asked for."""
        picture, self._effects = picture or self._context.shown, None
        if self._listing.by_effect and picture is not None:
            self._effects = effects_alone(picture, state)
        self._begin(state)
        self.add_axes(state)

    def _begin(self, state: AppState) -> None:
        keys = listed_keys(state, self._listing, self._effects)
        for part in self._parts:
            part.remove()
        self._bound, self._buttons, self._parts = {}, {}, []
        self._built_for = (Identity(state.origin), state.amplitudes.keys())
        self._spelt = {}
        self._found, self._looks = keys, (Identity(state.exclusions), Identity(state.spans))
        if not keys:
            with self._home:
                self._parts.append(self._context.gui.add_markdown(self._listing.why_empty))
        rows = list(map(parameter, keys))
        if self._effects is not None:
            self._missing = deque([tuple(rows)] if rows else [])
            return
        rows.sort(key=lambda row: axis_order(row.axis))
        self._missing = deque(tuple(own) for _, own in groupby(rows, key=lambda row: row.axis))

    def add_axes(self, state: AppState) -> None:
        """Lay out all folders that are still missing."""
        while self._missing:
            self._add_axis(state)

    def _add_axis(self, state: AppState) -> None:
        gui, own = self._context.gui, self._missing.popleft()
        axis = own[0].axis if self._effects is None else ""
        narrowed = len(self._found) < len(state.amplitudes)
        used = narrowed or not axis or any(state.amplitudes[row.key] for row in own)
        every = sum(1 for key in state.amplitudes if not axis or parameter(key).axis == axis)
        shown = f"{len(own)} of {every}" if len(own) < every else f"{every}"
        where = f"{axis} axis" if axis else BY_EFFECT.capitalize()
        title = f"{where} · {shown} error{'s' if every > 1 else ''}"
        with self._home:
            folder = gui.add_folder(title, expand_by_default=used)
        self._parts.append(folder)
        with folder:
            for row in own:
                self._buttons[row.key] = gui.add_html("")
                self._spell(state, row.key)
                self._bound[row.key] = Input(self._slider(state, row), self._context.changed)
            if axis:
                button = gui.add_button(
                    f"Reset {axis}",
                    color="gray",
                    hint=f"Give all errors of {axis} the values of the scene again.",
                )
                button.on_click(lambda _, axis=axis: self._context.post(lambda s: s.reset(axis)))

    def _slider(self, state: AppState, row: Parameter) -> Any:
        span = state.spans[row.key]
        return self._context.gui.add_slider(
            row.label,
            min=span.low,
            max=span.high,
            step=span.step,
            initial_value=state.amplitudes[row.key],
            marks=span.marks,
            hint=slider_hint(
                state, row, self._effects[row.key] if self._effects is not None else None
            ),
        )

    def _clicked(self, word: str) -> None:
        """Take note of a click of only, exclude or curve, or of a typed number."""
        what, _, key = word.partition(" ")
        if what == VALUE:
            self._typed(*key.partition(" ")[::2])
        elif what == CURVE:
            self._context.post(lambda state: state.with_chosen_error(key))
            self._context.act(self._show_curve)
        else:
            self._context.post(lambda state: with_switched(state, word))

    def _reveal(self, key: str) -> None:
        """Bring the slider of an error into view; one that is not listed is looked for."""
        if key not in self._bound:
            self._search.show(key)
            self._listing = replace(self._listing, query=key)
            self._build(self._context.store.state)
        self._context.page.run_script(reveal_script(f"{key} · "))

    def _typed(self, key: str, text: str) -> None:
        """Take note of a typed number; of what is none, say so and restore the present one."""
        if key not in PARAMETERS:
            return
        row = parameter(key)
        value = read_typed(text, row.unit)
        if value is not None:
            self._context.post(
                lambda state: edits.with_typed_amplitude(state, key, value).with_chosen_error(key)
            )
        self._context.act(partial(self._answer, key, None if value is not None else text))

    def _answer(self, key: str, refused: str | None) -> None:
        state = self._context.store.state
        if key not in self._buttons:
            return
        self._attempts[key] += 1
        self._spell(state, key)
        if refused is not None:
            text = refusal(parameter(key), refused, state.amplitudes[key])
            self._context.notify("Not a number", text, "yellow")

    def _spell(self, state: AppState, key: str) -> None:
        value, attempt = state.amplitudes[key], self._attempts[key]
        spelt = (value, attempt, Identity(state.exclusions))
        if self._spelt.get(key) == spelt:
            return
        self._spelt[key] = spelt
        handle, clicks = self._buttons[key], self._clicks
        text = error_controls(
            parameter(key), state.exclusions, value, clicks.button, clicks.text_box, attempt
        )
        if handle.content != text:
            handle.content = text

    def read(self, state: AppState) -> AppState:
        """Take over the sliders that a browser has moved."""
        for key, bound in self._bound.items():
            value = bound.poll()
            if value is not None:
                state = state.with_amplitude(key, value).with_chosen_error(key)
        query, not_zero = self._search.poll(), self._not_zero.poll()
        by_effect = self._by_effect.poll()
        if (query, not_zero, by_effect) == (None, None, None):
            return state
        before = self._listing
        self._listing = listing = Listing(
            before.query if query is None else query,
            before.not_zero if not_zero is None else not_zero,
            before.by_effect if by_effect is None else by_effect,
        )
        found = listed_keys(state, listing)
        if query is not None and len(found) == 1:
            state = state.with_chosen_error(found[0])
        if listing.by_effect != before.by_effect or {*found} != {*self._found}:
            # after the state has been dealt with, since widgets come and go
            self._context.act(lambda: self._build(self._context.store.state))
        return state

    def show(self, picture: LivePicture) -> None:
        """Put the sliders where the state has them."""
        state = picture.state
        if (Identity(state.origin), state.amplitudes.keys()) != self._built_for:
            self._search.show("")
            self._listing = replace(self._listing, query="")
            self._build(state, picture)
        elif not self._listing.query.strip() and not {*self._found}.issuperset(used_keys(state)):
            self._build(state, picture)  # one more of them is not zero
        looks = (Identity(state.exclusions), Identity(state.spans))
        if looks != self._looks:
            self._looks = looks
            for key, bound in self._bound.items():
                _refresh(bound.handle, state.spans[key])
        for key, bound in self._bound.items():
            bound.show(state.amplitudes[key])
            self._spell(state, key)


def _refresh(slider: Any, span: Span) -> None:
    """Follow a changed range; what is the same already is not sent."""
    if (slider.min, slider.max) != (span.low, span.high):
        slider.min, slider.max, slider.step = span.low, span.high, span.step
        show_marks(slider, span.marks)
