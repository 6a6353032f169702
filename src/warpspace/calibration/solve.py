"""Weighted least squares of errors and unknown set-ups to readings."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from warpspace.calibration.results import Request
from warpspace.calibration.stack import Stack
from warpspace.calibration.terms import Terms
from warpspace.exceptions import OptionError
from warpspace.units import Array

ROBUST_SCALE = 1.345
"""Standard deviations at which the soft L1 loss begins to trust a reading less."""
MAD = 1.4826
"""Standard deviation of a normal distribution per median absolute deviation."""
MOST_ROUNDS = 20
"""Times that a robust fit weighs its readings anew."""


@dataclass(frozen=True, slots=True)
class Solved:
    """A solution: amplitudes, unknowns, and the weighted derivatives there."""

    amplitudes: Array
    unknown: Array
    weighted: Array
    trust: Array


def solve(
    stack: Stack,
    terms: Terms,
    request: Request,
    prior: tuple[Array, Array] | None = None,
    unknown: Array | None = None,
) -> Solved:
    """Minimise the weighted residuals over amplitudes and unknowns."""
    weights = np.concatenate(stack.weights())
    count = len(terms.keys)
    start = np.concatenate([terms.start, stack.start() if unknown is None else unknown])
    if not len(start):
        return Solved(start, start, np.zeros((stack.size, 0)), np.ones(stack.size))

    def missed(values: Array) -> Array:
        rows = stack.residuals(terms, values[:count], values[count:])
        return np.concatenate([row.ravel() for row in rows]) * weights

    def slopes(values: Array) -> Array:
        by_parameter, by_unknown = stack.derivatives(terms, values[:count], values[count:])
        return -weights[:, None] * np.hstack([np.vstack(by_parameter), np.vstack(by_unknown)])

    trust = np.ones(stack.size)

    def function(values: Array) -> Array:
        rows = np.sqrt(trust) * missed(values)
        return rows if prior is None else np.append(rows, (values[:count] - prior[0]) / prior[1])

    def jacobian(values: Array) -> Array:
        rows = np.sqrt(trust)[:, None] * slopes(values)
        if prior is None:
            return rows
        own = np.hstack([np.diag(1.0 / prior[1]), np.zeros((count, len(values) - count))])
        return np.vstack([rows, own])

    for _ in range(MOST_ROUNDS if request.robust else 1):
        scale = np.linalg.norm(jacobian(start), axis=0)
        found: OptimizeResult = least_squares(
            function,
            start,
            jac=jacobian,  # pyright: ignore[reportArgumentType]
            x_scale=1.0 / np.where(scale > 0.0, scale, 1.0),
            xtol=1e-10,
            ftol=1e-13,
            gtol=1e-13,
            max_nfev=200,
        )
        if not found.success:
            raise OptionError(
                f"the fit does not converge ({found.message}); expected readings near to the model."
                " Leave out outliers (--robust), or look for fewer parameters (--fit KEYS)"
            )
        moved = float(np.abs((found.x - start) * scale).max(initial=0.0))
        start = found.x
        if not request.robust:
            break
        rows = missed(start)
        unit = max(MAD * float(np.median(np.abs(rows))), 1e-12)
        trust = 1.0 / np.sqrt(1.0 + (rows / (ROBUST_SCALE * unit)) ** 2)
        if moved < 1e-9 * unit:
            break
    return Solved(start[:count], start[count:], jacobian(start), trust)


def covariance_of(solved: Solved, count: int) -> Array:
    """Give the covariance of the parameters for a weight of one, [K, K]."""
    scale = np.linalg.norm(solved.weighted, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    triangle = np.linalg.qr(solved.weighted / scale, mode="r")
    inverse = np.linalg.pinv(triangle) / scale[:, None]
    return (inverse @ inverse.T)[:count, :count]
