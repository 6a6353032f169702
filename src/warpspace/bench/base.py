"""Base classes of standard tests: options, path, evaluation by the standard, figure."""

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, ClassVar

import numpy as np

from warpspace.analysis.blocks import Block, Column, Curve, Lines, Table
from warpspace.analysis.description import Analysis, ProgressCallback, Result
from warpspace.analysis.options import File, Option, Place, option, options_of
from warpspace.analysis.sampling.distribution import round_width
from warpspace.analysis.uncertainty.propagation import plus_minus, scene_uncertainty
from warpspace.bench.data import DataColumn, ReadingsFile, read_table, unit_notes
from warpspace.bench.linear_form import LinearForm
from warpspace.bench.plan import BenchPlan, Outcome, fit_setup, respond, simulate
from warpspace.kinematics.model import Loop, Model, complete_coordinates
from warpspace.plugins import Registry, load_plugins
from warpspace.scene.model import Scene
from warpspace.units import Array

PRINTED = 5e-4  # numbers below it are printed as zero
SHARED = 3  # options that every test has, the first fields of the base class


@dataclass(frozen=True, slots=True)
class BenchRun:
    """Readings of a test and their evaluation."""

    source: str  # "model" or "measured"
    plan: BenchPlan
    readings: Array  # [m], µm or µrad
    outcome: Outcome

    @property
    def is_measured(self) -> bool:
        return self.source == "measured"

    @property
    def values(self) -> dict[str, float]:
        return {quantity.key: quantity.value for quantity in self.outcome.quantities}

    def label(self, name: str) -> str:
        """Return the legend entry of a curve; measured curves are marked."""
        return f"{name}, measured" if self.is_measured else name

    def curve(
        self, name: str, x: Array, y: Array, colour: int = 0, *, once_round: bool = False
    ) -> Curve:
        """Build a curve of a chart: dots for measured readings, a closed line for a full turn."""
        if once_round and not self.is_measured:
            x, y = np.append(x, x[0] + 360.0), np.append(y, y[0])
        return Curve(self.label(name), x, y, colour, "dots" if self.is_measured else "line")


@dataclass(frozen=True, kw_only=True)
class BenchTest(Analysis):
    """A standard test. A subclass is a kind of test, its fields are its options."""

    task = "measure"
    has_chart = True
    chart_help = "figure of the test"
    title: ClassVar[str]
    standard: ClassVar[str]  # source of its formulas
    description: ClassVar[str]  # procedure and evaluated quantities, a few sentences
    columns: ClassVar[tuple[DataColumn, ...]]  # of a file of readings
    at: Place = option(
        (),
        "Positions of the axes that the test does not move",
        unset="those of the scene",
    )
    tool_extension_mm: float = option(
        0.0, "Length of the tool or probe beyond that of the scene", unit="mm", low=-1e4, high=1e4
    )
    data: File = option(None, "Measured readings, CSV with the columns above")

    @classmethod
    def options(cls) -> tuple[Option, ...]:
        """List the options of the test before those that all tests share."""
        options = options_of(cls)
        return (*options[SHARED:], *options[:SHARED])

    @classmethod
    def settings(cls) -> tuple[Option, ...]:
        return tuple(option_ for option_ in cls.options() if option_.name != "data")

    @classmethod
    def explained(cls) -> str:
        columns = ",".join(column.name for column in cls.columns)
        title = f"{cls.title} on SCENE ({cls.standard})."
        return f"{title}\n\n{cls.description}\n\nColumns of --data: {columns}."

    def warnings(self, scene: Scene) -> tuple[str, ...]:  # noqa: ARG002
        """Return no warnings: a path beyond the travel is refused."""
        return ()

    def run(self, scene: Scene, _watch: ProgressCallback, /) -> "BenchResult":
        return run_test(scene, self, self.data)

    @abstractmethod
    def plan(self, scene: Scene) -> BenchPlan:
        """Build the path of the test on the machine of a scene.

        Raises
        ------
        OptionError, UnknownNameError
            If the machine cannot run the test.
        """

    @abstractmethod
    def plan_data(self, scene: Scene, table: ReadingsFile) -> tuple[BenchPlan, Array]:
        """Build the path of measured readings and return the readings in its order, [m].

        Raises
        ------
        SceneError
            If readings are missing; the message states what was expected.
        """

    @abstractmethod
    def evaluate(self, plan: BenchPlan, readings: Array) -> Outcome:
        """Evaluate readings, [m], µm or µrad, by the formulas of the standard."""

    def linear_forms(self, plan: BenchPlan, readings: Array) -> Mapping[str, LinearForm]:  # noqa: ARG002 - for subclasses
        """Build the forms of quantities that are linear in the readings, the usual one first.

        Readings of one run are [m], or responses, [m, V]. 2σ or an RMS have no form.
        """
        return {}

    @abstractmethod
    def charts(self, runs: Sequence[BenchRun]) -> tuple[Lines, ...]:
        """Build the customary figure of the runs, the model first."""

    def data_columns(self, scene: Scene) -> tuple[DataColumn, ...]:  # noqa: ARG002 - for subclasses
        """Return the columns of a file of readings."""
        return self.columns

    def data_notes(self, table: ReadingsFile) -> tuple[str, ...]:  # noqa: ARG002 - for subclasses
        """List the differences between a file of readings and the options of the test."""
        return ()

    def axis_positions(self, scene: Scene) -> dict[str, Array]:
        """Return the positions of all axes before the test starts, scalars, mm or degrees."""
        positions = scene.workspace.positions
        return complete_coordinates(scene.machine, {**positions, **dict(self.at)}, positions)

    def model(self, scene: Scene) -> Model:
        if not self.tool_extension_mm:
            return scene.model
        x, y, z = scene.model.tool_point_mm
        return replace(scene.model, tool_point_mm=(x, y, z - self.tool_extension_mm))

    def place_text(self, scene: Scene, moving: Sequence[str]) -> str:
        stand = self.axis_positions(scene)
        still = [f"{name} {float(stand[name]):g}" for name in stand if name not in moving]
        tool = f"tool {self.tool_extension_mm:+g} mm" if self.tool_extension_mm else ""
        return " · ".join(part for part in (", ".join(still), tool) if part)


