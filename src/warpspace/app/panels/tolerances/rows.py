"""The rows of the tab Tolerances: per error its share, its box "fixed" and its slider."""

from collections.abc import Mapping
from typing import Any

from warpspace.app.browser.clicks import Clicks
from warpspace.app.browser.handles import Input
from warpspace.app.panels import PanelContext
from warpspace.app.readouts.probability import FIXED, spell_tolerance
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.machine.parameters import Parameter, parameter


class ToleranceRows:
    """Sliders of half widths, those that matter most first.

    Their order is that of the shares when they are laid out: no row moves away under a hand.

    Parameters
    ----------
    context : PanelContext
    """

    def __init__(self, context: PanelContext) -> None:
        self._context = context
        self._clicks = Clicks(context.gui, self._clicked)
        self._home: Any = context.gui.add_folder(None)
        self._folder: Any = None
        self._sliders: dict[str, Input[float]] = {}
        self._shares: dict[str, Any] = {}

    @property
    def keys(self) -> tuple[str, ...]:
        """Parameters that have a row."""
        return tuple(self._sliders)

    def _clicked(self, word: str) -> None:
        """Take note of a click of the box "fixed"."""
        what, _, key = word.partition(" ")
        if what == FIXED:
            self._context.post(
                lambda state: edits.with_fixed(state, key, key not in state.specification.fixed)
            )

    def build(self, state: AppState, shares: Mapping[str, float]) -> None:
        """Lay out the rows of the parameters of a loop.

        Parameters
        ----------
        state : AppState
        shares : mapping of str to float
            Share of the variance of E by parameter.
        """
        gui = self._context.gui
        if self._folder is not None:
            self._folder.remove()
        self._sliders, self._shares = {}, {}
        with self._home:
            self._folder = gui.add_folder("Half width and share of each error")
        longest = max(shares.values(), default=0.0)
        with self._folder:
            for key in sorted(shares, key=lambda key: -shares[key]):
                row = parameter(key)
                self._shares[key] = gui.add_html(self._spell(state, row, shares[key], longest))
                self._sliders[key] = Input(self._slider(state, row), self._context.changed)

    def _slider(self, state: AppState, row: Parameter) -> Any:
        """Add the slider of one tolerance."""
        span = edits.half_width_span(state, row.key)
        centre = found.centre if (found := state.tolerances.get(row.key)) else 0.0
        return self._context.gui.add_slider(
            f"{row.key} · {row.name} ± [{row.unit}]",
            min=span.low,
            max=span.high,
            step=span.step,
            initial_value=edits.half_width_of(state, row.key),
            hint=f"Half width of the tolerance of {row.name} about {centre:g} {row.unit}; 0 holds"
            " it there.",
        )

    def _spell(self, state: AppState, row: Parameter, share: float, longest: float) -> str:
        """Spell what stands above a slider."""
        fixed = row.key in state.specification.fixed
        return spell_tolerance(row, share, longest, fixed=fixed, button=self._clicks.button)

    def read(self, state: AppState) -> AppState:
        """Take over the sliders that a browser has moved."""
        for key, slider in self._sliders.items():
            half_width = slider.poll()
            if half_width is not None:
                state = edits.with_half_width(state, key, half_width)
        return state

    def show(self, state: AppState) -> None:
        """Put the sliders where the state has them; one that is too short is made longer."""
        for key, slider in self._sliders.items():
            span = edits.half_width_span(state, key)
            slider.handle.max = max(slider.handle.max, span.high)
            slider.show(edits.half_width_of(state, key))

    def show_shares(self, state: AppState, shares: Mapping[str, float]) -> None:
        """Write the shares and the boxes; what is the same already is not sent."""
        longest = max(shares.values(), default=0.0)
        for key, handle in self._shares.items():
            text = self._spell(state, parameter(key), shares[key], longest)
            if handle.content != text:
                handle.content = text
