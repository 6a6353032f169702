"""The column at the left: errors by their effect, the largest first; a row opens into its curve."""

import unicodedata
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from functools import lru_cache

import numpy as np
from markupsafe import Markup

from warpspace.analysis.blocks import Band, Curve, Lines
from warpspace.app.browser.html import (
    EMPTY,
    button,
    choice,
    field,
    fill,
    ident,
    join,
    number,
    rows,
    slider,
    tag,
    text_box,
)
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.block_html import lines_html
from warpspace.app.panels.panel import Context, Panel, Refresh
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.edits import amplitude_span
from warpspace.app.state.leaf import Identity, Span
from warpspace.app.state.tree import put
from warpspace.app.state.typed_numbers import comma_rows, read_rows, spell_typed
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.machine.axes import ErrorKind, Parameter, parameter
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.curves.registry import CurveKind, curve_kind, curve_kinds
from warpspace.machine.curves.simple import Constant
from warpspace.machine.errors import BACKWARD
from warpspace.machine.limits import MAX_CURVE_ROWS, MAX_CURVE_TEXT, MAX_ERROR
from warpspace.scene.model import grid_basis
from warpspace.units import MINUS, Array, spell

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


LONGEST_QUERY = 80
FOLDED = "zero"  # section of the errors that are zero
OF_ALL = {
    "reset": ("Reset to the scene", "Values and curves of the scene"),
    "zero": ("Set all to zero", "The nominal machine"),
    "include": ("Include all", "End every “only” and “exclude”"),
}
"""What can be done with all errors: words and hint by event of the page."""


