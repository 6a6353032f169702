"""Contributions of parameters: tolerances to the variance, errors to the error of a point."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from warpspace.analysis.blocks import (
    Bars,
    Block,
    Column,
    Panel,
    Role,
    Series,
    Table,
    number_columns,
)
from warpspace.analysis.description import ProgressCallback, Result
from warpspace.analysis.options import error_words, option
from warpspace.analysis.sampling.cases import Case, Reduction, SamplingPlan, reduce_nodes
from warpspace.analysis.sampling.machine_sampling import Sampled
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import View, amplitudes_of, build_basis, error_values, evaluate_exact
from warpspace.kinematics.chain import columns, nominal_point
from warpspace.kinematics.model import Coordinates, Model
from warpspace.machine.axes import parameter
from warpspace.machine.errors import ErrorSet
from warpspace.scene.model import Scene
from warpspace.units import Array, spell_signed

LEAST_SHOWN = 0.005  # µm or µrad of a budget that is named
CHECK_MACHINES = 20_000
CHECK_NODES = 512
SOBOL_NODES = 5
DEFAULT_SOBOL, MAX_SOBOL = 1024, 65_536


@dataclass(frozen=True, slots=True)
class Share:
    """Contribution of the tolerance of one parameter."""

    key: str
    half_width: float  # µm or µrad
    variance_um2: float  # µm²; its part of trace(J Σ Jᵀ), averaged over the points
    share: float  # the same over the sum of all
    sampled_share: float  # the share estimated from sampled machines, see `variance_contributions`
    # sobol indices of the mean |E| of a machine; half width of the 95 % interval of the total
    sobol_first: float | None = None
    sobol_total: float | None = None
    sobol_total_confidence: float | None = None

    @property
    def unit(self) -> str:
        return parameter(self.key).unit


def expected_square(case: Case) -> tuple[Array, float]:
    """Compute E|E|² of the linear model without sampling, averaged over the points.

    The variance is that of each parameter, var(aₖ)·|Jₖ|², [K]; beside it |J·centre|², µm².
    """
    draws, gains = case.draws, case.responses(case.average())
    variance = draws.variance * np.mean(np.sum(gains**2, axis=0), axis=1)
    middle = np.einsum("k,ckn->cn", draws.centre, gains)
    return variance, float(np.mean(np.sum(middle**2, axis=0)))


def variance_contributions(case: Case, sobol: int | None = None) -> "ContributionsResult":
    draws = case.draws
    variance, offset = expected_square(case)
    total = float(variance.sum())
    if not total > 0.0:
        raise OptionError("no parameter of this loop has a tolerance above zero")
    sampled = _sampled_variance(case)
    indices = _sobol(case, sobol) if sobol else {}
    rows = [
        Share(
            key,
            float(draws.half_width[index]),
            float(variance[index]),
            float(variance[index] / total),
            float(sampled[index] / sampled.sum()),
            *indices.get(key, (None, None, None)),
        )
        for index, key in enumerate(draws.keys)
    ]
    rows.sort(key=lambda row: -row.share)
    return ContributionsResult(
        contributions=tuple(rows), variance_um2=total, rms_um=float(np.sqrt(total + offset))
    )


def _sampled_variance(case: Case) -> Array:
    draws, gains = case.draws, case.responses(case.average())
    gains = gains[:, :, :: max(1, gains.shape[2] // CHECK_NODES)]
    values = draws.draw(np.random.default_rng(case.plan.seed), CHECK_MACHINES)
    centred = values - values.mean(axis=0)
    spread = centred.var(axis=0)
    spread = np.where(spread > 0.0, spread, 1.0)
    contributions = np.zeros(len(draws.keys))
    for gain in gains:
        covariance = centred.T @ (values @ gain) / CHECK_MACHINES
        contributions += np.mean(covariance**2, axis=1) / spread
    return contributions


def _sobol(case: Case, base: int) -> Mapping[str, tuple[float, float, float]]:
    from SALib.analyze import sobol as analysis
    from SALib.sample import sobol as sampling

    if not 2 <= base <= MAX_SOBOL or base & (base - 1):
        raise OptionError(f"sobol: {base}; expected a power of two from 2 to {MAX_SOBOL:,}")
    draws, seed = case.draws, case.plan.seed + 1  # SALib takes 0 for no seed
    wide = [index for index, width in enumerate(draws.half_width) if width > 0.0]
    problem = {
        "num_vars": len(wide),
        "names": [draws.keys[index] for index in wide],
        "bounds": [[0.0, 1.0]] * len(wide),
    }
    unit = np.full((1, len(draws.keys)), 0.5)
    drawn = sampling.sample(problem, base, calc_second_order=False, seed=seed)
    unit = np.repeat(unit, len(drawn), axis=0)
    unit[:, wide] = drawn
    places = replace(
        case, plan=replace(case.plan, reduction=Reduction.MEAN, nodes=SOBOL_NODES)
    ).common_places()
    gains = case.responses(places)
    result = reduce_nodes(draws.from_unit(unit), gains, Reduction.MEAN, places.weights)
    indices = analysis.analyze(problem, result, calc_second_order=False, seed=seed)
    columns = zip(indices["S1"], indices["ST"], indices["ST_conf"], strict=True)
    return {
        draws.keys[index]: (float(first), float(total), float(spread))
        for index, (first, total, spread) in zip(wide, columns, strict=True)
    }


@dataclass(frozen=True, kw_only=True)
class Contributions(Sampled):
    """Show which tolerances the volumetric error comes from.

    The variance of the volumetric error is shared out over the tolerances of SCENE, in percent.
    The model is linear and the parameters independent: the shares of trace(J Σ Jᵀ), averaged over
    the points, are exact. Beside them stands what 20,000 sampled machines give. Sobol indices look
    at the length |E| instead, which is not linear: the total index counts interactions, so that
    their sum is above 1.
    """

    name = "contributions"
    task = "design"
    doing = "sampling"
    has_chart = True
    sobol: int | None = option(
        None,
        "Sobol indices of a machine's mean |E| beside the exact shares, from this many base"
        " samples, a power of two such as 1024",
        unset="none",
    )

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "ContributionsResult":
        if self.sobol is not None and self.sobol < 2:
            raise OptionError(f"{{sobol}} {self.sobol}; expected a power of two, 2 or above")
        plan = SamplingPlan(seed=self.seed, cylinder=self.cylinder)
        plan.check()
        result = variance_contributions(self.case(scene, plan), self.sobol)
        watch(1.0)
        where = f"{scene.view(self.loop).loop} loop · {self.drawn} · RMS |E| {result.rms_um:.1f} µm"
        return replace(result, title=scene.title, where=where)


@dataclass(frozen=True, kw_only=True)
class ContributionsResult(Result):
    """Shares of the variance by parameter, largest first."""

    json_keys = ("contributions", "variance_um2", "rms_um")
    contributions: tuple[Share, ...]
    # µm²; trace(J Σ Jᵀ) averaged over the points: the variance of E between machines
    variance_um2: float
    # root of E|E|²: the variance, and the mean error that centres off zero give, together
    rms_um: float
    title: str = ""
    where: str = ""

    @property
    def rows(self) -> tuple[Share, ...]:
        return self.contributions

    def blocks(self) -> Iterator[Block]:
        with_sobol = any(row.sobol_total is not None for row in self.rows)
        columns = (
            Column("key", leads=True),
            *number_columns(("half width",), "g"),
            Column("unit"),
            Column("variance", ".1f", "µm²"),
            *number_columns(("share", "sampled"), ".2f", "%"),
            *(number_columns(("Sobol first", "total", "± (95 %)"), ".3f") if with_sobol else ()),
        )
        cells = [
            (
                row.key, row.half_width, row.unit, row.variance_um2, 100.0 * row.share,
                100.0 * row.sampled_share,
                *((row.sobol_first, row.sobol_total, row.sobol_total_confidence)[: 3 * with_sobol]),
            )
            for row in self.rows
        ]  # fmt: skip
        yield f"{self.title} · {self.where}"
        yield Table(columns, cells)
        yield self._bars(with_sobol=with_sobol)

    def _bars(self, *, with_sobol: bool) -> Bars:
        rows = self.rows
        panels = [
            Panel(
                "share of the variance of E",
                (
                    Series([100.0 * row.share for row in rows], role="key", form=".1f"),
                    Series([100.0 * row.sampled_share for row in rows], as_mark=True),
                ),
                "%",
            )
        ]
        legend: list[tuple[str, Role]] = [
            ("exact share", "key"),
            (f"stroke: from {CHECK_MACHINES:,} sampled machines", "none"),
        ]
        if with_sobol:
            total = [row.sobol_total or 0.0 for row in rows]
            spread = [row.sobol_total_confidence or 0.0 for row in rows]
            first = [max(row.sobol_first or 0.0, 0.0) for row in rows]
            indices = Series(total, spread=spread), Series(first, as_mark=True)
            panels.append(Panel("Sobol index of the mean |E| of a machine", indices))
            words = "Sobol index, total with its 95 % interval; stroke: first order"
            legend.append((words, "plain"))
        return Bars(
            f"Contributions of tolerances · {self.title}", self.where,
            [error_words(row.key) for row in rows], tuple(panels), legend=tuple(legend),
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class PointContribution:
    """Contribution of one parameter to the error of one point."""

    key: str  # parameter key
    value: float  # µm or µrad; the error at the point's axis position
    error_um: Array  # [3]; displacement of the point by this error alone, first order
    # its part along the total error: these parts add up to the length of the first-order error
    along_um: float
    direction: Array  # [3]; unit vector in R along or about which the error acts
    origin_mm: Array  # [3]; origin in R of the frame the error sits in
    lever_mm: Array  # [3]; from that origin to the point


@dataclass(frozen=True, slots=True)
class Explanation:
    """Budget of the error of one point."""

    nominal_mm: Array  # [3]
    error_um: Array  # [3]; from the exact chain
    orientation_urad: Array  # [3]; from the exact chain
    # all parameters of the loop that are not zero there, largest first
    contributions: tuple[PointContribution, ...]
    # [3]; exact error minus the sum of the contributions: what the first order leaves out
    remainder_um: Array


def explain(
    model: Model,
    errors: ErrorSet,
    coordinates: Coordinates,
    view: View | None = None,
    point_mm: Array | None = None,
) -> Explanation:
    view = view or View()
    point = nominal_point(model, view.loop, coordinates) if point_mm is None else point_mm
    keys = [key for key in errors if parameter(key).axis in model.machine.axes]
    vectors = build_basis(model, errors, keys, coordinates, view, point).contributions(
        amplitudes_of(errors, keys)
    )
    total = vectors.sum(axis=0)
    length = float(np.linalg.norm(total))
    towards = total / length if length > 0.0 else np.zeros(3)
    responses = columns(model, view.loop, keys, coordinates, point)
    values = error_values(model, errors, coordinates)
    parts = [
        PointContribution(
            key,
            float(values[key]),
            vector,
            float(vector @ towards),
            responses[key].direction,
            point - responses[key].lever_mm,
            responses[key].lever_mm,
        )
        for key, vector in zip(keys, vectors, strict=True)
        if key in responses and np.any(vector != 0.0)
    ]
    parts.sort(key=lambda part: float(np.linalg.norm(part.error_um)), reverse=True)
    exact = evaluate_exact(model, errors, coordinates, view, point)
    return Explanation(
        np.asarray(point, dtype=float),
        exact.error_um,
        exact.orientation_urad,
        tuple(parts),
        exact.error_um - total,
    )


def budget_words(budget: Mapping[str, float], max_terms: int = 3) -> str:
    """Format the largest contributions to a number, µm or µrad."""
    terms = [(key, part) for key, part in budget.items() if abs(part) >= LEAST_SHOWN]
    return ", ".join(f"{key} {spell_signed(part)}" for key, part in terms[:max_terms])
