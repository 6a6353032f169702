"""The curve of one error in its row: drawn, said where it comes from, and edited as numbers."""

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from warpspace.analysis.blocks import Band, Curve, Lines
from warpspace.app.browser.html import EMPTY, button, choice, field, fill, ident, join, rows, tag
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.typed_numbers import comma_rows, read_rows, spell_typed
from warpspace.app.tasks.charts import lines_html
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.machine.axes import Parameter, parameter
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.curves.registry import CurveKind, curve_kind, curve_kinds
from warpspace.machine.curves.simple import Constant
from warpspace.machine.errors import BACKWARD
from warpspace.machine.limits import MAX_CURVE_ROWS, MAX_CURVE_TEXT, MAX_ERROR
from warpspace.units import Array, spell

CHART_SAMPLES = 181
MAX_KINKS = 500  # kinks of a curve that are drawn where they are


@dataclass(frozen=True, slots=True)
class EnteredCurve:
    """A curve that a user has entered."""

    function: ErrorFunction
    remarks: tuple[str, ...] = ()  # what was left out or put in order, a sentence each


def kind_titles() -> tuple[str, ...]:
    """List what the kinds of curve are called that people can write, simplest first."""
    return tuple(kind.title for kind in curve_kinds() if kind.edited_as_rows)


def shape_kind(function: ErrorFunction | None) -> str:
    """Give the title of the kind of a function; an absent one is a constant."""
    return Constant.title if function is None else function.title


def spell_rows(function: ErrorFunction | None) -> str:
    """Write the numbers of a function as the rows that `read_curve` reads.

    A measured table with more rows than may be edited is thinned out; of a kind that cannot be
    written as rows it is said where it comes from.
    """
    if function is None:
        return "0"
    if not function.edited_as_rows:
        return function.row_words
    rows = function.rows()
    if len(rows) > MAX_CURVE_ROWS:
        rows = [rows[i] for i in np.linspace(0, len(rows) - 1, MAX_CURVE_ROWS).astype(int)]
    return "\n".join("  ".join(map(spell_typed, row)) for row in rows)


def read_curve(kind: str, text: str, span: tuple[float, float]) -> EnteredCurve:
    """Read the rows that a user has edited, or pasted from a spreadsheet."""
    chosen = _kind(kind)
    if len(text) > MAX_CURVE_TEXT:
        raise OptionError(f"{len(text):,} characters; expected at most {MAX_CURVE_TEXT:,}")
    try:
        return _read(chosen, text, span)
    except OptionError:
        with_commas = comma_rows(text)
        if with_commas is None:
            raise
    return _read(chosen, with_commas, span)


def _read(kind: CurveKind, text: str, span: tuple[float, float]) -> EnteredCurve:
    rows, left_out = read_rows(text)
    if not rows:
        raise OptionError(f"no numbers; expected {kind.row_words}")
    ordered, tidied = kind.tidied(rows)
    function = kind.from_rows(span, ordered)
    peak = function.amplitude
    if not abs(peak) <= MAX_ERROR:
        raise OptionError(f"the curve reaches {peak:.3g}; expected at most ±{MAX_ERROR:g}")
    return EnteredCurve(function, (*left_out, *tidied))


def convert_shape(
    function: ErrorFunction | None, kind: str, span: tuple[float, float]
) -> ErrorFunction:
    """Give a first curve of another kind with the amplitude of a present one."""
    present = function or Constant(span)
    return present if shape_kind(function) == kind else _kind(kind).from_curve(present, span)


def sample_curve(function: ErrorFunction | None, span: tuple[float, float]) -> tuple[Array, Array]:
    """Sample a curve along the travel for a chart."""
    at = np.linspace(*span, CHART_SAMPLES)
    kinks = () if function is None else function.kinks
    if inside := [q for q in kinks if span[0] < q < span[1]][:MAX_KINKS]:
        at = np.unique(np.concatenate([at, inside]))
    value = np.zeros(at.shape) if function is None else function.evaluate(at)
    return at, np.where(np.isfinite(value), value, np.nan)


def _kind(title: str) -> CurveKind:
    try:
        return curve_kind(title)
    except UnknownNameError as error:
        expected = f"expected one of {', '.join(error.known)}"
        raise OptionError(f"shape {title!r}; {expected}") from None


# --- The row of an error --------------------------------------------------------------------------

FEW_READINGS = 400  # that are drawn at most, evenly picked from all
TYPING = (
    "Blanks, tabs or semicolons between numbers; decimal point or comma. Cells of a spreadsheet can"
    " be pasted, a CSV file dropped here."
)