@dataclass(frozen=True)
class BenchResult(Result):
    """Result of a test: the model, and measured readings if there are any."""

    drawn_by: ClassVar[str] = "warpspace.outputs.charts.result_charts:bench_chart"
    test: BenchTest
    scene: Scene
    runs: tuple[BenchRun, ...]  # the model, then the measured readings
    notes: tuple[str, ...] = ()  # caveats about the readings

    @property
    def model(self) -> BenchRun:
        return self.runs[0]

    @property
    def measured(self) -> BenchRun | None:
        return self.runs[1] if len(self.runs) > 1 else None

    @property
    def rms_difference(self) -> float | None:
        """RMS of measured − model after the set-up is fitted, µm or µrad."""
        if self.measured is None:
            return None
        difference = self.measured.readings - self.model.readings
        return float(np.sqrt(np.mean(fit_setup(self.model.plan, difference)[1] ** 2)))

    @cached_property
    def u95(self) -> dict[str, float | None]:
        """U95 of the quantities of the model by key; empty if the scene states no uncertainty."""
        run, uncertainty = self.model, scene_uncertainty(self.scene, Loop.RELATIVE)
        if uncertainty is None:
            return {}
        layers = [(replace(self.scene, errors=part), keys) for part, keys in uncertainty.layers]
        gains = np.hstack([respond(scene, run.plan, keys) for scene, keys in layers])

        def evaluate_change(change: Array) -> Array:
            outcome = self.test.evaluate(run.plan, run.readings + gains @ change)
            return np.array([quantity.value for quantity in outcome.quantities])

        return dict(zip(run.values, uncertainty.propagate(evaluate_change), strict=True))

    @property
    def charts(self) -> tuple[Lines, ...]:
        return self.test.charts(self.runs)

    def caveats(self) -> tuple[str, ...]:
        return self.notes

    def as_json(self) -> dict[str, Any]:
        """Return the quantities of the measured readings, or of the model if there are none."""
        run = self.measured or self.model
        u95 = {f"u95_{key}": value for key, value in self.u95.items()}
        document: dict[str, Any] = {
            "test": self.test.name,
            "scene": self.scene.name,
            "of": run.source,
            "place": run.plan.place,
            **run.values,
            **({} if run.is_measured else u95),
            **run.outcome.details,
        }
        if self.measured is not None:
            document["model"] = {**self.model.values, **u95}
            document["rms_difference"] = self.rms_difference
        return document | {"notes": list(self.notes)}

    def blocks(self) -> Iterator[Block]:
        yield f"{self.test.title} ({self.test.standard}) · {self.scene.title}"
        yield f"  {self.model.plan.place} · {self.model.plan.readings} readings"
        rows: dict[str, list[Any]] = {}
        for index, run in enumerate(self.runs, start=1):
            for quantity in run.outcome.quantities:
                empty = [quantity.name, *[None] * len(self.runs), quantity.unit]
                value = 0.0 if abs(quantity.value) < PRINTED else quantity.value
                rows.setdefault(quantity.key, empty)[index] = value
        numbers = (Column(run.source, ".3f") for run in self.runs)
        columns = (Column("", leads=True, wraps=True), *numbers, Column("unit"))
        if self.u95:
            columns = (*columns, Column("U95 of the model"))
            rows = {key: [*row, plus_minus(self.u95[key], ".3f")] for key, row in rows.items()}
        yield Table(columns, list(rows.values()))
        yield from self.charts


