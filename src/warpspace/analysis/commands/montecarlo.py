"""Monte Carlo simulation: distribution of |E| over machines within tolerance."""

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product
from math import prod
from operator import attrgetter
from typing import Annotated, Any, TypeAlias, Unpack

import numpy as np

from warpspace.analysis.blocks import Block, Column, Histogram, Table, number_columns
from warpspace.analysis.commands.contributions import expected_square
from warpspace.analysis.description import ProgressCallback, Result, count_progress, to_json
from warpspace.analysis.options import Grammar, option
from warpspace.analysis.registry import PUBLICATIONS, PrintedNumber
from warpspace.analysis.sampling.cases import DEFAULT_NODES, Case, Reduction, both_orders
from warpspace.analysis.sampling.machine_sampling import (
    Execution,
    SampledMachines,
    SampleStatistics,
    limit_or_that_of,
    montecarlo_each,
)
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.field.evaluate import SecondOrder, compare_orders
from warpspace.machine.errors import TOLERANCE_CLASSES
from warpspace.machine.limits import MAX_ERROR, MIN_HALF_WIDTH, SWEEP_CASES
from warpspace.scene.model import Scene
from warpspace.scene.text_files import parse_number, parse_whole
from warpspace.units import spell_fixed

NUMBERS = {
    "mean": "mean_um", "RMS": "rms_um", "median": "median_um", "P95": "p95_um", "P99": "p99_um",
    "max": "max_um",
}  # fmt: skip
JSON_NUMBERS = (
    "mean_um", "mode_um", "median_um", "p95_um", "p99_um", "max_um", "histogram",
)  # fmt: skip
INTERVAL = ("probability", "low", "high")
PRINTED = 200  # rows that are printed
WHERE = {
    Reduction.SAMPLED: "at one random point",
    Reduction.MAX: "everywhere",
    Reduction.MEAN: "in the mean",
}
WHAT = {
    Reduction.SAMPLED: "|E| at one random point each",
    Reduction.MAX: "largest |E| of each",
    Reduction.MEAN: "mean |E| of each",
}


def read_steps(text: str, _scene: Scene) -> tuple[str, tuple[float, ...]]:
    key, _, values = text.partition("=")
    try:
        if ":" in values:
            low, high, number = values.split(":")
            count = parse_whole(number) if parse_whole(number) <= SWEEP_CASES else 0
            widths = np.linspace(parse_number(low), parse_number(high), count).tolist()
        else:
            widths = [parse_number(value) for value in values.split(",")]
    except ValueError:
        widths = []
    if not (key.strip() and widths):
        raise ValueError(
            f"expected KEY=FROM:TO:N with N from 1 to {SWEEP_CASES:,}, or KEY=NUMBER,…, for"
            " instance EAX=5:20:4 or rotation=10,20"
        )
    return key.strip(), tuple(widths)


Steps: TypeAlias = Annotated[
    tuple[tuple[str, tuple[float, ...]], ...], Grammar("KEY=FROM:TO:N", read_steps, each=True)
]


@dataclass(frozen=True, slots=True)
class SweepPoint:
    """One scene with one choice of half widths."""

    scene: Scene  # with the tolerances that were taken
    half_widths: Mapping[str, float]  # µm or µrad; those that are swept, by key or class
    sampled: SampleStatistics

    @property
    def row(self) -> dict[str, Any]:
        sampled, plan = self.sampled, self.sampled.case.plan
        names = "probability", "probability_low", "probability_high"
        return {
            "scene": self.scene.name,
            "title": self.scene.title,
            **self.half_widths,
            "samples": plan.samples,
            "seed": plan.seed,
            **{name: getattr(sampled, name) for name in NUMBERS.values()},
            "spec_um": plan.spec_um,
            **dict(zip(names, sampled.interval, strict=True)),
        }


