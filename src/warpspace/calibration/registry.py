"""The kinds of measurement there are. A new one is a module beside this and a line below."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from warpspace.analysis.options import Option
from warpspace.bench.base import BenchTest, bench_names, find_test
from warpspace.bench.data import parse_table
from warpspace.bench.plan import BenchPlan, respond, simulate
from warpspace.calibration.kinds import Lengths, MeasurementKind, Points, Prediction, Tracker
from warpspace.calibration.positions import Positions
from warpspace.calibration.readings import Readings, ReadingTable, check_spread
from warpspace.calibration.spheres import SphereKind, SphereTcp
from warpspace.exceptions import OptionError, SceneError, UnknownNameError
from warpspace.machine.limits import MAX_ERROR
from warpspace.scene.model import Scene
from warpspace.scene.text_files import parse_number
from warpspace.units import MM_PER_UM, Array


class TestReadings(MeasurementKind):
    """Readings of one test with its options, for instance ``circular:plane=XZ:radius=150``."""

    __test__ = False
    own_columns = True
    words = "readings of a standard test (warpspace test --list)"
    columns = "those of warpspace test NAME --data FILE"

    def __init__(self, text: str) -> None:
        given, *options = text.split(":")
        kind = find_test(given)
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

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        own = parse_table(table.text, self.test.data_columns(scene), table.source)
        plan, measured = self.test.plan_data(scene, own)
        hint = "Are the readings in the unit that their column names?"
        check_spread(float(np.abs(measured).max()) * MM_PER_UM, MAX_ERROR * 1e-3, own.source, hint)
        count = len(measured)
        lines = own.lines if len(own) == count else np.arange(2, count + 2)
        found = self._readings(plan, measured, own.source, tuple(int(line) for line in lines))
        return replace(found, notes=(*found.notes, *own.notes, *self.test.data_notes(own)))

    def planned(self, scene: Scene) -> Readings:
        """Lay the path of the test as it would be run; nothing is read yet."""
        plan = self.test.plan(scene)
        lines = tuple(range(1, plan.readings + 1))
        return self._readings(plan, np.zeros(plan.readings), self._text, lines)

    def _readings(
        self, plan: BenchPlan, read_um: Array, source: str, lines: tuple[int, ...]
    ) -> Readings:
        return Readings(
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
        return tuple(f"{readings.source} {name}" for name in _plan(readings).setup)

    def observe(self, scene: Scene, readings: Readings, guess: Prediction) -> Array:
        machine = replace(scene, model=self.test.model(scene), errors=guess.errors)
        taken = simulate(machine, _plan(readings)) * MM_PER_UM
        return (taken + _set_up(readings, guess.unknowns) @ guess.values)[:, None]

    def slopes(
        self, scene: Scene, readings: Readings, guess: Prediction, keys: tuple[str, ...]
    ) -> tuple[Array, Array]:
        machine = replace(scene, model=self.test.model(scene), errors=guess.errors)
        matrix = respond(machine, _plan(readings), keys) * MM_PER_UM
        return matrix[:, None, :], _set_up(readings, guess.unknowns)[:, None, :]


def _plan(readings: Readings) -> BenchPlan:
    if readings.plan is None:
        raise OptionError(f"{readings.source}: expected readings of a test")
    return readings.plan


def _set_up(readings: Readings, unknowns: tuple[str, ...]) -> Array:
    own: Mapping[str, Array] = {
        f"{readings.source} {name}": column for name, column in _plan(readings).setup.items()
    }
    none = np.zeros(len(readings))
    columns = [own.get(name, none) for name in unknowns]
    return np.stack(columns, -1) if columns else np.zeros((len(none), 0))


def _value(option: Option, text: str, given: str) -> Any:
    try:
        if option.name == "at":
            parts = (part.partition("=") for part in text.split(",") if part)
            return {name.strip().upper(): parse_number(number) for name, _, number in parts}
        return option.read(text, None)
    except ValueError:
        raise OptionError(f"{{kinds}} {given!r}: {text!r} is no point for {option.flag}") from None
    except OptionError as error:
        said = error.with_names(lambda _: option.flag)
        raise OptionError(f"{{kinds}} {given!r}: {said}") from None


KINDS: Mapping[str, MeasurementKind] = {
    kind.name: kind
    for kind in (Points(), Tracker(), Positions(), SphereKind(), SphereTcp(), Lengths())
}


def find_kind(name: str) -> MeasurementKind:
    """Look up a kind: one of this table, or a test with its options (``circular:plane=XZ``)."""
    if name in KINDS:
        return KINDS[name]
    tests = bench_names()
    if name.partition(":")[0] not in tests:
        raise UnknownNameError("kind of measurement", name, (*KINDS, *tests))
    return _test_kind(name)


_test_kind = lru_cache(maxsize=256)(TestReadings)


def recognise(table: ReadingTable, scene: Scene) -> MeasurementKind:
    found = next((kind for kind in KINDS.values() if kind.fits(table, scene)), None)
    if found is None:
        there = ", ".join((*table.labels, *table.columns))
        kinds = "; ".join(f"{kind.name}: {kind.columns}" for kind in KINDS.values())
        raise SceneError(table.source, [f"has columns {there}; expected those of a kind: {kinds}"])
    return found
