"""Squareness of two linear axes by three reference lines (ISO 230-1)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from warpspace.bench.base import BenchTest, Run
from warpspace.bench.data import DataColumn, Table
from warpspace.bench.evaluation.lines import REFERENCES, WORDS, ReferenceLine, reference_lines
from warpspace.bench.kinds.straightness import check_across, line_plan, mean_by_position
from warpspace.bench.options import check_count, option
from warpspace.bench.outcome import Chart, Curve, Outcome, Quantity
from warpspace.bench.paths.planes import PLANES, Plane, find_plane, plane_axes
from warpspace.bench.plan import Plan
from warpspace.scene.model import Scene
from warpspace.units import Array


@dataclass(frozen=True, kw_only=True)
class Squareness(BenchTest):
    """Squareness of two axes with a square or two straightness runs."""

    name: ClassVar[str] = "squareness"
    title: ClassVar[str] = "Squareness"
    standard: ClassVar[str] = "ISO 230-1"
    words: ClassVar[str] = (
        "A probe runs along both arms of a square (or a laser along two lines made square by a"
        " pentaprism): each axis moves, the deviation across it is read. The angle between the"
        " reference lines of both is the squareness error, in the sign of EC0Y, EB0Z or EA0Z:"
        " positive where the second axis is turned by the right-hand rule against the first."
        " End-point,"
        " least-squares and minimum-zone lines may differ. The square itself is taken as perfect."
    )
    columns: ClassVar[tuple[DataColumn, ...]] = (
        DataColumn("line", "name"),
        DataColumn("direction", "sign", default="+"),
        DataColumn("position_mm", "number"),
        DataColumn("deviation_um"),
    )
    plane: str = option("XY", "choice", "Plane of the two axes.", choices=tuple(PLANES))
    points: int = option(21, "count", "Positions along each axis.")

    def plan(self, scene: Scene) -> Plan:
        """Run the first axis there and back, then the second."""
        check_count("--points", self.points, 3, 2_000)
        axes = plane_axes(scene.machine, self.plane)[:2]
        positions = [np.linspace(*scene.axis_span(axis), self.points) for axis in axes]
        return self._lay(
            scene,
            np.repeat([0.0, 1.0], 2 * self.points),
            np.concatenate([part for one in positions for part in (one, one[::-1])]),
            np.tile(np.repeat([1.0, -1.0], self.points), 2),
        )

    def plan_data(self, scene: Scene, table: Table) -> tuple[Plan, Array]:
        """Run the positions of a file; ``line`` names the axis."""
        axes = plane_axes(scene.machine, self.plane)[:2]
        problems = [
            f"line {int(line)}, line: {word!r}; expected {axes[0]} or {axes[1]} (--plane"
            f" {self.plane})"
            for line, word in zip(table.lines, table.words["line"], strict=True)
            if word not in axes
        ]
        which = np.array([float(word == axes[1]) for word in table.words["line"]])
        for index, axis in enumerate(axes):
            count = len(np.unique(np.round(table["position_mm"][which == index], 6)))
            if count < 3 and not problems:
                problems.append(f"line {axis} has {count} positions; expected at least 3")
        if problems:
            raise table.refuse(*problems)
        order = np.argsort(which, kind="stable")
        plan = self._lay(
            scene, which[order], table["position_mm"][order], table["direction"][order]
        )
        return plan, table["deviation_um"][order]

    def _lay(self, scene: Scene, which: Array, position: Array, way: Array) -> Plan:
        """Join the plans of both lines; `which` is 0 for all of the first, then 1."""
        plane = find_plane(self.model(scene), self.stand(scene), self.plane)
        parts: list[Plan] = []
        for index, axis in enumerate((plane.first, plane.second)):
            check_across(self, scene, axis)
            chosen = which == index
            across = (plane.up, plane.along)[index]
            parts.append(line_plan(self, scene, axis, across, position[chosen], way[chosen]))
        return _join(parts[0], parts[1], plane)

    def evaluate(self, plan: Plan, readings: Array) -> Outcome:
        """Take the angle between the reference lines of both axes."""
        key, sign = PLANES[self.plane][2], float(plan.marks["gain_sign"][0])
        lines = _lines(plan, readings)
        quantities: list[Quantity] = []
        for name in REFERENCES:
            angle = sign * (lines[0][name].slope + lines[1][name].slope)
            quantities.append(
                Quantity(f"{name}_urad", f"squareness {key}, {WORDS[name]}", angle, "µrad")
            )
        for index, axis in enumerate(self.plane):
            height = lines[index]["least_squares"].deviation_um
            quantities.append(
                Quantity(f"straightness_{axis}_um", f"straightness of {axis}", height, "µm")
            )
        return Outcome(tuple(quantities), {"squareness_key": key})

    def charts(self, runs: Sequence[Run]) -> tuple[Chart, ...]:
        """Draw the deviations along both axes with their least-squares lines."""
        charts: list[Chart] = []
        for index, axis in enumerate(self.plane):
            curves: list[Curve] = []
            for run in runs:
                chosen = run.plan.marks["line"] == index
                position, mean = mean_by_position(
                    run.plan.marks["along_mm"][chosen], run.readings[chosen]
                )
                level = mean.mean()
                style = "dots" if run.is_measured else "line"
                curves.append(Curve(run.named("deviation"), position, mean - level, 0, style))
                if run is runs[-1]:
                    lines = reference_lines(position, mean)
                    curves += [
                        Curve(
                            WORDS[name],
                            position,
                            lines[name].at(position) - level,
                            1 + row,
                            "dashed",
                        )
                        for row, name in enumerate(REFERENCES)
                    ]
            other = self.plane[1 - index]
            charts.append(
                Chart(
                    "lines", f"{axis} runs, deviation along {other}", f"along {axis} [mm]",
                    "deviation [µm]", tuple(curves),
                )
            )  # fmt: skip
        return tuple(charts)


def _lines(plan: Plan, readings: Array) -> list[dict[str, ReferenceLine]]:
    """Lay the reference lines of both axes."""
    found: list[dict[str, ReferenceLine]] = []
    for index in (0.0, 1.0):
        chosen = plan.marks["line"] == index
        position, mean = mean_by_position(plan.marks["along_mm"][chosen], readings[chosen])
        found.append(reference_lines(position, mean))
    return found


def _join(first: Plan, second: Plan, plane: Plane) -> Plan:
    """Put two plans one behind the other; the square may be turned, and each line has its zero."""
    n, m = first.readings, second.readings
    one, two = np.repeat([1.0, 0.0], [n, m]), np.repeat([0.0, 1.0], [n, m])
    along = np.concatenate([first.marks["along_mm"], second.marks["along_mm"]])
    travel = {
        name: np.concatenate(
            [plan.travel.get(name, np.zeros(plan.readings)) for plan in (first, second)]
        )
        for name in (*first.travel, *second.travel)
    }
    return Plan(
        {
            name: np.concatenate([first.coordinates[name], second.coordinates[name]])
            for name in first.coordinates
        },
        np.concatenate([first.point_mm, second.point_mm]),
        travel,
        np.arange(n + m),
        np.concatenate([first.direction, second.direction]),
        np.full(n + m, -1),
        np.ones(n + m),
        np.full(n + m, np.inf),
        {
            "position_mm": np.concatenate(
                [first.marks["position_mm"], second.marks["position_mm"]]
            ),
            "along_mm": along,
            "gain_sign": np.full(n + m, plane.sign),
            "way": np.concatenate([first.marks["way"], second.marks["way"]]),
            "line": two,
        },
        {
            f"zero_{plane.first}_um": one,
            f"zero_{plane.second}_um": two,
            "turned_urad": (one - two) * along * 1e-3,
        },
        f"{plane.first}{plane.second} · {first.place}",
        (np.arange(n), np.arange(n, n + m)),
    )
