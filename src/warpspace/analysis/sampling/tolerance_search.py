"""Search for the cheapest proportions of tolerances on a sample of machines, and their scale.

The error of a sampled machine is base + t · move, where t widens all free tolerances in the same
ratio. |base + t · move| ≤ limit is a quadratic inequality, so that each machine keeps the limit on
one interval of t, and the widest t of a sample is found by sorting the ends of the intervals.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.sampling.cases import Case, Reduction
from warpspace.analysis.sampling.distribution import Stream
from warpspace.exceptions import OptionError
from warpspace.kinematics.model import Loop
from warpspace.machine.errors import Tolerance, ToleranceSet
from warpspace.units import Array

SAMPLES = 20_000
Floats = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Ensemble:
    """Sampled machines of unit tolerances."""

    keys: tuple[str, ...]  # (K,); parameters of the loop
    # [S, K]; place of each parameter in its tolerance: 0 in the centre, ±1 at the limits
    unit: Floats
    # [3, S, K] or [3, K, N]; µm per µm or µrad: at the one point of each machine, or at the N
    # points common to all
    gains: Floats
    # [3, S, K], or None; gains times unit draws, where each machine has one point
    spread: Floats | None

    @property
    def size(self) -> int:
        spread = 0 if self.spread is None else self.spread.nbytes
        return self.unit.nbytes + self.gains.nbytes + spread

    @property
    def mean_square_gain(self) -> Array:
        """Square of the gains, averaged over machines or points, [K], µm² per µm² or µrad²."""
        if self.spread is not None:
            return np.einsum("csk,csk->k", self.gains, self.gains) / len(self.unit)
        return np.einsum("ckn,ckn->k", self.gains, self.gains) / self.gains.shape[2]

    def error_um(self, centre: Array, half_width: Array) -> Floats:
        """Evaluate the error of every machine at its point, [3, S], or at each, [3, S, N], µm."""
        middle, half = centre.astype(np.float32), half_width.astype(np.float32)
        if self.spread is not None:
            error = self.spread @ half + self.gains @ middle
        else:
            error = (middle + half * self.unit) @ self.gains
        return error.astype(np.float32, copy=False)

    def norm_um(self, centre: Array, half_width: Array) -> Array:
        """Evaluate |E| of every machine, [S], µm; see `error_um` for the parameters."""
        error = self.error_um(centre, half_width)
        square = np.einsum("c...,c...->...", error, error)
        return np.sqrt(square if square.ndim == 1 else square.max(axis=1)).astype(float)

    def ranges(self, tolerances: ToleranceSet) -> Array:
        """Return centre and half-width of each parameter, [2, K]; zeros without a tolerance."""
        zero = Tolerance(0.0, 0.0)
        tolerance_row = [tolerances.get(key) or zero for key in self.keys]
        return np.array([[t.centre for t in tolerance_row], [t.half_width for t in tolerance_row]])

    def estimate(self, tolerances: ToleranceSet, limit_um: float | None) -> Stream:
        """Evaluate |E| of the machines of a tolerance set."""
        norm_um = self.norm_um(*self.ranges(tolerances))
        stream = Stream(len(norm_um), limit_um)
        stream.add(norm_um)
        return stream

    def variance_shares(self, tolerances: ToleranceSet) -> dict[str, float]:
        """Compute the share of each tolerance in the variance of the error."""
        variances = self.ranges(tolerances)[1] ** 2 * self.mean_square_gain
        shares = variances / (float(variances.sum()) or 1.0)
        return dict(zip(self.keys, shares.tolist(), strict=True))

    def norm_and_slope(
        self, centre: Array, half_width: Array
    ) -> tuple[Array, "Floats", NDArray[np.intp] | None]:
        """Evaluate |E| of every machine, [S], µm, with its direction and node."""
        error = self.error_um(centre, half_width)
        at = None
        if error.ndim == 3:
            at = np.argmax(np.einsum("csn,csn->sn", error, error), axis=1)
            error = error[:, np.arange(len(at)), at]
        norm = np.sqrt(np.einsum("cs,cs->s", error, error))
        return norm.astype(float), error / np.maximum(norm, np.float32(1e-12)), at

    def slope(self, pull: Floats, at: NDArray[np.intp] | None) -> Array:
        """Add up the slopes of |E| in each half width over the machines, [K], µm per µm or µrad."""
        if at is None:
            assert self.spread is not None  # noqa: S101 - each machine has a point of its own
            return np.einsum("cs,csk->k", pull, self.spread, optimize=True).astype(float)
        slope = np.zeros(len(self.keys))
        for node in range(self.gains.shape[2]):
            chosen = at == node
            by_parameter = pull[:, chosen] @ self.unit[chosen]
            slope += np.einsum("ck,ck->k", by_parameter, self.gains[:, :, node])
        return slope


def build_ensemble(case: Case) -> Ensemble:
    """Draw machines of unit tolerances: those of the Monte Carlo run with the same seed."""
    keys, plan = case.draws.keys, case.plan
    ones = np.ones(len(keys))
    draws = replace(case.draws, centre=0.0 * ones, half_width=ones)
    blocks = [plan.block(index) for index in range(plan.blocks)]
    unit = np.concatenate([draws.draw(*block) for block in blocks]).astype(np.float32)
    if plan.reduction == Reduction.SAMPLED:
        parts = [
            np.broadcast_to(case.responses(case.random(*block)), (3, len(keys), block[1]))
            for block in blocks
        ]
        stacked = np.concatenate(parts, axis=2).astype(np.float32)
        gains = np.ascontiguousarray(np.swapaxes(stacked, 1, 2))
        return Ensemble(keys, unit, gains, gains * unit)
    refuse_many_points(case.view.loop)
    gains = case.responses(case.common_places()).astype(np.float32)
    return Ensemble(keys, unit, gains, None)


def refuse_many_points(loop: Loop) -> None:
    """Refuse the loop in which the worst point of a machine lies among too many points."""
    if loop is Loop.WORKPIECE:
        raise OptionError(
            "the worst point of the workpiece loop lies among all turns of the table; expected"
            " {over} = sampled, one random point of each machine"
        )


SMOOTH = 0.1
"""Width of the smoothed limit by the limit: a machine counts by degrees within about this."""
NARROWEST = 1e-4  # least half width by that of the variance rule
MOST_STEPS = 60
ENOUGH = 1e-6  # relative change of the cost at which the search ends
ScaleOf = Callable[[Array, NDArray[np.bool_]], float | None]


@dataclass(frozen=True, slots=True)
class Task:
    """Objective and constraints of an allocation."""

    ensemble: Ensemble
    centre: Array  # [K], µm or µrad; tolerances before; those that are not free stay
    half_width: Array
    free: NDArray[np.bool_]  # [K]
    cost: Array  # [K]; cost of a tolerance is this over its half width
    limit_um: float
    probability: float
    widest: float  # µm or µrad; largest half width that is given

    def spent(self, half_width: Array) -> float:
        """Cost of the free tolerances, from half widths of all, [K]."""
        return float(np.sum(self.cost[self.free] / half_width[self.free]))

    def filled(self, free_widths: Array) -> Array:
        """Return all half widths, [K], from those of the free parameters, [F]."""
        widths = self.half_width.copy()
        widths[self.free] = free_widths
        return widths


def scaled(task: Task, widths: Array, scale_of: ScaleOf) -> Array | None:
    """Widen or narrow the free tolerances together until enough machines keep the limit, [K]."""
    below = task.free & (widths < task.widest * (1.0 - 1e-6))
    largest = None
    if below.any() and not np.array_equal(below, task.free):
        fixed = np.where(task.free & ~below, task.widest, widths)
        largest = _scaled(task, fixed, below, scale_of)
    return _scaled(task, widths, task.free, scale_of) if largest is None else largest


def _scaled(
    task: Task, widths: Array, moving: NDArray[np.bool_], scale_of: ScaleOf
) -> Array | None:
    result, moving = widths.copy(), moving.copy()
    while moving.any():
        scale = scale_of(result, moving)
        if scale is None:
            return None
        capped = moving & (result * scale > task.widest)
        if not capped.any():
            result[moving] *= scale
            break
        result[capped] = task.widest
        moving &= ~capped
    return result


def search_widths(task: Task, step: Callable[[], object]) -> Array | None:
    """Find half widths, [K], of least cost that keep the limit with the probability.

    One free parameter or more, each of which moves the point; `step` is called after each step.
    None where no width will do, however narrow.

    Notes
    -----
    Sequential least-squares programming (scipy, SLSQP) in the logarithms of the half widths, from
    the variance rule. The share of machines within the limit is a step function of the widths: it
    is smoothed for the search by counting a machine as Φ((limit − |E|) / (0.1 limit)), with the
    value it has where the variance rule keeps the limit exactly. The result is then scaled to keep
    the limit exactly, without smoothing; should it cost more than the variance rule, that is given.
    """
    from scipy import optimize, special

    def sample_scale(half_width: Array, moving: NDArray[np.bool_]) -> float | None:
        none = np.zeros_like(half_width)
        base = task.ensemble.error_um(task.centre, np.where(moving, 0.0, half_width))
        move = task.ensemble.error_um(none, np.where(moving, half_width, 0.0))
        within = scales_within(base.astype(float), move.astype(float), task.limit_um)
        return largest_scale(within, task.probability)

    # the cheapest proportions for a given variance of E
    cheapest = np.cbrt(task.cost[task.free] / task.ensemble.mean_square_gain[task.free])
    cheapest = task.filled(cheapest * (0.5 * task.widest / cheapest.max()))
    start = scaled(task, cheapest, sample_scale)
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

    @lru_cache(maxsize=1)
    def remembered(log_scale: bytes) -> tuple[float, Array]:
        return within(np.frombuffer(log_scale))

    optimum = optimize.minimize(
        lambda x: float(np.sum(share * np.exp(-x))),
        np.zeros(len(first)),
        jac=lambda x: -share * np.exp(-x),
        method="SLSQP",
        bounds=[
            (np.log(NARROWEST), max(0.0, float(np.log(task.widest / width)))) for width in first
        ],
        constraints={
            "type": "ineq",
            "fun": lambda x: remembered(x.tobytes())[0] - level,
            "jac": lambda x: remembered(x.tobytes())[1],
        },
        callback=lambda _: step(),
        options={"maxiter": MOST_STEPS, "ftol": ENOUGH},
    )
    if not np.isfinite(optimum.x).all():
        return start
    better = scaled(task, task.filled(first * np.exp(optimum.x)), sample_scale)
    return better if better is not None and task.spent(better) < task.spent(start) else start


def scales_within(base_um: Array, move_um: Array, limit_um: float) -> Array:
    """Find the smallest and largest scale, 0 or above, at which machines keep a limit, [S, 2]."""
    a = np.einsum("c...,c...->...", move_um, move_um)
    b = np.einsum("c...,c...->...", base_um, move_um)
    c = np.einsum("c...,c...->...", base_um, base_um) - limit_um**2
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    moves = a > 0.0
    safe = np.where(moves, a, 1.0)
    low = np.where(moves, (-b - root) / safe, 0.0)
    high = np.where(moves, (-b + root) / safe, np.inf)
    never = np.where(moves, b * b - a * c, -c) < 0.0
    low, high = np.where(never, np.inf, low), np.where(never, -np.inf, high)
    if low.ndim == 2:
        low, high = low.max(axis=1), high.min(axis=1)
    return np.stack([np.maximum(low, 0.0), high], axis=1)


def largest_scale(within: Array, probability: float) -> float | None:
    """Return the largest scale with enough machines within the limit; see `scales_within`."""
    needed = math.ceil(probability * len(within) - 1e-9)
    valid = within[within[:, 0] <= within[:, 1]]
    low, high = np.sort(valid[:, 0]), np.sort(valid[:, 1])
    entered = np.searchsorted(low, high, side="right")
    lower = np.searchsorted(high, high, side="left")
    enough = entered - lower >= needed
    return float(high[enough].max()) if enough.any() else None
