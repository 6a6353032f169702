"""Further tests of the kinds of a plan: the most effective per minute, and the smallest set."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from warpspace.acceptance_tests.error_curves import ErrorCurves
from warpspace.acceptance_tests.plans import UNITS, PlannedTest
from warpspace.acceptance_tests.polytope import (
    CLOSE,
    Constraint,
    InfeasibleError,
    LargestError,
    Polytope,
)
from warpspace.analysis.description import NO_JSON, ProgressCallback
from warpspace.analysis.integer_program import solve_integer_program
from warpspace.bench.base import BenchTest
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.scene.model import Scene
from warpspace.units import Array

VARIED = ("plane", "axis", "across", "kind")  # options of tests, and their place
MAX_READINGS = 5_000  # of one test
NEEDED = 0.99  # share of the largest |E| that a further test leaves at most
PASSED = 1e-6  # share of a limit by which a machine that passes may exceed it
SET_SHARE = 0.8  # progress while the smallest set is sought


@dataclass(frozen=True, kw_only=True)
class FurtherTest:
    """A test that the plan does not contain."""

    test: str
    options: Mapping[str, Any]
    minutes: float
    name: str = field(metadata=NO_JSON)

    @classmethod
    def of(cls, planned: PlannedTest, **fields: float) -> Self:
        minutes, name = planned.minutes or 1.0, planned.name
        return cls(
            test=planned.test.name, options=planned.options, minutes=minutes, name=name, **fields
        )


@dataclass(frozen=True, kw_only=True)
class NextTest(FurtherTest):
    """A further test, and the bound of |E| with it and those before it."""

    bound_um: float


def build_constraint(
    curves: ErrorCurves, planned: PlannedTest, watch: ProgressCallback
) -> Constraint:
    """Build the constraint of a test of a plan; raise OptionError where it cannot be used."""
    watch(0.0)
    try:
        plan = planned.test.plan(curves.scene)
        if plan.readings > MAX_READINGS:
            raise OptionError(f"{plan.readings:,} readings; expected at most {MAX_READINGS:,}")
        forms = planned.test.linear_forms(plan, curves.readings(plan))
    except WarpspaceError as error:
        raise OptionError(f"{planned.name}: {error}") from error
    key = planned.quantity or next(iter(forms), "")
    if key not in forms:
        raise OptionError(
            f"{planned.name}: {key or 'its result'} has no linear form; expected one of"
            f" {', '.join(forms)}"
        )
    if not key.endswith(f"_{planned.unit}"):
        unit = next(unit for unit in UNITS if key.endswith(f"_{unit}"))
        raise OptionError(f"{planned.name}: limit_{planned.unit}; {key} expects limit_{unit}")
    return Constraint(planned.name, forms[key], planned.limit, key)


class FurtherTests:
    """Candidates for further tests, and known machines that pass the plan.

    A machine that passes the plan and a set of candidates shows that these leave its |E|: most sets
    are excluded by known machines, without a search of their own.
    """

    def __init__(
        self,
        curves: ErrorCurves,
        tests: Sequence[PlannedTest],
        constraints: Sequence[Constraint],
        watch: ProgressCallback,
    ) -> None:
        untimed = [planned.name for planned in tests if planned.minutes is None]
        if untimed:
            raise OptionError(f"{{next_count}}: {', '.join(untimed)}: expected minutes in the plan")
        self.curves, self.present, self.watch = curves, tuple(constraints), watch
        candidates = list(_candidates(curves, tests, watch))
        self.tests = [planned for planned, _ in candidates]
        self.constraints = [constraint for _, constraint in candidates]
        self.minutes = np.array([planned.minutes or 1.0 for planned in self.tests])
        self.sizes_um = np.zeros(0)  # [M]; largest |E| of each known machine
        self.passing = np.zeros((len(candidates), 0), dtype=bool)  # [C, M]

    def add(self, machine: Array) -> NDArray[np.bool_]:
        """Add a machine, [V]; return the candidates that it passes, [C]."""
        norms = np.linalg.norm(self.curves.gains @ machine, axis=-1)
        passed = np.array([passes(machine, each) for each in self.constraints], dtype=bool)
        self.sizes_um = np.append(self.sizes_um, norms.max())
        self.passing = np.column_stack([self.passing, passed])
        return passed

    def with_candidates(self, chosen: Iterable[int]) -> list[Constraint]:
        return [*self.present, *(self.constraints[number] for number in chosen)]

    def find_next(self, worst: LargestError, count: int) -> Iterator[NextTest]:
        """Add tests one by one, until the bound is below the limit of the scene."""
        limit_um, chosen = self.curves.scene.limit_um or 0.0, list[int]()
        self.add(worst.machine)
        while len(chosen) < count and worst.high_um > limit_um:
            rate, best = 0.0, None  # µm per minute
            is_open = np.ones(len(self.tests), dtype=bool)
            is_open[chosen] = False
            while is_open.any():
                # largest |E| of the known machines that pass the chosen tests and a candidate
                remaining_um = self.sizes_um * np.all(self.passing[chosen], axis=0)
                left_um = np.max(self.passing * remaining_um, axis=1)
                targets_um = np.minimum(NEEDED * worst.low_um, worst.low_um - rate * self.minutes)
                is_open &= left_um <= targets_um
                rates = np.where(is_open, (worst.low_um - left_um) / self.minutes, -1.0)
                number = int(np.argmax(rates))
                if not is_open[number]:
                    break
                share = 0.4 + 0.3 * (len(chosen) + 1.0 - is_open.mean()) / count
                self.watch(share)
                is_open[number] = False
                largest = self.curves.find_largest(
                    self.with_candidates([*chosen, number]),
                    partial(keep_share, self.watch, share),
                    stop_um=float(targets_um[number]),
                )
                self.add(largest.machine)
                if largest.low_um <= targets_um[number]:
                    rate = (worst.low_um - largest.low_um) / self.minutes[number]
                    best = number, largest
            if best is None:
                return
            chosen.append(best[0])
            worst = best[1]
            yield NextTest.of(self.tests[best[0]], bound_um=worst.high_um)

    def find_smallest_set(self, limit_um: float) -> tuple[FurtherTest, ...] | None:
        """Find the fewest, then the quickest, candidates that bring the bound below a limit.

        Returns None where all candidates together do not.

        Notes
        -----
        Implicit hitting set (Moreno-Centeno and Karp, Operations Research 61 (2013), 453). A known
        machine with |E| above the limit is to be excluded by one of the candidates that it fails;
        the smallest set that excludes all known machines is an integer program. Either its bound is
        below the limit, and no smaller set has such a bound, since that too would exclude the known
        machines; or a machine that passes it exceeds the limit, and is added. Exceeding counts from
        `CLOSE` of the limit.
        """
        tick = partial(keep_share, self.watch, SET_SHARE)
        while True:
            fails = ~self.passing[:, self.sizes_um > CLOSE * limit_um].T
            if not fails.any(axis=1).all():
                return None  # a machine that passes all candidates
            chosen = self._hit(fails) if len(fails) else []
            largest = self.curves.find_largest(self.with_candidates(chosen), tick, limit_um)
            if largest.high_um <= limit_um:
                return tuple(FurtherTest.of(self.tests[number]) for number in chosen)
            passed = self.add(largest.machine)
            gain = largest.error_um / largest.low_um @ self.curves.gains[largest.node]
            for number in range(len(self.tests)):  # pass more, so that fewer exclude it
                if passed[number]:
                    continue
                self.watch(SET_SHARE)
                extended = self.with_candidates([*np.flatnonzero(passed).tolist(), number])
                vertex = self.curves.polytope(extended).maximise(gain)
                if vertex.maximum > CLOSE * limit_um:
                    passed = passed | self.add(vertex.point)

    def _hit(self, fails: NDArray[np.bool_]) -> list[int]:
        """Choose the fewest candidates that exclude machines; of several sets the quickest.

        The candidates that each machine fails, [M, C].
        """
        costs = 1.0 + self.minutes / (1.0 + self.minutes.sum())
        is_integer, rows = np.ones(len(costs), dtype=bool), fails.astype(float)
        chosen, _ = solve_integer_program(costs, rows, (1.0, np.inf), (0.0, 1.0), is_integer)
        if chosen is None:  # all candidates together exclude each machine
            raise OptionError("{next_count}: the integer program of the smallest set has no answer")
        return np.flatnonzero(np.round(chosen)).tolist()


def keep_share(watch: ProgressCallback, share: float, _part: float) -> None:
    """Report the same share whatever part of a step is completed."""
    watch(share)


def passes(machine: Array, constraint: Constraint) -> bool:
    """Check if a machine, [V], passes a test, to `PASSED` of its limit.

    The least-squares residuals about the unknowns of the form bound its size: their largest from
    above, their RMS from below. Between both a linear program decides.
    """
    form, limit = constraint.form, constraint.limit * (1.0 + PASSED)
    residuals = form.rows @ machine - constraint.target
    residuals = np.abs(residuals - form.free @ np.linalg.lstsq(form.free, residuals)[0])
    if form.factor * residuals.max(initial=0.0) <= limit:
        return True
    if form.factor * np.sqrt(np.mean(residuals**2)) > limit or not form.free.size:
        return False
    try:
        Polytope(machine, machine, [replace(constraint, limit=limit)]).maximise(0.0 * machine)
    except InfeasibleError:
        return False
    return True


def _candidates(
    curves: ErrorCurves, tests: Sequence[PlannedTest], watch: ProgressCallback
) -> Iterator[tuple[PlannedTest, Constraint]]:
    """Vary axes, planes and directions of each kind of test, and the place of axes at rest."""
    scene, present = curves.scene, {planned.test for planned in tests}
    for planned in {(planned.test.name, planned.unit): planned for planned in tests}.values():
        settings = {setting.name: setting for setting in type(planned.test).settings()}
        choices = {
            name: settings[name].choices or tuple(scene.machine.axes)
            for name in VARIED
            if name in settings
        }
        for combination in product(*choices.values()):
            chosen = dict(zip(choices, combination, strict=True))
            options = {**planned.options, **chosen}
            for at in _places(scene, replace(planned.test, **chosen)):
                test = replace(planned.test, **chosen, at=tuple(at.items()) or planned.test.at)
                if test in present:
                    continue
                present.add(test)
                varied = replace(planned, test=test, options=options | ({"at": at} if at else {}))
                with suppress(OptionError):  # a test that the machine cannot run
                    yield varied, build_constraint(curves, varied, watch)


def _places(scene: Scene, test: BenchTest) -> list[dict[str, float]]:
    """List ends of the axes that a test does not move, after their present positions."""
    try:
        coordinates = test.plan(scene).coordinates
    except WarpspaceError:
        return []
    ranges = scene.workspace.ranges
    volume = [axis for axis, (low, high) in ranges.items() if low < high]
    resting = [axis for axis in volume if not np.ptp(coordinates[axis])]
    ends = product(*(ranges[axis] for axis in resting))
    return [{}, *(dict(zip(resting, end, strict=True)) for end in ends if resting)]
