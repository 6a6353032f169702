"""Positioning of an axis: accuracy, repeatability and reversal (ISO 230-2)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.analysis.blocks import Band, Curve, Lines
from warpspace.analysis.options import Axis, option
from warpspace.bench.base import BenchRun, BenchTest
from warpspace.bench.data import DataColumn, ReadingsFile
from warpspace.bench.linear_form import LinearForm, zone
from warpspace.bench.placing import axis_line, motion_direction, tool_points
from warpspace.bench.plan import BenchPlan, Outcome, build_outcome, build_plan
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.machine.axes import is_linear
from warpspace.scene.model import Scene
from warpspace.units import Array

LEVER_MM = 1000.0  # between the two points that an angle is read at: 1 µm there is 1 µrad
COVERAGE = 2.0  # k of ISO 230-2
FORWARD, BACKWARD = 1.0, -1.0
ALIKE = 1e-6  # means that differ by less, µm or µrad, are drawn as one


@dataclass(frozen=True)
class TargetStatistics:
    """Means and standard deviations at the targets, NaN for a direction without readings."""

    target: Array  # [t], mm or degrees
    mean: Array  # [2, t], µm or µrad; forward and backward
    # [2, t], µm or µrad; estimated standard deviation; 0 for the one run of a model
    deviation: Array


def target_statistics(target: Array, travel_sign: Array, readings: Array) -> TargetStatistics:
    """Compute mean and standard deviation of the readings per target and direction."""
    targets, index = np.unique(np.round(target, 6), return_inverse=True)
    mean, deviation = np.empty((2, 2, len(targets)))
    for row, sign in enumerate((FORWARD, BACKWARD)):
        chosen = travel_sign == sign
        at, values = index.reshape(-1)[chosen], readings[chosen]
        count = np.bincount(at, minlength=len(targets))
        is_measured = count > 0
        mean[row] = np.bincount(at, values, len(targets)) / np.where(is_measured, count, np.nan)
        squares = np.bincount(at, (values - mean[row, at]) ** 2, len(targets))
        free = np.where(is_measured, np.maximum(count - 1, 1), np.nan)
        deviation[row] = np.sqrt(squares / free)
    return TargetStatistics(targets, mean, deviation)


@dataclass(frozen=True, kw_only=True)
class Positioning(BenchTest):
    """Positioning of one axis, both directions."""

    name = "positioning"
    title = "Positioning accuracy"
    standard = "ISO 230-2"
    description = (
        "One axis runs to targets along its range, upwards and back; a laser interferometer, a"
        " rotary encoder or an autocollimator reads the position of the tool relative to the"
        " workpiece. Means and ±2s bands of both directions give accuracy A, systematic deviation"
        " E, mean deviation M, repeatability R and reversal B. The readings include the angular"
        " errors on the lever arm to the measuring line."
    )
    columns = (
        DataColumn("run", "number"),
        DataColumn("direction", "sign"),
        DataColumn("target_mm", "number"),
        DataColumn("deviation_um"),
    )
    axis: Axis = option("", "Axis that runs", unset="the first one")
    targets: int = option(11, "Targets along the range", low=2, high=1_000)
    start: float | None = option(None, "First target, mm or degrees; the range's end")
    end: float | None = option(None, "Last target, mm or degrees; the range's other end")

    def selected_axis(self, scene: Scene) -> str:
        axes = scene.machine.axes
        if self.axis and self.axis not in axes:
            raise UnknownNameError("axis", self.axis, axes)
        return self.axis or next(iter(axes))

    def data_columns(self, scene: Scene) -> tuple[DataColumn, ...]:
        if is_linear(self.selected_axis(scene)):
            return self.columns
        return (*self.columns[:2], DataColumn("target_deg", "number"), DataColumn("deviation_urad"))

    def plan(self, scene: Scene) -> BenchPlan:
        axis = self.selected_axis(scene)
        low, high = scene.axis_span(axis)
        low = low if self.start is None else self.start
        high = high if self.end is None else self.end
        if not low < high:
            raise OptionError(f"targets from {low:g} to {high:g}; expected start below end")
        targets = np.linspace(low, high, self.targets)
        travel_sign = np.repeat([FORWARD, BACKWARD], self.targets)
        return self._lay(
            scene, np.concatenate([targets, targets[::-1]]), travel_sign, np.ones(len(travel_sign))
        )

    def plan_data(self, scene: Scene, table: ReadingsFile) -> tuple[BenchPlan, Array]:
        linear = is_linear(self.selected_axis(scene))
        target = table["target_mm" if linear else "target_deg"]
        readings = table["deviation_um" if linear else "deviation_urad"]
        unit = "mm" if linear else "°"
        problems: list[str] = []
        targets, index = np.unique(np.round(target, 6), return_inverse=True)
        if len(targets) < 2:
            problems.append(f"has {len(targets)} target; expected at least 2 (ISO 230-2 takes 5)")
        for sign, word in ((FORWARD, "+"), (BACKWARD, "-")):
            chosen = table["direction"] == sign
            if not chosen.any():
                continue
            counts = np.bincount(index.reshape(-1)[chosen], minlength=len(targets))
            problems += [
                f"target {targets[number]:g} {unit}, direction {word}: {counts[number]} readings;"
                " expected at least 2 runs (ISO 230-2 takes 5)"
                for number in np.flatnonzero(counts < 2)
            ]
        if problems:
            raise table.refuse(*problems)
        return self._lay(scene, target, table["direction"], table["run"]), readings

    def _lay(self, scene: Scene, target: Array, travel_sign: Array, run: Array) -> BenchPlan:
        axis, model = self.selected_axis(scene), self.model(scene)
        coordinates = {**self.axis_positions(scene), axis: target}
        marks = {"target": target, "travel_sign": travel_sign, "run": run}
        place = f"{axis} · {self.place_text(scene, [axis])}"
        zero = {"zero_um" if is_linear(axis) else "zero_urad": np.ones(len(target))}
        count = len(target)
        if is_linear(axis):
            point = tool_points(model, coordinates, count)
            direction = motion_direction(model, coordinates, axis)
            return build_plan(
                coordinates, point, direction, place=place, marks=marks,
                travel={axis: travel_sign}, setup=zero,
            )  # fmt: skip
        line = axis_line(model, coordinates, axis)
        sign = line.sign * scene.machine.axes[axis].direction
        origin = np.broadcast_to(line.origin_mm, (count, 3))
        twice = {
            name: np.tile(np.broadcast_to(values, (count,)), 2)
            for name, values in coordinates.items()
        }
        sites = np.arange(count)
        return build_plan(
            twice, np.concatenate([origin, origin + LEVER_MM * line.across]),
            sign * np.broadcast_to(line.upright, (count, 3)), place=place, marks=marks,
            site=sites + count, against=sites, gain=1000.0 / LEVER_MM,
            travel={axis: np.tile(travel_sign, 2)}, setup=zero, path=(sites,),
        )  # fmt: skip

    def evaluate(self, plan: BenchPlan, readings: Array) -> Outcome:
        statistics = target_statistics(plan.marks["target"], plan.marks["travel_sign"], readings)
        unit = "µm" if "zero_um" in plan.setup else "µrad"
        suffix = "um" if unit == "µm" else "urad"
        rows = [(f"{key}_{suffix}", name, size) for key, name, size in _numbers(statistics)]
        return build_outcome(rows, {"targets": _target_rows(statistics, unit)})

    def linear_forms(self, plan: BenchPlan, readings: Array) -> Mapping[str, LinearForm]:
        return {"E_um" if "zero_um" in plan.setup else "E_urad": zone(readings)}

    def charts(self, runs: Sequence[BenchRun]) -> tuple[Lines, ...]:
        curves: list[Curve] = []
        bands: list[Band] = []
        note = ""
        plan = runs[0].plan
        linear = "zero_um" in plan.setup
        unit = "µm" if linear else "µrad"
        for run in runs:
            shift = 0.0
            if not run.is_measured and len(runs) > 1:  # the zero of an instrument is arbitrary
                shift = float(runs[-1].readings.mean() - run.readings.mean())
                note = f"Model shifted by {shift:+.2f} {unit}: the zero of the readings is free."
            marks = run.plan.marks
            statistics = target_statistics(
                marks["target"], marks["travel_sign"], run.readings + shift
            )
            alike = not run.is_measured and np.ptp(statistics.mean, axis=0).max() < ALIKE
            for row, word in enumerate(("forward", "backward")):
                if alike and row:
                    continue
                is_finite = np.isfinite(statistics.mean[row])
                if not is_finite.any():
                    continue
                x, mean = statistics.target[is_finite], statistics.mean[row, is_finite]
                curves.append(run.curve("both directions" if alike else word, x, mean, row))
                spread = COVERAGE * statistics.deviation[row, is_finite]
                if run.is_measured:
                    bands.append(Band(f"{word} ±2s", x, mean - spread, mean + spread, row))
        axis = plan.place.partition(" ")[0]
        x_label, y_label = f"{axis} [{'mm' if linear else '°'}]", f"deviation [{unit}]"
        labels = f"Positioning of {axis}", x_label, y_label
        return (Lines("lines", *labels, tuple(curves), tuple(bands), note),)


def _numbers(statistics: TargetStatistics) -> list[tuple[str, str, float]]:
    mean, spread = statistics.mean, COVERAGE * statistics.deviation
    is_bidirectional = not np.isnan(mean).any()
    reversal = mean[0] - mean[1]
    upper, lower = mean + spread, mean - spread
    repeat = 2.0 * spread
    at_target = np.maximum(spread.sum(axis=0) + np.abs(reversal), repeat.max(axis=0))
    rows: list[tuple[str, str, float]] = []
    if is_bidirectional:
        rows += [
            ("A", "bidirectional accuracy A", float(upper.max() - lower.min())),
            ("E", "bidirectional systematic deviation E", float(np.ptp(mean))),
            ("M", "mean bidirectional deviation M", float(np.ptp(mean.mean(axis=0)))),
            ("R", "bidirectional repeatability R", float(at_target.max())),
            ("B", "reversal B", float(np.abs(reversal).max())),
            ("B_mean", "mean reversal", float(reversal.mean())),
        ]
    for row, word in enumerate(("forward", "backward")):
        if np.isnan(mean[row]).any():
            continue
        rows += [
            (f"A_{word}", f"accuracy A, {word}", float(upper[row].max() - lower[row].min())),
            (f"E_{word}", f"systematic deviation E, {word}", float(np.ptp(mean[row]))),
            (f"R_{word}", f"repeatability R, {word}", float(repeat[row].max())),
        ]
    return rows


def _target_rows(statistics: TargetStatistics, unit: str) -> list[dict[str, float]]:
    suffix = "um" if unit == "µm" else "urad"
    place = "target_mm" if unit == "µm" else "target_deg"
    rows: list[dict[str, float]] = []
    for index, target in enumerate(statistics.target):
        row = {place: float(target)}
        for row_index, word in enumerate(("forward", "backward")):
            if np.isfinite(statistics.mean[row_index, index]):
                row[f"mean_{word}_{suffix}"] = float(statistics.mean[row_index, index])
                row[f"s_{word}_{suffix}"] = float(statistics.deviation[row_index, index])
        if np.isfinite(statistics.mean[:, index]).all():
            row[f"reversal_{suffix}"] = float(statistics.mean[0, index] - statistics.mean[1, index])
        rows.append(row)
    return rows
