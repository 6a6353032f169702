"""Acceptance: the largest error that a machine may have and still pass a plan of tests."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, TypeAlias

import numpy as np

from warpspace.acceptance_tests.error_curves import ErrorCurves
from warpspace.acceptance_tests.measurands import Measurand, PartModel, find_largest_deviations
from warpspace.acceptance_tests.measurements import (
    Estimates,
    estimate_from_readings,
    estimate_from_scene,
    limit_estimates,
)
from warpspace.acceptance_tests.next_tests import (
    FurtherTest,
    FurtherTests,
    NextTest,
    build_constraint,
)
from warpspace.acceptance_tests.plans import UNITS, PlannedTest, default_plan, load_plan, plan_names
from warpspace.acceptance_tests.polytope import Constraint, InfeasibleError, LargestError
from warpspace.analysis.blocks import Block, Column, Table, number_columns
from warpspace.analysis.description import NO_JSON, Analysis, Change, ProgressCallback, Result
from warpspace.analysis.options import Files, Grammar, Kinds, option, place_words, typed_word
from warpspace.bench.base import run_test
from warpspace.calibration.calibrate import Budget
from warpspace.calibration.instruments import NO_INSTRUMENT, instrument_names
from warpspace.calibration.registry import pair_kinds, read_readings
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import compare_orders, evaluate_field
from warpspace.machine.axes import parameter
from warpspace.machine.limits import LIMIT_UM
from warpspace.scene.model import Scene
from warpspace.units import Array, spell_signed

KNOTS = (2, 21)
MAX_NEXT = 10
MIN_FACTOR = 1.0 / 128.0
FACTOR_STEP = 0.015  # relative difference of factors that do and do not keep a limit
MAX_SLOPE = 1e6
MAX_SECOND_DIFFERENCE = 1e9
MARGIN = "value", "limit", "margin"  # columns
MIN_CONTRIBUTION = 0.01  # share of |E| of an error that the table lists
Plan: TypeAlias = Annotated[str | None, Grammar("PLAN", typed_word, is_file=True)]


@dataclass(frozen=True, kw_only=True)
class Acceptance(Analysis):
    """Find the worst machine that passes its acceptance tests.

    Considers all machines within the tolerances of SCENE: each error is an arbitrary curve, linear
    between its knots. PLAN lists tests of the bench with limits ([[acceptance]] test = "circular",
    plane = "XY", radius_mm = 100, limit_um = 8, minutes = 15); by default a bundled one for the
    axes of the machine. Reports the largest |E| in the volume over all machines that pass, between
    two bounds that differ by 2 % at most; the machine that has it; and the largest |E| without
    tests. First order; the machine is evaluated with the exact chain as well. Reversal and scatter
    of repeated runs are not considered.
    """

    name = "acceptance"
    task = "design"
    doing = "searching"
    makes_scenes = True
    scene_help = "Write SCENE with the errors of the worst machine that passes"
    has_table = True
    plan: Plan = option(
        None,
        f"Plan of tests, TOML, or a bundled one: {', '.join(plan_names())}",
        positional=True,
        unset="the bundled one for the axes of the machine",
    )
    knots: int = option(5, "Knots of each error along its axis", low=KNOTS[0], high=KNOTS[1])
    slope: float | None = option(
        None,
        "Largest slope of the errors along linear axes, µm/m or µrad/m",
        low=1e-3,
        high=MAX_SLOPE,
        unset="unlimited",
    )
    second_difference: float | None = option(
        None,
        "Largest second difference of the errors along linear axes, µm/m² or µrad/m²",
        low=1e-3,
        high=MAX_SECOND_DIFFERENCE,
        unset="unlimited",
    )
    data: Files = option(
        (), "Readings of this machine, which its errors agree with: files as for `calibrate`"
    )
    kinds: Kinds = option(
        (),
        "Kind of the readings, as for `calibrate`; once for all files, or once for each",
        flag="--kind",
        unset="recognised from the columns of each file",
    )
    instrument: Budget = option(
        NO_INSTRUMENT,
        f"Instrument whose uncertainty is included: {', '.join(instrument_names())}, or a file."
        " Readings without u_um have its scatter",
        unset="none",
    )
    measured: bool = option(
        False, "Consider machines that agree with the uncertainty of the errors in SCENE only"
    )
    next_count: int | None = option(
        None,
        "Find up to N more tests of the kinds of the plan, each the one that reduces the bound most"
        " per minute, until it is below the limit of SCENE; and the smallest set that is",
        flag="--next",
        low=1,
        high=MAX_NEXT,
    )
    keep_um: float | None = option(
        None,
        "Find the factor for the limits of the plan with which every machine that passes has"
        " |E| ≤ LIMIT",
        unit="µm",
        low=LIMIT_UM[0],
        high=LIMIT_UM[1],
        flag="--keep",
    )

    part: bool = option(
        False,
        "Also find the largest deviation of each measurand of the part of SCENE",
        label="Measurands of the part",
    )

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "AcceptanceResult":
        tests = load_plan(self.plan or default_plan(scene), scene)
        return find_worst_machine(scene, tests, self, watch)

    def estimates(self, curves: ErrorCurves, watch: ProgressCallback) -> Iterator[Estimates]:
        """Read what is known of the machine; raise OptionError where its uncertainty is not."""
        if (self.kinds or self.instrument.name) and not self.data:
            raise OptionError("{kinds}, {instrument}: no readings; expected {data} FILE")
        if self.measured:
            yield from estimate_from_scene(curves)
        if self.data:
            files = zip(self.data, pair_kinds(self.data, self.kinds), strict=True)
            sets = [read_readings(name, curves.scene, kind) for name, kind in files]
            yield from estimate_from_readings(curves, sets, self.instrument, watch)


@dataclass(frozen=True)
class TestValue:
    """A test of the plan on the worst machine."""

    name: str
    value: float  # first order
    limit: float
    unit: str
    exact: float  # with the exact chain


@dataclass(frozen=True, kw_only=True)
class AcceptanceResult(Result):
    """The largest error of a machine that passes, and the machine that has it."""

    scene: Scene = field(metadata=NO_JSON)
    machine: Scene = field(metadata=NO_JSON)  # the worst one that passes
    knots: int
    bound_um: tuple[float, float]  # of the largest |E|: attained, and proved
    at: Mapping[str, float]  # mm or degrees; where the worst machine has it
    direction: tuple[float, float, float]  # of its error there
    without_tests_um: float  # of the machines that agree with the measurements
    tests: tuple[TestValue, ...]
    errors: Mapping[str, float]  # largest value of each error, µm or µrad
    contributions_um: Mapping[str, float]  # along the direction, the largest first
    measured: tuple[str, ...] = field(default=(), metadata=NO_JSON)  # names of measurements
    ranges: Mapping[str, tuple[float, float]] | None = None  # of each error of a measured machine
    next: tuple[NextTest, ...] = ()  # each added to the tests before it
    limit_um: float | None = field(default=None, metadata=NO_JSON)  # of the smallest set
    smallest_set: tuple[FurtherTest, ...] | None = None  # None if there is none
    keep_um: float | None = None
    measurands: tuple[Measurand, ...] = ()  # of the part of the scene
    part_remarks: tuple[str, ...] = field(default=(), metadata=NO_JSON)
    factor: float | None = None  # for all limits, so that |E| ≤ keep_um; None if there is none

    def json_fields(self) -> dict[str, Any]:
        unused = {key for key in ("next", "measurands") if not getattr(self, key)}
        unused |= {"ranges"} if self.ranges is None else set[str]()
        unused |= {"smallest_set"} if self.limit_um is None else set[str]()
        unused |= {"keep_um", "factor"} if self.keep_um is None else set[str]()
        return {key: value for key, value in super().json_fields().items() if key not in unused}

    def changes(self) -> Sequence[Change]:
        return [Change("worst machine that passes", self.machine)]

    def blocks(self) -> Iterator[Block]:
        low, high = self.bound_um
        yield f"{self.scene.title} · {len(self.tests)} tests · {self.knots} knots"
        yield f"  largest |E| of a machine that passes: {low:.1f} µm (at most {high:.1f} µm)"
        yield f"  without tests: {self.without_tests_um:.1f} µm"
        if self.measured:
            yield f"  machines that agree with {', '.join(self.measured)}, 95 % together"
        yield f"  at {place_words(self.at)}"
        yield Table(
            (
                Column("test", leads=True, wraps=True, key="test"),
                *number_columns(MARGIN, keys=MARGIN),
                Column("unit", key="unit"),
            ),
            [
                (row.name, row.value, row.limit, round(row.limit - row.value, 6) + 0.0, row.unit)
                for row in self.tests
            ],
            title="Tests of the worst machine",
        )
        yield Table(
            (
                Column("key", leads=True),
                Column("error", wraps=True),
                Column("largest value", ".2f"),
                Column("unit"),
                Column("contribution", ".2f", "µm"),
            ),
            [
                (key, parameter(key).name, self.errors[key], parameter(key).unit, share)
                for key, share in self.contributions_um.items()
                if abs(share) >= MIN_CONTRIBUTION * low
            ],
            title="Errors responsible",
        )
        if self.measurands:
            yield _measurands_table(self.measurands)
        if self.ranges is not None:
            yield self._range_table(self.ranges)
        if self.keep_um is not None and self.factor is None:
            yield f"  no limits of these tests keep |E| ≤ {self.keep_um:g} µm everywhere"
        elif self.keep_um is not None:
            yield f"  |E| ≤ {self.keep_um:g} µm everywhere with {self.factor:.3f} × all limits"
        if self.next:
            yield Table(
                (
                    Column("test", wraps=True, leads=True),
                    Column("|E| at most", ".1f", "µm"),
                    Column("time", "g", "min"),
                ),
                [(step.name, step.bound_um, step.minutes) for step in self.next],
                title="Further tests, each added to those before it",
            )
        if self.limit_um is not None and self.smallest_set is None:
            yield f"  no further tests of these kinds keep |E| ≤ {self.limit_um:g} µm everywhere"
        elif self.smallest_set:
            yield Table(
                (Column("test", wraps=True, leads=True), Column("time", "g", "min")),
                [(test.name, test.minutes) for test in self.smallest_set],
                title=f"Smallest set of further tests with |E| ≤ {self.limit_um:g} µm everywhere",
            )

    def _range_table(self, ranges: Mapping[str, tuple[float, float]]) -> Table:
        curves = ErrorCurves(self.scene, self.knots)
        lower, upper = curves.by_key(curves.lower), curves.by_key(curves.upper)
        columns = number_columns(("lowest", "highest", "tolerance from", "to"))
        rows = [
            (key, parameter(key).name, *ends, lower[key][0], upper[key][0], parameter(key).unit)
            for key, ends in ranges.items()
        ]
        columns = (Column("key", leads=True), Column("error", wraps=True), *columns, Column("unit"))
        return Table(columns, rows, title="Errors that remain possible")

    def caveats(self) -> Iterator[str]:
        yield from super().caveats()
        yield from self.part_remarks
        axes = ErrorCurves(self.scene, self.knots).curved_axes
        if axes:
            count = 2 * self.knots - 1
            yield f"|E| is evaluated at {count} positions only along {', '.join(axes)}"


def _measurands_table(measurands: Sequence[Measurand]) -> Table:
    return Table(
        (
            Column("measurand", leads=True, wraps=True),
            Column("largest deviation", ".2f"),
            Column("at most", ".2f"),
            Column("without tests", ".2f"),
            Column("unit"),
            Column("tolerance"),
            Column("verdict"),
        ),
        [
            (
                f"{each.name} · {each.measure.replace('_', ' ')}", *each.bound, each.without_tests,
                UNITS[each.unit], " … ".join(map(spell_signed, each.tolerance or ())),
                each.verdict,
            )
            for each in measurands
        ],
        title="Measurands of the part",
    )  # fmt: skip


def find_worst_machine(
    scene: Scene,
    tests: Sequence[PlannedTest],
    request: Acceptance | None = None,
    watch: ProgressCallback = lambda _share: None,
) -> AcceptanceResult:
    """Find the machine within tolerance that passes all tests and has the largest |E|.

    Parameters
    ----------
    scene : Scene
    tests : sequence of PlannedTest
        Empty for all machines within tolerance.
    request : Acceptance, optional
        Its options except for the plan.
    watch : callable, optional

    Returns
    -------
    AcceptanceResult

    Raises
    ------
    OptionError
        If a tolerance is missing, the machine cannot run a test, no machine passes, or there is no
        part.
    """
    request = request or Acceptance()
    curves = ErrorCurves(scene, request.knots, request.slope, request.second_difference)
    measured = limit_estimates([*request.estimates(curves, watch)])
    constraints = [build_constraint(curves, planned, watch) for planned in tests]
    part = PartModel(curves, watch) if request.part else None
    plain = not (request.next_count or request.keep_um or measured or part)
    agreeing = replace(curves, measured=measured)
    try:
        without = agreeing.find_largest((), lambda part: watch(0.1 * part))
        worst = agreeing.find_largest(
            constraints, lambda part: watch(0.1 + (0.9 if plain else 0.2) * part)
        )
    except InfeasibleError as error:
        names = _conflict(curves, [*measured, *constraints], watch)
        verb = "exclude each other" if names[1:] else "cannot be passed"
        if measured and names[0] == measured[0].name and not names[1:]:
            verb = "exclude all"
        raise OptionError(f"{error}: {' and '.join(names)} {verb}") from None
    report = _report(agreeing, worst, without.low_um, list(zip(tests, constraints, strict=True)))
    if measured:
        ranges = agreeing.find_ranges(constraints, lambda part: watch(0.3 + 0.1 * part))
        report = replace(report, measured=tuple(each.name for each in measured), ranges=ranges)
    if part is not None:
        step = 0.1 if request.next_count or request.keep_um else 0.6
        measurands = find_largest_deviations(
            agreeing, constraints, part, lambda share: watch(0.4 + step * share)
        )
        report = replace(report, measurands=tuple(measurands), part_remarks=tuple(part.remarks()))
    if request.keep_um is not None:
        factor = find_factor(agreeing, constraints, worst, request.keep_um, watch)
        report = replace(report, keep_um=request.keep_um, factor=factor)
    if request.next_count:
        search = FurtherTests(agreeing, tests, constraints, watch)
        report = replace(report, next=tuple(search.find_next(worst, request.next_count)))
        if scene.limit_um is not None:
            smallest = search.find_smallest_set(scene.limit_um)
            report = replace(report, limit_um=scene.limit_um, smallest_set=smallest)
    return report


def find_factor(
    curves: ErrorCurves,
    constraints: Sequence[Constraint],
    worst: LargestError,
    limit_um: float,
    watch: ProgressCallback,
) -> float | None:
    """Find the largest factor, at most 1, for all limits with which |E| ≤ limit; None without one.

    The largest |E| grows with the factor, except that there may be no machine below one of them.
    """
    if worst.high_um <= limit_um:
        return 1.0
    low, high, factor, steps = 0.0, 1.0, None, 0
    while high - low > (FACTOR_STEP * low or MIN_FACTOR):
        steps += 1
        watch(0.4 + 0.1 * (1.0 - 0.8**steps))
        middle = (low + high) / 2.0
        scaled = [replace(each, limit=middle * each.limit) for each in constraints]
        try:
            largest = curves.find_largest(scaled, lambda _: watch(0.4), limit_um=limit_um)
        except InfeasibleError:
            low = middle
            continue
        if largest.high_um <= limit_um:
            low = factor = middle
        else:
            high = middle
    return factor


def _conflict(
    curves: ErrorCurves, constraints: Sequence[Constraint], watch: ProgressCallback
) -> list[str]:
    """Find a smallest set of tests that no machine passes, by leaving out one after the other."""
    remaining = list(constraints)
    for constraint in constraints:
        watch(0.0)
        fewer = [other for other in remaining if other is not constraint]
        try:
            curves.polytope(fewer).maximise(0.0 * curves.upper)
        except InfeasibleError:
            remaining = fewer
    return [constraint.name for constraint in remaining]


def _report(
    curves: ErrorCurves,
    worst: LargestError,
    without_um: float,
    tests: Sequence[tuple[PlannedTest, Constraint]],
) -> AcceptanceResult:
    machine = curves.build_scene(worst.machine)
    at = curves.positions_of(worst.node)
    direction = worst.error_um / max(worst.low_um, 1e-30)
    parts = direction @ curves.gains[worst.node] * worst.machine
    contributions = {key: float(part.sum()) for key, part in curves.by_key(parts).items()}
    ordered = sorted(contributions.items(), key=lambda item: -abs(item[1]))
    rows: list[TestValue] = []
    for planned, constraint in tests:
        first, exact = (
            abs(run_test(machine, planned.test, exact=exact).model.outcome[constraint.quantity])
            for exact in (False, True)
        )
        rows.append(TestValue(planned.name, first, planned.limit, UNITS[planned.unit], exact))
    exact_um = evaluate_field(
        machine.model, machine.errors, {axis: np.asarray(q) for axis, q in at.items()},
        machine.view(), curves.grid.point_mm.reshape(-1, 3)[worst.node], exact=True,
    ).error_um  # fmt: skip
    errors: dict[str, Array] = curves.by_key(worst.machine)
    title = f"{curves.scene.title}, worst machine that passes"
    return AcceptanceResult(
        scene=curves.scene,
        machine=replace(machine, title=title),
        knots=curves.knots,
        bound_um=(worst.low_um, worst.high_um),
        at=at,
        direction=tuple(direction.tolist()),
        without_tests_um=without_um,
        tests=tuple(rows),
        errors={key: float(part[np.argmax(np.abs(part))]) for key, part in errors.items()},
        contributions_um=dict(ordered),
        second_order=compare_orders(worst.error_um, exact_um),
    )
