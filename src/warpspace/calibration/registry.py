"""Registry of the kinds of measurement: a new kind is a module and a line below."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from warpspace.analysis.options import Option
from warpspace.bench.base import BenchTest, bench_names, find_test
from warpspace.bench.data import parse_table
from warpspace.bench.plan import BenchPlan, respond, simulate
from warpspace.calibration.kinds import (
    Lengths,
    MeasurementKind,
    Points,
    Positions,
    Prediction,
    Tracker,
)
from warpspace.calibration.part_reports import PartReports
from warpspace.calibration.readings import (
    Readings,
    ReadingTable,
    check_spread,
    parse_reading_table,
)
from warpspace.calibration.spheres import SphereKind, SphereTcp
from warpspace.exceptions import OptionError, SceneError, UnknownNameError
from warpspace.machine.limits import MAX_CSV_BYTES, MAX_ERROR
from warpspace.parts.inspection_report import is_report
from warpspace.resources import find_data
from warpspace.scene.model import Scene
from warpspace.scene.text_files import parse_number, read_table_text
from warpspace.units import MM_PER_UM, Array


class TestReadings(MeasurementKind):
    """Readings of one test with its options, for instance ``circular:plane=XZ:radius=150``."""

    __test__ = False
    reads_text = True
    description = "readings of a standard test (warpspace test --list)"
    columns = "those of warpspace test NAME --data FILE"

    def __init__(self, text: str) -> None:
        test_name, *parts = text.split(":")
        kind = find_test(test_name)
        options = {option.flag.removeprefix("--"): option for option in kind.settings()}
        values: dict[str, Any] = {}
        for part in parts:
            name, equals, value = part.partition("=")
            name = name.strip().replace("_", "-")
            if not equals or name not in options:
                raise UnknownNameError(f"option of {test_name}", name, options)
            values[options[name].name] = _value(options[name], value.strip(), text)
        self.test: BenchTest = kind(**values)
        self._text = text

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        test_data = parse_table(table.text, self.test.data_columns(scene), table.source)
        plan, measured_um = self.test.plan_data(scene, test_data)
        largest_mm = float(np.abs(measured_um).max()) * MM_PER_UM
        hint = "Are the readings in the unit that their column names?"
        check_spread(largest_mm, MAX_ERROR * 1e-3, test_data.source, hint)
        count = len(measured_um)
        lines = test_data.lines if len(test_data) == count else np.arange(2, count + 2)
        rows = tuple(int(line) for line in lines)
        readings = self._readings(plan, measured_um, test_data.source, rows)
        notes = (*readings.notes, *test_data.notes, *self.test.data_notes(test_data))
        return replace(readings, notes=notes)

    def plan_readings(self, scene: Scene) -> Readings:
        """Build the readings of a planned test, all zero."""
        plan = self.test.plan(scene)
        lines = tuple(range(1, plan.readings + 1))
        return self._readings(plan, np.zeros(plan.readings), self._text, lines)

    def _readings(
        self, plan: BenchPlan, read_um: Array, source: str, lines: tuple[int, ...]
    ) -> Readings:
        coordinates = {name: values[plan.site] for name, values in plan.coordinates.items()}
        arrays = coordinates, plan.point_mm[plan.site], read_um[:, None] * MM_PER_UM, None
        notes = (f"{self.test.title}: {plan.place}",)
        rows = (source,) * len(lines), lines, source
        return Readings(self._text, *arrays, *rows, notes, plan=plan)

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        return tuple(f"{readings.source} {name}" for name in _plan(readings).setup)

    def observe(self, scene: Scene, readings: Readings, prediction: Prediction) -> Array:
        machine = replace(scene, model=self.test.model(scene), errors=prediction.errors)
        simulated_mm = simulate(machine, _plan(readings)) * MM_PER_UM
        return (simulated_mm + _set_up(readings, prediction.unknowns) @ prediction.values)[:, None]

    def slopes(
        self, scene: Scene, readings: Readings, prediction: Prediction, keys: tuple[str, ...]
    ) -> tuple[Array, Array]:
        machine = replace(scene, model=self.test.model(scene), errors=prediction.errors)
        matrix = respond(machine, _plan(readings), keys) * MM_PER_UM
        return matrix[:, None, :], _set_up(readings, prediction.unknowns)[:, None, :]


def _plan(readings: Readings) -> BenchPlan:
    if readings.plan is None:
        raise OptionError(f"{readings.source}: expected readings of a test")
    return readings.plan


def _set_up(readings: Readings, unknowns: tuple[str, ...]) -> Array:
    set_up: Mapping[str, Array] = {
        f"{readings.source} {name}": row for name, row in _plan(readings).setup.items()
    }
    none = np.zeros(len(readings))
    columns = [set_up.get(name, none) for name in unknowns]
    return np.column_stack([np.zeros((len(none), 0)), *columns])


def _value(option: Option, text: str, test: str) -> Any:
    try:
        if option.name == "at":
            parts = (part.partition("=") for part in text.split(",") if part)
            return {name.strip().upper(): parse_number(number) for name, _, number in parts}
        return option.read(text, None)
    except ValueError:
        raise OptionError(f"{{kinds}} {test!r}: {text!r} is no point for {option.flag}") from None
    except OptionError as error:
        message = error.with_names(lambda _: option.flag)
        raise OptionError(f"{{kinds}} {test!r}: {message}") from None


KINDS: Mapping[str, MeasurementKind] = {
    kind.name: kind
    for kind in (
        Points(),
        Tracker(),
        Positions(),
        SphereKind(),
        SphereTcp(),
        Lengths(),
        PartReports(),
    )
}


def find_kind(name: str) -> MeasurementKind:
    """Find a kind: one of this table, or a test with its options (``circular:plane=XZ``)."""
    if name in KINDS:
        return KINDS[name]
    tests = bench_names()
    if name.partition(":")[0] not in tests:
        raise UnknownNameError("kind of measurement", name, (*KINDS, *tests))
    return _test_kind(name)


_test_kind = lru_cache(maxsize=256)(TestReadings)


def recognise(table: ReadingTable, scene: Scene) -> MeasurementKind:
    for kind in KINDS.values():
        if kind.matches(table, scene):
            return kind
    columns = ", ".join((*table.labels, *table.columns))
    kinds = "; ".join(f"{kind.name}: {kind.columns}" for kind in KINDS.values())
    raise SceneError(table.source, [f"has columns {columns}; expected those of a kind: {kinds}"])


def pair_kinds(names: Sequence[str], kinds: Sequence[str]) -> Sequence[str | None]:
    """Return the stated kind of each file, from one for all or one each; None without any."""
    paired = kinds if len(kinds) > 1 else (*kinds, None)[:1] * len(names)
    if len(paired) != len(names):
        raise OptionError(
            f"{len(paired)} values of {{kinds}} for {len(names)} files; expected 1 or {len(names)}"
        )
    return paired


def read_readings(
    name: str, scene: Scene, kind: str | None = None, frame: str | None = None
) -> Readings:
    """Read a file of readings, or a bundled one; the kind is recognised if it is not stated."""
    path = find_data(name)
    text, notes = read_table_text(path, MAX_CSV_BYTES)
    readings = parse_readings(text, str(path), scene, kind, frame)
    return replace(readings, notes=(*readings.notes, *notes))


def parse_readings(
    text: str, source: str, scene: Scene, kind: str | None = None, frame: str | None = None
) -> Readings:
    name = "part" if kind is None and is_report(text) else kind
    measurement = None if name is None else find_kind(name)
    if measurement is not None and measurement.reads_text:
        return measurement.read(ReadingTable(source, {}, {}, (), text), scene)
    table = replace(parse_reading_table(text, source), frame=frame)
    is_points = measurement is not None and measurement.name == "points"
    if measurement is None or (is_points and KINDS["positions"].matches(table, scene)):
        measurement = recognise(table, scene)
    readings = measurement.read(table, scene)
    return replace(readings, notes=(*readings.notes, *table.notes))
