"""The shape of a component error as text that people edit, checked, and sampled for a chart."""

from dataclasses import dataclass

import numpy as np

from warpspace.app.state.typed_numbers import comma_rows, read_rows, spell_typed
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.curves.registry import CurveKind, curve_kind, curve_kinds
from warpspace.machine.curves.simple import Constant
from warpspace.machine.limits import MAX_CURVE_ROWS, MAX_CURVE_TEXT, MAX_ERROR
from warpspace.units import Array

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


def parse_shape(kind: str, text: str, span: tuple[float, float]) -> ErrorFunction:
    """Read the rows that a user has edited; as `read_curve`, without its remarks."""
    return read_curve(kind, text, span).function


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
