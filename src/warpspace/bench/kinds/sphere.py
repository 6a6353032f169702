"""R-test: a ball on the table, the tool held on it while a rotary axis turns (ISO 10791-6)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from warpspace.analysis.blocks import Curve, Lines
from warpspace.analysis.options import option
from warpspace.analysis.typed import Axis, Vector
from warpspace.bench.base import BenchTest, Run
from warpspace.bench.data import DataColumn, Table
from warpspace.bench.placing import (
    ball_columns,
    default_ball,
    followed,
    reachable,
    rotary_axis,
    tool_points,
    travels,
)
from warpspace.bench.plan import Outcome, Plan, Quantity, build_plan
from warpspace.kinematics.chain import branch_pose
from warpspace.scene.model import Scene
from warpspace.units import Array

AXES = ("x", "y", "z")


@dataclass(frozen=True, kw_only=True)
class Sphere(BenchTest):
    """R-test with the controller's compensation of the tool centre point on."""

    name = "sphere"
    title = "R-test with a ball"
    standard = "ISO 10791-6, tests AK, BK, CK"
    words = (
        "A ball stands on the table, three sensors on the tool (or the other way round) read"
        " where it is along x, y and z. A rotary axis turns; the linear axes follow, so that"
        " nominally the tool stays on the ball. Readings are tool minus ball, in R or, with"
        " --frame workpiece, in directions that turn with the table. The range of each is what the"
        " standard asks for; with the ball's place fitted (it is never known as well) the ranges"
        " that are left are given too."
    )
    columns = (
        DataColumn("angle_deg", "number"),
        DataColumn("x_um"),
        DataColumn("y_um"),
        DataColumn("z_um"),
    )
    axis: Axis = option("", "Rotary axis that turns", unset="the last one")
    ball: Vector = option(
        None,
        "Centre of the ball in the workpiece frame",
        unit="mm",
        unset="one that can be reached",
    )
    start: float | None = option(
        None, "First position of the axis; as far as the others can follow", unit="°"
    )
    end: float | None = option(None, "Last position, likewise", unit="°")
    points: int = option(73, "Positions along the way", low=4, high=3_600)
    frame: Literal["machine", "workpiece"] = option("machine", "Directions of the readings")

    def plan(self, scene: Scene) -> Plan:
        """Turn the axis as far as the linear axes can follow."""
        axis, ball = self._set_up(scene)
        angle = reachable(
            scene,
            self.model(scene),
            axis,
            ball,
            self.stand(scene),
            self.start,
            self.end,
            self.points,
        )
        return self._lay(scene, angle)

    def plan_data(self, scene: Scene, table: Table) -> tuple[Plan, Array]:
        """Turn the axis to the positions of a file."""
        if len(table) < 4:
            raise table.refuse(f"has {len(table)} positions; expected at least 4")
        if np.ptp(table["angle_deg"]) < 1.0:
            raise table.refuse("all readings are at one angle; expected angles along the way")
        readings = np.concatenate([table[f"{name}_um"] for name in AXES])
        return self._lay(scene, table["angle_deg"]), readings

    def _set_up(self, scene: Scene) -> tuple[str, Array]:
        axis = rotary_axis(scene.machine, self.axis)
        if self.ball is not None:
            return axis, np.asarray(self.ball, dtype=float)
        return axis, default_ball(scene, self.model(scene), axis, self.stand(scene), None)

    def _lay(self, scene: Scene, angle_deg: Array) -> Plan:
        axis, ball = self._set_up(scene)
        model = self.model(scene)
        coordinates = followed(scene, model, axis, angle_deg, ball, self.stand(scene))
        count = len(angle_deg)
        turned = np.broadcast_to(np.eye(3), (count, 3, 3))
        if self.frame == "workpiece":
            pose = np.asarray(branch_pose(model, "workpiece", coordinates))
            turned = np.broadcast_to(pose[..., :3, :3], (count, 3, 3))
        direction = np.concatenate([turned[:, :, index] for index in range(3)])
        columns = {
            f"ball_{name}_um": np.sum(np.tile(column, (3, 1)) * direction, axis=-1)
            for name, column in ball_columns(model, coordinates).items()
        }
        spelled = ", ".join(f"{value:.4g}" for value in ball)
        return build_plan(
            coordinates,
            tool_points(model, coordinates, count),
            direction,
            place=f"{axis} turns · ball at ({spelled}) mm of the workpiece · readings in"
            f" {'R' if self.frame == 'machine' else 'the workpiece frame'}",
            marks={
                "angle_deg": np.tile(angle_deg, 3),
                "channel": np.repeat(np.arange(3.0), count),
            },
            site=np.tile(np.arange(count), 3),
            travel=travels(coordinates, np.ones(count)),
            setup=columns,
        )

    def evaluate(self, plan: Plan, readings: Array) -> Outcome:
        """Take the range of each direction, as read and with the ball's place fitted."""
        design = np.stack(list(plan.setup.values()), -1)
        place = np.linalg.lstsq(design, readings, rcond=None)[0]
        rest = readings - design @ place
        raw, left = readings.reshape(3, -1), rest.reshape(3, -1)
        quantities = [
            Quantity(f"{name}_um", f"range in {name}", float(np.ptp(raw[index])), "µm")
            for index, name in enumerate(AXES)
        ]
        quantities += [
            Quantity(
                f"{name}_fitted_um", f"range in {name}, ball's place fitted",
                float(np.ptp(left[index])), "µm",
            )
            for index, name in enumerate(AXES)
        ]  # fmt: skip
        norm = np.linalg.norm(left, axis=0)
        rms = float(np.sqrt(np.mean(norm**2)))
        quantities.append(Quantity("rms_fitted_um", "RMS distance, place fitted", rms, "µm"))
        details: dict[str, object] = {
            "ball_um": place.tolist(),
            "angle_deg": plan.marks["angle_deg"][: raw.shape[1]].tolist(),
        }
        for index, name in enumerate(AXES):
            details[f"{name}_readings_um"] = raw[index].tolist()
        return Outcome(tuple(quantities), details)

    def charts(self, runs: Sequence[Run]) -> tuple[Lines, ...]:
        """Draw x, y and z against the angle."""
        curves: list[Curve] = []
        for run in runs:
            rows = run.readings.reshape(3, -1)
            angle = run.plan.marks["angle_deg"][: rows.shape[1]]
            order = np.argsort(angle, kind="stable")
            curves += [
                run.curve(name, angle[order], rows[index][order], index)
                for index, name in enumerate(AXES)
            ]
        axis = runs[0].plan.place.partition(" ")[0]
        return (
            Lines(
                "lines", f"Tool minus ball while {axis} turns", f"{axis} [°]", "reading [µm]",
                tuple(curves),
            ),
        )  # fmt: skip