class ErrorsPanel(Panel):
    """Search, rows by effect, and those that are zero folded away.

    Order, scale of the bars and ranges of the sliders stay until the hand has left the column
    (`sort`, sent by the page), or something else has changed the errors: nothing slips away from
    under the pointer.
    """

    name = "errors"
    refresh = Refresh.IMMEDIATE

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._said: Mapping[str, Said | None] = {}  # of the rows of curves
        self._gains: Mapping[str, float] = {}
        self._gains_for: tuple[object, ...] = ()
        self._sorted_for: tuple[object, ...] = ()
        self._sorted_at: Mapping[str, float] = {}  # amplitudes when the rows were last sorted
        self._own: set[str] = set()  # errors that this column has changed since then
        self._order: tuple[str, ...] = ()
        self._used: tuple[str, ...] = ()
        self._largest = 1.0
        self._spans: dict[str, Span] = {}
        self._listed: object = None  # what the list was written for
        self._made: Mapping[str, float] = {}  # amplitudes that the rows were written with
        self._made_for: tuple[object, ...] = ()

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        state = picture.state
        made_for = (Identity(state.scene), state.view_key, tuple(state.positions.items()))
        if made_for != self._gains_for:
            self._gains, self._gains_for = _gains(picture, state), made_for
            self._sorted_for = self._sorted_for if self._own else ()
        sorted_for = (Identity(state.origin), tuple(state.amplitudes), *made_for[1:])
        before = self._sorted_at
        changed = {key for key, value in state.amplitudes.items() if value != before.get(key)}
        if sorted_for != self._sorted_for or changed - self._own:
            self._sort(state)
            self._sorted_for, self._sorted_at, self._own = sorted_for, state.amplitudes, set()
        listed = (self._order, self._used, state.page, state.exclusions, bool(state.changed_keys))
        found = {} if listed == self._listed else self._list(state)
        self._listed = listed
        return {**found, **self._rows(state)}

    def _effect(self, state: AppState, key: str) -> float:
        return self._gains.get(key, 0.0) * abs(state.amplitudes[key])

    def _sort(self, state: AppState) -> None:
        effects = {key: self._effect(state, key) for key in state.amplitudes}
        self._order = tuple(sorted(effects, key=lambda key: -effects[key]))
        self._used = used_keys(state)
        self._largest = max(effects.values(), default=0.0) or 1.0
        self._spans = _spans(state)

    def _list(self, state: AppState) -> dict[str, str]:
        query, used = state.page.query, self._used
        found = find_parameters(query, self._order) if query.strip() else used
        listed = [key for key in self._order if key in found]
        zero = [] if query.strip() else [key for key in self._order if key not in found]
        opened = FOLDED in state.page.open or not listed
        places = _places(listed, state.page.row)
        if query.strip() and not listed:
            places = tag("p", "No error goes by this name.", class_="ws-quiet")
        elif zero:
            words = tag("div", f"{len(zero)} errors are zero",
                        data_do="page:fold", data_value=FOLDED, id="ws-error-zero")  # fmt: skip
            places += tag(
                "div", words, class_="ws-zero", role="treeitem", aria_labelledby="ws-error-zero",
                tabindex=-1 if listed else 0, aria_expanded=str(opened).lower(),
            )  # fmt: skip
            places += _places(zero, state.page.row) if opened else EMPTY
        if listed or zero:  # for the keyboard: arrows go along it, Enter unfolds
            places = tag("div", places, role="tree", aria_label="Errors by effect")
        left_out: tuple[object, ...] = ()
        if state.exclusions:
            count = sum(not state.exclusions.active(key) for key in used)
            left_out = (f"{count} of {len(used)} errors left out. ",
                        button("Include all", "page:include", kind="link"))  # fmt: skip
        find = text_box(
            "errors:find", query, placeholder="Find an error  /", live=True, label="Find an error",
            id="ws-find",
        )  # fmt: skip
        menu = tag("details", tag("summary", "⋯", aria_label="All errors", title="All errors")
                   + tag("div", join(button(words, f"page:{word}", kind="quiet", hint=hint)
                                     for word, (words, hint) in OF_ALL.items())),
                   class_="ws-menu")  # fmt: skip
        touched = state.exclusions or state.changed_keys or FOLDED in state.page.open
        head = tag("div", find + (menu if touched else ""), class_="ws-find")
        body = tag("div", places, class_="ws-errors", data_leave="errors:sort")
        return {"errors": head + tag("p", join(left_out), class_="ws-quiet") + body}

    def _rows(self, state: AppState) -> dict[str, str]:
        pieces: dict[str, str] = {}
        made_for = (Identity(state.scene), self._gains_for, Identity(self._spans), state.exclusions,
                    state.page.row, Identity(self._said))  # fmt: skip
        made = self._made if made_for == self._made_for else {}
        self._made, self._made_for = state.amplitudes, made_for
        for key in self._order:
            value, span = state.amplitudes[key], self._spans[key]
            if value == made.get(key):
                continue
            if abs(value) > span.high:  # typed
                span = self._spans[key] = amplitude_span(key, value, None)
            effect, row = self._effect(state, key), parameter(key)
            share, active = min(effect / self._largest, 1.0), state.exclusions.active(key)
            hint = state.curve(key).slider_words(row.axis)
            html = _row(row, value, span, effect, share, hint, active=active)
            opened = key == state.page.row
            curve = curve_html(state, key, self._said.get(key)) if opened else EMPTY
            pieces[f"error.{key}"] = html + curve
        return pieces

    def take(self, state: AppState, word: str, value: str) -> AppState:
        what, _, key = word.partition(".")
        if what in ("set", "kind", "rows", "own") and key in state.amplitudes:
            self._own.add(key)
            if what == "set":
                return put(state, f"amplitudes.{key}", value)
            state, said = edit_curve(state, what, key, value)
            self._said = {**self._said, key: said}
            self.context.act(self.renew)  # also where it is refused
            return state
        if what in ("sort", "find"):
            self._sorted_for = ()
        if what == "sort":
            self.context.act(self.renew)
        if what == "find":
            return replace(state, page=replace(state.page, query=value[:LONGEST_QUERY]))
        if what == "row":
            row = value if value in state.amplitudes and value != state.page.row else ""
            return replace(state, page=replace(state.page, row=row))
        return state


def _places(keys: list[str], row: str) -> Markup:
    start = row if row in keys else next(iter(keys), "")
    return join(
        tag("div", "", data_piece=f"error.{key}", class_="ws-error", role="treeitem",
            aria_expanded=str(key == row).lower(), aria_labelledby=f"ws-error-{key}",
            tabindex=0 if key == start else -1)
        for key in keys
    )  # fmt: skip


def _row(
    row: Parameter, value: float, span: Span, effect: float, share: float, hint: str, *,
    active: bool,
) -> Markup:  # fmt: skip
    html = _row_template(row, span, hint, active).format(
        effect=number(effect) if active else "–", share=f"{100.0 * share:.1f}",
        value=f"{value:.10g}", typed=spell_typed(value), text=_shown(value),
    )  # fmt: skip
    return Markup(html)  # noqa: S704 - escaped there