@dataclass(frozen=True, kw_only=True)
class MonteCarlo(SampledMachines):
    """Sample machines within tolerance: distribution of |E|.

    Machines are sampled from the tolerances of each SCENE (a folder stands for the scenes in it;
    several are printed as a table); |E| is the length of the error in µm.
    Each parameter is sampled once per machine and is constant; a component error has this value at
    the evaluated point. Tool and relative loop: points uniform in the working volume, rotary axes
    at their positions in the scene. Workpiece loop: points uniform in the volume of the largest
    workpiece, its rotary axes uniform over their travel.

    With --tolerance there is a row for every combination of half widths. All rows have the same
    seed, so that they differ by their tolerances only.

    Quantiles are exact up to a million samples; beyond, from a histogram with steps of 0.002 %. The
    numbers of a seed are the same on any number of workers, processes or machines of a cluster.
    """

    name = "montecarlo"
    task = "design"
    scenes = (1, None)
    doing = "sampling"
    has_chart = True
    chart_help = "histogram"
    run_options = tuple(Execution.__annotations__)
    over: Reduction = option(
        Reduction.SAMPLED,
        "|E| at one random point per machine, or its largest or mean over a machine's points",
    )
    grid: int = option(DEFAULT_NODES, "Nodes per axis for the largest or mean |E|", low=2, high=101)
    limit_um: float | None = option(
        None,
        "Limit of |E|, for the share of machines within it",
        unit="µm",
        low=0.0,
        flag="--limit",
        unset="that of the scenes",
    )
    tolerance: Steps = option(
        (),
        "Half widths of a parameter, or of the class translation, rotation or squareness, in µm or"
        " µrad: N of them in equal steps, or a list as in EXX=5,10,20",
    )
    rows: bool = option(False, "A row for each scene, as for each combination of half widths")

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "MonteCarloResult":
        return self.run_all((scene,), watch)

    def run_all(
        self,
        scenes: Sequence[Scene],
        watch: ProgressCallback,
        /,
        **execution: Unpack[Execution],
    ) -> "MonteCarloResult":
        limit_um = limit_or_that_of(scenes, self.limit_um)
        if limit_um != self.limit_um:
            return replace(self, limit_um=limit_um).run_all(scenes, watch, **execution)
        self.check_against(len(scenes))
        counted = count_progress(watch, self.machines(len(scenes)))
        progress = execution.get("progress")

        def advance(count: int) -> None:
            counted(count)
            if progress is not None:
                progress(count)

        execution["progress"] = advance
        points = self.points(scenes, **execution)
        first = next(points)
        widest, retained, rows = first, [first], [first.row] if self.in_rows else []
        for point in points:
            if self.in_rows:
                rows.append(point.row)
            else:
                retained.append(point)
            if point.sampled.max_um > widest.sampled.max_um:
                widest = point
        return MonteCarloResult(
            analysis=self,
            points=tuple(retained),
            rows=tuple(rows),
            second_order=sampled_second_order(widest.sampled),
        )

    @property
    def in_rows(self) -> bool:
        return self.rows or bool(self.tolerance)

    def machines(self, scenes: int) -> int:
        return self.samples * scenes * prod(len(values) for _, values in self.tolerance)

    def check_against(self, scenes: int) -> None:
        steps = dict(self.tolerance)
        for key, _ in self.tolerance[len(steps) - 1 :] if len(steps) < len(self.tolerance) else ():
            raise OptionError(f"{{tolerance}}: {key} is given twice")
        for key, values in steps.items():
            if not values:
                raise OptionError(f"{{tolerance}} {key}: no half width; expected one at least")
            for value in values:
                if not (value == 0.0 or MIN_HALF_WIDTH <= value <= MAX_ERROR):
                    raise OptionError(
                        f"{{tolerance}} {key}: half width {value:g}; expected 0, or"
                        f" {MIN_HALF_WIDTH:g} to {MAX_ERROR:g} µm or µrad"
                    )
        count = self.machines(scenes) // self.samples
        if count > SWEEP_CASES:
            what = "combinations" if steps else "rows"
            raise OptionError(f"{count:,} {what}; expected at most {SWEEP_CASES:,}")

    def points(
        self, scenes: Iterable[Scene], **execution: Unpack[Execution]
    ) -> "Iterator[SweepPoint]":
        """Sample scenes as they are needed; the last half width changes first."""
        plan = self.plan(self.over, self.limit_um, self.grid)
        plan = replace(plan, workers=execution.get("workers"))
        plan.check()
        steps = dict(self.tolerance)
        waiting: deque[tuple[Scene, Mapping[str, float]]] = deque()

        def cases() -> Iterator[Case]:
            for scene in scenes:
                for values in product(*steps.values()):
                    point = dict(zip(steps, values, strict=True))
                    chosen = with_half_widths(scene, point)
                    waiting.append((chosen, point))
                    yield self.case(chosen, plan)

        for sampled in montecarlo_each(cases(), **execution):
            yield SweepPoint(*waiting.popleft(), sampled)


