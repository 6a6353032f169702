"""The errors panel: a slider with number box per parameter, in a folder per axis."""

from itertools import groupby
from typing import Any

from warpspace.app.live import Frame
from warpspace.app.panels import Desk
from warpspace.app.state import AppState
from warpspace.app.widgets import Bound
from warpspace.machine.parameters import Parameter, parameter
from warpspace.scene.model import Scene


def _hint(state: AppState, row: Parameter) -> str:
    """Say what a slider moves."""
    function = state.scene.errors.functions.get(row.key)
    curve = "constant" if row.is_constant or function is None else type(function).__name__.lower()
    meaning = {
        "constant": "the same everywhere",
        "ramp": f"rises along {row.axis}; this is the value at its upper end",
    }.get(curve, f"{curve} along {row.axis}; this is its largest value")
    span = state.spans[row.key]
    return (
        f"{row.name}, {row.kind.value}: {meaning}. "
        f"{span.low:g} to {span.high:g} {row.unit}, in the scene {state.start[row.key]:g}."
    )


class ErrorsPanel:
    """Sliders of all parameters; rebuilt when another scene is shown.

    Parameters
    ----------
    desk : Desk
    state : AppState
    """

    def __init__(self, desk: Desk, state: AppState) -> None:
        self._desk = desk
        self._scene: Scene | None = None
        self._bound: dict[str, Bound[float]] = {}
        self._parts: list[Any] = []
        buttons = desk.gui.add_button_group(
            "All errors",
            ("Reset", "All zero"),
            hint="Reset: the values of the scene. All zero: the nominal machine.",
        )
        updates = {"Reset": AppState.reset, "All zero": AppState.zeroed}
        buttons.on_click(lambda event: desk.post(updates[event.target.value]))
        self._home: Any = desk.gui.add_folder(None)
        self._build(state)

    def _build(self, state: AppState) -> None:
        """Lay out the folders of a scene's axes."""
        gui = self._desk.gui
        for part in self._parts:
            part.remove()
        self._scene, self._bound, self._parts = state.origin, {}, []
        rows = sorted(map(parameter, state.amplitudes), key=_by_axis)
        for axis, members in groupby(rows, key=lambda row: row.axis):
            own = list(members)
            used = any(state.amplitudes[row.key] for row in own)
            title = f"{axis} axis · {len(own)} errors"
            with self._home:
                folder = gui.add_folder(title, expand_by_default=used)
            self._parts.append(folder)
            with folder:
                for row in own:
                    self._bound[row.key] = Bound(self._slider(state, row), self._desk.changed)
                button = gui.add_button(
                    f"Reset {axis}",
                    hint=f"Give all errors of {axis} the values of the scene again.",
                )
                button.on_click(lambda _, axis=axis: self._desk.post(lambda s: s.reset(axis)))

    def _slider(self, state: AppState, row: Parameter) -> Any:
        """Add the slider of one parameter."""
        span = state.spans[row.key]
        return self._desk.gui.add_slider(
            row.label,
            min=span.low,
            max=span.high,
            step=span.step,
            initial_value=state.amplitudes[row.key],
            marks=((span.low, f"{span.low:g}"), (0.0, "0"), (span.high, f"{span.high:g}")),
            hint=_hint(state, row),
        )

    def read(self, state: AppState) -> AppState:
        """Take over the sliders that a browser has moved."""
        for key, bound in self._bound.items():
            value = bound.poll()
            if value is not None:
                state = state.with_amplitude(key, value)
        return state

    def show(self, frame: Frame) -> None:
        """Put the sliders where the state has them."""
        state = frame.state
        if state.origin is not self._scene:
            self._build(state)
        for key, bound in self._bound.items():
            bound.show(state.amplitudes[key])


def _by_axis(row: Parameter) -> int:
    """Sort by axis; within an axis the order of the table stays."""
    return "XYZABC".index(row.axis)
