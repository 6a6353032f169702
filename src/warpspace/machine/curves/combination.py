"""The weighted sum of two curves of one axis: exact where a kind of curve can hold it."""

from collections.abc import Sequence

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.machine.curves.constant import Constant
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.curves.directional import Directional
from warpspace.machine.curves.harmonics import Harmonics
from warpspace.machine.curves.poly import Poly
from warpspace.machine.curves.ramp import Ramp
from warpspace.machine.curves.table import Table
from warpspace.machine.curves.two_arguments import TwoArguments
from warpspace.machine.limits import MAX_POINTS, MAX_TERMS
from warpspace.units import Array

Weights = tuple[float, float]
MOST_SAMPLES = 20_001
CLOSE = 1e-5
"""Largest deviation of a sampled sum half way between its points, by its largest value."""


def combine_curves(first: ErrorFunction, second: ErrorFunction, weights: Weights) -> ErrorFunction:
    """Add two curves, each times a number.

    Parameters
    ----------
    first, second : ErrorFunction
        Over the same range.
    weights : tuple of float, (2,)

    Returns
    -------
    ErrorFunction
        Exact for constants, ramps and polynomials among each other, for harmonics, for tables, and
        for any of the last two with a constant; otherwise a table of as many points as it needs to
        deviate by at most a hundred-thousandth of the largest value, or of 20,001.
    """
    span = first.span
    for one, other in ((first, second), (second, first)):
        weight = weights[0] if one is first else weights[1]
        if isinstance(other, Constant) and other.value == 0.0:
            return one.scaled(weight)
    if isinstance(first, Directional) or isinstance(second, Directional):
        there, back = (
            combine_curves(_way(first, way), _way(second, way), weights)
            for way in ("forward", "backward")
        )
        return Directional(span, there, back)
    if isinstance(first, TwoArguments) or isinstance(second, TwoArguments):
        return _surface(first, second, weights)
    match first, second:
        case Constant(), Constant():
            return Constant(span, weights[0] * first.value + weights[1] * second.value)
        case Ramp(), Ramp() if first.span == second.span:
            return Ramp(span, weights[0] * first.value + weights[1] * second.value)
        case ((Constant() | Ramp() | Poly()), (Constant() | Ramp() | Poly())):
            return Poly(span, _added([_coefficients(first), _coefficients(second)], weights))
        case ((Constant() | Harmonics()), (Constant() | Harmonics())):
            terms = _terms(first, second, weights)
            if len(terms) <= MAX_TERMS:
                return Harmonics(span, terms)
        case ((Constant() | Table()), (Constant() | Table())):
            at = np.union1d(first.kinks, second.kinks)
            if len(at) <= MAX_POINTS:
                return _table(first, second, weights, at)
        case _:
            pass
    return _sampled(first, second, weights)


def _way(curve: ErrorFunction, way: str) -> ErrorFunction:
    """Give the curve of one direction of travel."""
    return getattr(curve, way) if isinstance(curve, Directional) else curve


def _surface(first: ErrorFunction, second: ErrorFunction, weights: Weights) -> TwoArguments:
    """Add curves of which one or both depend on a second axis, at the points of both."""
    surfaces = [curve for curve in (first, second) if isinstance(curve, TwoArguments)]
    axes = surfaces[0].axes
    if any(surface.axes != axes for surface in surfaces):
        one, other = (surface.axes[1] for surface in surfaces)
        raise OptionError(f"guides depend on {one} and on {other}; expected one second axis")
    zero = Constant(first.span)
    plain = [
        curve
        if isinstance(curve, TwoArguments | Constant | Table)
        else _sampled(curve, zero, (1.0, 0.0))
        for curve in (first, second)
    ]
    own = np.unique(np.concatenate([np.array(curve.kinks) for curve in plain]))
    other = np.unique(np.concatenate([np.array(one.positions[1]) for one in surfaces]))
    if len(own) * len(other) > MAX_POINTS:
        raise OptionError(f"guides need {len(own) * len(other):,} points; at most {MAX_POINTS:,}")
    at = {axes[0]: own[:, None], axes[1]: other}
    total = sum(
        weight * np.broadcast_to(curve.evaluate_at(axes[0], at), (len(own), len(other)))
        for weight, curve in zip(weights, plain, strict=True)
    )
    positions = (tuple(own.tolist()), tuple(other.tolist()))
    return TwoArguments(first.span, axes, positions, tuple(map(tuple, np.asarray(total).tolist())))


def _coefficients(curve: Constant | Ramp | Poly) -> tuple[float, ...]:
    """Give the coefficients of a curve that is a polynomial."""
    if isinstance(curve, Constant):
        return (curve.value,)
    if isinstance(curve, Poly):
        return curve.coefficients
    low, high = curve.span
    slope = curve.value / (high - low)
    return (-slope * low, slope)


def _added(parts: Sequence[tuple[float, ...]], weights: Weights) -> tuple[float, ...]:
    """Add coefficients; the shorter list is filled with zeros."""
    length = max(map(len, parts))
    total = np.zeros(length)
    for part, weight in zip(parts, weights, strict=True):
        total[: len(part)] += weight * np.array(part)
    return tuple(total.tolist())


def _terms(
    first: Constant | Harmonics, second: Constant | Harmonics, weights: Weights
) -> tuple[tuple[float, float, float], ...]:
    """Add harmonics; terms of the same order and phase become one."""
    found: dict[tuple[float, float], float] = {}
    for curve, weight in zip((first, second), weights, strict=True):
        own = ((0.0, curve.value, 0.0),) if isinstance(curve, Constant) else curve.terms
        for order, amplitude, phase in own:
            place = (order, phase)
            found[place] = found.get(place, 0.0) + weight * amplitude
    return tuple((order, value, phase) for (order, phase), value in found.items())


def _table(first: ErrorFunction, second: ErrorFunction, weights: Weights, at: Array) -> Table:
    """Give the sum at positions as a table."""
    value = weights[0] * first.evaluate(at) + weights[1] * second.evaluate(at)
    return Table(first.span, tuple(zip(at.tolist(), value.tolist(), strict=True)))


def _sampled(first: ErrorFunction, second: ErrorFunction, weights: Weights) -> Table:
    """Give the sum as a table, twice as fine until it is close enough."""
    kinks = [q for q in (*first.kinks, *second.kinks) if first.span[0] < q < first.span[1]]
    count = 65
    while True:
        at = np.union1d(np.linspace(*first.span, count), kinks[: MAX_POINTS - MOST_SAMPLES])
        found = _table(first, second, weights, at)
        between = (at[1:] + at[:-1]) / 2.0
        exact = weights[0] * first.evaluate(between) + weights[1] * second.evaluate(between)
        largest = max(float(np.abs(exact).max()), abs(found.amplitude))
        off = float(np.abs(exact - found.evaluate(between)).max())
        if off <= CLOSE * largest or count >= MOST_SAMPLES:
            return found
        count = min(2 * count - 1, MOST_SAMPLES)
