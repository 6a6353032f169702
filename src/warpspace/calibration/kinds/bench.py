"""Readings of a standard test, evaluated as the test's own path and sensors have them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warpspace.analysis.options import Option
from warpspace.bench.base import BenchTest, bench_names, find_test
from warpspace.bench.data import parse_table
from warpspace.bench.plan import Plan
from warpspace.bench.readings import respond, simulate
from warpspace.calibration.kinds.kind import Guess, Kind
from warpspace.calibration.readings import Readings, ReadingTable, check_spread
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.machine.limits import MAX_ERROR
from warpspace.scene.files import parse_number
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, Array

RENAMED = {"r-test": "sphere"}
"""The test `sphere` reads deviations at sphere poses; the kind of that name reads centres."""
NAMES = {RENAMED[name]: name for name in RENAMED}


@dataclass(frozen=True, slots=True)
class PlannedReadings(Readings):
    """Readings along the path of a test."""

    plan: Plan | None = None  # always there


def test_kinds() -> tuple[str, ...]:
    """Name the tests as ``--kind`` takes them."""
    return tuple(NAMES.get(name, name) for name in bench_names())


class TestReadings(Kind):
    """Readings of one test with its options, for instance ``circular:plane=XZ:radius=150``."""

    __test__ = False
    own_columns = True
    words = "readings of a standard test (warpspace test --list)"
    columns = "those of warpspace test NAME --data FILE"

    def __init__(self, text: str) -> None:
        given, *options = text.split(":")
        kind = find_test(RENAMED.get(given, given))
        known = {option.flag.removeprefix("--"): option for option in kind.settings()}
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
        found = self._readings(plan, measured, own.source, tuple(int(line) for line in lines))
        return replace(found, notes=(*found.notes, *own.notes, *self.test.data_notes(own)))

    def planned(self, scene: Scene) -> PlannedReadings:
        """Lay the path of the test as it would be run; nothing is read yet."""
        plan = self.test.plan(scene)
        lines = tuple(range(1, plan.readings + 1))
        return self._readings(plan, np.zeros(plan.readings), self._text, lines)

    def _readings(
        self, plan: Plan, read_um: Array, source: str, lines: tuple[int, ...]
    ) -> PlannedReadings:
        return PlannedReadings(
            self._text,
            {name: values[plan.site] for name, values in plan.coordinates.items()},
            plan.point_mm[plan.site],
            read_um[:, None] * MM_PER_UM,
            None,
            (source,) * len(lines),
            lines,
            source,
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

    def observe(self, scene: Scene, readings: Readings, guess: Guess) -> Array:
        """Run the test on the model, and add what the set-up gives."""
        machine = replace(scene, model=self.test.model(scene), errors=guess.errors)
        taken = simulate(machine, _plan(readings)) * MM_PER_UM
        return (taken + _set_up(readings, guess.unknowns) @ guess.values)[:, None]

    def slopes(
        self, scene: Scene, readings: Readings, guess: Guess, keys: tuple[str, ...]
    ) -> tuple[Array, Array]:
        """Take the linear response of the test."""
        machine = replace(scene, model=self.test.model(scene), errors=guess.errors)
        matrix = respond(machine, _plan(readings), keys).matrix * MM_PER_UM
        return matrix[:, None, :], _set_up(readings, guess.unknowns)[:, None, :]


def _plan(readings: Readings) -> Plan:
    plan = getattr(readings, "plan", None)
    if not isinstance(plan, Plan):
        raise OptionError(f"{readings.source}: expected readings of a test")
    return plan


def _set_up(readings: Readings, unknowns: tuple[str, ...]) -> Array:
    own: Mapping[str, Array] = {
        f"{readings.source} {name}": column for name, column in _plan(readings).setup.items()
    }
    none = np.zeros(len(readings))
    columns = [own.get(name, none) for name in unknowns]
    return np.stack(columns, -1) if columns else np.zeros((len(none), 0))


def _value(option: Option, text: str, given: str) -> Any:
    """Read the value of an option of a test; axes are looked at where the test is laid."""
    try:
        if option.name == "at":
            parts = (part.partition("=") for part in text.split(",") if part)
            return {name.strip().upper(): parse_number(number) for name, _, number in parts}
        return option.read(text, None)
    except ValueError:
        raise OptionError(f"{{kinds}} {given!r}: {text!r} is no point for {option.flag}") from None
    except OptionError as error:
        said = error.said(lambda _: option.flag)
        raise OptionError(f"{{kinds}} {given!r}: {said}") from None
