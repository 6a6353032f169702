"""The error list: errors by their effect, largest first; a row opens its curve and an editor."""

import unicodedata
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
from markupsafe import Markup

from warpspace.analysis.blocks import Band, Curve, Lines
from warpspace.app.browser import actions as do
from warpspace.app.browser import html
from warpspace.app.browser.html import fill
from warpspace.app.browser.templates import Templates
from warpspace.app.evaluation.compare import plain_state, present_words, without_table
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.block_html import lines_html
from warpspace.app.panels.file_dialogs import PLAIN
from warpspace.app.panels.panel import Context, Panel, Refresh, on
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.edits import amplitude_span
from warpspace.app.state.leaf import Identity, Span
from warpspace.app.state.tree import put
from warpspace.app.state.typed_numbers import comma_rows, read_rows, spell_typed
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.field.evaluate import build_basis
from warpspace.machine.axes import ErrorKind, Parameter, is_linear, parameter
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.curves.registry import CurveKind, curve_kind, curve_kinds
from warpspace.machine.curves.simple import Constant
from warpspace.machine.errors import BACKWARD
from warpspace.machine.limits import MAX_CURVE_ROWS, MAX_CURVE_TEXT, MAX_ERROR
from warpspace.scene.model import grid_basis
from warpspace.units import MINUS, Array, spell

HTML = Templates("errors")
CHART_SAMPLES = 181
MAX_KINKS = 500  # of a curve, drawn exactly


def kind_titles() -> list[str]:
    """List the titles of the kinds of curve that can be edited, simplest first."""
    return [kind.title for kind in curve_kinds() if kind.edited_as_rows]


def spell_rows(function: ErrorFunction) -> str:
    """Format the numbers of a function as the rows that `read_curve` reads.

    A table with more rows than can be edited is thinned out; kinds that have no rows return their
    description.
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
    """Read rows that a user has edited, or pasted from a spreadsheet.

    Returns the curve and remarks on ignored or reordered rows, a sentence each.
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
    rows, ignored = read_rows(text)
    if not rows:
        raise OptionError(f"no numbers; expected {kind.row_words}")
    ordered, tidied = kind.tidied(rows)
    function = kind.from_rows(span, ordered)
    peak = function.amplitude
    if not abs(peak) <= MAX_ERROR:
        raise OptionError(f"the curve reaches {peak:.3g}; expected at most ±{MAX_ERROR:g}")
    return function, (*ignored, *tidied)


# --- The row of an error --------------------------------------------------------------------------

MOST_READINGS = 400  # drawn, evenly spaced


@dataclass(frozen=True, slots=True)
class CurveEditFeedback:
    text: str  # rows as typed or read
    message: str
    is_problem: bool


def curve_html(state: AppState, key: str, feedback: CurveEditFeedback | None) -> Markup:
    row, function = parameter(key), state.curve(key)
    chart = lines_html(_chart(state, row, function))
    only, excluded = key in state.exclusions.only, key in state.exclusions.excluded
    editor = _editor(row, function, feedback)
    return HTML.curve(row, chart, *origin_words(state, key), editor, only, excluded)


def _editor(row: Parameter, function: ErrorFunction, feedback: CurveEditFeedback | None) -> Markup:
    titles, n_lines = [Constant.title] if row.is_constant else kind_titles(), 0
    if not function.edited_as_rows:
        titles, feedback = [*titles, function.title], None
    else:
        feedback = feedback or CurveEditFeedback(spell_rows(function), "", is_problem=False)
        n_lines = min(max(feedback.text.count("\n") + 1, 2), 8)
    kinds = dict(zip(titles, titles, strict=True))
    columns = function.row_words
    return HTML.editor(row, function.title, kinds, columns, feedback, n_lines)


