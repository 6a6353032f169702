"""Further tests of the kinds of a plan: those that reduce the largest error most per minute."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from warpspace.acceptance_tests.error_curves import ErrorCurves
from warpspace.acceptance_tests.plans import UNITS, PlannedTest
from warpspace.acceptance_tests.polytope import (
    Constraint,
    InfeasibleError,
    LargestError,
    Polytope,
)
from warpspace.analysis.description import NO_JSON, ProgressCallback
from warpspace.bench.base import BenchTest
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.scene.model import Scene

VARIED = ("plane", "axis", "across", "kind")  # options of tests, and their place
MAX_READINGS = 5_000  # of one test
NEEDED = 0.99  # share of the largest |E| that a further test leaves at most


@dataclass(frozen=True)
class NextTest:
    """A further test, and the bound of |E| with it and those before it."""

    test: str
    options: Mapping[str, Any]
    bound_um: float
    minutes: float
    name: str = field(metadata=NO_JSON)


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


def find_next_tests(
    curves: ErrorCurves,
    tests: Sequence[PlannedTest],
    constraints: Sequence[Constraint],
    worst: LargestError,
    count: int,
    watch: ProgressCallback,
) -> Iterator[NextTest]:
    """Add tests one by one, until the bound is below the limit of the scene.

    Only a test that the worst machine fails can reduce the bound. Most others are excluded as soon
    as a machine that passes them exceeds what is left by the best test so far.
    """
    untimed = [planned.name for planned in tests if planned.minutes is None]
    if untimed:
        raise OptionError(f"{{next_count}}: {', '.join(untimed)}: expected minutes in the plan")
    candidates = list(_candidates(curves, tests, watch))
    present, limit_um = list(constraints), curves.scene.limit_um or 0.0
    for step in range(count):
        rate, best = 0.0, None  # µm per minute
        for number, (planned, constraint) in enumerate(candidates):
            share = 0.6 + 0.4 * (step + number / len(candidates)) / count
            watch(share)
            minutes = planned.minutes or 1.0
            target_um = min(NEEDED * worst.low_um, worst.low_um - rate * minutes)
            if target_um <= 0.0 or passes(worst, constraint):
                continue
            tick = partial(_keep_share, watch, share)
            extended = [*present, constraint]
            if curves.find_largest(extended, tick, limit_um=target_um).high_um <= target_um:
                largest = curves.find_largest(extended, tick)
                rate, best = (worst.low_um - largest.low_um) / minutes, (number, largest)
        if best is None or worst.high_um <= limit_um:
            return
        number, worst = best
        planned, constraint = candidates.pop(number)
        present.append(constraint)
        name, minutes = planned.test.name, planned.minutes or 1.0
        yield NextTest(name, planned.options, worst.high_um, minutes, planned.name)


def _keep_share(watch: ProgressCallback, share: float, _part: float) -> None:
    watch(share)


def passes(worst: LargestError, constraint: Constraint) -> bool:
    try:
        Polytope(worst.machine, worst.machine, [constraint]).maximise(0.0 * worst.machine)
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
