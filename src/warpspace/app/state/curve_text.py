"""The shape of a component error as text that people edit, checked, and sampled for a chart."""

import math
import re

import numpy as np

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.machine.curves.constant import Constant
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.curves.registry import CurveKind, curve_kind, curve_kinds
from warpspace.machine.limits import MAX_ERROR
from warpspace.units import Array

CHART_SAMPLES = 181
MAX_TEXT = 8000
MAX_KINKS = 500
"""Kinks of a curve that are drawn where they are."""
SHOWN_ROWS = 200
"""Rows of a measured table that are offered for editing; longer ones are thinned out."""


def kind_titles() -> tuple[str, ...]:
    """List what the kinds of curve are called, simplest first."""
    return tuple(kind.title for kind in curve_kinds())


def shape_kind(function: ErrorFunction | None) -> str:
    """Give the title of the kind of a function; an absent one is a constant."""
    return Constant.title if function is None else function.title


def spell_rows(function: ErrorFunction | None) -> str:
    """Write the numbers of a function as the rows that `parse_shape` reads."""
    if function is None:
        return "0"
    rows = function.rows()
    if len(rows) > SHOWN_ROWS:
        rows = [rows[i] for i in np.linspace(0, len(rows) - 1, SHOWN_ROWS).astype(int)]
    return "\n".join("  ".join(f"{value:.6g}" for value in row) for row in rows)


def parse_shape(kind: str, text: str, span: tuple[float, float]) -> ErrorFunction:
    """Read the rows that a user has edited.

    Parameters
    ----------
    kind : str
        Title of a kind of curve.
    text : str
        Rows of numbers; blanks, semicolons and tabs between the numbers, a comma with a blank as
        well, `#` starts a remark.
    span : tuple of float, (2,), mm or degrees
        Range of the axis.

    Returns
    -------
    ErrorFunction

    Raises
    ------
    OptionError
        Naming the row, what it holds and what was expected.
    """
    chosen = _kind(kind)
    if len(text) > MAX_TEXT:
        raise OptionError(f"{len(text):,} characters; expected at most {MAX_TEXT:,}")
    lines = (line.split("#", 1)[0].strip() for line in text.splitlines())
    rows = [_numbers(number, line) for number, line in enumerate(lines, start=1) if line]
    if not rows:
        raise OptionError(f"no numbers; expected {chosen.row_words}")
    function = chosen.from_rows(span, rows)
    peak = function.amplitude
    if not abs(peak) <= MAX_ERROR:
        raise OptionError(f"the curve reaches {peak:.3g}; expected at most ±{MAX_ERROR:g}")
    return function


def convert_shape(
    function: ErrorFunction | None, kind: str, span: tuple[float, float]
) -> ErrorFunction:
    """Give a first curve of another kind with the amplitude of a present one.

    Parameters
    ----------
    function : ErrorFunction or None
    kind : str
        Title of a kind of curve.
    span : tuple of float, (2,), mm or degrees

    Returns
    -------
    ErrorFunction
        What the kind starts from; the present curve where the kind stays.
    """
    present = function or Constant(span)
    return present if shape_kind(function) == kind else _kind(kind).from_curve(present, span)


def sample_curve(function: ErrorFunction | None, span: tuple[float, float]) -> tuple[Array, Array]:
    """Sample a curve along the travel for a chart.

    Returns
    -------
    position : ndarray, [n], mm or degrees
    value : ndarray, [n], µm or µrad
        What no number holds is left out (NaN).
    """
    at = np.linspace(*span, CHART_SAMPLES)
    kinks = () if function is None else function.kinks
    if inside := [q for q in kinks if span[0] < q < span[1]][:MAX_KINKS]:
        at = np.unique(np.concatenate([at, inside]))
    value = np.zeros(at.shape) if function is None else function.evaluate(at)
    return at, np.where(np.isfinite(value), value, np.nan)


def _kind(title: str) -> CurveKind:
    """Find a kind of curve."""
    try:
        return curve_kind(title)
    except UnknownNameError as error:
        expected = f"expected one of {', '.join(error.known)}"
        raise OptionError(f"shape {title!r}; {expected}") from None


def _numbers(number: int, line: str) -> tuple[float, ...]:
    """Read the numbers of one line."""
    words = [word for word in re.split(r"[\s;|]+|,\s+", line.replace("−", "-")) if word]
    try:
        values = tuple(float(word.replace(",", ".")) for word in words)
    except ValueError:
        raise OptionError(f"row {number}: {line[:40]!r} holds what is no number") from None
    if not all(map(math.isfinite, values)):
        raise OptionError(f"row {number}: {line[:40]!r}; expected finite numbers")
    return values
