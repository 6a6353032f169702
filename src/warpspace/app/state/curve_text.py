"""The shape of a component error as text that people edit, checked, and sampled for a chart."""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.machine.errors import Constant, ErrorFunction, Harmonics, Poly, Ramp, Table
from warpspace.scene.schema import MAX_ERROR, MAX_LENGTH_MM, MAX_ORDER
from warpspace.units import Array

CHART_SAMPLES = 181
MAX_TEXT = 8000
MAX_COEFFICIENTS, MAX_TERMS, MAX_ROWS = 16, 64, 500
SHOWN_ROWS = 200
"""Rows of a measured table that are offered for editing; longer ones are thinned out."""
Numbers = list[tuple[float, ...]]


@dataclass(frozen=True, slots=True)
class ShapeKind:
    """One kind of curve.

    Attributes
    ----------
    name : str
        What the choice is called.
    function : type
        Class of its functions.
    rows : str
        How its numbers are written, one row a line.
    build : callable
        Makes the function of a span from rows of numbers.
    spell : callable
        Gives the rows of a function.
    """

    name: str
    function: type[ErrorFunction]
    rows: str
    build: "Callable[[tuple[float, float], Numbers], ErrorFunction]"
    spell: Callable[[ErrorFunction], Sequence[Sequence[float]]]


def shape_kind(function: ErrorFunction | None) -> str:
    """Give the name of the kind of a function; an absent one is a constant."""
    return next((k.name for k in KINDS.values() if isinstance(function, k.function)), "constant")


def spell_rows(function: ErrorFunction | None) -> str:
    """Write the numbers of a function as the rows that `parse_shape` reads."""
    if function is None:
        return "0"
    rows = KINDS[shape_kind(function)].spell(function)
    if len(rows) > SHOWN_ROWS:
        rows = [rows[i] for i in np.linspace(0, len(rows) - 1, SHOWN_ROWS).astype(int)]
    return "\n".join("  ".join(f"{value:.6g}" for value in row) for row in rows)


def parse_shape(kind: str, text: str, span: tuple[float, float]) -> ErrorFunction:
    """Read the rows that a user has edited.

    Parameters
    ----------
    kind : str
        A key of `KINDS`.
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
    if kind not in KINDS:
        raise OptionError(f"shape {kind!r}; expected one of {', '.join(KINDS)}")
    if len(text) > MAX_TEXT:
        raise OptionError(f"{len(text):,} characters; expected at most {MAX_TEXT:,}")
    lines = (line.split("#", 1)[0].strip() for line in text.splitlines())
    rows = [_numbers(number, line) for number, line in enumerate(lines, start=1) if line]
    if not rows:
        raise OptionError(f"no numbers; expected {KINDS[kind].rows}")
    function = KINDS[kind].build(span, rows)
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
        A key of `KINDS`.
    span : tuple of float, (2,), mm or degrees

    Returns
    -------
    ErrorFunction
        A polynomial or table follows the present curve, a harmonic has one wave over the range.
    """
    present = function or Constant(span)
    if shape_kind(function) == kind:
        return present
    value = present.amplitude
    low, high = span
    match kind:
        case "constant":
            return Constant(span, value)
        case "ramp":
            return Ramp(span, value)
        case "polynomial":
            first, last = (float(v) for v in present.evaluate(np.array(span)))
            slope = (last - first) / (high - low)
            return Poly(span, (first - slope * low, slope))
        case "harmonics":
            return Harmonics(span, ((float(f"{360.0 / (high - low):.6g}"), value, 0.0),))
        case "table":
            at = np.linspace(low, high, 5)
            values = present.evaluate(at)
            return Table(span, tuple(zip(at.tolist(), values.tolist(), strict=True)))
        case _:
            raise OptionError(f"shape {kind!r}; expected one of {', '.join(KINDS)}")


def sample_curve(function: ErrorFunction | None, span: tuple[float, float]) -> tuple[Array, Array]:
    """Sample a curve along the travel for a chart.

    Returns
    -------
    position : ndarray, [n], mm or degrees
    value : ndarray, [n], µm or µrad
        What no number holds is left out (NaN).
    """
    at = np.linspace(*span, CHART_SAMPLES)
    if isinstance(function, Table):
        # Kinks are drawn where they are.
        inside = [q for q, _ in function.points if span[0] < q < span[1]][:MAX_ROWS]
        at = np.unique(np.concatenate([at, inside]))
    value = np.zeros(at.shape) if function is None else function.evaluate(at)
    return at, np.where(np.isfinite(value), value, np.nan)


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


