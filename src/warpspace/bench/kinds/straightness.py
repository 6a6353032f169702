"""Straightness of the motion of an axis against three reference lines (ISO 230-1)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from warpspace.bench.base import BenchTest, Run
from warpspace.bench.data import DataColumn, Table
from warpspace.bench.evaluation.lines import WORDS, reference_lines
from warpspace.bench.options import check_count, option
from warpspace.bench.outcome import Chart, Curve, Outcome, Quantity
from warpspace.bench.paths.placing import linear_axis, motion_direction
from warpspace.bench.paths.planes import axis_vector
from warpspace.bench.plan import Plan, build_plan
from warpspace.exceptions import OptionError
from warpspace.kinematics.chain import nominal_point
from warpspace.kinematics.model import Loop
from warpspace.scene.model import Scene
from warpspace.units import Array


def line_plan(
    test: BenchTest, scene: Scene, axis: str, across: Array, position: Array, way: Array
) -> Plan:
    """Lay the plan of an axis along a straight edge that a probe senses across.

    Parameters
    ----------
    test : BenchTest
    scene : Scene
    axis : str
    across : ndarray, [3]
        Direction in R that is sensed.
    position : ndarray, [m], mm
    way : ndarray, [m]
        +1 or −1: direction of travel.
    """
    model = test.model(scene)
    coordinates = {**test.stand(scene), axis: position}
    count = len(position)
    point = np.broadcast_to(nominal_point(model, Loop.TOOL, coordinates), (count, 3))
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

    name: ClassVar[str] = "straightness"
    title: ClassVar[str] = "Straightness"
    standard: ClassVar[str] = "ISO 230-1"
    words: ClassVar[str] = (
        "A probe on the tool runs along a straight edge, or a laser with a straightness optic is"
        " used: the axis moves, the deviation across it is read. Straightness is the height of the"
        " deviations about the line through the end points, the least-squares line, and the two"
        " parallel lines of least distance (minimum zone). How the edge lies is no error: a"
        " squareness"
        " error does not count."
    )
    columns: ClassVar[tuple[DataColumn, ...]] = (
        DataColumn("direction", "sign", default="+"),
        DataColumn("position_mm", "number"),
        DataColumn("deviation_um"),
    )
    axis: str = option("", "axis", "Linear axis that runs; the first one by default.")
    across: str | None = option(
        None,
        "choice",
        "Direction that is sensed; the next one by default.",
        choices=("x", "y", "z"),
    )
    points: int = option(21, "count", "Positions along the axis.")

    def directions(self, scene: Scene) -> tuple[str, int]:
        """Give the axis that runs, and which of x, y, z is sensed."""
        axis = linear_axis(scene.machine, self.axis)
        vector = axis_vector(scene.model, self.stand(scene), axis)
        own = int(np.argmax(np.abs(vector)))
        if self.across and "xyz".index(self.across) == own:
            raise OptionError(
                f"--across {self.across} is the direction of {axis}; expected one across it"
            )
        return axis, "xyz".index(self.across) if self.across else (own + 1) % 3

    def plan(self, scene: Scene) -> Plan:
        """Run the axis there and back."""
        check_count("--points", self.points, 3, 2_000)
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
        """Lay the plan through positions."""
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

    def charts(self, runs: Sequence[Run]) -> tuple[Chart, ...]:
        """Draw the deviations about the least-squares line, with the other two lines."""
        curves: list[Curve] = []
        for run in runs:
            position, mean = mean_by_position(run.plan.marks["along_mm"], run.readings)
            lines = reference_lines(position, mean)
            level = lines["least_squares"].at(position)
            style = "dots" if run.is_measured else "line"
            curves.append(Curve(run.named("deviation"), position, mean - level, 0, style))
            if run is runs[-1]:
                for colour, name in ((1, "end_points"), (2, "minimum_zone")):
                    y = lines[name].at(position) - level
                    curves.append(Curve(WORDS[name], position, y, colour, "dashed"))
        axis = runs[0].plan.place.partition(" ")[0]
        across = "xyz"[int(np.argmax(np.abs(runs[0].plan.direction[0])))]
        return (
            Chart(
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