def edit_curve(state: AppState, action: do.EditCurve) -> tuple[AppState, CurveEditFeedback | None]:
    """Edit kind or rows of a curve, or reset it to the scene; return the feedback."""
    key, value, feedback = action.key, action.value, None
    span, present = state.axis_span(key), state.curve(key)
    try:
        if action.edit == "rows":
            function, remarks = read_curve(type(present), value, span)
            if remarks:
                message = " ".join(remarks)
                feedback = CurveEditFeedback(spell_rows(function), message, is_problem=False)
        elif action.edit == "kind":
            kind = curve_kind(value)
            function = present if type(present) is kind else kind.from_curve(present, span)
        else:
            function = state.own_curves.get(key) or Constant(span)
    except (OptionError, UnknownNameError) as error:
        text = value if action.edit == "rows" else spell_rows(present)
        return state, CurveEditFeedback(text, str(error), is_problem=True)
    return edits.with_curve(state, key, function), feedback


def origin_words(state: AppState, key: str) -> tuple[str, bool]:
    """Describe the origin of an error; return also if it differs from the scene as opened."""
    scene, scene_curve, chain = state.origin, state.own_curves.get(key), state.scene.machine.chain
    if chain != scene.machine.chain:  # measured on another machine
        scene = replace(scene, uncertainty={}, measured={})
    uncertainty, measurement = scene.uncertainty.get(key), scene.measured.get(key)
    if scene_curve is None:
        text = "zero, not specified in the scene"
    elif measurement is not None:
        runs = len(measurement.runs)
        text = f"measured: {measurement.count} readings in {runs} runs, file {scene.name}"
    elif uncertainty is not None:
        text = f"fitted to measurements, file {scene.name}"
    else:
        text = "assumed: specified without readings"
    if chain != state.origin.machine.chain:
        text += f", for the chain {state.origin.machine.chain}"
    if uncertainty is not None:
        text += f"; u = {spell(abs(uncertainty.amplitude))} {parameter(key).unit} (k = 1)"
    curve, scene_curve = state.curve(key), scene_curve or Constant(state.axis_span(key))
    differs = curve != scene_curve
    file, reference = state.imported.get(key, ("", scene_curve))
    if file and differs:
        text = f"measured, {file} "
    return (f"edited; before: {text} " if differs and curve != reference else text), differs


