"""Ball plate: a grid of balls measured in several positions, as on measuring machines."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from warpspace.analysis.blocks import Curve, Lines
from warpspace.analysis.options import option
from warpspace.bench import placing
from warpspace.bench.base import BenchRun, BenchTest
from warpspace.bench.data import XYZ, DataColumn, ReadingsFile
from warpspace.bench.linear_form import LinearForm, absolute, largest_range
from warpspace.bench.plan import BenchPlan, Outcome, build_outcome, build_plan, fit_setup
from warpspace.exceptions import OptionError
from warpspace.geometry.surfaces import round_down
from warpspace.scene.model import Scene
from warpspace.units import UM_PER_MM, Array

DRAWN_SHARE = 0.35  # of the pitch: length of the largest deviation as drawn


@dataclass(frozen=True, kw_only=True)
class BallPlate(BenchTest):
    """Balls of a plate in one plane, at several heights."""

    name = "ball-plate"
    title = "Ball plate"
    standard = "ISO 10360-2, ASME B89.4.10360.2 (artefact)"
    description = (
        "A plate with a grid of balls (or holes) lies in a plane of the machine and is measured"
        " in several positions along the third axis. In each the six degrees of freedom of the"
        " plate are fitted; the residuals are errors of the machine. An affine fit gives the"
        " scales of both axes and their squareness; the largest error of a distance between any"
        " two balls is the quantity of acceptance tests."
    )
    columns = (*(DataColumn(name, "number") for name in ("position", "row", "column")), *XYZ)
    plane: Literal["XY", "XZ", "YZ"] = option("XY", "Plane of the plate")
    balls: int = option(5, "Balls along each side", low=2, high=20)
    pitch_mm: float | None = option(
        None, "Distance of the balls", unset="to fill the range", unit="mm"
    )
    positions: int = option(3, "Positions of the plate along the third axis", low=1, high=10)

    def plan(self, scene: Scene) -> BenchPlan:
        balls = np.arange(self.balls)
        grid = np.meshgrid(np.arange(self.positions), balls, balls, indexing="ij")
        return self._lay(scene, *(part.reshape(-1).astype(float) for part in grid))

    def plan_data(self, scene: Scene, table: ReadingsFile) -> tuple[BenchPlan, Array]:
        problems: list[str] = []
        indices: dict[str, Array] = {}
        for name, largest in (
            ("position", self.positions),
            ("row", self.balls),
            ("column", self.balls),
        ):
            values = table[name]
            wrong = (values != np.round(values)) | (values < 1) | (values > largest)
            problems += [
                f"line {int(line)}, {name}: {value:g}; expected a whole number from 1 to {largest}"
                f" (--{'positions' if name == 'position' else 'balls'} {largest})"
                for line, value in zip(table.lines[wrong], values[wrong], strict=True)
            ]
            indices[name] = values - 1.0
        for index in np.unique(indices["position"]):
            balls = int((indices["position"] == index).sum())
            if balls < 4 and not problems:
                problems.append(f"position {index + 1:g}: {balls} balls; expected at least 4")
        if problems:
            raise table.refuse(*problems)
        readings = np.concatenate([table["x_um"], table["y_um"], table["z_um"]])
        return self._lay(scene, indices["position"], indices["row"], indices["column"]), readings

    def _lay(self, scene: Scene, number: Array, row: Array, column: Array) -> BenchPlan:
        first, second = placing.plane_axes(scene.machine, self.plane)
        names = placing.following_axes(scene.model)
        third = next(name for name in names if name not in (first, second))
        stand, model = self.axis_positions(scene), self.model(scene)
        low, high = scene.workspace.ranges[third]
        heights = np.linspace(low, high, self.positions)
        if self.positions == 1:
            heights = np.array([float(stand[third])])
        coordinates = {
            **stand,
            first: self._side(scene, first, column),
            second: self._side(scene, second, row),
            third: heights[number.astype(int)],
        }
        count = len(number)
        point = placing.tool_points(model, coordinates, count)
        axes = np.stack([placing.programmed_direction(model, stand, name) for name in names], -1)
        nominal = np.broadcast_to(placing.tool_offset(model, coordinates), (count, 3)) @ axes
        plane = placing.find_plane(model, stand, self.plane)
        marks = {"position": number, "row": row, "column": column}
        marks["gain_sign"] = np.full(count, plane.sign)
        marks |= {f"seen_{axis}_mm": nominal[:, index] for index, axis in enumerate("xyz")}
        return build_plan(
            coordinates,
            point,
            np.repeat(axes.T, count, axis=0),
            place=f"plate in {self.plane} · {third} "
            + ", ".join(f"{value:g}" for value in heights)
            + f" · {self.place_text(scene, names)}",
            marks={name: np.tile(values, 3) for name, values in marks.items()},
            site=np.tile(np.arange(count), 3),
            setup=_plate_setup(number, nominal),
            path=tuple(np.flatnonzero(number == index) for index in np.unique(number)),
            squareness_key=plane.key,
        )

    def _side(self, scene: Scene, name: str, index: Array) -> Array:
        low, high = scene.workspace.ranges[name]
        if not low < high:
            raise OptionError(f"a ball plate needs a range of {name} in [workspace]")
        pitch = (high - low) / (self.balls - 1) if self.pitch_mm is None else self.pitch_mm
        if not 0.0 < pitch <= (high - low) / (self.balls - 1) + 1e-9:
            raise OptionError(
                f"{{pitch_mm}} {pitch:g} mm: {self.balls} balls take"
                f" {pitch * (self.balls - 1):g} mm, {name} has {high - low:g} mm"
            )
        return (low + high) / 2.0 + pitch * (index - (self.balls - 1) / 2.0)

    def evaluate(self, plan: BenchPlan, readings: Array) -> Outcome:
        residual_um = plate_residuals(plan, readings)
        sign = float(plan.marks["gain_sign"][0])
        nominal = np.stack([plan.marks[f"seen_{axis}_mm"] for axis in "xyz"], -1)[
            : len(residual_um)
        ]
        number = plan.marks["position"][: len(residual_um)]
        columns = ["XYZ".index(name) for name in self.plane]
        rows: list[dict[str, float]] = []
        for index in np.unique(number):
            chosen = number == index
            deviation, position = residual_um[chosen], nominal[chosen][:, columns]
            scale_1, scale_2, angle = _affine(position, deviation[:, columns])
            rows.append(
                {
                    "position": int(index) + 1,
                    "rms_um": float(np.sqrt(np.mean(np.sum(deviation**2, axis=-1)))),
                    f"scale_{self.plane[0]}_um_per_m": scale_1,
                    f"scale_{self.plane[1]}_um_per_m": scale_2,
                    "squareness_urad": sign * angle,
                    "flatness_um": float(np.ptp(deviation[:, 3 - sum(columns)])),
                    "length_error_um": _length_error(nominal[chosen], deviation),
                }
            )

        def worst(name: str) -> float:
            return max((row[name] for row in rows), key=abs)

        def mean(name: str) -> float:
            return float(np.mean([row[name] for row in rows]))

        quantities = (
            ("length_error_um", "largest error of a distance", worst),
            ("squareness_urad", f"squareness {plan.squareness_key}, mean", mean),
            *((f"scale_{axis}_um_per_m", f"scale of {axis}, mean", mean) for axis in self.plane),
            ("flatness_um", "largest height of the plate", worst),
            ("rms_um", "RMS of a position, mean", mean),
        )
        return build_outcome(
            ((name, text, total(name)) for name, text, total in quantities),
            {"positions": rows, "squareness_key": plan.squareness_key},
        )

    def linear_forms(self, plan: BenchPlan, readings: Array) -> Mapping[str, LinearForm]:
        residual = np.stack(np.split(fit_setup(plan, readings)[1], 3), axis=1)  # [b, 3, ...]
        count = len(residual)
        nominal = np.stack([plan.marks[f"seen_{axis}_mm"] for axis in "xyz"], -1)[:count]
        number, across = (
            plan.marks["position"][:count],
            "XYZ".index(({*"XYZ"} - {*self.plane}).pop()),
        )
        lengths: list[Array] = []
        for index in np.unique(number):
            at, deviation = nominal[number == index], residual[number == index]
            first, second = np.triu_indices(len(at), 1)
            apart = at[first] - at[second]
            apart /= np.linalg.norm(apart, axis=-1, keepdims=True)
            lengths.append(np.einsum("pc,pc...->p...", apart, deviation[first] - deviation[second]))
        return {
            "length_error_um": absolute(*lengths),
            "flatness_um": largest_range(residual[:, across], number),
        }

    def charts(self, runs: Sequence[BenchRun]) -> tuple[Lines, ...]:
        columns = ["XYZ".index(name) for name in self.plane]
        largest = max(float(np.abs(plate_residuals(run.plan, run.readings)).max()) for run in runs)
        marks = runs[0].plan.marks
        count = runs[0].plan.readings // 3
        nominal = np.stack([marks[f"seen_{axis}_mm"] for axis in "xyz"], -1)[:count][:, columns]
        pitch = float(np.ptp(nominal, axis=0).min()) / max(self.balls - 1, 1)
        exact_factor = DRAWN_SHARE * pitch * UM_PER_MM / largest if largest > 1e-6 else 1.0
        factor = round_down(exact_factor) if exact_factor > 0.0 else 1.0
        charts: list[Lines] = []
        for index in np.unique(marks["position"]):
            chosen = marks["position"][:count] == index
            ball_row = marks["row"][:count][chosen]
            ball_column = marks["column"][:count][chosen]
            curves = list(_net("nominal", nominal[chosen], ball_row, ball_column, 5, "thin"))
            for run in runs:
                residual_um = plate_residuals(run.plan, run.readings)[chosen][:, columns]
                moved = nominal[chosen] + factor * residual_um / UM_PER_MM
                style = "dots" if run.is_measured else "line"
                curves += _net(run.label("actual"), moved, ball_row, ball_column, 0, style)
            x_label, y_label = (f"{axis.lower()} [mm]" for axis in self.plane)
            labels = f"Position {int(index) + 1}", x_label, y_label
            note = f"Deviations {factor:,.0f} × exaggerated."
            charts.append(Lines("plane", *labels, tuple(curves), note=note))
        return tuple(charts)


def plate_residuals(plan: BenchPlan, readings: Array) -> Array:
    """Compute the deviations of the balls after a best fit of the plate, [b, 3], µm."""
    return fit_setup(plan, readings)[1].reshape(3, -1).T


def _plate_setup(number: Array, nominal: Array) -> dict[str, Array]:
    columns: dict[str, Array] = {}
    for index in np.unique(number):
        inside = (number == index).astype(float)
        middle = nominal[number == index].mean(axis=0)
        arm = (nominal - middle) * inside[:, None] * 1e-3
        for axis, letter in enumerate("xyz"):
            shift = np.zeros((len(nominal), 3))
            shift[:, axis] = inside
            turn = np.cross(np.eye(3)[axis], arm)
            columns[f"position_{int(index) + 1}_{letter}_um"] = shift.T.reshape(-1)
            columns[f"position_{int(index) + 1}_about_{letter}_urad"] = turn.T.reshape(-1)
    return columns


def _affine(place: Array, deviation: Array) -> tuple[float, float, float]:
    """Fit scales in µm/m and the angle between both directions in µrad, [b, 2] each."""
    design = np.column_stack([np.ones(len(place)), place])
    first, second = np.linalg.lstsq(design, deviation, rcond=None)[0].T
    # A positive angle here moves points of the first direction along + with the second one.
    return float(first[1] * 1e3), float(second[2] * 1e3), float((first[2] + second[1]) * 1e3)


def _length_error(nominal: Array, deviation: Array) -> float:
    first, second = np.triu_indices(len(nominal), 1)
    apart = nominal[first] - nominal[second]
    length = np.linalg.norm(apart, axis=-1)
    error = np.sum((deviation[first] - deviation[second]) * apart, axis=-1) / length
    return float(error[np.argmax(np.abs(error))])


def _net(
    name: str, place: Array, row: Array, column: Array, colour: int, style: str
) -> tuple[Curve, ...]:
    if style == "dots":
        return (Curve(name, place[:, 0], place[:, 1], colour, "dots"),)
    curves: list[Curve] = []
    for lines, along in ((row, column), (column, row)):
        for value in np.unique(lines):
            chosen = np.flatnonzero(lines == value)
            chosen = chosen[np.argsort(along[chosen], kind="stable")]
            kind = "thin" if style == "thin" else "line"
            curves.append(
                Curve("" if curves else name, place[chosen, 0], place[chosen, 1], colour, kind)
            )
    return tuple(curves)
