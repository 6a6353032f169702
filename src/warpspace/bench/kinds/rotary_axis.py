"""Tests of a rotary axis: error motions (ISO 230-7) and the R-test (ISO 10791-6)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from warpspace.analysis.blocks import Curve, Lines
from warpspace.analysis.options import Axis, Vector, option
from warpspace.bench import placing
from warpspace.bench.base import BenchRun, BenchTest
from warpspace.bench.data import ANGLE, XYZ, DataColumn, ReadingsFile
from warpspace.bench.kinds.circular import is_full
from warpspace.bench.linear_form import LinearForm, absolute, zone
from warpspace.bench.plan import BenchPlan, Outcome, build_outcome, build_plan, fit_setup
from warpspace.exceptions import OptionError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.relative_motion import relative_point
from warpspace.scene.model import Scene
from warpspace.units import Array

LEVER_MM = 1000.0  # between the places where the axis is sensed: 1 µm there is 1 µrad
TURNS = {"x": "A", "y": "B", "z": "C"}
CHANNELS = ("x_um", "y_um", "z_um", "a_urad", "b_urad", "c_urad")
"""Across, across, along the axis; about the same three: E_XC, E_YC, E_ZC, E_AC, E_BC, E_CC of C."""


@dataclass(frozen=True, kw_only=True)
class RotaryAxis(BenchTest):
    """Error motions of a rotary table, a swivelling head or a spindle."""

    name = "rotary-axis"
    title = "Error motions of a rotary axis"
    standard = "ISO 230-7"
    description = (
        "Sensors at two heights read an artefact on the axis while it turns: two radial, two"
        " tilt, one axial deviation, and the angular one against an encoder; the linear axes"
        " stand. Radial and tilt error motion are taken towards a point that turns with the axis,"
        " about the least-squares centre; axial and angular about their means. The mean of the"
        " readings over a full turn is the axis average line: location and orientation of the axis"
        " at the place of the test."
    )
    columns = (ANGLE, *map(DataColumn, CHANNELS[:5]), DataColumn("c_urad", default=0.0))
    axis: Axis = option("", "Rotary axis that turns", unset="the last one")
    height_mm: float | None = option(
        None,
        "Height of the sensors along the axis above its origin",
        unit="mm",
        unset="that of the middle of the working volume",
    )
    points: int = option(72, "Positions along the turn", low=8, high=3_600)

    def plan(self, scene: Scene) -> BenchPlan:
        axis = placing.find_axis(scene.machine, self.axis, "rotary")
        low, high = scene.machine.axes[axis].travel
        full = high - low >= 360.0
        end = low + 360.0 if full else high
        return self._lay(scene, np.linspace(low, end, self.points, endpoint=not full))

    def plan_data(self, scene: Scene, table: ReadingsFile) -> tuple[BenchPlan, Array]:
        table.check_angles(8, "turn")
        readings = np.concatenate([table[name] for name in CHANNELS])
        return self._lay(scene, table["angle_deg"]), readings

    def _lay(self, scene: Scene, angle_deg: Array) -> BenchPlan:
        axis, model = placing.find_axis(scene.machine, self.axis, "rotary"), self.model(scene)
        stand = self.axis_positions(scene)
        line = placing.axis_line(model, stand, axis)
        height = self.height_mm
        if height is None:
            tool = transforms.apply(
                branch_pose(model, "workpiece", stand), relative_point(model, stand)
            )
            height = float((tool - line.origin_mm) @ line.direction)
        count = len(angle_deg)
        base = np.broadcast_to(line.origin_mm + height * line.direction, (count, 3))
        points = [base, base + LEVER_MM * line.direction, base + LEVER_MM * line.across]
        sites = np.arange(count)
        across, upright, along = line.across, line.upright, line.direction
        # A turn about `across` moves the upper point along −upright, one about `upright` along
        # +across; a turn about the axis moves the outer point along +upright.
        sensed = (
            (0, None, across), (0, None, upright), (0, None, along),
            (1, 0, -upright), (1, 0, across), (2, 0, upright),
        )  # fmt: skip
        theta = np.deg2rad(angle_deg)
        return build_plan(
            {
                name: np.tile(np.broadcast_to(values, (count,)), 3)
                for name, values in {**stand, axis: angle_deg}.items()
            },
            np.concatenate(points),
            np.concatenate(
                [np.broadcast_to(line.sign * direction, (count, 3)) for _, _, direction in sensed]
            ),
            place=f"{axis} · sensors {height:g} mm above its origin · "
            + self.place_text(scene, [axis]),
            marks={
                "angle_deg": np.tile(angle_deg, 6),
                "channel": np.repeat(np.arange(6.0), count),
                "direction": np.full(6 * count, float(scene.machine.axes[axis].direction)),
            },
            site=np.concatenate([sites + count * at for at, _, _ in sensed]),
            against=np.concatenate(
                [np.full(count, -1) if zero is None else sites for _, zero, _ in sensed]
            ),
            gain=np.repeat([1.0, 1.0, 1.0, *[1000.0 / LEVER_MM] * 3], count),
            travel={axis: np.tile(np.sign(np.gradient(angle_deg)), 3)},
            setup=_eccentricity(theta),
            path=(sites,),
        )  # fmt: skip

    def evaluate(self, plan: BenchPlan, readings: Array) -> Outcome:
        angle_deg, motions, average_line = error_motions(plan, readings)
        axis = plan.place.partition(" ")[0]
        rows: list[tuple[str, str, float]] = [
            ("radial_um", "radial error motion", np.ptp(motions["radial"])),
            ("axial_um", "axial error motion", np.ptp(motions["axial"])),
            ("tilt_urad", "tilt error motion", np.ptp(motions["tilt"])),
            ("angular_urad", "angular positioning", np.ptp(motions["angular"])),
        ]
        for (key, unit, text), value in zip(_line_parts(axis), average_line, strict=True):
            rows.append((f"{key}_{unit}", f"{text} ({key})", float(value)))
        details = {f"{name}_motion": values.tolist() for name, values in motions.items()}
        return build_outcome(rows, {"angle_deg": angle_deg.tolist(), **details})

    def linear_forms(self, plan: BenchPlan, readings: Array) -> Mapping[str, LinearForm]:
        _, motions, average_line = error_motions(plan, readings)
        units = {"radial": "um", "axial": "um", "tilt": "urad", "angular": "urad"}
        forms = {f"{name}_{unit}": zone(motions[name]) for name, unit in units.items()}
        parts = _line_parts(plan.place.partition(" ")[0])
        for (key, unit, _), value in zip(parts, average_line, strict=True):
            forms[f"{key}_{unit}"] = absolute(np.asarray(value)[None])
        return forms

    def charts(self, runs: Sequence[BenchRun]) -> tuple[Lines, ...]:
        axis = runs[0].plan.place.partition(" ")[0]
        charts: list[Lines] = []
        for name, unit in (
            ("radial", "µm"),
            ("tilt", "µrad"),
            ("axial", "µm"),
            ("angular", "µrad"),
        ):
            curves: list[Curve] = []
            for run in runs:
                x, motions, _ = error_motions(run.plan, run.readings)
                full = is_full(x)
                curves.append(run.curve(f"{name} error motion", x, motions[name], once_round=full))
            labels = f"{axis}: {name}", f"{axis} [°]", f"deviation [{unit}]"
            charts.append(Lines("polar", *labels, tuple(curves)))
        return tuple(charts)


def _line_parts(axis: str) -> list[tuple[str, str, str]]:
    across = {"A": "yz", "B": "zx", "C": "xy"}[axis[0]]
    parts = [(f"E{x.upper()}0{axis}", "um", f"location in {x}") for x in across]
    return parts + [(f"E{TURNS[x]}0{axis}", "urad", f"orientation about {x}") for x in across]


def error_motions(plan: BenchPlan, readings: Array) -> tuple[Array, dict[str, Array], list[Array]]:
    """Compute error motions, [n, ...], µm and µrad, from the readings of six channels, [6 n, ...].

    Positions, [n], ascend. Radial and tilt are taken towards a point that turns with the axis
    (rotating sensitive direction), about the least-squares centre; axial and angular about their
    means, the angular one NaN where it was not measured. Last, the axis average line: location in
    µm along the two directions across the axis, orientation in µrad about them.
    """
    channels = readings.reshape(6, len(readings) // 6, *readings.shape[1:])
    angle_deg = plan.marks["angle_deg"][: channels.shape[1]]
    order = np.argsort(angle_deg, kind="stable")
    channels, angle_deg = channels[:, order], angle_deg[order]
    theta = np.deg2rad(angle_deg) * plan.marks["direction"][0]
    once = np.stack([np.ones_like(theta), np.cos(theta), np.sin(theta)], -1)
    _, cosine, sine = once.T.reshape(3, -1, *[1] * (readings.ndim - 1))
    x, y, z, a, b, c = channels

    def once_round(values: Array) -> Array:
        return np.asarray(np.linalg.lstsq(once, values, rcond=None)[0], dtype=float)

    def about_centre(values: Array) -> Array:
        return values - once @ once_round(values)

    # The axis leans towards +across by a turn about upright, towards +upright by one about −across.
    leaning = b * cosine - a * sine
    motions = {
        "radial": about_centre(x * cosine + y * sine),
        "axial": z - z.mean(axis=0),
        "tilt": about_centre(leaning),
        "angular": c - c.mean(axis=0),
    }
    # means over the turn without the once-per-turn part of an eccentric artefact
    return angle_deg, motions, [once_round(values)[0] for values in (x, y, a, b)]


def _eccentricity(theta: Array) -> dict[str, Array]:
    zero, ones = np.zeros_like(theta), np.ones_like(theta)
    cosine, sine = np.cos(theta), np.sin(theta)
    return {
        "eccentric_x_um": np.concatenate([cosine, sine, zero, zero, zero, zero]),
        "eccentric_y_um": np.concatenate([-sine, cosine, zero, zero, zero, zero]),
        "leaning_x_urad": np.concatenate([zero, zero, zero, cosine, sine, zero]),
        "leaning_y_urad": np.concatenate([zero, zero, zero, -sine, cosine, zero]),
        "height_um": np.concatenate([zero, zero, ones, zero, zero, zero]),
        "zero_urad": np.concatenate([zero, zero, zero, zero, zero, ones]),
    }


@dataclass(frozen=True, kw_only=True)
class RTest(BenchTest):
    """R-test with the controller's compensation of the tool centre point on."""

    name = "r-test"
    title = "R-test with a ball"
    standard = "ISO 10791-6, tests AK, BK, CK"
    description = (
        "A ball stands on the table, three sensors on the tool (or the other way round) read its"
        " position along x, y and z. A rotary axis turns; the linear axes follow, so that"
        " nominally the tool stays on the ball. Readings are tool minus ball, in R or, in the"
        " workpiece frame, in directions that turn with the table. The range of each is the"
        " quantity of the standard; the ranges after the ball's position is fitted (it is not"
        " known accurately) are reported too."
    )
    columns = (ANGLE, *XYZ)
    axis: Axis = option("", "Rotary axis that turns", unset="the last one")
    ball: Vector = option(
        None,
        "Centre of the ball in the workpiece frame",
        unit="mm",
        unset="one that can be reached",
    )
    start: float | None = option(
        None, "First position of the axis", unset="as far as the others can follow", unit="°"
    )
    end: float | None = option(None, "Last position", unset="likewise", unit="°")
    points: int = option(73, "Positions along the path", low=4, high=3_600)
    frame: Literal["machine", "workpiece"] = option("machine", "Directions of the readings")

    def plan(self, scene: Scene) -> BenchPlan:
        axis, ball = self._set_up(scene)
        low, high = scene.machine.axes[axis].travel
        stand = self.axis_positions(scene)
        present = float(np.clip(stand[axis], low, high))
        if high - low > 360.0:
            low = max(low, min(present - 180.0, high - 360.0))
            high = low + 360.0
        if self.start is not None or self.end is not None:
            low = low if self.start is None else self.start
            high = high if self.end is None else self.end
            if not low < high:
                raise OptionError(f"{axis} from {low:g} to {high:g}°; expected start below end")
            return self._lay(scene, np.linspace(low, high, self.points))
        fine = np.unique(np.append(np.linspace(low, high, 721), present))
        path = placing.follow(self.model(scene), {**stand, axis: fine}, ball)
        inside = placing.within_travel(scene.machine, path)
        at = int(np.searchsorted(fine, present))
        if not inside[at]:
            ball_text = ", ".join(f"{value:.4g}" for value in ball)
            raise OptionError(
                f"the tool cannot reach the ball at ({ball_text}) mm of the workpiece with"
                f" {axis} = {present:g}; give {{ball}} x,y,z within the travel"
            )
        outside = np.flatnonzero(~inside)
        first = float(fine[outside[outside < at].max(initial=-1) + 1])
        last = float(fine[outside[outside > at].min(initial=len(fine)) - 1])
        if last - first < 1.0:
            raise OptionError(
                f"{axis} could turn by {last - first:.2g}° only before a linear axis reaches its"
                " end; give {ball} x,y,z nearer to the axis"
            )
        return self._lay(scene, np.linspace(first, last, self.points))

    def plan_data(self, scene: Scene, table: ReadingsFile) -> tuple[BenchPlan, Array]:
        table.check_angles(4, "path")
        readings = np.concatenate([table[f"{name}_um"] for name in "xyz"])
        return self._lay(scene, table["angle_deg"]), readings

    def _set_up(self, scene: Scene) -> tuple[str, Array]:
        axis = placing.find_axis(scene.machine, self.axis, "rotary")
        if self.ball is not None:
            return axis, np.asarray(self.ball, dtype=float)
        stand = self.axis_positions(scene)
        return axis, placing.default_ball(scene, self.model(scene), axis, stand, None)

    def _lay(self, scene: Scene, angle_deg: Array) -> BenchPlan:
        axis, ball = self._set_up(scene)
        model, count = self.model(scene), len(angle_deg)
        stand = self.axis_positions(scene)
        coordinates = placing.follow(model, {**stand, axis: angle_deg}, ball)
        placing.check_travel(scene, coordinates, f"the path about {axis}")
        turned = np.eye(3)
        if self.frame == "workpiece":
            turned = branch_pose(model, "workpiece", coordinates)[..., :3, :3]
        turned = np.broadcast_to(turned, (count, 3, 3))
        direction = np.concatenate([turned[:, :, index] for index in range(3)])
        ball_text = ", ".join(f"{value:.4g}" for value in ball)
        return build_plan(
            coordinates,
            placing.tool_points(model, coordinates, count),
            direction,
            place=f"{axis} turns · ball at ({ball_text}) mm of the workpiece · readings in"
            f" {'R' if self.frame == 'machine' else 'the workpiece frame'}",
            marks={
                "angle_deg": np.tile(angle_deg, 3),
                "channel": np.repeat(np.arange(3.0), count),
            },
            site=np.tile(np.arange(count), 3),
            travel=placing.travel_directions(coordinates, np.ones(count)),
            setup=placing.ball_setup(model, coordinates, direction),
        )

    def evaluate(self, plan: BenchPlan, readings: Array) -> Outcome:
        place, residual = fit_setup(plan, readings)
        raw, residuals = readings.reshape(3, -1), residual.reshape(3, -1)
        rows = [(f"{x}_um", f"range in {x}", np.ptp(raw[at])) for at, x in enumerate("xyz")]
        rows += [
            (f"{x}_fitted_um", f"range in {x}, ball position fitted", np.ptp(residuals[at]))
            for at, x in enumerate("xyz")
        ]
        rms = np.sqrt(np.mean(np.linalg.norm(residuals, axis=0) ** 2))
        rows.append(("rms_fitted_um", "RMS distance, position fitted", rms))
        details: dict[str, object] = {
            "ball_um": place.tolist(),
            "angle_deg": plan.marks["angle_deg"][: raw.shape[1]].tolist(),
        }
        details |= {f"{x}_readings_um": raw[at].tolist() for at, x in enumerate("xyz")}
        return build_outcome(rows, details)

    def linear_forms(self, plan: BenchPlan, readings: Array) -> Mapping[str, LinearForm]:
        residual = fit_setup(plan, readings)[1]
        forms = {
            f"{x}_um": zone(part) for x, part in zip("xyz", np.split(readings, 3), strict=True)
        }
        for x, part in zip("xyz", np.split(residual, 3), strict=True):
            forms[f"{x}_fitted_um"] = zone(part)
        return forms

    def charts(self, runs: Sequence[BenchRun]) -> tuple[Lines, ...]:
        curves: list[Curve] = []
        for run in runs:
            rows = run.readings.reshape(3, -1)
            angle = run.plan.marks["angle_deg"][: rows.shape[1]]
            order = np.argsort(angle, kind="stable")
            curves += [
                run.curve(name, angle[order], rows[index][order], index)
                for index, name in enumerate("xyz")
            ]
        axis = runs[0].plan.place.partition(" ")[0]
        labels = f"Tool minus ball while {axis} turns", f"{axis} [°]", "reading [µm]"
        return (Lines("lines", *labels, tuple(curves)),)