def _single(rows: Numbers) -> float:
    """Take the one number there is."""
    if len(rows) != 1 or len(rows[0]) != 1:
        raise OptionError("expected one number")
    return _limited(rows[0][0], 1)


def _limited(value: float, row: int, limit: float = MAX_ERROR, what: str = "value") -> float:
    """Refuse what is too large."""
    if abs(value) > limit:
        raise OptionError(f"row {row}: {what} {value:g}; expected at most ±{limit:g}")
    return value


def _poly(span: tuple[float, float], rows: Numbers) -> ErrorFunction:
    """Read coefficients, in one row or one below the other."""
    coefficients = tuple(value for row in rows for value in row)
    if len(coefficients) > MAX_COEFFICIENTS:
        raise OptionError(f"{len(coefficients)} coefficients; expected at most {MAX_COEFFICIENTS}")
    return Poly(span, coefficients)


def _harmonics(span: tuple[float, float], rows: Numbers) -> ErrorFunction:
    """Read terms of order, amplitude and phase; an absent phase is zero."""
    if len(rows) > MAX_TERMS:
        raise OptionError(f"{len(rows)} terms; expected at most {MAX_TERMS}")
    terms: list[tuple[float, float, float]] = []
    for number, row in enumerate(rows, start=1):
        if len(row) not in (2, 3):
            raise OptionError(f"row {number}: {len(row)} numbers; expected {HARMONIC_ROWS}")
        order, amplitude, phase = (*row, 0.0)[:3]
        if not 0.0 <= order <= MAX_ORDER:
            raise OptionError(f"row {number}: order {order:g}; expected 0 to {MAX_ORDER}")
        _limited(amplitude, number, what="amplitude")
        terms.append((order, amplitude, _limited(phase, number, MAX_LENGTH_MM, "phase")))
    return Harmonics(span, tuple(terms))


def _table(span: tuple[float, float], rows: Numbers) -> ErrorFunction:
    """Read points; positions must ascend."""
    if len(rows) > MAX_ROWS:
        raise OptionError(f"{len(rows)} rows; expected at most {MAX_ROWS}")
    for number, row in enumerate(rows, start=1):
        if len(row) != 2:
            raise OptionError(f"row {number}: {len(row)} numbers; expected {TABLE_ROWS}")
        _limited(row[0], number, MAX_LENGTH_MM, "position")
        _limited(row[1], number)
    for number, (one, two) in enumerate(pairwise(rows), start=2):
        if not one[0] < two[0]:
            raise OptionError(
                f"row {number}: position {two[0]:g} after {one[0]:g}; expected ascending positions"
            )
    return Table(span, tuple((row[0], row[1]) for row in rows))


def _toml_rows(function: ErrorFunction) -> Sequence[Sequence[float]]:
    """Take the rows out of the spelling for a scene file."""
    spelt = function.to_toml()
    if isinstance(spelt, dict):
        (values,) = spelt.values()
        return values if isinstance(values[0], list) else [[value] for value in values]
    return [[float(spelt)]]  # pyright: ignore[reportArgumentType]


HARMONIC_ROWS = "order, amplitude and phase in degrees in each row"
TABLE_ROWS = "position and value in each row, positions ascending"
KINDS: dict[str, ShapeKind] = {
    kind.name: kind
    for kind in (
        ShapeKind(
            "constant",
            Constant,
            "one number: the same everywhere",
            lambda span, rows: Constant(span, _single(rows)),
            _toml_rows,
        ),
        ShapeKind(
            "ramp",
            Ramp,
            "one number: the value at the upper end, from zero at the lower",
            lambda span, rows: Ramp(span, _single(rows)),
            lambda function: [[function.amplitude]],
        ),
        ShapeKind("polynomial", Poly, "coefficients c0, c1, … of Σ cₖ·qᵏ", _poly, _toml_rows),
        ShapeKind("harmonics", Harmonics, HARMONIC_ROWS, _harmonics, _toml_rows),
        ShapeKind("table", Table, TABLE_ROWS, _table, _toml_rows),
    )
}
"""The kinds of curves by name, simplest first."""