@dataclass(frozen=True, kw_only=True)
class MonteCarloResult(Result):
    """The distribution of |E| of the machines of one scene or several."""

    analysis: MonteCarlo
    points: tuple[SweepPoint, ...]  # of each scene; of many rows only the first
    rows: tuple[Mapping[str, Any], ...]  # for each combination, where these were asked for

    @property
    def sampled(self) -> SampleStatistics:
        """Statistics of the first scene."""
        return self.points[0].sampled

    def __getattr__(self, name: str) -> Any:
        """Return a statistic of the first scene, such as `p95_um`."""
        if name not in SampleStatistics.__dataclass_fields__:
            raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
        return getattr(self.sampled, name)

    def json_fields(self) -> dict[str, Any]:
        analysis = self.analysis
        if analysis.in_rows:
            return {"tolerances": to_json(dict(analysis.tolerance)), "rows": [*self.rows]}
        if len(self.points) == 1:
            return _numbers(self.points[0].sampled)
        each = [
            {"scene": point.scene.name, "title": point.scene.title, **_numbers(point.sampled)}
            for point in self.points
        ]
        return {"scenes": each}

    def blocks(self) -> Iterator[Block]:
        first = self.points[0]
        if self.analysis.in_rows or len(self.points) > 1:
            yield from self._several_scenes()
        else:
            yield from self._single_scene(first.scene, first.sampled)

    def _several_scenes(self) -> Iterator[Block]:
        analysis, first = self.analysis, self.points[0].sampled
        if analysis.in_rows:
            yield (
                f"{first.case.view.loop} loop · {analysis.samples:,} machines a row,"
                f" {analysis.over} · {first.case.draws.distribution} · seed {analysis.seed}"
            )
        else:
            yield self._settings(first)
        rows: Sequence[Mapping[str, Any]] = self.rows or [point.row for point in self.points]
        swept = [key for key, _ in analysis.tolerance]
        limit = number_columns(
            () if analysis.limit_um is None else (f"≤ {analysis.limit_um:g} µm",), unit="%"
        )
        columns = (
            Column("scene", leads=True),
            *(Column(key, "g", "±") for key in swept),
            *number_columns(NUMBERS, unit="µm"),
            *limit,
        )
        names = ("scene", *swept, *NUMBERS.values())
        yield Table(
            columns,
            [
                (*(row[name] for name in names), *(100.0 * row["probability"] for _ in limit))
                for row in islice(rows, PRINTED)
            ],
        )
        n_hidden = len(rows) - PRINTED
        if n_hidden > 0:
            yield f"… and {n_hidden:,} {'rows' if analysis.in_rows else 'scenes'} more"

    def _single_scene(self, scene: Scene, sampled: SampleStatistics) -> Iterator[Block]:
        analysis = self.analysis
        settings = self._settings(sampled)
        yield f"{scene.title} · {settings}"
        yield (
            f"  mean {spell_fixed(sampled.mean_um)}, mode {spell_fixed(sampled.mode_um)},"
            f" median {spell_fixed(sampled.median_um)}, P95 {spell_fixed(sampled.p95_um)},"
            f" P99 {spell_fixed(sampled.p99_um)}, max {spell_fixed(sampled.max_um)} µm"
        )
        printed: dict[str, PrintedNumber] = {}
        if analysis.over is Reduction.SAMPLED:
            for publication in PUBLICATIONS.members():
                number = publication.sampled_mean(scene, sampled.case.view.loop)
                if number is not None:
                    printed[publication.name] = number
            variance, offset = expected_square(sampled.case)
            expected_um = math.sqrt(variance.sum() + offset)
            yield (
                f"  RMS  {spell_fixed(sampled.rms_um)} µm sampled, {spell_fixed(expected_um)} µm"
                " from trace(J Σ Jᵀ) without sampling"
            )
        yield from (f"  {number.quotation}" for number in printed.values())
        probability = sampled.probability
        if probability is not None:
            yield (
                f"  |E| ≤ {probability.spec_um:g} µm {WHERE[analysis.over]}:"
                f" {100.0 * probability.probability:.2f} % of the machines, 95 % interval"
                f" {100.0 * probability.low:.2f} … {100.0 * probability.high:.2f} %"
            )
        draws = sampled.case.draws
        centred = [k for k, width in zip(draws.keys, draws.half_width, strict=True) if width == 0.0]
        count = len(draws.keys) - len(centred)
        note = f"; held at their centre: {', '.join(centred)}" if centred else ""
        yield f"  {count} parameters drawn{note}"
        if not sampled.exact_quantiles:
            yield "  quantiles to 0.002 % of their value"
        marks = [(name, number.value_um) for name, number in printed.items()]
        yield sampled_histogram(sampled, scene.title, settings, marks)

    def _settings(self, sampled: SampleStatistics) -> str:
        analysis, draws = self.analysis, sampled.case.draws
        drawn = str(draws.distribution)
        if drawn == "normal":
            drawn = "normal, 3σ = half width" + (", clipped" if draws.clip else "")
        return (
            f"{sampled.case.view.loop} loop · {analysis.samples:,} machines, {WHAT[analysis.over]}"
            f" · {drawn} · seed {analysis.seed}"
        )


