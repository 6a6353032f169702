"""Readings of a standard test, evaluated as the test's own path and sensors have them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from warpspace.bench.base import BenchTest
from warpspace.bench.data import parse_table
from warpspace.bench.options import TestOption, options_of
from warpspace.bench.plan import Plan
from warpspace.bench.readings import respond, simulate
from warpspace.bench.registry import bench_names, find_test
from warpspace.calibration.kinds.kind import Kind
from warpspace.calibration.readings import Readings, check_spread
from warpspace.calibration.table import ReadingTable
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.machine.errors import ErrorSet
from warpspace.machine.limits import MAX_ERROR
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, Array

RENAMED = {"r-test": "sphere"}
"""The test `sphere` reads deviations at sphere poses; the kind of that name reads centres."""
NAMES = {RENAMED[name]: name for name in RENAMED}


@dataclass(frozen=True, slots=True)
class PlannedReadings(Readings):
    """Readings along the path of a test.

    Attributes
    ----------
    plan : Plan or None
        Always there.
    """

    plan: Plan | None = None


def test_kinds() -> tuple[str, ...]:
    """Name the tests as ``--kind`` takes them."""
    return tuple(NAMES.get(name, name) for name in bench_names())


class TestReadings(Kind):
    """Readings of one test with its options, for instance ``circular:plane=XZ:radius=150``.

    Parameters
    ----------
    text : str
        Name of the test, and options with colons between.

    Raises
    ------
    OptionError, UnknownNameError
        If there is no such test or option.
    """

    __test__ = False
    own_columns: ClassVar[bool] = True
    words: ClassVar[str] = "readings of a standard test (warpspace test --list)"
    columns: ClassVar[str] = "those of warpspace test NAME --data FILE"

    def __init__(self, text: str) -> None:
        given, *options = text.split(":")
        kind = find_test(RENAMED.get(given, given))
        known = {option.flag.removeprefix("--"): option for option in options_of(kind)}
        values: dict[str, Any] = {}
        for part in options:
            name, equals, value = part.partition("=")
            name = name.strip().replace("_", "-")
            if not equals or name not in known:
                raise UnknownNameError(f"option of {given}", name, known)
            values[known[name].name] = _value(known[name], value.strip(), text)
        self.test: BenchTest = kind(**values)
        self._text = text

    def fits(self, table: ReadingTable, scene: Scene) -> bool:
        """Say no: several tests have like columns, and all have options."""
        del table, scene
        return False

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        """Lay the path of the test through the poses of the file."""
        own = parse_table(table.text, self.test.data_columns(scene), table.source)
        plan, measured = self.test.plan_data(scene, own)
        hint = "Are the readings in the unit that their column names?"
        check_spread(float(np.abs(measured).max()) * MM_PER_UM, MAX_ERROR * 1e-3, own.source, hint)
        count = len(measured)
        lines = own.lines if len(own) == count else np.arange(2, count + 2)
        return PlannedReadings(
            self._text,
            {name: values[plan.site] for name, values in plan.coordinates.items()},
            plan.point_mm[plan.site],
            measured[:, None] * MM_PER_UM,
            None,
            (table.source,) * count,
            tuple(int(line) for line in lines),
            own.source,
            (f"{self.test.title}: {plan.place}",),
            plan=plan,
        )

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        """Name what the set-up of the test leaves unknown; each file has its own."""
        return tuple(f"{readings.source} {name}" for name in _plan(readings).setup)

    def start(self, readings: Readings, unknowns: tuple[str, ...]) -> Array:
        """Begin with none."""
        del readings
        return np.zeros(len(unknowns))

    def observe(
        self,
        scene: Scene,
        readings: Readings,
        errors: ErrorSet,
        unknowns: tuple[str, ...],
        values: Array,
    ) -> Array:
        """Run the test on the model, and add what the set-up gives."""
        machine = replace(scene, model=self.test.model(scene), errors=errors)
        taken = simulate(machine, _plan(readings)) * MM_PER_UM
        return (taken + _set_up(readings, unknowns) @ values)[:, None]

    def slopes(
        self,
        scene: Scene,
        readings: Readings,
        errors: ErrorSet,
        keys: tuple[str, ...],
        unknowns: tuple[str, ...],
        values: Array,
    ) -> tuple[Array, Array]:
        """Take the linear response of the test."""
        del values
        machine = replace(scene, model=self.test.model(scene), errors=errors)
        matrix = respond(machine, _plan(readings), keys).matrix * MM_PER_UM
        return matrix[:, None, :], _set_up(readings, unknowns)[:, None, :]


def _plan(readings: Readings) -> Plan:
    """Give the path of readings of a test."""
    plan = getattr(readings, "plan", None)
    if not isinstance(plan, Plan):
        raise OptionError(f"{readings.source}: expected readings of a test")
    return plan


def _set_up(readings: Readings, unknowns: tuple[str, ...]) -> Array:
    """Give what a unit of each unknown adds to each reading, [m, unknowns]."""
    own: Mapping[str, Array] = {
        f"{readings.source} {name}": column for name, column in _plan(readings).setup.items()
    }
    none = np.zeros(len(readings))
    return (
        np.stack([own.get(name, none) for name in unknowns], -1)
        if unknowns
        else none[:, None][:, :0]
    )


def _value(option: TestOption, text: str, given: str) -> Any:
    """Read the value of an option of a test.

    Raises
    ------
    OptionError
        If it cannot be read.
    """
    try:
        if option.kind == "count":
            return int(text)
        if option.kind == "number":
            return float(text)
        if option.kind == "point":
            parts = (part.partition("=") for part in text.split(",") if part)
            return {name.strip().upper(): float(number) for name, _, number in parts}
        if option.kind == "vector":
            return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise OptionError(
            f"--kind {given!r}: {text!r} is no {option.kind} for {option.flag}"
        ) from None
    if option.kind == "choice" and text not in option.choices:
        choices = ", ".join(option.choices)
        raise OptionError(f"--kind {given!r}: {option.flag} {text!r}; expected one of {choices}")
    return text