def _chart(state: AppState, row: Parameter, function: ErrorFunction) -> Lines:
    unit = state.scene.machine.axes[row.axis].unit
    span = state.axis_span(row.key)
    inside = [q for q in function.kinks if span[0] < q < span[1]][:MAX_KINKS]
    at = np.unique(np.concatenate([np.linspace(*span, CHART_SAMPLES), inside]))
    value = _finite(function.evaluate(at))
    curves = [Curve("", at, value)]
    if function.has_directions or len(function.lines) > 1:
        styles = ("thin", "dashed")
        ends = (function.lines[0], function.lines[-1])
        curves += [
            Curve(name, at, _finite(line.evaluate(at)), 0, style)
            for (name, line), style in zip(ends, styles, strict=True)
        ]
    bands = []
    uncertainty = state.scene.uncertainty.get(row.key)
    measured = state.scene.measured.get(row.key)
    if uncertainty is not None:
        half = uncertainty.evaluate(at)
        bands = [Band("standard uncertainty", at, value - half, value + half)]
    if measured is not None:
        for direction, points in measured.scatter.items():
            drawn = points[:: -(-len(points) // MOST_READINGS)]
            drawn = drawn[np.argsort(drawn[:, 0], kind="stable")]
            is_backward = direction == BACKWARD
            name = "readings backward" if is_backward else "readings"
            curves.append(Curve(name, drawn[:, 0], drawn[:, 1], 1 + is_backward, "dots"))
    title = describe_curve(f"{row.key}, {row.name}", row.unit, unit, at, value)
    axes = f"{row.axis} [{unit}]", f"{row.key} [{row.unit}]"
    return Lines("lines", title, *axes, tuple(curves), tuple(bands))


def _finite(values: Array) -> Array:
    return np.where(np.isfinite(values), values, np.nan)


def describe_curve(name: str, unit: str, along: str, at: Array, value: Array) -> str:
    if np.ptp(value) == 0.0:
        return f"{name}: {spell(float(value[0]))} {unit} everywhere"
    ends = (0, len(at) - 1)
    places = {"starts with": ends[0], "ends with": ends[1], "least": int(np.argmin(value)),
              "greatest": int(np.argmax(value))}  # fmt: skip
    extremes = [
        f"{word} {spell(float(value[place]))} {unit} at {spell(float(at[place]))} {along}"
        for word, place in places.items()
        if word.endswith("with") or place not in ends
    ]
    return f"{name}: " + ", ".join(extremes)


LONGEST_QUERY = 80
FOLDED = "zero"  # section of the errors that are zero
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Ranking:
    """Order, bar scale and slider ranges of the rows; they are constant during a drag."""

    inputs: tuple[object, ...]
    gains: Mapping[str, float]
    amplitudes: Mapping[str, float]
    order: tuple[str, ...]
    used: tuple[str, ...]
    largest: float  # effect of the longest bar, µm
    spans: dict[str, Span]


class ErrorsPanel(Panel):
    """Search box, rows by effect, and a folded section of errors that are zero.

    The ranking is renewed when focus and pointer leave the list (the page sends a signal), or when
    errors are changed elsewhere, so that no row moves away from the pointer.
    """

    name = "errors"
    refresh = Refresh.IMMEDIATE

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._feedback: Mapping[str, CurveEditFeedback | None] = {}
        self._edited: set[str] = set()  # errors changed in this list since the last ranking
        self._is_edit = False  # since the last rendering
        self._shown: Mapping[str, float] = {}  # amplitudes of the last rendering
        self._ranking: Ranking | None = None
        self._memory: dict[str, tuple[object, Any]] = {}  # values with their inputs

    def _recall(self, name: str, inputs: object, compute: Callable[[], T]) -> T:
        """Return the value computed last, unless its inputs have changed."""
        if name not in self._memory or self._memory[name][0] != inputs:
            self._memory[name] = inputs, compute()
        return self._memory[name][1]

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        state = picture.state
        inputs = (Identity(state.scene), state.view_key, tuple(state.positions.items()))
        gains = self._recall("gains", inputs, lambda: _gains(picture))
        ranking = self._rank(state, gains)
        listed = (ranking.order, ranking.used, bool(state.changed_keys))
        inputs = (*listed, state.page, state.exclusions, picture.other_title)
        errors = self._recall("list", inputs, lambda: _list_html(picture, ranking))
        return {"errors": errors, **self._render_rows(state, ranking, gains)}

    def _rank(self, state: AppState, gains: Mapping[str, float]) -> Ranking:
        """Return the present ranking, or a new one if it is out of date."""
        ranking, positions = self._ranking, tuple(state.positions.items())
        view = state.view_key, state.shows_rotary
        inputs = (Identity(state.origin), tuple(state.amplitudes), *view, positions)
        is_own, self._is_edit = self._is_edit or state.amplitudes == self._shown, False
        self._shown = state.amplitudes
        if is_own and ranking is not None and ranking.inputs == inputs:  # not after an undo
            before = ranking.amplitudes
            changed = {key for key, value in state.amplitudes.items() if value != before.get(key)}
            if changed <= self._edited and (self._edited or ranking.gains is gains):
                return ranking
        effects = {key: gains.get(key, 0.0) * abs(at) for key, at in state.amplitudes.items()}

        def rank(key: str) -> tuple[bool, float]:  # those that the drawing shows come first
            return state.shows_rotary and is_linear(parameter(key).axis), -effects[key]

        order = tuple(sorted(effects, key=rank))
        largest, used = max(effects.values(), default=0.0) or 1.0, used_keys(state)
        self._edited, spans = set(), _spans(state)
        self._ranking = Ranking(inputs, gains, state.amplitudes, order, used, largest, spans)
        return self._ranking

    def _render_rows(
        self, state: AppState, ranking: Ranking, gains: Mapping[str, float]
    ) -> dict[str, str]:
        inputs = (Identity(state.scene), Identity(ranking), Identity(gains), state.exclusions,
                  state.page.row, Identity(self._feedback))  # fmt: skip
        rows_html = self._recall("rows", inputs, dict[str, tuple[float, str]])  # by key
        for key in ranking.order:
            value, span = state.amplitudes[key], ranking.spans[key]
            if key in rows_html and rows_html[key][0] == value:
                continue
            if abs(value) > span.high:  # typed
                span = ranking.spans[key] = amplitude_span(key, value, None)
            effect, row = gains.get(key, 0.0) * abs(value), parameter(key)
            share, active = min(effect / ranking.largest, 1.0), state.exclusions.active(key)
            hint = state.curve(key).slider_words(row.axis)
            row_html = _row(row, value, span, effect if active else None, share, hint)
            if key == state.page.row:
                row_html += curve_html(state, key, self._feedback.get(key))
            rows_html[key] = value, row_html
        return {f"error.{key}": rows_html[key][1] for key in ranking.order}

    @on(do.SetError, do.EditCurve)
    def edit(self, state: AppState, action: do.SetError | do.EditCurve) -> AppState | None:
        if action.key not in state.amplitudes:
            return None
        self._edited.add(action.key)
        self._is_edit = True
        if isinstance(action, do.SetError):
            return put(state, f"amplitudes.{action.key}", action.value)
        state, feedback = edit_curve(state, action)
        self._feedback = {**self._feedback, action.key: feedback}
        self.context.call_soon(self.rerender)  # also if the edit is refused
        return state

    @on(do.Signal.SORT_ERRORS)
    def sort(self, state: AppState) -> None:
        self._ranking = None
        self.context.call_soon(self.rerender)

    @on(do.Input.FIND_ERRORS)
    def find(self, state: AppState, query: str) -> AppState:
        self._ranking = None
        return replace(state, page=replace(state.page, query=query[:LONGEST_QUERY]))

    @on(do.Input.UNFOLD_ERROR)
    def unfold(self, state: AppState, key: str) -> AppState:
        row = key if key in state.amplitudes and key != state.page.row else ""
        return replace(state, page=replace(state.page, row=row))


def _list_html(picture: LivePicture, ranking: Ranking) -> str:
    state, page, used = picture.state, picture.state.page, ranking.used
    query = page.query.strip()
    matches = find_parameters(query, ranking.order) if query else used
    listed = [key for key in ranking.order if key in matches]
    zero = [key for key in ranking.order if not query and key not in matches]
    is_open, excluded = FOLDED in page.open, None
    if state.exclusions:
        excluded = sum(not state.exclusions.active(key) for key in used)
    has_menu = bool(state.exclusions or state.changed_keys or is_open)
    remark = present_words(picture) if picture.other_title else ""
    return HTML.list(page.query, listed, zero, is_open or not listed, page.row, excluded, len(used),
                     remark, has_menu)  # fmt: skip


def _row(
    row: Parameter, value: float, span: Span, effect: float | None, share: float, hint: str
) -> Markup:
    """Render the row of an error; an excluded one has no effect."""
    key, name, text = row.key, do.SetError(row.key), _short(value)
    return fill(
        '<div class="{kind}" id="ws-error-{key}" data-do="{unfold}"'
        ' title="{symbol}, {title}: {quantity}"><span>{effect} µm</span><b>{key}</b> {title}</div>'
        '<div class="ws-effect"><i style="width:{share}%"></i></div>'
        '<div class="ws-error-set" title="{hint}">'
        '<svg class="ws-kind" aria-hidden="true"><use href="#ws-kind-{pictogram}"/></svg>{slider}'
        '<span class="ws-edit" id="ws-box-{key}" data-box="{name}" data-text="{typed}"'
        ' data-label="{key} in {unit}">{text}</span><span class="ws-unit">{unit}</span></div>',
        kind="ws-error-head off" if effect is None else "ws-error-head", key=key, name=name,
        unfold=do.Input.UNFOLD_ERROR(key),
        symbol=row.symbol, quantity=row.kind.value, title=row.name, unit=row.unit,
        pictogram=row.name.partition(" ")[0],
        effect="–" if effect is None else html.number(effect), share=f"{100.0 * share:.1f}",
        typed=spell_typed(value), text=text,
        hint=f"{row.name}: {hint}. Drag, or type a number.",
        slider=html.slider(name, value, span.low, span.high, span.step, twin=f"box-{key}",
                      label=f"{key} {row.name}", text=f"{text} {row.unit}"),
    )  # fmt: skip


def _short(value: float) -> str:
    """Format a value for a row: four digits, and all before the point."""
    short = float(f"{value:.4g}") if abs(value) < 1000.0 else round(value, 1)
    return spell_typed(short).replace("-", MINUS)


def _spans(state: AppState) -> dict[str, Span]:
    """Compute the ranges of sliders: one for all errors of a kind, wider for large values."""
    scene = state.origin
    kinds: dict[ErrorKind, list[Span]] = defaultdict(list)
    for key, start in state.start.items():
        kinds[parameter(key).kind].append(amplitude_span(key, start, scene.tolerances.get(key)))
    widest = {kind: max(spans, key=lambda span: span.high) for kind, spans in kinds.items()}
    return {key: widest[parameter(key).kind] for key in state.amplitudes}


def _gains(picture: LivePicture) -> dict[str, float]:
    """Compute the RMS effect of a unit of each error of the present state, µm.

    Over the volume; of an error of a rotary axis over its traces where that is more.
    """
    if picture.compared is not None:  # another state may be drawn
        picture = PLAIN.evaluate(without_table(plain_state(picture.state)))
    state = picture.state
    basis = grid_basis(state.scene, picture.grid, picture.view)
    squares = np.sum(basis.position**2, axis=-1).reshape(len(basis.keys), -1)
    rms = np.sqrt(squares @ picture.grid.weights.reshape(-1))
    gains = dict(zip(basis.keys, rms.tolist(), strict=True))
    scene = state.scene
    for of in picture.traces:
        keys = [key for key in basis.keys if not is_linear(parameter(key).axis)]
        at, view = of.group.coordinates, state.view(of.group.loop)
        traced = build_basis(scene.model, scene.errors, keys, at, view, of.group.nominal_mm)
        squares = np.sum(traced.position**2, axis=-1).reshape(len(keys), -1).mean(axis=1)
        for key, square in zip(keys, squares.tolist(), strict=True):
            gains[key] = max(gains[key], float(np.sqrt(square)))
    return gains


# --- Search of error parameters by key, symbol, name, axis and kind -------------------------------

_GREEK = {"δ": "delta", "ε": "epsilon", "α": "alpha", "β": "beta", "γ": "gamma"}
_FILLER = frozenset({"of", "the", "to", "in", "about", "axis", "error", "errors"})
_NEAR = 0.75


def find_parameters(query: str, keys: Sequence[str]) -> tuple[str, ...]:
    parts = fold(query[:LONGEST_QUERY]).split()
    tokens = [part for part in parts if part not in _FILLER] or parts
    rows = [parameter(key) for key in keys]
    exact = tuple(row.key for row in rows if all(_fits(token, row) for token in tokens))
    if exact:
        return exact
    terms = list({term for row in rows for term in _terms(row) if len(term) > 2})
    tokens = [(get_close_matches(t, terms, n=1, cutoff=_NEAR) or [t])[0] for t in tokens]
    return tuple(row.key for row in rows if all(_fits(token, row) for token in tokens))


def fold(text: str) -> str:
    """Normalise case, accents and Greek letters; punctuation becomes blanks."""
    plain = unicodedata.normalize("NFKD", text).casefold()
    for letter, name in _GREEK.items():
        plain = plain.replace(letter, f" {name} ")
    return "".join(c if c.isalnum() else " " for c in plain if not unicodedata.combining(c))


@lru_cache(maxsize=256)
def _terms(row: Parameter) -> tuple[str, ...]:
    symbol = fold(row.symbol)
    names = fold(f"{row.key} {row.name} {row.kind.value} {row.axis} {row.unit}")
    return (*names.split(), *symbol.split(), symbol.replace(" ", ""))


def _fits(token: str, row: Parameter) -> bool:
    """Check if a token matches a parameter: a single letter its axis, a longer one a prefix.

    A key matches anywhere, so that "c0y" finds EC0Y.
    """
    if len(token) == 1:
        return token == row.axis.casefold() or token in fold(row.name).split()
    return any(term.startswith(token) for term in _terms(row)) or token in row.key.casefold()


def used_keys(state: AppState) -> tuple[str, ...]:
    """List the errors that are not zero now, or were not in the scene; with those that are drawn.

    The drawing of the rotary axes lists all errors of rotary axes, to be set there.
    """
    return tuple(
        key
        for key, value in state.amplitudes.items()
        if value or state.start[key]
        or (state.shows_rotary and not is_linear(parameter(key).axis))
    )  # fmt: skip
