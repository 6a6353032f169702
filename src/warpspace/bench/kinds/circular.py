"""Circular test of two linear axes, or of linear axes that follow a rotary one (ISO 230-4)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from warpspace.bench.base import BenchTest, Run
from warpspace.bench.data import DataColumn, Table
from warpspace.bench.evaluation.circle import CircleFit, fit_circle_readings, is_full
from warpspace.bench.options import check_count, option
from warpspace.bench.outcome import Chart, Curve, Outcome, Quantity
from warpspace.bench.paths.following import FollowedCircle, lay_followed
from warpspace.bench.paths.placing import relative_point
from warpspace.bench.paths.planes import PLANES, find_plane, plane_axes
from warpspace.bench.plan import Plan, build_plan
from warpspace.exceptions import OptionError
from warpspace.field.grid import Workspace
from warpspace.kinematics.chain import nominal_point
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import is_linear
from warpspace.scene.model import Scene
from warpspace.units import UM_PER_MM_URAD, Array

DEFAULT_POINTS, MIN_POINTS, MAX_POINTS = 360, 8, 100_000
TURN = 360.0
ALIKE_UM = 1e-6
"""Runs that differ by less are drawn as one."""
SENSES = {1.0: "counter-clockwise", -1.0: "clockwise"}


@dataclass(frozen=True, kw_only=True)
class Circular(BenchTest):
    """Circular test with a ball bar."""

    name: ClassVar[str] = "circular"
    title: ClassVar[str] = "Circular test"
    standard: ClassVar[str] = "ISO 230-4"
    words: ClassVar[str] = (
        "A ball bar reads the distance of the tool from a ball on the table while two axes run a"
        " circle or an arc, counter-clockwise and back. About the least-squares centre, circular"
        " deviation G is the largest minus the smallest radial deviation; an ellipse at 45° is"
        " squareness, one along the axes a difference of their scales, a step where an axis turns"
        " back its reversal. With --rotary the linear axes follow a ball on a rotary axis, and the"
        " bar stands in the radial, tangential or axial direction of its circle; these readings"
        " count as they are."
    )
    columns: ClassVar[tuple[DataColumn, ...]] = (
        DataColumn("direction", "sign", default="+"),
        DataColumn("angle_deg", "number"),
        DataColumn("radial_um"),
    )
    plane: str = option("XY", "choice", "Plane of the circle.", choices=tuple(PLANES))
    radius_mm: float = option(100.0, "number", "Radius of the circle.", unit="mm")
    start_deg: float = option(
        0.0, "number", "Where an arc begins, from the first axis towards the second.", unit="°"
    )
    end_deg: float = option(TURN, "number", "Where it ends; 360 for a full circle.", unit="°")
    points: int = option(DEFAULT_POINTS, "count", "Points of the circle.")
    rotary: str = option("", "axis", "Rotary axis that the linear axes follow instead.")
    bar: str = option(
        "radial", "choice", "Direction of the bar, with --rotary.",
        choices=("radial", "tangential", "axial"),
    )  # fmt: skip

    def plan(self, scene: Scene) -> Plan:
        """Run the circle counter-clockwise, then clockwise."""
        check_count("points", self.points, MIN_POINTS, MAX_POINTS)
        span = self.end_deg - self.start_deg
        if not 0.0 < span <= TURN:
            raise OptionError(
                f"arc from {self.start_deg:g} to {self.end_deg:g}°; expected above 0 and at most"
                " 360°"
            )
        angle = self.start_deg + np.linspace(0.0, span, self.points, endpoint=span < TURN)
        angle, sense = np.concatenate([angle, angle[::-1]]), np.repeat([1.0, -1.0], self.points)
        return self._lay(scene, angle, sense)

    def plan_data(self, scene: Scene, table: Table) -> tuple[Plan, Array]:
        """Run the angles of a file."""
        if len(table) < MIN_POINTS:
            raise table.refuse(f"has {len(table)} readings; expected at least {MIN_POINTS}")
        if np.ptp(table["angle_deg"]) < 1.0:
            raise table.refuse(
                f"all readings are at {table['angle_deg'][0]:g}°; expected angles along an arc"
            )
        return self._lay(scene, table["angle_deg"], table["direction"]), table["radial_um"]

    def _lay(self, scene: Scene, angle_deg: Array, sense: Array) -> Plan:
        """Lay the plan through programmed angles."""
        if self.rotary:
            wanted = FollowedCircle(self.rotary, self.radius_mm, self.bar, self.at)
            return lay_followed(scene, self.model(scene), wanted, angle_deg, sense)
        first, second, _ = plane_axes(scene.machine, self.plane)
        if not 0.0 < self.radius_mm < np.inf:
            raise OptionError(f"radius: {self.radius_mm:g} mm; expected above 0")
        model, stand = self.model(scene), self.stand(scene)
        middle = {name: float(value) for name, value in stand.items()}
        check_circle(scene.workspace, middle, (first, second), self.radius_mm, angle_deg)
        plane = find_plane(model, stand, self.plane)
        theta = np.deg2rad(angle_deg)
        coordinates = {
            **stand,
            first: middle[first] + self.radius_mm * np.cos(theta),
            second: middle[second] + self.radius_mm * np.sin(theta),
        }
        count = len(theta)
        outward = relative_point(model, coordinates) - relative_point(model, stand)
        outward = outward / np.linalg.norm(outward, axis=-1, keepdims=True)
        points = np.broadcast_to(nominal_point(model, Loop.TOOL, coordinates), (count, 3))
        centre = np.broadcast_to(nominal_point(model, Loop.TOOL, stand), (1, 3))
        # A little further on: at a point of reversal an axis is about to move.
        ahead = theta + sense * 1e-6
        return build_plan(
            {name: np.append(np.broadcast_to(values, (count,)), middle[name])
             for name, values in coordinates.items()},
            np.concatenate([points, centre]),
            outward,
            place=f"{self.plane} plane · radius {self.radius_mm:g} mm · centre "
            + ", ".join(f"{name} {value:g}" for name, value in middle.items()),
            marks={
                "angle_deg": angle_deg, "sense": sense,
                "along": outward @ plane.along, "up": outward @ plane.up,
                "radius_mm": np.full(count, self.radius_mm),
                "gain_sign": np.full(count, plane.sign),
            },
            site=np.arange(count), against=np.full(count, count), length_mm=self.radius_mm,
            travel={
                first: np.append(-np.sin(ahead) * sense, 0.0),
                second: np.append(np.cos(ahead) * sense, 0.0),
            },
            setup={
                f"centre_{first}_um": outward @ plane.along,
                f"centre_{second}_um": outward @ plane.up,
                "bar_um": np.ones(count),
            },
            path=(np.arange(count),),
        )  # fmt: skip

    def evaluate(self, plan: Plan, readings: Array) -> Outcome:
        """Take circular deviation, hysteresis, squareness, scales and centre."""
        fit = fit_circle_readings(plan, readings)
        quantities = [
            Quantity("circular_deviation_um", "circular deviation G", fit.deviation_um, "µm")
        ]
        for sense, value in fit.by_sense.items():
            word = SENSES[sense].replace("-", "_")
            quantities.append(
                Quantity(f"circular_deviation_{word}_um", f"G, {SENSES[sense]}", value, "µm")
            )
        if fit.hysteresis_um is not None:
            quantities.append(Quantity("hysteresis_um", "hysteresis H", fit.hysteresis_um, "µm"))
        radius = fit.radius_um
        quantities.append(Quantity("radius_um", "mean radius − nominal", radius, "µm"))
        details: dict[str, object] = {}
        if fit.squareness_urad is not None and not self.rotary:
            first, second, key = PLANES[self.plane]
            quantities += [
                Quantity("squareness_urad", f"squareness {key}", fit.squareness_urad, "µrad"),
                Quantity(
                    "scale_difference_um", f"{first} longer than {second}",
                    fit.scale_difference_um, "µm",
                ),
            ]  # fmt: skip
            details["squareness_key"] = key
        details["centre_um"] = list(fit.centre_um)
        details["angle_deg"] = plan.marks["angle_deg"].tolist()
        details["radial_um"] = fit.radial_um.tolist()
        return Outcome(tuple(quantities), details)

    def charts(self, runs: Sequence[Run]) -> tuple[Chart, ...]:
        """Draw the radial deviation on the nominal circle, both ways round."""
        curves: list[Curve] = []
        for run in runs:
            fit = fit_circle_readings(run.plan, run.readings)
            angle, sense = run.plan.marks["angle_deg"], run.plan.marks["sense"]
            alike = not run.is_measured and (fit.hysteresis_um or 0.0) < ALIKE_UM
            for row, (sign, word) in enumerate(SENSES.items()):
                chosen = sense == sign
                if not chosen.any() or (alike and row):
                    continue
                order = np.argsort(angle[chosen], kind="stable")
                x, y = angle[chosen][order], fit.radial_um[chosen][order]
                if is_full(angle[chosen]) and not run.is_measured:
                    x, y = np.append(x, x[0] + TURN), np.append(y, y[0])
                style = "dots" if run.is_measured else "line"
                curves.append(
                    Curve(run.named("both ways round" if alike else word), x, y, row, style)
                )
        fit = fit_circle_readings(runs[0].plan, runs[0].readings)
        if fit.squareness_urad is not None and not self.rotary:
            curves.append(self._squareness(fit, runs[0].plan))
        return (
            Chart(
                "polar", self._title(), "angle [°]", "deviation [µm]", tuple(curves), (),
                "As read." if self.rotary else "About the least-squares centre.",
            ),
        )  # fmt: skip

    def _title(self) -> str:
        """Say what circle it is."""
        if self.rotary:
            return f"{self.bar} deviation along the circle about {self.rotary}"
        return f"{self.plane} plane, 0° at +{self.plane[0]}, 90° at +{self.plane[1]}"

    def _squareness(self, fit: CircleFit, plan: Plan) -> Curve:
        """Draw what mean radius and squareness alone would give."""
        angle = np.linspace(0.0, TURN, 181)
        sign = float(plan.marks["gain_sign"][0])
        half = sign * (fit.squareness_urad or 0.0) * self.radius_mm * UM_PER_MM_URAD / 2.0
        y = fit.radius_um + half * np.sin(2.0 * np.deg2rad(angle))
        return Curve("mean radius and squareness alone", angle, y, 2, "dashed")


def check_circle(
    workspace: Workspace,
    centre: Mapping[str, float],
    axes: tuple[str, str],
    radius_mm: float,
    angle_deg: Array,
) -> None:
    """Refuse a circle or arc that leaves the working volume.

    Raises
    ------
    OptionError
        With the axes, and the largest radius about this centre.
    """
    problems: list[str] = []
    full = is_full(angle_deg)
    ends = np.deg2rad(angle_deg)
    for name, value in centre.items():
        low, high = workspace.ranges[name]
        if name not in axes:
            if is_linear(name) and not low <= value <= high:
                problems.append(f"{name} = {value:g} lies outside {low:g} … {high:g} mm")
            continue
        reach = (np.cos, np.sin)[axes.index(name)](ends)
        least, most = (-1.0, 1.0) if full else (float(reach.min()), float(reach.max()))
        first, last = value + radius_mm * least, value + radius_mm * most
        if first < low or last > high:
            problems.append(
                f"{name} would run {first:g} … {last:g} mm, the volume has {low:g} … {high:g} mm"
            )
    if problems:
        room = min(
            min(centre[name] - workspace.ranges[name][0], workspace.ranges[name][1] - centre[name])
            for name in axes
        )
        hint = f"; largest radius about this centre: {room:g} mm" if full and room > 0.0 else ""
        raise OptionError(f"the circle leaves the working volume: {'; '.join(problems)}{hint}")
