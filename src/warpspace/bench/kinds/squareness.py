"""Squareness of two linear axes by three reference lines (ISO 230-1)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from warpspace.analysis.blocks import Curve, Lines
from warpspace.analysis.options import option
from warpspace.bench.base import BenchTest, Run
from warpspace.bench.data import DataColumn, Table
from warpspace.bench.kinds.straightness import (
    REFERENCES,
    WORDS,
    ReferenceLine,
    check_across,
    line_plan,
    mean_by_position,
    reference_lines,
)
from warpspace.bench.placing import PLANES, Plane, find_plane, plane_axes
from warpspace.bench.plan import Outcome, Plan, Quantity, build_plan
from warpspace.scene.model import Scene
from warpspace.units import Array


@dataclass(frozen=True, kw_only=True)
class Squareness(BenchTest):
    """Squareness of two axes with a square or two straightness runs."""

    name = "squareness"
    title = "Squareness"
    standard = "ISO 230-1"
    words = (
        "A probe runs along both arms of a square (or a laser along two lines made square by a"
        " pentaprism): each axis moves, the deviation across it is read. The angle between the"
        " reference lines of both is the squareness error, in the sign of EC0Y, EB0Z or EA0Z:"
        " positive where the second axis is turned by the right-hand rule against the first."
        " End-point, least-squares and minimum-zone lines may differ. The square itself is taken"
        " as perfect."
    )
    columns = (
        DataColumn("line", "name"),
        DataColumn("direction", "sign", default="+"),
        DataColumn("position_mm", "number"),
        DataColumn("deviation_um"),
    )
    plane: Literal["XY", "XZ", "YZ"] = option("XY", "Plane of the two axes")
    points: int = option(21, "Positions along each axis", low=3, high=2_000)

    def plan(self, scene: Scene) -> Plan:
        """Run the first axis there and back, then the second."""
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

    def charts(self, runs: Sequence[Run]) -> tuple[Lines, ...]:
        """Draw the deviations along both axes with their least-squares lines."""
        charts: list[Lines] = []
        for index, axis in enumerate(self.plane):
            curves: list[Curve] = []
            for run in runs:
                chosen = run.plan.marks["line"] == index
                position, mean = mean_by_position(
                    run.plan.marks["along_mm"][chosen], run.readings[chosen]
                )
                level = mean.mean()
                curves.append(run.curve("deviation", position, mean - level))
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
                Lines(
                    "lines", f"{axis} runs, deviation along {other}", f"along {axis} [mm]",
                    "deviation [µm]", tuple(curves),
                )
            )  # fmt: skip
        return tuple(charts)


def _lines(plan: Plan, readings: Array) -> list[dict[str, ReferenceLine]]:
    found: list[dict[str, ReferenceLine]] = []
    for index in (0.0, 1.0):
        chosen = plan.marks["line"] == index
        position, mean = mean_by_position(plan.marks["along_mm"][chosen], readings[chosen])
        found.append(reference_lines(position, mean))
    return found


def _join(first: Plan, second: Plan, plane: Plane) -> Plan:
    n, m = first.readings, second.readings
    one, two = np.repeat([1.0, 0.0], [n, m]), np.repeat([0.0, 1.0], [n, m])

    def joined(name: str) -> dict[str, Array]:
        parts = [getattr(first, name), getattr(second, name)]
        none = [np.zeros(n), np.zeros(m)]
        return {
            key: np.concatenate(
                [part.get(key, zero) for part, zero in zip(parts, none, strict=True)]
            )
            for key in {**parts[0], **parts[1]}
        }

    marks = joined("marks")
    return build_plan(
        joined("coordinates"),
        np.concatenate([first.point_mm, second.point_mm]),
        np.concatenate([first.direction, second.direction]),
        place=f"{plane.first}{plane.second} · {first.place}",
        marks={**marks, "gain_sign": np.full(n + m, plane.sign), "line": two},
        travel=joined("travel"),
        setup={
            f"zero_{plane.first}_um": one,
            f"zero_{plane.second}_um": two,
            "turned_urad": (one - two) * marks["along_mm"] * 1e-3,
        },
        path=(np.arange(n), np.arange(n, n + m)),
    )
