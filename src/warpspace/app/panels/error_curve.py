"""The panel of one error: its curve along the travel, edited as rows of numbers."""

from typing import Any

from warpspace.app.browser.handles import Input
from warpspace.app.browser.viser_private import dom_id
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.readouts.curve_chart import (
    SERIES,
    add_chart,
    chart_axis,
    chart_scales,
    chart_text,
    curve_data,
    describe_curve,
    measured_words,
    value_span,
)
from warpspace.app.readouts.html import message
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.curve_text import (
    convert_shape,
    kind_titles,
    read_curve,
    shape_kind,
    spell_rows,
)
from warpspace.exceptions import OptionError
from warpspace.machine.axes import Parameter, parameter
from warpspace.machine.curves.registry import curve_kind
from warpspace.machine.errors import Constant, ErrorFunction, Measurement

CHART_HEIGHT = 128
LABEL_WIDTH = 76  # room for the labels, which stand beside their controls here, CSS pixels


Drawn = tuple[ErrorFunction, ErrorFunction | None, Measurement | None]
"""A curve, its standard uncertainty and its readings."""


class ErrorCurvePanel:
    """The curve of the error that was moved last, or chosen."""

    def __init__(self, context: PanelContext, state: AppState) -> None:
        self._context, gui = context, context.gui
        self._key = ""
        self._key = self._chosen(state)
        self._follows_at_once = False
        self._keys = tuple(state.amplitudes)
        # what the numbers stand for, and what is drawn
        self._written: ErrorFunction | None = None
        self._drawn: Drawn | None = None
        self._which: Input[str] = Input(
            gui.add_dropdown(
                "Error",
                _options(self._keys),
                initial_value=parameter(self._key).label,
                hint="The error whose curve is shown; moving a slider chooses its error.",
            ),
            context.changed,
        )
        self._words: Any = gui.add_html("")
        self._chart: Any = add_chart(
            gui,
            curve_data(None, (0.0, 1.0)),
            SERIES,
            CHART_HEIGHT,
        )
        self._kind: Input[str] = Input(
            gui.add_dropdown(
                "Curve",
                kind_titles(),
                hint=f"Along the axis: {', '.join(kind_titles())}.",
            ),
            context.changed,
        )
        self._rows: Input[str] = Input(
            gui.add_text("Numbers", "0", multiline=True, hint=_rows_hint(Constant.title)),
            context.changed,
        )
        self._problem: Any = gui.add_html("")
        gui.add_html(_style(self._which.handle, self._kind.handle, self._rows.handle))
        self._show(state)

    def read(self, state: AppState) -> AppState:
        """Take over what a browser has chosen or written."""
        label, kind, rows = self._which.poll(), self._kind.poll(), self._rows.poll()
        if label is not None:
            state = state.with_chosen_error(label.split(" ", 1)[0])
        return self._edited(state, self._chosen(state), kind, rows)

    def _edited(self, state: AppState, key: str, kind: str | None, rows: str | None) -> AppState:
        if kind is None and rows is None:
            return state
        span, present = edits.axis_span(state, key), edits.curve_of(state, key)
        try:
            if kind is not None and kind != shape_kind(present):
                function, remarks = convert_shape(present, kind, span), ()
                # numbers of the kind before mean something else now
                rows = None
            elif rows is not None:
                entered = read_curve(shape_kind(present), rows, span)
                function, remarks = entered.function, entered.remarks
            else:
                return state
        except OptionError as error:
            self._problem.content = message(str(error), "curve problem", small=True)
            return state
        said = " ".join(remarks)
        self._problem.content = message(said, "curve remark", small=True) if said else ""
        if rows is not None:
            # what is being written stays as it was written
            self._written = function
        self._follows_at_once = True
        return edits.with_curve(state, key, function)

    def show(self, picture: LivePicture) -> None:
        """Follow another choice or an edit at once, all else when changes pause."""
        if self._follows_at_once or self._chosen(picture.state) != self._key:
            self._show(picture.state)

    def settle(self, picture: LivePicture) -> None:
        """Follow the state."""
        self._show(picture.state)

    def _chosen(self, state: AppState) -> str:
        """Give the error to be shown: the chosen one, else that shown before, else the largest."""
        keys = (state.chosen_error, self._key)
        return next((key for key in keys if key in state.amplitudes), "") or _first(state)

    def _show(self, state: AppState) -> None:
        if tuple(state.amplitudes) != self._keys:
            self._keys = tuple(state.amplitudes)
            self._which.handle.options = _options(self._keys)
            self._written = self._drawn = None
        self._follows_at_once = False
        key = self._chosen(state)
        if key != self._key:
            self._key = key
            self._written = self._drawn = None
        row = parameter(self._key)
        self._which.show(row.label)
        function = edits.curve_of(state, self._key)
        if function != self._written:
            self._write(function, row)
        scene = state.scene
        drawn = (function, scene.uncertainty.get(row.key), scene.measured.get(row.key))
        if drawn != self._drawn:
            self._drawn = drawn
            self._draw(drawn, row, state)

    def _write(self, function: ErrorFunction, row: Parameter) -> None:
        self._written = function
        kind = shape_kind(function)
        kinds = (Constant.title,) if row.is_constant else kind_titles()
        if not function.edited_as_rows:
            kinds = (*kinds, kind)
        if self._kind.handle.options != kinds:
            self._kind.handle.options = kinds
        self._kind.show(kind)
        self._rows.handle.hint = _rows_hint(kind)
        self._rows.show(spell_rows(function))
        self._problem.content = ""

    def _draw(self, drawn: Drawn, row: Parameter, state: AppState) -> None:
        unit = state.scene.machine.axes[row.axis].unit
        function, uncertainty, measured = drawn
        span = edits.axis_span(state, row.key)
        data = at, value, *_ = curve_data(function, span, uncertainty, measured)
        scales = chart_scales(value_span(data), (float(at[0]), float(at[-1])))
        self._chart.data, self._chart.scales = data, scales
        self._words.content = chart_text(
            describe_curve(f"{row.key}, {row.name}", row.unit, unit, at, value)
            + measured_words(uncertainty, measured)
        )
        self._chart.axes = (
            chart_axis(f"{row.axis} [{unit}]", 34),
            chart_axis(f"{row.key} [{row.unit}]", 44),
        )


def _style(*handles: Any) -> str:
    """Put labels beside their controls, since there is little height."""
    labels = ",".join(f"label[for='{dom_id(handle)}']" for handle in handles)
    return (
        f"<style>div:has(> div > p > :is({labels})) {{ flex-wrap: nowrap !important; }}"
        f"div:has(> p > :is({labels})) {{ width: {LABEL_WIDTH}px !important; }}</style>"
    )


def _first(state: AppState) -> str:
    varying = {
        key: abs(value) for key, value in state.amplitudes.items() if not parameter(key).is_constant
    }
    return max(varying or dict.fromkeys(state.amplitudes, 0.0), key=lambda key: varying.get(key, 0))


def _options(keys: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(parameter(key).label for key in keys)


def _rows_hint(kind: str) -> str:
    text = curve_kind(kind).row_words
    return (
        f"{text[0].upper()}{text[1:]}. Blanks, tabs or semicolons between numbers, decimal point or"
        " comma, or cells pasted from a spreadsheet; q in mm or degrees."
    )
