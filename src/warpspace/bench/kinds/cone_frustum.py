"""Cone frustum: a circle on a tilted cone, all five axes moving (ISO 10791-7, NAS 979)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from warpspace.bench.base import BenchTest, Run
from warpspace.bench.data import DataColumn, Table
from warpspace.bench.evaluation.circle import fit_circle_readings
from warpspace.bench.options import check_count, option
from warpspace.bench.outcome import Chart, Curve, Outcome, Quantity
from warpspace.bench.paths.following import ball_columns, travels
from warpspace.bench.paths.orienting import orient
from warpspace.bench.paths.placing import ball_point, check_travel, follow
from warpspace.bench.plan import Plan, build_plan
from warpspace.exceptions import OptionError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, nominal_point
from warpspace.kinematics.model import Loop
from warpspace.scene.model import Scene
from warpspace.units import Array

MOST = 3_600
"""Readings of one file: the rotary axes are found for one after the other."""


@dataclass(frozen=True, kw_only=True)
class ConeFrustum(BenchTest):
    """A circle on a cone whose base is tilted; the tool axis follows its flank."""

    name: ClassVar[str] = "cone-frustum"
    title: ClassVar[str] = "Cone frustum"
    standard: ClassVar[str] = "ISO 10791-7, M3"
    words: ClassVar[str] = (
        "The tool runs round a cone that stands tilted on the table, its axis along the flank,"
        " so that three linear and two rotary axes move at once. A ball bar from the middle of the"
        " circle, or"
        " the roundness of the machined cone, gives the radial deviation: circularity about the"
        " least-squares centre."
    )
    columns: ClassVar[tuple[DataColumn, ...]] = (
        DataColumn("angle_deg", "number"),
        DataColumn("radial_um"),
    )
    radius_mm: float = option(50.0, "number", "Radius of the circle.", unit="mm")
    half_apex_deg: float = option(15.0, "number", "Half the apex angle of the cone.", unit="°")
    tilt_deg: float = option(
        10.0, "number", "Tilt of its base, about y of the workpiece.", unit="°"
    )
    centre: tuple[float, float, float] | None = option(
        None, "vector", "Middle of the circle in the workpiece frame, x,y,z in mm; by default that"
        " of the working volume.", unit="mm",
    )  # fmt: skip
    points: int = option(72, "count", "Points of the circle.")

    def plan(self, scene: Scene) -> Plan:
        """Run the circle once."""
        check_count("--points", self.points, 8, 720)
        return self._lay(scene, np.linspace(0.0, 360.0, self.points, endpoint=False))

    def plan_data(self, scene: Scene, table: Table) -> tuple[Plan, Array]:
        """Run the angles of a file, in their order."""
        if len(table) < 8:
            raise table.refuse(f"has {len(table)} readings; expected at least 8")
        if len(table) > MOST:
            raise table.refuse(f"has {len(table):,} readings; expected at most {MOST:,}")
        order = np.argsort(table["angle_deg"], kind="stable")
        angle = table["angle_deg"][order]
        if np.ptp(angle) < 1.0:
            raise table.refuse("all readings are at one angle; expected angles along the circle")
        return self._lay(scene, angle), table["radial_um"][order]

    def _lay(self, scene: Scene, angle_deg: Array) -> Plan:
        """Lay the plan: rotary axes turn the tool along the flank, linear axes follow."""
        if not 0.0 < self.radius_mm < 1e4:
            raise OptionError(f"--radius {self.radius_mm:g} mm; expected above 0")
        if not 0.0 <= self.half_apex_deg < 90.0 or not -90.0 < self.tilt_deg < 90.0:
            raise OptionError(
                f"--half-apex {self.half_apex_deg:g}, --tilt {self.tilt_deg:g}; expected 0 to"
                f" 90 and"
                " -90 to 90 degrees"
            )
        model, stand = self.model(scene), self.stand(scene)
        middle = (
            np.asarray(ball_point(model, stand))
            if self.centre is None
            else np.asarray(self.centre, dtype=float)
        )
        theta = np.deg2rad(angle_deg)
        leaning = transforms.axis_rotation(1, np.deg2rad(self.tilt_deg))
        flat = np.stack([np.cos(theta), np.sin(theta), np.zeros_like(theta)], -1)
        outward = transforms.rotate(leaning, flat)
        half = np.deg2rad(self.half_apex_deg)
        flank = np.cos(half) * leaning[:, 2] - np.sin(half) * outward
        coordinates = orient(scene.machine, model, stand, flank)
        coordinates = follow(model, coordinates, middle + self.radius_mm * outward)
        check_travel(scene, coordinates, "the cone")
        pose = np.asarray(branch_pose(model, "workpiece", coordinates))
        direction = transforms.rotate(
            np.broadcast_to(pose, (len(theta), 4, 4))[..., :3, :3], outward
        )
        columns = ball_columns(model, coordinates)
        spelled = ", ".join(f"{value:.4g}" for value in middle)
        return build_plan(
            coordinates,
            np.broadcast_to(nominal_point(model, Loop.TOOL, coordinates), (len(theta), 3)),
            direction,
            place=f"cone {2 * self.half_apex_deg:g}° tilted by {self.tilt_deg:g}° · radius"
            f" {self.radius_mm:g} mm about ({spelled}) mm",
            marks={
                "angle_deg": angle_deg, "sense": np.ones(len(theta)),
                "along": np.cos(theta), "up": np.sin(theta),
                "radius_mm": np.full(len(theta), self.radius_mm),
                "gain_sign": np.ones(len(theta)),
            },
            length_mm=self.radius_mm,
            travel=travels(coordinates, np.ones(len(theta))),
            setup={
                **{f"ball_{name}_um": np.sum(column * direction, axis=-1)
                   for name, column in columns.items()},
                "bar_um": np.ones(len(theta)),
            },
        )  # fmt: skip

    def evaluate(self, plan: Plan, readings: Array) -> Outcome:
        """Take circularity and mean radius."""
        fit = fit_circle_readings(plan, readings)
        return Outcome(
            (
                Quantity("circular_deviation_um", "circularity", fit.deviation_um, "µm"),
                Quantity("radius_um", "mean radius − nominal", fit.radius_um, "µm"),
            ),
            {
                "centre_um": list(fit.centre_um),
                "angle_deg": plan.marks["angle_deg"].tolist(),
                "radial_um": fit.radial_um.tolist(),
            },
        )

    def charts(self, runs: Sequence[Run]) -> tuple[Chart, ...]:
        """Draw the radial deviation on the nominal circle."""
        curves: list[Curve] = []
        for run in runs:
            fit = fit_circle_readings(run.plan, run.readings)
            x, y = run.plan.marks["angle_deg"], fit.radial_um
            if not run.is_measured:
                x, y = np.append(x, x[0] + 360.0), np.append(y, y[0])
            style = "dots" if run.is_measured else "line"
            curves.append(Curve(run.named("radial deviation"), x, y, 0, style))
        return (
            Chart(
                "polar", "Circle on the cone", "angle [°]", "radial deviation [µm]", tuple(curves),
                (), "About the least-squares centre.",
            ),
        )  # fmt: skip