def run_test(
    scene: Scene,
    test: BenchTest,
    data: str | Path | ReadingsFile | None = None,
    *,
    exact: bool = True,
) -> BenchResult:
    """Run a test on the model of a scene and evaluate measured readings by the same formulas.

    Parameters
    ----------
    scene : Scene
    test : BenchTest
    data : str, Path or Table, optional
        CSV file with the columns of the test, or its content. The model then runs through the
        same poses.
    exact : bool, optional
        The exact chain; else the first order.

    Returns
    -------
    BenchResult

    Raises
    ------
    OptionError, UnknownNameError
        If the machine cannot run the test.
    SceneError
        If the file cannot be read.

    Examples
    --------
    >>> import warpspace
    >>> from warpspace.bench.kinds.rotary_axis import RTest
    >>> scene = warpspace.load_scene("dvf5000_first")
    >>> result = warpspace.run_test(scene, RTest(axis="C", ball=(100.0, 0.0, 60.0)))
    >>> round(result.model.outcome["z_um"], 1)
    21.5
    """
    if data is None:
        plan = test.plan(scene)
        return BenchResult(
            test, scene, (_run("model", test, plan, simulate(scene, plan, exact=exact)),)
        )
    table = data
    if not isinstance(table, ReadingsFile):
        table = read_table(table, test.data_columns(scene))
    plan, measured = test.plan_data(scene, table)
    readings = simulate(scene, plan, exact=exact)
    angular = any(name.endswith("_urad") for name in table.columns)
    notes = unit_notes(measured, readings, "µrad" if angular else "µm")
    runs = _run("model", test, plan, readings), _run("measured", test, plan, measured)
    return BenchResult(test, scene, runs, (*table.notes, *test.data_notes(table), *notes))


def _run(source: str, test: BenchTest, plan: BenchPlan, readings: Array) -> BenchRun:
    return BenchRun(source, plan, readings, test.evaluate(plan, readings))


BASE = 0.62  # radius of the circle of no deviation; the plot reaches to 1
RINGS = 2  # rings of round deviations on either side of it
RING_WIDTH = 0.36  # width that these take on either side
SMALLEST_DEVIATION = 1e-3  # a nanometre: charts draw smaller deviations, µm or µrad, as zero


@dataclass(frozen=True, slots=True)
class PolarLayout:
    """A polar chart: 0° to the right, counter-clockwise."""

    ring: float  # µm or µrad; deviation from one ring to the next
    unit: str
    # deviation and radius of every ring, outwards; zero is the circle of no deviation
    rings: tuple[tuple[float, float], ...]
    curves: tuple[Array, ...]  # [n, 2]; in the order of the chart's


def lay_polar(chart: Lines) -> PolarLayout:
    largest = max((float(np.abs(curve.y).max()) for curve in chart.curves), default=0.0)
    ring = round_width(largest / RINGS * (1.0 - 1e-6)) if largest > SMALLEST_DEVIATION else 1.0
    per_unit = RING_WIDTH / (RINGS * ring)
    curves: list[Array] = []
    for curve in chart.curves:
        x, y = np.cos(np.deg2rad(curve.x)), np.sin(np.deg2rad(curve.x))
        curves.append((BASE + per_unit * curve.y)[:, None] * np.stack([x, y], axis=-1))
    unit = "µrad" if "µrad" in chart.y_label else "µm"
    rings = tuple((step * ring, BASE + per_unit * step * ring) for step in range(-RINGS, RINGS + 1))
    return PolarLayout(ring, unit, rings, tuple(curves))


_KINDS = "warpspace.bench.kinds"
_TESTS: Registry[type[BenchTest] | str] = Registry(
    "test",
    {
        "positioning": f"{_KINDS}.positioning:Positioning",
        "circular": f"{_KINDS}.circular:Circular",
        "diagonals": f"{_KINDS}.diagonals:Diagonals",
        "straightness": f"{_KINDS}.straightness:Straightness",
        "squareness": f"{_KINDS}.straightness:Squareness",
        "rotary-axis": f"{_KINDS}.rotary_axis:RotaryAxis",
        "r-test": f"{_KINDS}.rotary_axis:RTest",
        "ball-plate": f"{_KINDS}.ball_plate:BallPlate",
        "cone-frustum": f"{_KINDS}.cone_frustum:ConeFrustum",
    },
)
register_test, unregister_test = _TESTS.register, _TESTS.unregister


def bench_names() -> tuple[str, ...]:
    load_plugins()
    return tuple(_TESTS)


def find_test(name: str) -> type[BenchTest]:
    test = _TESTS.find(name)
    return resolve_name(test) if isinstance(test, str) else test
