"""The cheapest proportions of tolerances on a sample of machines."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special

from warpspace.analysis.allocation.ensemble import Ensemble
from warpspace.analysis.allocation.scaling import largest_scale, scales_within
from warpspace.units import Array

SMOOTH = 0.1
"""Width of the smoothed limit by the limit: a machine counts by degrees within about this."""
NARROWEST = 1e-4
"""Least half width by that of the variance rule."""
MOST_STEPS = 60
ENOUGH = 1e-6
"""Relative change of the cost at which the search ends."""
ScaleOf = Callable[[Array, NDArray[np.bool_]], float | None]


@dataclass(frozen=True, slots=True)
class Task:
    """What is to be minimised, on which machines.

    Attributes
    ----------
    ensemble : Ensemble
    centre, half_width : ndarray, [K], µm or µrad
        Tolerances before; those that are not free stay.
    free : ndarray of bool, [K]
    cost : ndarray, [K]
        Cost of a tolerance is this over its half width.
    limit_um : float, µm
    probability : float
    widest : float, µm or µrad
        Largest half width that is given.
    """

    ensemble: Ensemble
    centre: Array
    half_width: Array
    free: NDArray[np.bool_]
    cost: Array
    limit_um: float
    probability: float
    widest: float

    def spent(self, half_width: Array) -> float:
        """Cost of the free tolerances, from half widths of all, [K]."""
        return float(np.sum(self.cost[self.free] / half_width[self.free]))

    def filled(self, free_widths: Array) -> Array:
        """Put the half widths of the free parameters, [F], beside those that stay, [K]."""
        return fill(self.half_width, self.free, free_widths)


def fill(half_width: Array, free: NDArray[np.bool_], free_widths: Array) -> Array:
    """Replace some of the half widths, [K], by others, [F]."""
    found = half_width.copy()
    found[free] = free_widths
    return found


def scaled(task: Task, widths: Array, scale_of: ScaleOf) -> Array | None:
    """Widen or narrow the free tolerances together until enough machines keep the limit.

    Parameters
    ----------
    task : Task
    widths : ndarray, [K], µm or µrad
        Their proportions. Those that are the widest there is stay, if the others can give way.
    scale_of : callable
        Takes half widths and which of them move, gives the largest scale; see `largest_scale`.

    Returns
    -------
    ndarray, [K], or None
        None where no scale will do. What would become wider than `Task.widest` stays there.
    """
    below = task.free & (widths < task.widest * (1.0 - 1e-6))
    found = None
    if below.any() and not np.array_equal(below, task.free):
        held = np.where(task.free & ~below, task.widest, widths)
        found = _scaled(task, held, below, scale_of)
    return _scaled(task, widths, task.free, scale_of) if found is None else found


def _scaled(
    task: Task, widths: Array, moving: NDArray[np.bool_], scale_of: ScaleOf
) -> Array | None:
    """Scale those that move, and hold at the widest what would pass it."""
    found, moving = widths.copy(), moving.copy()
    while moving.any():
        scale = scale_of(found, moving)
        if scale is None:
            return None
        over = moving & (found * scale > task.widest)
        if not over.any():
            found[moving] *= scale
            break
        found[over] = task.widest
        moving &= ~over
    return found


def sample_scale(task: Task, half_width: Array, moving: NDArray[np.bool_]) -> float | None:
    """Give the largest scale of the tolerances that move, on the machines of the ensemble."""
    none = np.zeros_like(half_width)
    base = task.ensemble.error_um(task.centre, np.where(moving, 0.0, half_width))
    move = task.ensemble.error_um(none, np.where(moving, half_width, 0.0))
    within = scales_within(base.astype(float), move.astype(float), task.limit_um)
    return largest_scale(within, task.probability)


def variance_widths(task: Task) -> Array:
    """Give the proportions that are cheapest where only the variance of E counts.

    Returns
    -------
    ndarray, [K], µm or µrad
        For the free ones (cost / squared gain)^⅓: Σ cost/w for a given Σ (gain·w)² is least there.
    """
    square = task.ensemble.mean_square_gain[task.free]
    widths = np.cbrt(task.cost[task.free] / square)
    return task.filled(widths * (0.5 * task.widest / widths.max()))


def search_widths(task: Task, step: Callable[[], object]) -> Array | None:
    """Find half widths of least cost that keep the limit with the probability on the ensemble.

    Parameters
    ----------
    task : Task
        With one free parameter or more, each of which moves the point.
    step : callable
        Called after each step of the search; what it raises ends the search.

    Returns
    -------
    ndarray, [K], µm or µrad
        None where no width will do, however narrow.

    Notes
    -----
    Sequential least-squares programming (scipy, SLSQP) in the logarithms of the half widths, from
    the variance rule. The share of machines within the limit is a step function of the widths: it
    is smoothed for the search by counting a machine as Φ((limit − |E|) / (0.1 limit)), with the
    value it has where the variance rule keeps the limit exactly. The result is then scaled to keep
    the limit exactly, without smoothing; should it cost more than the variance rule, that is given.
    """

    def exact(widths: Array) -> Array | None:
        return scaled(task, widths, lambda half, moving: sample_scale(task, half, moving))

    start = exact(variance_widths(task))
    if start is None:
        return None
    first = start[task.free]
    soft = SMOOTH * task.limit_um
    count = len(task.ensemble.unit)
    least = float(np.sum(task.cost[task.free] / first))
    share = task.cost[task.free] / first / least

    def within(log_scale: Array) -> tuple[float, Array]:
        half = task.filled(first * np.exp(log_scale))
        norm, direction, at = task.ensemble.norm_and_slope(task.centre, half)
        distance = (task.limit_um - norm) / soft
        density = np.exp(-0.5 * distance**2) / (np.sqrt(2.0 * np.pi) * soft * count)
        slope = -task.ensemble.slope((direction * density).astype(np.float32), at)
        return float(special.ndtr(distance).mean()), (slope * half)[task.free]

    level, _ = within(np.zeros(len(first)))
    latest: dict[bytes, tuple[float, Array]] = {}

    def remembered(log_scale: Array) -> tuple[float, Array]:
        key = log_scale.tobytes()
        if key not in latest:
            latest.clear()
            latest[key] = within(log_scale)
        return latest[key]

    found = optimize.minimize(
        lambda x: float(np.sum(share * np.exp(-x))),
        np.zeros(len(first)),
        jac=lambda x: -share * np.exp(-x),
        method="SLSQP",
        bounds=[
            (np.log(NARROWEST), max(0.0, float(np.log(task.widest / width)))) for width in first
        ],
        constraints={
            "type": "ineq",
            "fun": lambda x: remembered(x)[0] - level,
            "jac": lambda x: remembered(x)[1],
        },
        callback=lambda _: step(),
        options={"maxiter": MOST_STEPS, "ftol": ENOUGH},
    )
    if not np.isfinite(found.x).all():
        return start
    better = exact(task.filled(first * np.exp(found.x)))
    return better if better is not None and task.spent(better) < task.spent(start) else start