class CurveEditor:
    """Draws and edits the curve of the error whose row is unfolded."""

    def __init__(self) -> None:
        self.version = 0
        self._said: dict[str, tuple[str, str, bool]] = {}  # text, what is said of it, whether wrong

    def html(self, state: AppState, key: str) -> Markup:
        """Give chart, origin and editor of an error."""
        row, function = parameter(key), edits.curve_of(state, key)
        only, excluded = key in state.exclusions.only, key in state.exclusions.excluded
        own, edited = origin_words(state, key)
        back = button("Undo the edit", f"errors:own.{key}", kind="link",
                      hint="Value and curve of the scene")  # fmt: skip
        return tag("div", join((
            _chart(state, row, function),
            rows([("Origin", own + (back if edited else EMPTY))], "ws-origin"),
            self._editor(row, function),
            tag("div", join((
                button("Only this error", "errors:only", key, pressed=only,
                       hint="Draw the machine with the errors chosen so, and no other"),
                button("Exclude", "errors:exclude", key, pressed=excluded,
                       hint="Draw the machine without this error; its value is kept"),
            )), class_="ws-actions"),
        )), class_="ws-error-more", data_key=f"more-{key}")  # fmt: skip

    def _editor(self, row: Parameter, function: ErrorFunction) -> Markup:
        kind, name, key = shape_kind(function), f"errors:rows.{row.key}", row.key
        kinds = (Constant.title,) if row.is_constant else kind_titles()
        kinds = kinds if function.edited_as_rows else (*kinds, kind)
        chosen = choice(f"errors:kind.{key}", kind, {title: title for title in kinds})
        text, said, wrong = self._said.get(key, (spell_rows(function), "", False))
        words = curve_kind(kind).row_words
        fields = field("Curve", chosen, f"errors:kind.{key}")
        if not function.edited_as_rows:
            return fields + tag("p", words[0].upper() + words[1:] + ".", class_="ws-tiny")
        return fields + fill(
            '<textarea id="{id}" class="ws-box ws-rows-box" data-set="{name}" rows="{count}"'
            ' spellcheck="false" aria-label="{label}" aria-invalid="{wrong}" title="{hint}">'
            '\n{text}</textarea><p class="ws-tiny">{words}</p>{said}',
            id=ident(name), name=name, count=min(max(text.count("\n") + 1, 2), 8), text=text,
            label=f"Numbers of {key}: {words}", hint=TYPING, wrong=str(wrong).lower(),
            words=f"{words}, in {row.unit}",
            said=tag("p", said, class_="ws-problem" if wrong else "ws-quiet",
                     role="alert" if wrong else "status") if said else EMPTY,
        )  # fmt: skip

    def take(self, state: AppState, what: str, key: str, value: str) -> AppState:
        """Change kind or numbers of a curve, or go back to the scene's."""
        self.version += 1
        self._said.pop(key, None)
        if what == "own":
            function = state.own_curves.get(key) or Constant(edits.axis_span(state, key))
            return edits.with_curve(state, key, function)
        span, present = edits.axis_span(state, key), edits.curve_of(state, key)
        try:
            if what == "kind":
                return edits.with_curve(state, key, convert_shape(present, value, span))
            entered = read_curve(shape_kind(present), value, span)
        except OptionError as error:
            self._said[key] = (value if what == "rows" else spell_rows(present), str(error), True)
            return state
        if entered.remarks:
            self._said[key] = (spell_rows(entered.function), " ".join(entered.remarks), False)
        return edits.with_curve(state, key, entered.function)


def origin_words(state: AppState, key: str) -> tuple[str, bool]:
    """Say where an error comes from, and whether it has been edited since."""
    scene = state.origin
    own = state.own_curves.get(key)
    uncertainty, measurement = scene.uncertainty.get(key), scene.measured.get(key)
    if own is None:
        words = "zero, not given in the scene"
    elif measurement is not None:
        runs = len(measurement.runs)
        words = f"measured: {measurement.count} readings in {runs} runs, file {scene.name}"
    elif uncertainty is not None:
        words = f"fitted to measurements, file {scene.name}"
    else:
        words = "assumed: given without readings"
    if uncertainty is not None:
        words += f"; u = {spell(abs(uncertainty.amplitude))} {parameter(key).unit} (k = 1)"
    before = own or Constant(edits.axis_span(state, key))
    edited = edits.curve_of(state, key) != before
    return (f"edited; before: {words} " if edited else words), edited


def _chart(state: AppState, row: Parameter, function: ErrorFunction) -> Markup:
    unit = state.scene.machine.axes[row.axis].unit
    at, value = sample_curve(function, edits.axis_span(state, row.key))
    curves = [Curve("", at, value)]
    if function.has_directions or len(function.lines) > 1:
        styles = ("thin", "dashed")
        ends = (function.lines[0], function.lines[-1])
        curves += [
            Curve(name, at, _finite(line.evaluate(at)), 0, style)
            for (name, line), style in zip(ends, styles, strict=True)
        ]
    bands = []
    if (uncertainty := state.scene.uncertainty.get(row.key)) is not None:
        half = uncertainty.evaluate(at)
        bands = [Band("standard uncertainty", at, value - half, value + half)]
    if (measured := state.scene.measured.get(row.key)) is not None:
        for way, points in measured.scatter.items():
            few = points[:: -(-len(points) // FEW_READINGS)]
            few = few[np.argsort(few[:, 0], kind="stable")]
            name = "readings backward" if way == BACKWARD else "readings"
            curves.append(Curve(name, few[:, 0], few[:, 1], 1 + (way == BACKWARD), "dots"))
    title = describe_curve(f"{row.key}, {row.name}", row.unit, unit, at, value)
    chart = Lines("lines", title, f"{row.axis} [{unit}]", f"{row.key} [{row.unit}]",
                  tuple(curves), tuple(bands))  # fmt: skip
    return tag("div", lines_html(chart), class_="ws-curve")


def _finite(values: Array) -> Array:
    return np.where(np.isfinite(values), values, np.nan)


def describe_curve(name: str, unit: str, along: str, at: Array, value: Array) -> str:
    """Say what the curve of an error shows, for those who do not see it."""
    places = [0, len(at) - 1, int(np.argmin(value)), int(np.argmax(value))]
    words = ("starts with", "ends with", "least", "greatest")
    if np.ptp(value) == 0.0:
        return f"{name}: {spell(float(value[0]))} {unit} everywhere"
    said = [
        f"{word} {spell(float(value[place]))} {unit} at {spell(float(at[place]))} {along}"
        for word, place in zip(words, places, strict=True)
        if word.endswith("with") or place not in places[:2]
    ]
    return f"{name}: " + ", ".join(said)
