"""Cone frustum: a circle on a tilted cone, all five axes moving (ISO 10791-7, NAS 979)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.analysis.blocks import Curve, Lines
from warpspace.analysis.options import Vector, option
from warpspace.bench import placing
from warpspace.bench.base import BenchRun, BenchTest
from warpspace.bench.data import ANGLE, DataColumn, ReadingsFile
from warpspace.bench.kinds.circular import circle_forms, fit_circle_readings
from warpspace.bench.linear_form import LinearForm
from warpspace.bench.plan import BenchPlan, Outcome, build_outcome, build_plan
from warpspace.exceptions import OptionError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, tool_axis
from warpspace.kinematics.model import Model
from warpspace.kinematics.relative_motion import relative_point
from warpspace.scene.model import Scene
from warpspace.units import Array

SEEDS = 73  # positions of each rotary axis tried as a start
STEPS = 30
CLOSE = 1e-9  # residual of the direction: a thousandth of a microradian
PENALTY = 0.02  # per radian from the start, to choose among several solutions


def orient(model: Model, stand: Mapping[str, Array], tool_axes: Array) -> dict[str, Array]:
    """Find the positions of two rotary axes that turn the tool along directions, [n, 3]."""
    machine = model.machine
    names = [axis.name for axis in machine.axes.values() if not axis.is_linear]
    if len(names) < 2:
        raise OptionError(
            f"the machine {machine.chain} has {len(names)} rotary"
            f" {'axis' if len(names) == 1 else 'axes'}; expected two to turn the tool along the"
            " cone"
        )
    names = names[:2]
    limits = np.array([machine.axes[name].travel for name in names])

    def direction(angles: Array) -> Array:
        at = {**stand, names[0]: angles[..., 0], names[1]: angles[..., 1]}
        pose = np.asarray(branch_pose(model, "workpiece", at))[..., :3, :3]
        return transforms.rotate(np.swapaxes(pose, -1, -2), tool_axis(model, at))

    ranges = (np.linspace(float(low), float(high), SEEDS) for low, high in limits)
    seeds = np.stack(np.meshgrid(*ranges, indexing="ij"), -1).reshape(-1, 2)
    start = np.array([float(stand[name]) for name in names])
    cost = np.linalg.norm(direction(seeds) - tool_axes[0], axis=-1)
    cost = cost + PENALTY * np.abs(np.deg2rad(seeds - start)).sum(axis=-1)
    angles = seeds[int(np.argmin(cost))]
    solution = np.empty((len(tool_axes), 2))
    for row, target in enumerate(tool_axes):
        angles = _newton(direction, angles, target)
        gap = float(np.linalg.norm(direction(angles) - target))
        if gap > 1e-6:
            raise OptionError(
                f"{names[0]} and {names[1]} cannot turn the tool along the cone:"
                f" {np.rad2deg(gap):.2g}° are missing at point {row + 1}"
            )
        solution[row] = angles
    for column, (low, high) in enumerate(limits):
        if high - low >= 360.0 - 1e-9:
            solution[:, column] = low + np.mod(solution[:, column] - low, 360.0)
    return {**stand, names[0]: solution[:, 0], names[1]: solution[:, 1]}


def _newton(direction: Callable[[Array], Array], start: Array, target: Array) -> Array:
    angles = start.copy()
    step_deg = 1e-4
    for _ in range(STEPS):
        tried = angles + step_deg * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        values = direction(tried)
        gap = target - values[0]
        if np.linalg.norm(gap) < CLOSE:
            break
        slope = (values[1:] - values[0]).T / step_deg
        move = np.linalg.lstsq(slope, gap, rcond=1e-6)[0]
        angles = angles + move * min(1.0, 20.0 / max(float(np.abs(move).max()), 1e-12))
    return angles


MAX_READINGS = 3_600  # of one file: the rotary axes are solved for each


@dataclass(frozen=True, kw_only=True)
class ConeFrustum(BenchTest):
    """A circle on a cone whose base is tilted; the tool axis follows its flank."""

    name = "cone-frustum"
    title = "Cone frustum"
    standard = "ISO 10791-7, M3"
    description = (
        "The tool runs round a cone that stands tilted on the table, its axis along the flank, so"
        " that three linear and two rotary axes move at once. A ball bar from the middle of the"
        " circle, or the roundness of the machined cone, gives the radial deviation: circularity"
        " about the least-squares centre."
    )
    columns = (ANGLE, DataColumn("radial_um"))
    radius_mm: float = option(50.0, "Radius of the circle", unit="mm")
    half_apex_deg: float = option(15.0, "Half the apex angle of the cone", unit="°")
    tilt_deg: float = option(10.0, "Tilt of its base, about y of the workpiece", unit="°")
    centre: Vector = option(
        None,
        "Middle of the circle in the workpiece frame",
        unit="mm",
        unset="that of the working volume",
    )
    points: int = option(72, "Points of the circle", low=8, high=720)

    def plan(self, scene: Scene) -> BenchPlan:
        return self._lay(scene, np.linspace(0.0, 360.0, self.points, endpoint=False))

    def plan_data(self, scene: Scene, table: ReadingsFile) -> tuple[BenchPlan, Array]:
        if len(table) > MAX_READINGS:
            raise table.refuse(f"has {len(table):,} readings; expected at most {MAX_READINGS:,}")
        table.check_angles(8, "circle", "readings")
        order = np.argsort(table["angle_deg"], kind="stable")
        return self._lay(scene, table["angle_deg"][order]), table["radial_um"][order]

    def _lay(self, scene: Scene, angle_deg: Array) -> BenchPlan:
        if not 0.0 < self.radius_mm < 1e4:
            raise OptionError(f"{{radius_mm}} {self.radius_mm:g} mm; expected above 0")
        if not 0.0 <= self.half_apex_deg < 90.0 or not -90.0 < self.tilt_deg < 90.0:
            raise OptionError(
                f"{{half_apex_deg}} {self.half_apex_deg:g}, {{tilt_deg}} {self.tilt_deg:g};"
                " expected 0 to 90 and -90 to 90 degrees"
            )
        model, stand = self.model(scene), self.axis_positions(scene)
        middle = relative_point(model, stand)
        if self.centre is not None:
            middle = np.asarray(self.centre, dtype=float)
        theta = np.deg2rad(angle_deg)
        leaning = transforms.axis_rotation(1, np.deg2rad(self.tilt_deg))
        flat = np.stack([np.cos(theta), np.sin(theta), np.zeros_like(theta)], -1)
        outward = transforms.rotate(leaning, flat)
        half = np.deg2rad(self.half_apex_deg)
        flank = np.cos(half) * leaning[:, 2] - np.sin(half) * outward
        coordinates = orient(model, stand, flank)
        coordinates = placing.follow(model, coordinates, middle + self.radius_mm * outward)
        placing.check_travel(scene, coordinates, "the cone")
        pose = branch_pose(model, "workpiece", coordinates)
        direction = transforms.rotate(pose[..., :3, :3], outward)
        centre_text = ", ".join(f"{value:.4g}" for value in middle)
        return build_plan(
            coordinates,
            placing.tool_points(model, coordinates, len(theta)),
            direction,
            place=f"cone {2 * self.half_apex_deg:g}° tilted by {self.tilt_deg:g}° · radius"
            f" {self.radius_mm:g} mm about ({centre_text}) mm",
            marks={
                "angle_deg": angle_deg, "sense": np.ones(len(theta)),
                "along": np.cos(theta), "up": np.sin(theta),
            },
            length_mm=self.radius_mm,
            travel=placing.travel_directions(coordinates, np.ones(len(theta))),
            setup={
                **placing.ball_setup(model, coordinates, direction),
                "bar_um": np.ones(len(theta)),
            },
        )  # fmt: skip

    def evaluate(self, plan: BenchPlan, readings: Array) -> Outcome:
        fit = fit_circle_readings(plan, readings)
        rows = [
            ("circular_deviation_um", "circularity", fit.deviation_um),
            ("radius_um", "mean radius − nominal", fit.radius_um),
        ]
        return build_outcome(rows, fit.details(plan))

    def linear_forms(self, plan: BenchPlan, readings: Array) -> Mapping[str, LinearForm]:
        forms = circle_forms(plan, readings)
        return {key: forms[key] for key in ("circular_deviation_um", "radius_um")}

    def charts(self, runs: Sequence[BenchRun]) -> tuple[Lines, ...]:
        curves: list[Curve] = []
        for run in runs:
            fit = fit_circle_readings(run.plan, run.readings)
            x = run.plan.marks["angle_deg"]
            curves.append(run.curve("radial deviation", x, fit.radial_um, once_round=True))
        labels = "Circle on the cone", "angle [°]", "radial deviation [µm]"
        return (Lines("polar", *labels, tuple(curves), note="About the least-squares centre."),)
