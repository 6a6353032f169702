"""Allocation of tolerances: the widest that keep a limit of |E| with a required probability."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis import description
from warpspace.analysis.blocks import Block, Column, Table, number_columns
from warpspace.analysis.options import Grammar, option, read_keys, read_numbers
from warpspace.analysis.sampling import tolerance_search
from warpspace.analysis.sampling.cases import Case, Reduction, both_orders
from warpspace.analysis.sampling.distribution import Draws, Probability, machines_needed
from warpspace.analysis.sampling.machine_sampling import KeptLimit, montecarlo, sample_chunks
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.field.evaluate import compare_orders
from warpspace.machine.axes import parameter
from warpspace.machine.limits import COST, LIMIT_UM, MAX_HALF_WIDTH, PROBABILITY
from warpspace.scene.model import Scene
from warpspace.units import Array

DIGITS = 3
"""Significant digits of an allocated half width; it is rounded down, so that the limit is kept."""
NO_EFFECT = 1e-18  # mean squared gain, µm² per µm² or µrad², below which a parameter moves no point
TRIES, NARROWER = 5, 0.99
"""Rounding changes the proportions a little: should the limit then fail, all are narrowed again."""
EXACT_MACHINES = 2000  # machines of which the answer is verified with the exact chain
SEARCHED, WIDENED, CHECKED = 0.4, 0.2, 0.4
"""Shares of the work: the search, the scale on new machines, the checks before and after."""


def read_costs(text: str, _scene: Scene) -> tuple[tuple[str, float], ...]:
    return tuple(read_numbers(text, "KEY=NUMBER", "EA0Z=4,EXX=0.5").items())


Fixed: TypeAlias = Annotated[tuple[str, ...], Grammar("KEY,…", read_keys, many=True)]
Costs: TypeAlias = Annotated[
    tuple[tuple[str, float], ...], Grammar("KEY=NUMBER,…", read_costs, many=True)
]


@dataclass(frozen=True, kw_only=True)
class Allocate(KeptLimit):
    """Find the widest tolerances that meet a limit of |E|.

    The required share of the machines within the new tolerances of SCENE has |E| ≤ LIMIT, at the
    least cost: a half width w of an error costs 1/w, or the number of --cost divided by w. A
    tolerance of 0 remains 0, and centres are unchanged; half widths are rounded down to three
    digits and are at most 1000 µm or µrad. The limit applies everywhere in the volume, unless
    --over selects another evaluation; the lower end of the 95 % interval (Wilson) of the share
    meets the required one. `warpspace montecarlo FILE --limit LIMIT --over max` gives the same
    figure; another --seed samples other machines.
    """

    name = "allocate"
    task = "design"
    doing = "allocating"
    makes_scenes = True
    scene_help = "Scene file to write with the new tolerances"
    limit_um: float = option(
        100.0,
        "Largest |E| accepted",
        unit="µm",
        low=LIMIT_UM[0],
        high=LIMIT_UM[1],
        flag="--limit",
        required=True,
    )
    probability: float = option(
        0.95,
        "Share of the machines that has to keep the limit",
        low=PROBABILITY[0],
        high=PROBABILITY[1],
    )
    costs: Costs = option(
        (),
        "Cost of an error's tolerance, 1 if not given: a half width w costs NUMBER/w",
        flag="--cost",
    )
    fixed: Fixed = option((), "Errors whose tolerance stays unchanged")

    def run(self, scene: Scene, watch: description.ProgressCallback, /) -> "AllocateResult":
        case = self.case(scene, self.plan_of(self.limit_um))
        return replace(allocate(case, self, description.count_progress(watch, 1.0)), scene=scene)

    def check_keys(self, allowed: Sequence[str]) -> None:
        for key in (*dict(self.costs), *self.fixed):
            if key not in allowed:
                raise UnknownNameError("error parameter", key, allowed)
        for key, cost in self.costs:
            if not COST[0] <= cost <= COST[1]:
                raise OptionError(
                    f"{{costs}} of {key}: {cost:g}; expected {COST[0]:g} to {COST[1]:g}"
                )
        for key in sorted({*self.fixed}.intersection(dict(self.costs))):
            raise OptionError(f"{key}: has a cost and is fixed; expected one of the two")


class Exact(NamedTuple):
    """An allocation verified with the exact chain, on some of the machines."""

    machines: int
    probability: float
    first_order: float  # probability on the same machines

    def verdict(self) -> str:
        change = f"{100.0 * (self.probability - self.first_order):+.2f}"
        comparison = f"{change} % against" if float(change) else "as many as to"
        return (
            f"exact chain: {100.0 * self.probability:.2f} % of {self.machines:,} of these machines,"
            f" {comparison} the first order"
        )


@dataclass(frozen=True, kw_only=True)
class AllocateResult(description.Result):
    """Allocated tolerances, and the probability that the limit is kept."""

    analysis: Allocate
    scene: Scene | None = None
    draws: Draws  # the tolerances before
    half_width: Array  # [K], µm or µrad; after, in the order of `draws.keys`
    free: NDArray[np.bool_]  # [K]; which of them were allocated
    # of keeping the limit, on the same machines, with its 95 % confidence interval (Wilson)
    before: Probability
    after: Probability
    cost_before: float  # Σ cost/w over the allocated tolerances; infinite where one was zero
    cost_after: float
    samples: int  # of these machines
    seed: int
    exact: Exact
    widest: float  # µm or µrad; largest half width that is given

    @property
    def tolerances(self) -> dict[str, float]:
        """Half width by parameter, µm or µrad, of those that were allocated."""
        widths = zip(self.draws.keys, self.half_width, self.free, strict=True)
        return {key: float(width) for key, width, free in widths if free}

    @property
    def at_widest(self) -> tuple[str, ...]:
        """Parameters with the largest half width allowed."""
        return tuple(key for key, width in self.tolerances.items() if width >= self.widest)

    def json_fields(self) -> dict[str, Any]:
        analysis = self.analysis
        return {
            "limit_um": analysis.limit_um,
            "wanted": analysis.probability,
            "loop": str(analysis.loop),
            "over": analysis.over,
            "distribution": str(analysis.drawn),
            "tolerances": dict(zip(self.draws.keys, self.half_width.tolist(), strict=True)),
            "allocated": list(self.tolerances),
            "probability": self.after.probability,
            "low": self.after.low,
            "high": self.after.high,
            "probability_before": self.before.probability,
            "cost": self.cost_after,
            "cost_before": self.cost_before,
            "samples": self.samples,
            "seed": self.seed,
            "exact": self.exact._asdict(),
        }

    def changes(self) -> Sequence[description.Change]:
        if self.scene is None:
            return ()
        tolerances = self.scene.tolerances.with_half_widths(self.tolerances)
        return [
            description.Change("tolerances allocated", replace(self.scene, tolerances=tolerances))
        ]

    def blocks(self) -> Iterator[Block]:
        analysis, draws = self.analysis, self.draws
        title = () if self.scene is None else (self.scene.title,)
        yield " · ".join(
            (*title, f"{analysis.loop} loop", str(analysis.drawn), f"evaluated {analysis.where}")
        )
        columns = (
            Column("key", leads=True),
            Column("error", wraps=True),
            *number_columns(("before ±", "after ±"), "g"),
            Column("unit"),
            Column("note", wraps=True),
        )
        widths = zip(draws.keys, draws.half_width, self.half_width, self.free, strict=True)
        yield Table(
            columns,
            [
                (
                    key, parameter(key).name, float(before), float(after), parameter(key).unit,
                    self._note(key, zero=before == 0.0, free=bool(free)),
                )
                for key, before, after, free in widths
            ],
        )  # fmt: skip
        yield (
            f"  |E| ≤ {analysis.limit_um:g} µm before: {100.0 * self.before.probability:.2f} %"
            f" of the machines, cost {self.cost_before:.3g}"
        )
        yield (
            f"  |E| ≤ {analysis.limit_um:g} µm after: {100.0 * self.after.probability:.2f} % of the"
            f" machines, 95 % interval {100.0 * self.after.low:.2f} …"
            f" {100.0 * self.after.high:.2f} %, cost {self.cost_after:.3g}"
            f" ({self.samples:,} machines)"
        )
        yield f"  {self.exact.verdict()}"

    def _note(self, key: str, *, zero: bool, free: bool) -> str:
        if not free:
            return "fixed" if key in self.analysis.fixed else "zero" if zero else "no effect"
        if key in self.at_widest:
            return "widest allowed"
        cost = dict(self.analysis.costs).get(key)
        return "" if cost is None else f"cost {cost:g}"


def allocate(
    case: Case,
    analysis: Allocate,
    advance: description.ProgressCallback = description.ignore_progress,
    widest: float = MAX_HALF_WIDTH,
) -> AllocateResult:
    """Find the tolerances of least cost that keep a limit with a probability.

    `advance` is called with the share of the work that was done since its last call.
    """
    analysis.check_keys(case.model.machine.allowed_keys)
    draws, plan = case.draws, replace(case.plan, spec_um=analysis.limit_um)
    plan.check()
    if plan.reduction == Reduction.MEAN:
        raise OptionError("{over} mean: expected sampled or max")
    if plan.reduction == Reduction.MAX:
        tolerance_search.refuse_many_points(case.view.loop)
    needed = machines_needed(plan.samples, analysis.probability)
    if needed > plan.samples:
        raise OptionError(
            f"{{samples}}: {plan.samples:,} machines are too few to show that"
            f" {100.0 * analysis.probability:g} % keep a limit (lower end of the 95 % interval)"
        )
    case = replace(case, plan=plan)
    # the search has machines of its own
    seed = int(np.random.SeedSequence((plan.seed, 1)).generate_state(1)[0])
    coarse = replace(plan, samples=tolerance_search.SAMPLES, seed=seed)
    task = _task(
        draws, analysis, tolerance_search.build_ensemble(replace(case, plan=coarse)), widest
    )
    steps: list[None] = []

    def step() -> None:
        steps.append(None)
        advance(SEARCHED / tolerance_search.MOST_STEPS)

    widths = tolerance_search.search_widths(task, step)
    advance(SEARCHED * (1.0 - len(steps) / tolerance_search.MOST_STEPS))
    scale = _new_scales(case, analysis.limit_um, needed / plan.samples, advance)
    widths = None if widths is None else tolerance_search.scaled(task, widths, scale)

    def probability(half: Array, share: float) -> Probability:
        drawn = replace(case, draws=replace(draws, half_width=half))
        result = montecarlo(drawn, progress=lambda n: advance(share * n / plan.samples))
        assert result.probability is not None  # noqa: S101 - the plan has a limit
        return result.probability

    if widths is None:
        raise OptionError(_why_not(task))
    before = probability(draws.half_width, CHECKED / 2.0)
    half_width = np.where(task.free, round_down(widths), draws.half_width)
    after = probability(half_width, CHECKED / 2.0)
    for _ in range(TRIES):
        if after.low >= analysis.probability:
            break
        half_width = np.where(task.free, round_down(NARROWER * half_width), draws.half_width)
        after = probability(half_width, 0.0)
    else:
        raise OptionError(_why_not(task))
    orders = both_orders(replace(case, draws=replace(draws, half_width=half_width)), EXACT_MACHINES)
    first, exact = (
        float(np.mean(np.linalg.norm(each, axis=-1).max(axis=-1) <= analysis.limit_um))
        for each in orders
    )
    return AllocateResult(
        analysis=replace(analysis, loop=case.view.loop),
        draws=draws,
        half_width=half_width,
        free=task.free,
        before=before,
        after=after,
        cost_before=task.spent(draws.half_width),
        cost_after=task.spent(half_width),
        samples=plan.samples,
        seed=plan.seed,
        exact=Exact(len(orders[0]), exact, first),
        widest=widest,
        second_order=compare_orders(*orders),
    )


def round_down(widths: Array) -> Array:
    """Round positive numbers down to `DIGITS` significant digits."""
    rounded = np.zeros_like(widths)
    for index, width in enumerate(widths):
        if width > 0.0:
            places = DIGITS - 1 - math.floor(math.log10(width))
            nearest = round(float(width), places)
            step = 10.0**-places
            rounded[index] = nearest if nearest <= width else round(nearest - step, places)
    return rounded


def _task(
    draws: Draws, analysis: Allocate, ensemble: tolerance_search.Ensemble, widest: float
) -> tolerance_search.Task:
    moves = ensemble.mean_square_gain > NO_EFFECT
    fixed = np.array([key in analysis.fixed for key in draws.keys])
    free = moves & (draws.half_width > 0.0) & ~fixed
    if not free.any():
        raise OptionError(
            "nothing to allocate: every tolerance is fixed, zero, or without effect on the error in"
            " this loop; expected one or more that are free"
        )
    costs = dict(analysis.costs)
    return tolerance_search.Task(
        ensemble,
        draws.centre,
        draws.half_width,
        free,
        np.array([costs.get(key, 1.0) for key in draws.keys]),
        analysis.limit_um,
        analysis.probability,
        widest,
    )


def _new_scales(
    case: Case, limit_um: float, share: float, advance: description.ProgressCallback
) -> tolerance_search.ScaleOf:
    draws, common = case.draws, None
    if case.plan.reduction == Reduction.MAX:
        common = case.responses(case.common_places())

    def scale(half_width: Array, moving: NDArray[np.bool_]) -> float | None:
        drawn = replace(draws, half_width=half_width)

        def chunk(rng: np.random.Generator, count: int) -> Array:
            amplitudes = drawn.draw(rng, count)
            base = np.where(moving, draws.centre, amplitudes)
            move = amplitudes - base
            if common is not None:
                return tolerance_search.scales_within(base @ common, move @ common, limit_um)
            gains = case.responses(case.random(rng, count))
            base_um = np.einsum("nk,ckn->cn", base, gains)
            return tolerance_search.scales_within(
                base_um, np.einsum("nk,ckn->cn", move, gains), limit_um
            )

        scales: list[Array] = []
        for part in sample_chunks(chunk, case.plan):
            scales.append(part)
            advance(WIDENED * len(part) / case.plan.samples)
        return tolerance_search.largest_scale(np.concatenate(scales), share)

    return scale


def _why_not(task: tolerance_search.Task) -> str:
    fixed = np.where(task.free, 0.0, task.half_width)
    norm = task.ensemble.norm_um(task.centre, fixed)
    share = float(np.mean(norm <= task.limit_um))
    return (
        f"no tolerance, however narrow, keeps {task.limit_um:g} µm on"
        f" {100.0 * task.probability:g} % of the machines: with all free ones at zero,"
        f" {100.0 * share:.1f} % keep it; expected a larger limit, a smaller probability, fewer"
        " fixed tolerances, or centres nearer to zero"
    )
