"""Piecewise polynomials: the result of an exact conversion between conventions."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.machine.curves import curve
from warpspace.machine.curves.simple import Constant, Poly
from warpspace.machine.limits import MAX_LENGTH_MM, MAX_POINTS
from warpspace.units import Array

DEGREE = 5
MAX_PIECES = 4096
SMALL = 1e-12  # µm or µrad: tolerance of fits, below which a curve is zero
PER_PIECE = 8  # positions of each piece at which the peak is searched


@dataclass(frozen=True)
class Pieces(curve.ErrorFunction):
    """Piecewise polynomial, constant beyond its ends."""

    name = "pieces"
    title = "pieces of polynomials"
    forms = (("pieces", "end", "points"),)
    row_words = "pieces of polynomials come from a conversion"
    edited_as_rows = False
    # (n,); ascending positions at which the pieces begin, mm or degrees
    starts: tuple[float, ...] = (0.0,)
    end: float = 1.0  # of the last piece
    # (n, up to 6); of Σ cₖ·(q − start)ᵏ, per piece
    coefficients: tuple[tuple[float, ...], ...] = ((0.0,),)
    # measured positions, where it was converted from a table
    points: tuple[float, ...] = ()

    @cached_property
    def _padded(self) -> Array:
        rows = [np.pad(row, (0, DEGREE + 1 - len(row))) for row in self.coefficients]
        return np.array(rows, dtype=float)

    def evaluate(self, position: Array) -> Array:
        starts = np.array(self.starts)
        clipped = np.clip(np.asarray(position, dtype=float), starts[0], self.end)
        piece = np.clip(np.searchsorted(starts, clipped, side="right") - 1, 0, len(starts) - 1)
        coefficients = np.moveaxis(self._padded[piece], -1, 0)
        value = np.polynomial.polynomial.polyval(
            clipped - starts[piece], coefficients, tensor=False
        )
        return np.asarray(value, dtype=float)

    def scaled(self, factor: float) -> Self:
        rows = tuple(tuple(factor * c for c in row) for row in self.coefficients)
        return replace(self, coefficients=rows)

    def grown(self) -> Self:
        reach = self.end - self.starts[0]
        return replace(self, starts=self.starts[:1], coefficients=((0.0, 1.0 / reach),))

    @property
    def samples(self) -> int:
        return max(curve.SPAN_SAMPLES, PER_PIECE * len(self.starts) + 1)

    @property
    def kinks(self) -> tuple[float, ...]:
        return (*self.starts, self.end)

    @classmethod
    def read(cls, raw: Any, span: curve.Span, reader: curve.ValueReader) -> Self:
        """Read ``{ pieces = [[start, c0, c1, …], …], end = q, points = [] }``."""
        limit = (-MAX_LENGTH_MM, MAX_LENGTH_MM)
        rows: list[tuple[float, ...]] = []
        for index, entry in enumerate(reader.entries(raw["pieces"], ("pieces",), MAX_POINTS)):
            place = ("pieces", index)
            numbers = reader.entries(entry, place, DEGREE + 2)
            if len(numbers) == 1:
                reader.note(place, "expected [start, c0, c1, …]", entry)
            row = tuple(reader.number(value, (*place, k)) for k, value in enumerate(numbers))
            rows.append(row or (0.0, 0.0))
        end = reader.number(raw["end"], ("end",), *limit)
        if reader.findings:
            return cls(span)
        starts = reader.ascending([row[0] for row in rows] + [end], ("pieces",), MAX_POINTS, limit)
        if reader.findings:
            return cls(span)
        points = (
            ()
            if raw["points"] == []
            else reader.ascending(raw["points"], ("points",), MAX_POINTS, limit)
        )
        return cls(span, starts[:-1], end, tuple(row[1:] for row in rows), points)

    def to_toml(self) -> object:
        pairs = zip(self.starts, self.coefficients, strict=True)
        pieces = [[start, *row] for start, row in pairs]
        return {"pieces": pieces, "end": self.end, "points": list(self.points)}

    def describe(self, unit: str, value: curve.Spell, position: curve.Spell) -> str:
        del unit, value, position
        return f"{len(self.starts)} pieces of polynomials"


def fit_curves(
    evaluate: Callable[[Array], Array], span: curve.Span, kinks: Array
) -> list[curve.ErrorFunction | None]:
    """Fit curves to functions of one position, values [n, K] at [n], smooth between kinks, [m].

    A constant or a polynomial where one piece is sufficient, else pieces; None for a zero function.
    The deviation is at most 10⁻¹² µm or µrad, as far as floating-point resolution allows.
    """
    low, high = span
    inner = kinks[(kinks > low) & (kinks < high)]
    at = np.concatenate([[low], np.unique(inner), [high]])
    limit = len(at) + MAX_PIECES
    while True:
        coefficients, deviation = _fit(evaluate, at)
        bad = deviation > SMALL
        if not bad.any():
            break
        if len(at) + int(bad.sum()) > limit:
            raise OptionError("the curves vary too rapidly to be converted exactly")
        at = np.sort(np.concatenate([at, ((at[:-1] + at[1:]) / 2.0)[bad]]))
    return [_simplest(span, at, coefficients[..., k]) for k in range(coefficients.shape[-1])]


def _fit(evaluate: Callable[[Array], Array], at: Array) -> tuple[Array, Array]:
    width = np.diff(at)
    nodes = np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
    checks = np.linspace(-0.97, 0.97, 9)
    abscissae = np.concatenate([nodes, checks])
    places = at[:-1, None] + 0.5 * width[:, None] * (1.0 + abscissae)
    values = np.asarray(evaluate(places.ravel()))
    values = values.reshape(len(width), len(abscissae), -1)
    inside, beyond = values[:, : DEGREE + 1], values[:, DEGREE + 1 :]
    series = np.linalg.solve(
        np.polynomial.chebyshev.chebvander(nodes, DEGREE),
        inside.transpose(1, 0, 2).reshape(DEGREE + 1, -1),
    )
    interpolated = np.tensordot(np.polynomial.chebyshev.chebvander(checks, DEGREE), series, axes=1)
    expected = beyond.transpose(1, 0, 2).reshape(len(checks), -1)
    deviation = np.abs(interpolated - expected).max(axis=0)
    size = np.abs(values).max(axis=1).ravel()
    deviation = np.where(deviation > 2e-14 * size, deviation, 0.0)  # floating-point resolution
    powers = _power_matrix() @ series  # of (q − start) / width
    shape = (DEGREE + 1, len(width), values.shape[-1])
    scale = width[:, None] ** -np.arange(DEGREE + 1.0)
    local = powers.reshape(shape).transpose(1, 0, 2) * scale[..., None]
    return local, deviation.reshape(len(width), -1).max(axis=1)


def _power_matrix() -> Array:
    rows = np.zeros((DEGREE + 1, DEGREE + 1))
    for k in range(DEGREE + 1):
        basis = np.polynomial.Chebyshev.basis(k, domain=[0.0, 1.0])
        rows[: k + 1, k] = basis.convert(kind=np.polynomial.Polynomial).coef
    return rows


def _simplest(span: curve.Span, at: Array, coefficients: Array) -> curve.ErrorFunction | None:
    width = np.diff(at)[:, None]
    reach = np.abs(coefficients) * width ** np.arange(DEGREE + 1.0)
    significant = np.where(reach > SMALL / 4.0, coefficients, 0.0)
    if not significant.any():
        return None
    degree = int(np.flatnonzero(significant.any(axis=0)).max())
    if degree == 0 and np.ptp(significant[:, 0]) <= SMALL:
        return Constant(span, float(significant[:, 0].mean()))
    if len(significant) == 1:
        polynomial = np.polynomial.Polynomial
        shifted = polynomial(significant[0, : degree + 1])(polynomial([-at[0], 1.0]))
        return Poly(span, tuple(shifted.coef.tolist()))
    rows = tuple(tuple(float(c) for c in row[: degree + 1]) for row in significant)
    return Pieces(span, tuple(at[:-1].tolist()), float(at[-1]), rows)
