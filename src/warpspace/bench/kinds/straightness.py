"""Straightness of an axis, and squareness of two, by three reference lines (ISO 230-1)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from warpspace.analysis.blocks import Curve, Lines
from warpspace.analysis.options import Axis, option
from warpspace.bench import placing
from warpspace.bench.base import BenchRun, BenchTest
from warpspace.bench.data import ALONG, DataColumn, ReadingsFile
from warpspace.bench.linear_form import LinearForm, absolute, project_out, zone
from warpspace.bench.plan import BenchPlan, Outcome, build_outcome, build_plan
from warpspace.exceptions import OptionError
from warpspace.kinematics.conversion import fit_line
from warpspace.machine.axes import direction_index
from warpspace.scene.model import Scene
from warpspace.units import Array

REFERENCES = {  # ISO 230-1, 3.4.10 to 3.4.12
    "end_points": "end-point line",
    "least_squares": "least-squares line",
    "minimum_zone": "minimum-zone line",
}


@dataclass(frozen=True, slots=True)
class FittedLine:
    """A straight line through deviations."""

    slope: float  # µrad; µm per mm, times a thousand
    offset: float  # µm; at position zero
    deviation_um: float  # largest minus smallest distance from the line

    def at(self, position_mm: Array) -> Array:
        return self.offset + self.slope * 1e-3 * position_mm


def fit_lines(position_mm: Array, readings_um: Array) -> tuple[Array, Array, dict[str, FittedLine]]:
    """Compute the mean reading at each position, [p] twice, and its three reference lines."""
    x, mean = mean_by(position_mm, readings_um)
    lines: dict[str, FittedLine] = {}
    for name in REFERENCES:
        offset, slope = fit_line(x, mean, name.replace("points", "point"))
        lines[name] = FittedLine(slope * 1e3, offset, float(np.ptp(mean - slope * x)))
    return x, mean, lines


def mean_by(position: Array, readings: Array) -> tuple[Array, Array]:
    """Compute the mean readings, [p, ...], at each position; both ascend."""
    x, index, count = np.unique(np.round(position, 6), return_inverse=True, return_counts=True)
    total = np.zeros((len(x), *readings.shape[1:]))
    np.add.at(total, index.reshape(-1), readings)
    return x, (total.T / count).T


def line_forms(position_mm: Array, readings: Array) -> dict[str, LinearForm]:
    """Build the forms of the deviation from each reference line."""
    x, mean = mean_by(position_mm, readings)
    return {
        "end_points": zone(mean - np.multiply.outer(x, end_slope(x, mean))),
        "least_squares": zone(project_out(mean, np.ones(len(x)), x)),
        "minimum_zone": zone(mean, x),
    }


def end_slope(x: Array, mean: Array) -> Array:
    return (mean[-1] - mean[0]) / (x[-1] - x[0])


def build_line_plan(
    test: BenchTest,
    scene: Scene,
    lines: Mapping[str, Array],
    line_index: Array,
    position: Array,
    travel_sign: Array,
    unknowns: Sequence[str],
) -> BenchPlan:
    """Build the plan of axes that run along straight edges, a probe sensing across them.

    `lines` are axes with the sensed direction, [3] in R; each site has the index of its line, its
    position along it and the sign of travel. The zero of each line and the orientation of the
    edges are unknowns of the set-up, named by `unknowns`.
    """
    model, stand = test.model(scene), test.axis_positions(scene)
    coordinates, travel = dict(stand), dict[str, Array]()
    along, across = np.zeros(len(position)), np.zeros((len(position), 3))
    for number, (axis, direction) in enumerate(lines.items()):
        forth = placing.motion_direction(model, stand, axis)
        if np.sort(np.abs(forth))[-2] > 1e-6:
            direction_text = ", ".join(f"{value:.3f}" for value in np.abs(forth))
            raise OptionError(
                f"{axis} runs along ({direction_text}) in this pose; expected x, y or z"
            )
        on_line = line_index == number
        coordinates[axis] = np.where(on_line, position, stand[axis])
        travel[axis] = np.where(on_line, travel_sign, 0.0)
        along[on_line], across[on_line] = position[on_line], direction
    zeros = [(line_index == number).astype(float) for number in range(len(lines))]
    first = next(iter(lines))
    return build_plan(
        coordinates,
        placing.tool_points(model, coordinates, len(position)),
        across,
        place=f"{first} · {test.place_text(scene, [first])}",
        marks={"position_mm": position, "along_mm": along, "travel_sign": travel_sign},
        travel=travel,
        setup=dict(zip(unknowns, (*zeros, (1.0 - 2.0 * line_index) * along * 1e-3), strict=True)),
        path=tuple(np.flatnonzero(zero) for zero in zeros),
    )


@dataclass(frozen=True, kw_only=True)
class Straightness(BenchTest):
    """Straightness of one axis in one direction."""

    name = "straightness"
    title = "Straightness"
    standard = "ISO 230-1"
    description = (
        "A probe on the tool runs along a straight edge, or a laser with a straightness optic is"
        " used: the axis moves, the deviation across it is read. Straightness is the height of the"
        " deviations about the line through the end points, the least-squares line, and the two"
        " parallel lines of least distance (minimum zone). The orientation of the edge is fitted:"
        " squareness errors do not count."
    )
    columns = ALONG
    axis: Axis = option("", "Linear axis that runs", unset="the first one")
    across: Literal["x", "y", "z"] | None = option(None, "Sensed direction", unset="the next one")
    points: int = option(21, "Positions along the axis", low=3, high=2_000)

    def directions(self, scene: Scene) -> tuple[str, int]:
        axis = placing.find_axis(scene.machine, self.axis, "linear")
        along = direction_index(axis)
        if self.across and "xyz".index(self.across) == along:
            raise OptionError(
                f"{{across}} {self.across} is the direction of {axis}; expected one across it"
            )
        return axis, "xyz".index(self.across) if self.across else (along + 1) % 3

    def plan(self, scene: Scene) -> BenchPlan:
        position = np.linspace(*scene.axis_span(self.directions(scene)[0]), self.points)
        there_and_back = np.concatenate([position, position[::-1]])
        return self._lay(scene, there_and_back, np.repeat([1.0, -1.0], self.points))

    def plan_data(self, scene: Scene, table: ReadingsFile) -> tuple[BenchPlan, Array]:
        places = len(np.unique(np.round(table["position_mm"], 6)))
        if places < 3:
            raise table.refuse(f"has {places} positions; expected at least 3")
        return self._lay(scene, table["position_mm"], table["direction"]), table["deviation_um"]

    def _lay(self, scene: Scene, position: Array, travel_sign: Array) -> BenchPlan:
        axis, across = self.directions(scene)
        sensed, stand = "XYZ"[across], self.axis_positions(scene)
        direction = np.eye(3)[across]
        if sensed in scene.machine.axes:
            direction = placing.programmed_direction(scene.model, stand, sensed)
        lines, line_index = {axis: direction}, np.zeros(len(position))
        return build_line_plan(
            self, scene, lines, line_index, position, travel_sign, ("zero_um", "tilt_urad")
        )

    def evaluate(self, plan: BenchPlan, readings: Array) -> Outcome:
        position, mean, lines = fit_lines(plan.marks["along_mm"], readings)
        details = {
            "slope_urad": {name: line.slope for name, line in lines.items()},
            "position_mm": position.tolist(),
            "deviation_um": mean.tolist(),
        }
        rows = [
            (f"{name}_um", f"straightness, {REFERENCES[name]}", line.deviation_um)
            for name, line in lines.items()
        ]
        return build_outcome(rows, details)

    def linear_forms(self, plan: BenchPlan, readings: Array) -> Mapping[str, LinearForm]:
        forms = line_forms(plan.marks["along_mm"], readings)
        return {f"{name}_um": form for name, form in forms.items()}

    def charts(self, runs: Sequence[BenchRun]) -> tuple[Lines, ...]:
        curves: list[Curve] = []
        for run in runs:
            position, mean, lines = fit_lines(run.plan.marks["along_mm"], run.readings)
            level = lines["least_squares"].at(position)
            curves.append(run.curve("deviation", position, mean - level))
            if run is runs[-1]:
                curves += _lines_drawn(lines, ("end_points", "minimum_zone"), position, level)
        axis = runs[0].plan.place.partition(" ")[0]
        across = "xyz"[int(np.argmax(np.abs(runs[0].plan.direction[0])))]
        labels = f"Straightness of {axis} in {across}", f"along {axis} [mm]", "deviation [µm]"
        return (Lines("lines", *labels, tuple(curves), note="About the least-squares line."),)


def _lines_drawn(
    lines: Mapping[str, FittedLine], names: Sequence[str], position: Array, level: Array | float
) -> list[Curve]:
    return [
        Curve(REFERENCES[name], position, lines[name].at(position) - level, colour, "dashed")
        for colour, name in enumerate(names, start=1)
    ]


@dataclass(frozen=True, kw_only=True)
class Squareness(BenchTest):
    """Squareness of two axes with a square or two straightness runs."""

    name = "squareness"
    title = "Squareness"
    standard = "ISO 230-1"
    description = (
        "A probe runs along both arms of a square (or a laser along two lines made square by a"
        " pentaprism): each axis moves, the deviation across it is read. The angle between the"
        " reference lines of both is the squareness error, in the sign of EC0Y, EB0Z or EA0Z:"
        " positive where the second axis is turned by the right-hand rule against the first."
        " End-point, least-squares and minimum-zone lines may differ. The square itself is assumed"
        " to be perfect."
    )
    columns = (DataColumn("line", "name"), *ALONG)
    plane: Literal["XY", "XZ", "YZ"] = option("XY", "Plane of the two axes")
    points: int = option(21, "Positions along each axis", low=3, high=2_000)

    def plan(self, scene: Scene) -> BenchPlan:
        axes = placing.plane_axes(scene.machine, self.plane)
        positions = [np.linspace(*scene.axis_span(axis), self.points) for axis in axes]
        return self._lay(
            scene,
            np.repeat([0.0, 1.0], 2 * self.points),
            np.concatenate([part for stretch in positions for part in (stretch, stretch[::-1])]),
            np.tile(np.repeat([1.0, -1.0], self.points), 2),
        )

    def plan_data(self, scene: Scene, table: ReadingsFile) -> tuple[BenchPlan, Array]:
        axes = placing.plane_axes(scene.machine, self.plane)
        expected = f"{axes[0]} or {axes[1]} ({{plane}} {self.plane})"
        problems = table.unknown_labels("line", axes, expected)
        line_index = np.array([float(word == axes[1]) for word in table.labels["line"]])
        for index, axis in enumerate(axes):
            count = len(np.unique(np.round(table["position_mm"][line_index == index], 6)))
            if count < 3 and not problems:
                problems.append(f"line {axis} has {count} positions; expected at least 3")
        if problems:
            raise table.refuse(*problems)
        order = np.argsort(line_index, kind="stable")
        plan = self._lay(
            scene, line_index[order], table["position_mm"][order], table["direction"][order]
        )
        return plan, table["deviation_um"][order]

    def _lay(
        self, scene: Scene, line_index: Array, position: Array, travel_sign: Array
    ) -> BenchPlan:
        plane = placing.find_plane(self.model(scene), self.axis_positions(scene), self.plane)
        directions = plane.second_direction, plane.first_direction
        lines = dict(zip(self.plane, directions, strict=True))
        unknowns = (*(f"zero_{axis}_um" for axis in lines), "turned_urad")
        plan = build_line_plan(self, scene, lines, line_index, position, travel_sign, unknowns)
        signs = np.full(len(line_index), plane.sign)
        marks = {**plan.marks, "gain_sign": signs, "line": line_index}
        place = f"{self.plane} · {plan.place}"
        return replace(plan, place=place, marks=marks, squareness_key=plane.key)

    def evaluate(self, plan: BenchPlan, readings: Array) -> Outcome:
        key, sign = plan.squareness_key, float(plan.marks["gain_sign"][0])
        first, second = (lines for _, _, lines in _arms(plan, readings))
        rows: list[tuple[str, str, float]] = []
        for name, line_text in REFERENCES.items():
            angle = sign * (first[name].slope + second[name].slope)
            rows.append((f"{name}_urad", f"squareness {key}, {line_text}", angle))
        for axis, lines in zip(self.plane, (first, second), strict=True):
            height = lines["least_squares"].deviation_um
            rows.append((f"straightness_{axis}_um", f"straightness of {axis}", height))
        return build_outcome(rows, {"squareness_key": key})

    def linear_forms(self, plan: BenchPlan, readings: Array) -> Mapping[str, LinearForm]:
        end_points, least_squares = [], []
        heights: dict[str, LinearForm] = {}
        for index, axis in enumerate(self.plane):
            arm = plan.marks["line"] == index
            position, deviation = plan.marks["along_mm"][arm], readings[arm]
            x, mean = mean_by(position, deviation)
            away = x - x.mean()
            end_points.append(1e3 * end_slope(x, mean))
            least_squares.append(1e3 * np.tensordot(away, mean, 1) / (away @ away))
            heights[f"straightness_{axis}_um"] = line_forms(position, deviation)["least_squares"]
        slopes = {"least_squares_urad": least_squares, "end_points_urad": end_points}
        angles = {key: absolute(np.add(*each)[None]) for key, each in slopes.items()}
        return {**angles, **heights}

    def charts(self, runs: Sequence[BenchRun]) -> tuple[Lines, ...]:
        charts: list[Lines] = []
        for index, axis in enumerate(self.plane):
            curves: list[Curve] = []
            for run in runs:
                position, mean, lines = _arms(run.plan, run.readings)[index]
                level = mean.mean()
                curves.append(run.curve("deviation", position, mean - level))
                if run is runs[-1]:
                    curves += _lines_drawn(lines, tuple(REFERENCES), position, level)
            title = f"{axis} runs, deviation along {self.plane[1 - index]}"
            labels = title, f"along {axis} [mm]", "deviation [µm]"
            charts.append(Lines("lines", *labels, tuple(curves)))
        return tuple(charts)


def _arms(plan: BenchPlan, readings: Array) -> list[tuple[Array, Array, dict[str, FittedLine]]]:
    arms = [plan.marks["line"] == index for index in (0.0, 1.0)]
    return [fit_lines(plan.marks["along_mm"][arm], readings[arm]) for arm in arms]
