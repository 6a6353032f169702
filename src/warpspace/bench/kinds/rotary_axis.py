"""Error motions of a rotary axis: radial, axial, tilt, angular (ISO 230-7)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.analysis.blocks import Curve, Lines
from warpspace.analysis.options import option
from warpspace.analysis.typed import Axis
from warpspace.bench.base import BenchTest, Run
from warpspace.bench.data import DataColumn, Table
from warpspace.bench.evaluation import is_full
from warpspace.bench.placing import axis_line, ball_point, rotary_axis
from warpspace.bench.plan import Outcome, Plan, Quantity, build_plan
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.scene.model import Scene
from warpspace.units import Array

LEVER_MM = 1000.0
"""Between the places where the axis is sensed: 1 µm there is 1 µrad."""
CHANNELS = ("x_um", "y_um", "z_um", "a_urad", "b_urad", "c_urad")
"""Across, across, along the axis; about the same three: E_XC, E_YC, E_ZC, E_AC, E_BC, E_CC of C."""
LETTERS = ("X", "Y", "Z", "A", "B", "C")


@dataclass(frozen=True)
class Motions:
    """Error motions of an axis over its position."""

    angle_deg: Array  # [n]; ascending
    # [n], µm and µrad; towards a point that turns with the axis (rotating sensitive direction),
    # about the least-squares centre
    radial: Array
    tilt: Array
    # [n], µm and µrad; about their means; the angular one NaN where it was not measured
    axial: Array
    angular: Array
    # location in µm along the two directions across the axis, orientation in µrad about them: the
    # axis average line
    average_line: tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class RotaryAxis(BenchTest):
    """Error motions of a rotary table, a swivelling head or a spindle."""

    name = "rotary-axis"
    title = "Error motions of a rotary axis"
    standard = "ISO 230-7"
    words = (
        "Sensors at two heights read an artefact on the axis while it turns: two radial, two"
        " tilt, one axial deviation, and the angular one against an encoder; the linear axes"
        " stand. Radial and tilt error motion are taken towards a point that turns with the axis,"
        " about the least-squares centre; axial and angular about their means. The mean of the"
        " readings over a full turn is the axis average line: where the axis is and how it leans,"
        " as the place of the test sees it."
    )
    columns = (
        DataColumn("angle_deg", "number"),
        *(DataColumn(name) for name in CHANNELS[:5]),
        DataColumn("c_urad", default=0.0),
    )
    axis: Axis = option("", "Rotary axis that turns", unset="the last one")
    height_mm: float | None = option(
        None,
        "Height of the sensors along the axis above its origin",
        unit="mm",
        unset="that of the middle of the working volume",
    )
    points: int = option(72, "Positions along the turn", low=8, high=3_600)

    def plan(self, scene: Scene) -> Plan:
        """Turn the axis through its travel, at most once round."""
        axis = rotary_axis(scene.machine, self.axis)
        low, high = scene.machine.axes[axis].travel
        full = high - low >= 360.0
        end = low + 360.0 if full else high
        return self._lay(scene, np.linspace(low, end, self.points, endpoint=not full))

    def plan_data(self, scene: Scene, table: Table) -> tuple[Plan, Array]:
        """Turn the axis to the positions of a file."""
        if len(table) < 8:
            raise table.refuse(f"has {len(table)} positions; expected at least 8")
        if np.ptp(table["angle_deg"]) < 1.0:
            raise table.refuse("all readings are at one angle; expected angles along a turn")
        readings = np.concatenate([table[name] for name in CHANNELS])
        return self._lay(scene, table["angle_deg"]), readings

    def _lay(self, scene: Scene, angle_deg: Array) -> Plan:
        axis, model = rotary_axis(scene.machine, self.axis), self.model(scene)
        stand = self.stand(scene)
        line = axis_line(model, stand, axis)
        height = self.height_mm
        if height is None:
            tool = transforms.apply(
                branch_pose(model, "workpiece", stand), ball_point(model, stand)
            )
            height = float((tool - line.origin_mm) @ line.direction)
        count = len(angle_deg)
        base = np.broadcast_to(line.origin_mm + height * line.direction, (count, 3))
        points = [base, base + LEVER_MM * line.direction, base + LEVER_MM * line.across]
        one = np.arange(count)
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
                [np.broadcast_to(line.sign * way, (count, 3)) for _, _, way in sensed]
            ),
            place=f"{axis} · sensors {height:g} mm above its origin · "
            + self.place_words(scene, [axis]),
            marks={
                "angle_deg": np.tile(angle_deg, 6),
                "channel": np.repeat(np.arange(6.0), count),
                "direction": np.full(6 * count, float(scene.machine.axes[axis].direction)),
            },
            site=np.concatenate([one + count * at for at, _, _ in sensed]),
            against=np.concatenate(
                [np.full(count, -1) if zero is None else one for _, zero, _ in sensed]
            ),
            gain=np.repeat([1.0, 1.0, 1.0, *[1000.0 / LEVER_MM] * 3], count),
            travel={axis: np.tile(np.sign(np.gradient(angle_deg)), 3)},
            setup=_eccentricity(theta),
            path=(one,),
        )  # fmt: skip

    def evaluate(self, plan: Plan, readings: Array) -> Outcome:
        """Take the error motion values and the axis average line."""
        found = motions(plan, readings)
        axis = plan.place.partition(" ")[0]
        quantities = [
            Quantity("radial_um", "radial error motion", float(np.ptp(found.radial)), "µm"),
            Quantity("axial_um", "axial error motion", float(np.ptp(found.axial)), "µm"),
            Quantity("tilt_urad", "tilt error motion", float(np.ptp(found.tilt)), "µrad"),
            Quantity("angular_urad", "angular positioning", float(np.ptp(found.angular)), "µrad"),
        ]
        words = ("location in x", "location in y", "orientation about x", "orientation about y")
        frame = {"A": "yzx", "B": "zxy", "C": "xyz"}[axis[0]]
        keys = (f"E{frame[0].upper()}0{axis}", f"E{frame[1].upper()}0{axis}")
        turns = tuple("ABC"["XYZ".index(key[1])] for key in keys)
        names = (*keys, *(f"E{turn}0{axis}" for turn in turns))
        units = ("µm", "µm", "µrad", "µrad")
        for name, word, value, unit in zip(names, words, found.average_line, units, strict=True):
            spelled = word.replace("x", "#").replace("y", frame[1]).replace("#", frame[0])
            suffix = "um" if unit == "µm" else "urad"
            quantities.append(Quantity(f"{name}_{suffix}", f"{spelled} ({name})", value, unit))
        details: dict[str, object] = {"angle_deg": found.angle_deg.tolist()}
        for name in ("radial", "axial", "tilt", "angular"):
            details[f"{name}_motion"] = getattr(found, name).tolist()
        return Outcome(tuple(quantities), details)

    def charts(self, runs: Sequence[Run]) -> tuple[Lines, ...]:
        """Draw the polar plots of the four motions."""
        axis = runs[0].plan.place.partition(" ")[0]
        charts: list[Lines] = []
        units = {"radial": "µm", "tilt": "µrad", "axial": "µm", "angular": "µrad"}
        for name, unit in units.items():
            curves: list[Curve] = []
            for run in runs:
                found = motions(run.plan, run.readings)
                x, y = found.angle_deg, getattr(found, name)
                words = f"{name} error motion"
                curves.append(run.curve(words, x, y, once_round=is_full(x)))
            title = f"{axis}: {name}"
            charts.append(
                Lines("polar", title, f"{axis} [°]", f"deviation [{unit}]", tuple(curves))
            )
        return tuple(charts)


def motions(plan: Plan, readings: Array) -> Motions:
    """Take the readings of the six channels, [6 n], apart."""
    channels = readings.reshape(6, -1)
    angle_deg = plan.marks["angle_deg"][: channels.shape[1]]
    order = np.argsort(angle_deg, kind="stable")
    channels, angle_deg = channels[:, order], angle_deg[order]
    theta = np.deg2rad(angle_deg) * plan.marks["direction"][0]
    cosine, sine = np.cos(theta), np.sin(theta)
    once = np.stack([np.ones_like(theta), cosine, sine], -1)
    x, y, z, a, b, c = channels

    def about_centre(values: Array) -> Array:
        return values - once @ np.linalg.lstsq(once, values, rcond=None)[0]

    # The axis leans towards +across by a turn about upright, towards +upright by one about −across.
    leaning = b * cosine - a * sine
    return Motions(
        angle_deg,
        about_centre(x * cosine + y * sine),
        about_centre(leaning),
        z - z.mean(),
        c - c.mean(),
        (once_mean(x, theta), once_mean(y, theta), once_mean(a, theta), once_mean(b, theta)),
    )


def once_mean(values: Array, theta: Array) -> float:
    """Mean of a reading over the turn, what comes once a turn (an eccentric artefact) set aside."""
    design = np.stack([np.ones_like(theta), np.cos(theta), np.sin(theta)], -1)
    return float(np.linalg.lstsq(design, values, rcond=None)[0][0])


def _eccentricity(theta: Array) -> dict[str, Array]:
    zero, cosine, sine = np.zeros_like(theta), np.cos(theta), np.sin(theta)
    one = np.ones_like(theta)
    return {
        "eccentric_x_um": np.concatenate([cosine, sine, zero, zero, zero, zero]),
        "eccentric_y_um": np.concatenate([-sine, cosine, zero, zero, zero, zero]),
        "leaning_x_urad": np.concatenate([zero, zero, zero, cosine, sine, zero]),
        "leaning_y_urad": np.concatenate([zero, zero, zero, -sine, cosine, zero]),
        "height_um": np.concatenate([zero, zero, one, zero, zero, zero]),
        "zero_urad": np.concatenate([zero, zero, zero, zero, zero, one]),
    }
