"""Further tests of the kinds of a plan: those that reduce the largest error most per minute."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np

from warpspace.acceptance.error_curves import ErrorCurves
from warpspace.acceptance.plans import UNITS, AcceptanceTest
from warpspace.acceptance.polytope import (
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
COARSE_GAP = 0.2  # of the bounds that candidates are ranked by


@dataclass(frozen=True)
class NextTest:
    """A further test, and the bound of |E| with it and those before it."""

    test: str
    options: Mapping[str, Any]
    bound_um: float
    minutes: float
    name: str = field(metadata=NO_JSON)


def build_constraint(
    curves: ErrorCurves, entry: AcceptanceTest, watch: ProgressCallback
) -> Constraint:
    """Build the constraint of a test of a plan; raise OptionError where it cannot be used."""
    watch(0.0)
    try:
        plan = entry.test.plan(curves.scene)
        forms = entry.test.linear_forms(plan, curves.readings(plan))
    except WarpspaceError as error:
        raise OptionError(f"{entry.name}: {error}") from error
    key = entry.quantity or next(iter(forms), "")
    if key not in forms:
        raise OptionError(
            f"{entry.name}: {key or 'its result'} has no linear form; expected one of"
            f" {', '.join(forms)}"
        )
    if not key.endswith(f"_{entry.unit}"):
        unit = next(unit for unit in UNITS if key.endswith(f"_{unit}"))
        raise OptionError(f"{entry.name}: limit_{entry.unit}; {key} expects limit_{unit}")
    return Constraint(entry.name, forms[key], entry.limit, key)


def find_next_tests(
    curves: ErrorCurves,
    tests: Sequence[AcceptanceTest],
    constraints: Sequence[Constraint],
    worst: LargestError,
    count: int,
    watch: ProgressCallback,
) -> Iterator[NextTest]:
    """Add tests one by one, until the bound is below the limit of the scene.

    Only a test that the worst machine fails can reduce the bound. Its reduction is estimated with a
    coarse search; the bound of the best one is that of the fine search.
    """
    untimed = [entry.name for entry in tests if entry.minutes is None]
    if untimed:
        raise OptionError(f"{{next_count}}: {', '.join(untimed)}: expected minutes in the plan")
    candidates = list(_candidates(curves, tests, watch))
    present, limit_um = list(constraints), curves.scene.limit_um or 0.0
    for step in range(count):
        ranking: list[tuple[float, int]] = []
        for number, (entry, constraint) in enumerate(candidates):
            share = (step + number / len(candidates)) / count
            watch(0.6 + 0.4 * share)
            if passes(worst, constraint):
                continue
            coarse = curves.find_largest([*present, constraint], lambda _: watch(0.6), COARSE_GAP)
            reduction = worst.low_um - coarse.low_um
            ranking.append((reduction / (entry.minutes or 1.0), number))
        if not ranking or worst.high_um <= limit_um:
            return
        entry, constraint = candidates.pop(max(ranking)[1])
        present.append(constraint)
        worst = curves.find_largest(present, lambda _: watch(0.6))
        name, minutes = entry.test.name, entry.minutes or 1.0
        yield NextTest(name, entry.options, worst.high_um, minutes, entry.name)


def passes(worst: LargestError, constraint: Constraint) -> bool:
    try:
        Polytope(worst.values, worst.values, [constraint]).maximise(0.0 * worst.values)
    except InfeasibleError:
        return False
    return True


def _candidates(
    curves: ErrorCurves, tests: Sequence[AcceptanceTest], watch: ProgressCallback
) -> Iterator[tuple[AcceptanceTest, Constraint]]:
    """Vary axes, planes and directions of each kind of test, and the place of axes at rest."""
    scene, present = curves.scene, {entry.test for entry in tests}
    for entry in {(entry.test.name, entry.unit): entry for entry in tests}.values():
        settings = {setting.name: setting for setting in type(entry.test).settings()}
        choices = {
            name: settings[name].choices or tuple(scene.machine.axes)
            for name in VARIED
            if name in settings
        }
        for values in product(*choices.values()):
            chosen = dict(zip(choices, values, strict=True))
            options = {**entry.options, **chosen}
            for at in _places(scene, replace(entry.test, **chosen)):
                test = replace(entry.test, **chosen, at=tuple(at.items()) or entry.test.at)
                if test in present:
                    continue
                present.add(test)
                varied = replace(entry, test=test, options=options | ({"at": at} if at else {}))
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