@lru_cache(maxsize=128)
def _row_template(row: Parameter, span: Span, hint: str, active: bool) -> str:
    key, name, text = row.key, f"errors:set.{row.key}", Markup("{text}")
    hint = f"{row.name}: {hint}. Drag, or type a number.".replace("{", "{{").replace("}", "}}")
    head = fill(
        '<div class="{kind}" id="ws-error-{key}" data-do="errors:row" data-value="{key}"'
        ' title="{symbol}, {words}: {of}"><span>{effect} µm</span><b>{key}</b> {words}</div>',
        kind="ws-error-head" if active else "ws-error-head off", key=key, symbol=row.symbol,
        of=row.kind.value, words=row.name, effect=Markup("{effect}"),
    )  # fmt: skip
    body = fill(
        '<div class="ws-effect"><i style="width:{share}%"></i></div>'
        '<div class="ws-error-set" title="{hint}">{slider}'
        '<span class="ws-edit" id="ws-box-{key}" data-box="{name}" data-text="{typed}"'
        ' data-label="{key} in {unit}">{text}</span><span class="ws-unit">{unit}</span></div>',
        share=Markup("{share}"), key=key, name=name, typed=Markup("{typed}"), text=text, hint=hint,
        slider=slider(name, "{value}", span.low, span.high, span.step, twin=f"box-{key}",
                      label=f"{key} {row.name}", text=f"{text} {row.unit}"),
        unit=row.unit,
    )  # fmt: skip
    return f"{head}{body}"


def _shown(value: float) -> str:
    """Spell a value as a row has room for: four digits, and all before the point."""
    short = float(f"{value:.4g}") if abs(value) < 1000.0 else round(value, 1)
    return spell_typed(short).replace("-", MINUS)


def _spans(state: AppState) -> dict[str, Span]:
    """Give the ranges of sliders: one for all errors of a kind, wider where a value needs it."""
    scene = state.origin
    kinds: dict[ErrorKind, list[Span]] = defaultdict(list)
    for key, start in state.start.items():
        kinds[parameter(key).kind].append(amplitude_span(key, start, scene.tolerances.get(key)))
    widest = {kind: max(spans, key=lambda span: span.high) for kind, spans in kinds.items()}
    return {key: widest[parameter(key).kind] for key in state.amplitudes}


def _gains(picture: LivePicture, state: AppState) -> dict[str, float]:
    """Give the RMS effect in the volume of a unit of each error alone, µm."""
    basis = grid_basis(state.scene, picture.grid, picture.view)
    squares = np.sum(basis.position**2, axis=-1).reshape(len(basis.keys), -1)
    rms = np.sqrt(squares @ picture.grid.weights.reshape(-1))
    return dict(zip(basis.keys, rms.tolist(), strict=True))


# --- Finding error parameters by what people call them --------------------------------------------
# Key, symbol, plain name, axis, kind.

_GREEK = {"δ": "delta", "ε": "epsilon", "α": "alpha", "β": "beta", "γ": "gamma"}
_FILLER = frozenset({"of", "the", "to", "in", "about", "axis", "error", "errors"})
_NEAR = 0.75


def find_parameters(query: str, keys: Sequence[str]) -> tuple[str, ...]:
    words = fold(query[:LONGEST_QUERY]).split()
    tokens = [word for word in words if word not in _FILLER] or words
    if not tokens:
        return tuple(keys)
    rows = [parameter(key) for key in keys]
    exact = tuple(row.key for row in rows if all(_fits(token, row) for token in tokens))
    if exact:
        return exact
    known = list({word for row in rows for word in _words(row) if len(word) > 2})
    meant = [get_close_matches(token, known, n=1, cutoff=_NEAR) or [token] for token in tokens]
    return tuple(row.key for row in rows if all(_fits(token, row) for (token,) in meant))


def fold(text: str) -> str:
    """Fold case, accents and spelling of Greek letters away; punctuation becomes blanks."""
    plain = unicodedata.normalize("NFKD", text).casefold()
    for letter, name in _GREEK.items():
        plain = plain.replace(letter, f" {name} ")
    return "".join(c if c.isalnum() else " " for c in plain if not unicodedata.combining(c))


@lru_cache(maxsize=256)
def _words(row: Parameter) -> tuple[str, ...]:
    symbol = fold(row.symbol)
    said = fold(f"{row.key} {row.name} {row.kind.value} {row.axis} {row.unit}")
    return (*said.split(), *symbol.split(), symbol.replace(" ", ""))


def _fits(token: str, row: Parameter) -> bool:
    """Tell whether a word fits a parameter: a single letter its axis, a longer one any beginning.

    A key fits from its second letter as well, so that "c0y" finds EC0Y.
    """
    words = _words(row)
    if len(token) == 1:
        return token == row.axis.casefold() or token in fold(row.name).split()
    return any(word.startswith(token) for word in words) or token in row.key.casefold()


def used_keys(state: AppState) -> tuple[str, ...]:
    """Give the errors that are not zero now, or were not when the scene was opened."""
    return tuple(key for key, value in state.amplitudes.items() if value or state.start[key])
