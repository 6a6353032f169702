"""The curve of one error in its row: drawn, said where it comes from, and edited as numbers."""

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


def kind_titles() -> list[str]:
    """List what the kinds of curve are called that people can write, simplest first."""
    return [kind.title for kind in curve_kinds() if kind.edited_as_rows]


def spell_rows(function: ErrorFunction) -> str:
    """Write the numbers of a function as the rows that `read_curve` reads.

    A measured table with more rows than may be edited is thinned out; of a kind that cannot be
    written as rows it is said where it comes from.
    """
    if not function.edited_as_rows:
        return function.row_words
    rows = function.rows()
    if len(rows) > MAX_CURVE_ROWS:
        rows = [rows[i] for i in np.linspace(0, len(rows) - 1, MAX_CURVE_ROWS).astype(int)]
    return "\n".join("  ".join(map(spell_typed, row)) for row in rows)


def read_curve(
    kind: CurveKind, text: str, span: tuple[float, float]
) -> tuple[ErrorFunction, tuple[str, ...]]:
    """Read the rows that a user has edited, or pasted from a spreadsheet.

    Gives with the curve what was left out or put in order, a sentence each.
    """
    if len(text) > MAX_CURVE_TEXT:
        raise OptionError(f"{len(text):,} characters; expected at most {MAX_CURVE_TEXT:,}")
    try:
        return _read(kind, text, span)
    except OptionError:
        with_commas = comma_rows(text)
        if with_commas is None:
            raise
    return _read(kind, with_commas, span)


def _read(
    kind: CurveKind, text: str, span: tuple[float, float]
) -> tuple[ErrorFunction, tuple[str, ...]]:
    rows, left_out = read_rows(text)
    if not rows:
        raise OptionError(f"no numbers; expected {kind.row_words}")
    ordered, tidied = kind.tidied(rows)
    function = kind.from_rows(span, ordered)
    peak = function.amplitude
    if not abs(peak) <= MAX_ERROR:
        raise OptionError(f"the curve reaches {peak:.3g}; expected at most ±{MAX_ERROR:g}")
    return function, (*left_out, *tidied)


def sample_curve(function: ErrorFunction, span: tuple[float, float]) -> tuple[Array, Array]:
    inside = [q for q in function.kinks if span[0] < q < span[1]][:MAX_KINKS]
    at = np.unique(np.concatenate([np.linspace(*span, CHART_SAMPLES), inside]))
    return at, _finite(function.evaluate(at))


# --- The row of an error --------------------------------------------------------------------------

FEW_READINGS = 400  # that are drawn at most, evenly picked from all
TYPING = (
    "Blanks, tabs or semicolons between numbers; decimal point or comma. Cells of a spreadsheet can"
    " be pasted, a CSV file dropped here."
)


Said = tuple[str, str, bool]
"""The rows as typed or read, what is said of them, and whether that is a problem."""


def curve_html(state: AppState, key: str, said: Said | None) -> Markup:
    """Give chart, origin and editor of an error."""
    row, function = parameter(key), state.curve(key)
    only, excluded = key in state.exclusions.only, key in state.exclusions.excluded
    own, edited = origin_words(state, key)
    back = button("Undo the edit", f"errors:own.{key}", kind="link",
                  hint="Value and curve of the scene")  # fmt: skip
    return tag("div", join((
        _chart(state, row, function),
        rows([("Origin", own + (back if edited else EMPTY))], "ws-origin"),
        _editor(row, function, said or (spell_rows(function), "", False)),
        tag("div", join((
            button("Only this error", "state:set.exclusions.only", f"{'-' if only else '+'}{key}",
                   pressed=only, hint="Draw the machine with the errors chosen so, and no other"),
            button("Exclude", "state:set.exclusions.excluded", f"{'-' if excluded else '+'}{key}",
                   pressed=excluded, hint="Draw the machine without this error; its value is kept"),
        )), class_="ws-actions"),
    )), class_="ws-error-more", data_key=f"more-{key}")  # fmt: skip


def _editor(row: Parameter, function: ErrorFunction, told: Said) -> Markup:
    name, kind, words = f"errors:rows.{row.key}", f"errors:kind.{row.key}", function.row_words
    titles = [Constant.title] if row.is_constant else kind_titles()
    titles += [] if function.edited_as_rows else [function.title]
    fields = field("Curve", choice(kind, function.title, {title: title for title in titles}), kind)
    if not function.edited_as_rows:
        return fields + tag("p", words[0].upper() + words[1:] + ".", class_="ws-tiny")
    text, said, wrong = told
    return fields + fill(
        '<textarea id="{id}" class="ws-box ws-rows-box" data-set="{name}" rows="{count}"'
        ' spellcheck="false" aria-label="{label}" aria-invalid="{wrong}" title="{hint}">'
        '\n{text}</textarea><p class="ws-tiny">{words}</p>{said}',
        id=ident(name), name=name, count=min(max(text.count("\n") + 1, 2), 8), text=text,
        label=f"Numbers of {row.key}: {words}", hint=TYPING, wrong=str(wrong).lower(),
        words=f"{words}, in {row.unit}",
        said=tag("p", said, class_="ws-problem" if wrong else "ws-quiet",
                 role="alert" if wrong else "status") if said else EMPTY,
    )  # fmt: skip


def edit_curve(state: AppState, what: str, key: str, value: str) -> tuple[AppState, Said | None]:
    """Change kind or numbers of a curve, or go back to the scene's; say what there is to say."""
    span, present = state.axis_span(key), state.curve(key)
    said: Said | None = None
    try:
        if what == "rows":
            function, remarks = read_curve(type(present), value, span)
            said = (spell_rows(function), " ".join(remarks), False) if remarks else None
        elif what == "kind":
            kind = curve_kind(value)
            function = present if type(present) is kind else kind.from_curve(present, span)
        else:
            function = state.own_curves.get(key) or Constant(span)
    except (OptionError, UnknownNameError) as error:
        return state, (value if what == "rows" else spell_rows(present), str(error), True)
    return edits.with_curve(state, key, function), said


def origin_words(state: AppState, key: str) -> tuple[str, bool]:
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
    before = own or Constant(state.axis_span(key))
    edited = state.curve(key) != before
    return (f"edited; before: {words} " if edited else words), edited


def _chart(state: AppState, row: Parameter, function: ErrorFunction) -> Markup:
    unit = state.scene.machine.axes[row.axis].unit
    at, value = sample_curve(function, state.axis_span(row.key))
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
    if np.ptp(value) == 0.0:
        return f"{name}: {spell(float(value[0]))} {unit} everywhere"
    ends = (0, len(at) - 1)
    places = {"starts with": ends[0], "ends with": ends[1], "least": int(np.argmin(value)),
              "greatest": int(np.argmax(value))}  # fmt: skip
    said = [
        f"{word} {spell(float(value[place]))} {unit} at {spell(float(at[place]))} {along}"
        for word, place in places.items()
        if word.endswith("with") or place not in ends
    ]
    return f"{name}: " + ", ".join(said)
