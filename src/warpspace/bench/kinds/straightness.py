"""Straightness of the motion of an axis against three reference lines (ISO 230-1)."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from warpspace.analysis.blocks import Curve, Lines
from warpspace.analysis.options import option
from warpspace.analysis.typed import Axis
from warpspace.bench.base import BenchTest, Run
from warpspace.bench.data import DataColumn, Table
from warpspace.bench.placing import axis_vector, linear_axis, motion_direction, tool_points
from warpspace.bench.plan import Outcome, Plan, Quantity, build_plan
from warpspace.exceptions import OptionError
from warpspace.scene.model import Scene
from warpspace.units import Array

# --- Reference lines of straightness and squareness -----------------------------------------------
# End points, least squares, minimum zone.

REFERENCES = ("end_points", "least_squares", "minimum_zone")
"""ISO 230-1, 3.4.10 to 3.4.12."""
WORDS = {
    "end_points": "end-point line",
    "least_squares": "least-squares line",
    "minimum_zone": "minimum-zone line",
}


@dataclass(frozen=True, slots=True)
class ReferenceLine:
    """A straight line through deviations."""

    name: str  # one of `REFERENCES`
    slope: float  # µrad; µm per mm, times a thousand
    offset: float  # µm; at position zero
    deviation_um: float  # largest minus smallest distance from the line

    def at(self, position_mm: Array) -> Array:
        """Give the line at positions, [n], µm."""
        return self.offset + self.slope * 1e-3 * position_mm


def reference_lines(position_mm: Array, deviation_um: Array) -> dict[str, ReferenceLine]:
    """Lay the three reference lines through deviations, [n], µm, at two positions or more.

    Notes
    -----
    The minimum zone is the one of smallest height: two parallel lines that hold all points, one of
    which lies on an edge of their convex hull.
    """
    order = np.argsort(position_mm, kind="stable")
    x, y = position_mm[order], deviation_um[order]
    middle = x.mean()
    spread = x - middle
    slopes = {
        "end_points": (y[-1] - y[0]) / (x[-1] - x[0]),
        "least_squares": float(spread @ (y - y.mean()) / (spread @ spread)),
        "minimum_zone": _narrowest(x, y),
    }
    found: dict[str, ReferenceLine] = {}
    for name, slope in slopes.items():
        rest = y - slope * x
        low, high = float(rest.min()), float(rest.max())
        offset = {
            "end_points": float(rest[0]),
            "least_squares": float(y.mean() - slope * middle),
            "minimum_zone": (low + high) / 2.0,
        }[name]
        found[name] = ReferenceLine(name, float(slope) * 1e3, offset, high - low)
    return found


def _narrowest(x: Array, y: Array) -> float:
    edges = sorted({*_hull_slopes(x, y), *_hull_slopes(x, -y, -1.0)})

    def height(number: int) -> float:
        return float(np.ptp(y - edges[number] * x))

    low, high = 0, len(edges) - 1  # the height is a convex function of the slope
    while low < high:
        middle = (low + high) // 2
        if height(middle) <= height(middle + 1):
            high = middle
        else:
            low = middle + 1
    return edges[low]


def _hull_slopes(x: Array, y: Array, sign: float = 1.0) -> list[float]:
    hull: list[tuple[float, float]] = []
    for px, py in zip(x.tolist(), y.tolist(), strict=True):
        if hull and hull[-1][0] == px:
            if hull[-1][1] <= py:
                continue
            hull.pop()
        while len(hull) > 1:
            (ax, ay), (bx, by) = hull[-2:]
            if (by - ay) * (px - ax) < (py - ay) * (bx - ax):
                break
            hull.pop()
        hull.append((px, py))
    return [sign * (by - ay) / (bx - ax) for (ax, ay), (bx, by) in pairwise(hull)]


def line_plan(
    test: BenchTest, scene: Scene, axis: str, across: Array, position: Array, way: Array
) -> Plan:
    """Lay the plan of an axis along a straight edge that a probe senses across, [3] in R.

    The way is the direction of travel at each position, +1 or −1.
    """
    model = test.model(scene)
    coordinates = {**test.stand(scene), axis: position}
    count = len(position)
    point = tool_points(model, coordinates, count)
    stand = test.stand(scene)
    forth = motion_direction(model, stand, axis) @ axis_vector(model, stand, axis)
    along = float(np.sign(forth)) * position
    return build_plan(
        coordinates,
        point,
        across,
        place=f"{axis} · {test.place_words(scene, [axis])}",
        marks={"position_mm": position, "along_mm": along, "way": way},
        travel={axis: way},
        setup={"zero_um": np.ones(count), "tilt_urad": along * 1e-3},
    )


def mean_by_position(position: Array, readings: Array) -> tuple[Array, Array]:
    """Take the mean of all readings at each position, [p] twice."""
    places, index = np.unique(np.round(position, 6), return_inverse=True)
    weights = np.bincount(index.reshape(-1), readings)
    return places, weights / np.bincount(index.reshape(-1))


@dataclass(frozen=True, kw_only=True)
class Straightness(BenchTest):
    """Straightness of one axis in one direction."""

    name = "straightness"
    title = "Straightness"
    standard = "ISO 230-1"
    words = (
        "A probe on the tool runs along a straight edge, or a laser with a straightness optic is"
        " used: the axis moves, the deviation across it is read. Straightness is the height of the"
        " deviations about the line through the end points, the least-squares line, and the two"
        " parallel lines of least distance (minimum zone). How the edge lies is no error: a"
        " squareness error does not count."
    )
    columns = (
        DataColumn("direction", "sign", default="+"),
        DataColumn("position_mm", "number"),
        DataColumn("deviation_um"),
    )
    axis: Axis = option("", "Linear axis that runs", unset="the first one")
    across: Literal["x", "y", "z"] | None = option(
        None, "Direction that is sensed", unset="the next one"
    )
    points: int = option(21, "Positions along the axis", low=3, high=2_000)

    def directions(self, scene: Scene) -> tuple[str, int]:
        """Give the axis that runs, and which of x, y, z is sensed."""
        axis = linear_axis(scene.machine, self.axis)
        vector = axis_vector(scene.model, self.stand(scene), axis)
        own = int(np.argmax(np.abs(vector)))
        if self.across and "xyz".index(self.across) == own:
            raise OptionError(
                f"{{across}} {self.across} is the direction of {axis}; expected one across it"
            )
        return axis, "xyz".index(self.across) if self.across else (own + 1) % 3

    def plan(self, scene: Scene) -> Plan:
        """Run the axis there and back."""
        axis, _ = self.directions(scene)
        position = np.linspace(*scene.axis_span(axis), self.points)
        return self._lay(
            scene,
            np.concatenate([position, position[::-1]]),
            np.repeat([1.0, -1.0], self.points),
        )

    def plan_data(self, scene: Scene, table: Table) -> tuple[Plan, Array]:
        """Run the positions of a file."""
        places = len(np.unique(np.round(table["position_mm"], 6)))
        if places < 3:
            raise table.refuse(f"has {places} positions; expected at least 3")
        return self._lay(scene, table["position_mm"], table["direction"]), table["deviation_um"]

    def _lay(self, scene: Scene, position: Array, way: Array) -> Plan:
        axis, across = self.directions(scene)
        check_across(self, scene, axis)
        return line_plan(self, scene, axis, np.eye(3)[across], position, way)

    def evaluate(self, plan: Plan, readings: Array) -> Outcome:
        """Take straightness against the three reference lines."""
        position, mean = mean_by_position(plan.marks["along_mm"], readings)
        found = reference_lines(position, mean)
        quantities = [
            Quantity(f"{name}_um", f"straightness, {WORDS[name]}", line.deviation_um, "µm")
            for name, line in found.items()
        ]
        slopes = {name: line.slope for name, line in found.items()}
        details = {
            "slope_urad": slopes,
            "position_mm": position.tolist(),
            "deviation_um": mean.tolist(),
        }
        return Outcome(tuple(quantities), details)

    def charts(self, runs: Sequence[Run]) -> tuple[Lines, ...]:
        """Draw the deviations about the least-squares line, with the other two lines."""
        curves: list[Curve] = []
        for run in runs:
            position, mean = mean_by_position(run.plan.marks["along_mm"], run.readings)
            lines = reference_lines(position, mean)
            level = lines["least_squares"].at(position)
            curves.append(run.curve("deviation", position, mean - level))
            if run is runs[-1]:
                for colour, name in ((1, "end_points"), (2, "minimum_zone")):
                    y = lines[name].at(position) - level
                    curves.append(Curve(WORDS[name], position, y, colour, "dashed"))
        axis = runs[0].plan.place.partition(" ")[0]
        across = "xyz"[int(np.argmax(np.abs(runs[0].plan.direction[0])))]
        return (
            Lines(
                "lines", f"Straightness of {axis} in {across}", f"along {axis} [mm]",
                "deviation [µm]",
                tuple(curves), (), "About the least-squares line.",
            ),
        )  # fmt: skip


def check_across(test: BenchTest, scene: Scene, axis: str) -> None:
    """Refuse an axis that does not run along x, y or z in R where it stands."""
    way = np.abs(np.asarray(motion_direction(test.model(scene), test.stand(scene), axis)))
    if np.sort(way)[-2] > 1e-6:
        spelled = ", ".join(f"{value:.3f}" for value in way)
        raise OptionError(
            f"{axis} runs along ({spelled}) where the machine stands; expected x, y or z"
        )