def _numbers(sampled: SampleStatistics) -> dict[str, Any]:
    case, plan = sampled.case, sampled.case.plan
    probability = {} if sampled.probability is None else {"specification": sampled.probability}
    return to_json(
        {
            "samples": plan.samples,
            "seed": plan.seed,
            "distribution": case.draws.distribution,
            "loop": case.view.loop,
            "over": plan.reduction,
            **{name: getattr(sampled, name) for name in JSON_NUMBERS},
            **probability,
        }
    )


def sampled_histogram(
    sampled: SampleStatistics,
    title: str,
    subtitle: str,
    printed: Sequence[tuple[str, float]] = (),
) -> Histogram:
    edges, probability = sampled.histogram.edges_um, sampled.probability
    captions = ()
    if probability is not None:
        share, low, high = (100.0 * getattr(probability, name) for name in INTERVAL)
        limit = f"stay within {probability.spec_um:g} µm"
        captions = (
            f"{share:.2f} % of the machines\n{limit}", f"95 % interval {low:.2f} … {high:.2f} %",
        )  # fmt: skip
    marks = [("mode", sampled.mode_um), ("mean", sampled.mean_um), ("P95", sampled.p95_um)]
    return Histogram(
        title,
        subtitle,
        "volumetric error |E|, µm",
        f"machines per {edges[1] - edges[0]:g} µm, %",
        edges,
        100.0 * sampled.histogram.counts / sampled.case.plan.samples,
        (*marks, *printed),
        sampled.case.plan.spec_um,
        captions,
    )


def sampled_second_order(*sampled: SampleStatistics) -> SecondOrder:
    """Compare first order and exact chain on machines drawn for the scene with the largest |E|."""
    return compare_orders(*both_orders(max(sampled, key=attrgetter("max_um")).case))


def sweep(
    scenes: Iterable[Scene],
    half_widths: Mapping[str, Sequence[float]] | None = None,
    **options: Any,
) -> Iterator[SweepPoint]:
    """Sample machines of many scenes, with every combination of some half widths.

    Parameters
    ----------
    scenes : iterable of Scene
        Taken as they are needed.
    half_widths : mapping of str to sequence of float, µm or µrad, optional
        For a parameter key, or for a class (translation, rotation, squareness); parameters with a
        tolerance of their own are not touched by that of their class. None: as the scenes are.
    workers : int, optional
        Threads, or tasks of the executor at a time; the numbers do not depend on it.
    executor : concurrent.futures.Executor, optional
        Does the work instead of threads: a pool of processes, or a cluster's.
    progress, take : callable, optional
        Called with the number of machines done since the last call; with the number of a case and
        |E| of its next machines, in order.
    options
        The other options of `montecarlo`. Every point has the same seed, so that points differ by
        their half widths and not by chance.

    Yields
    ------
    SweepPoint
        Scene by scene; of the half widths, the last one changes first.

    Raises
    ------
    SceneError
        If a scene has no tolerances, or not for every parameter.
    OptionError, UnknownNameError
        If an argument is out of range, or a scene has no such parameter.
    """
    steps = tuple((key, tuple(values)) for key, values in (half_widths or {}).items())
    execution = {key: options.pop(key) for key in MonteCarlo.run_options if key in options}
    analysis = MonteCarlo(tolerance=steps, **options)
    analysis.check_against(1)
    yield from analysis.points(scenes, **execution)


def with_half_widths(scene: Scene, half_widths: Mapping[str, float]) -> Scene:
    if not half_widths:
        return scene
    tolerances = scene.tolerances
    classes = {key: value for key, value in half_widths.items() if key in TOLERANCE_CLASSES}
    by_key = {key: value for key, value in half_widths.items() if key not in classes}
    for key in by_key:
        if key not in scene.machine.allowed_keys:
            expected = (*scene.parameter_keys, *TOLERANCE_CLASSES)
            raise UnknownNameError("parameter or tolerance class", key, expected)
    tolerances = replace(tolerances, default={**tolerances.default, **classes})
    return replace(scene, tolerances=tolerances.with_half_widths(by_key))
