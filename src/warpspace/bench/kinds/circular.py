"""Circular test of two linear axes, or of linear axes that follow a rotary one (ISO 230-4)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.blocks import Curve, Lines
from warpspace.analysis.options import Axis, option
from warpspace.bench import placing
from warpspace.bench.base import BenchRun, BenchTest
from warpspace.bench.data import ANGLE, DIRECTION, DataColumn, ReadingsFile
from warpspace.bench.linear_form import LinearForm, absolute, zone
from warpspace.bench.plan import BenchPlan, Outcome, build_outcome, build_plan
from warpspace.exceptions import OptionError
from warpspace.field.grid import Workspace
from warpspace.machine.axes import is_linear
from warpspace.scene.model import Scene
from warpspace.units import UM_PER_MM_URAD, Array

DEFAULT_POINTS, MIN_POINTS, MAX_POINTS = 360, 8, 100_000
TURN = 360.0
BAR_MM = 100.0  # length of a bar at a rotary axis: motion across it is of second order
LEEWAY_DEG = 5.0  # difference of the ends of an arc that is not reported
ALIKE_UM = 1e-6  # runs that differ by less are drawn as one
SENSES = {1.0: "counter-clockwise", -1.0: "clockwise"}


# Centre, radius, ellipse, hysteresis (ISO 230-4).

FULL_DEG = 314.0
"""Arcs from which a circle counts as full: eight points have gaps of 45°."""
HALF_DEG = 180.0  # shorter arcs cannot separate an ellipse from a displaced centre


@dataclass(frozen=True)
class CircleFit:
    """Components of a trace of radial readings."""

    radial_um: Array  # [m]; readings about the least-squares centre
    centre_um: tuple[float, float]
    radius_um: float  # mean radius minus nominal radius
    # largest minus smallest radial deviation of all readings about the one centre: G(b), or G where
    # one sense was run
    deviation_um: float
    # µm; G, the same of each sense about its own centre: +1 counter-clockwise, −1 clockwise
    by_sense: Mapping[float, float]
    # D, radius of the least-squares circle of both senses minus nominal radius
    mean_radial_um: float | None
    # H, largest difference between the senses at one angle. Both None where one sense was run.
    hysteresis_um: float | None
    # amplitude of the sin 2φ part, and radius along the first axis minus radius along the second
    # (twice the cos 2φ part); None and 0 on arcs that are too short
    shear_um: float | None
    radius_difference_um: float

    def details(self, plan: BenchPlan) -> dict[str, object]:
        """Return the further numbers of an outcome."""
        return {
            "centre_um": list(self.centre_um),
            "angle_deg": plan.marks["angle_deg"].tolist(),
            "radial_um": self.radial_um.tolist(),
        }


def covered_deg(angle_deg: Array) -> float:
    """Compute the arc that angles cover: the turn less the largest gap, degrees."""
    sorted_deg = np.unique(np.round(np.mod(angle_deg, 360.0), 6))
    gaps = np.diff(np.append(sorted_deg, sorted_deg[0] + 360.0))
    return 360.0 - float(gaps.max())


def is_full(angle_deg: Array) -> bool:
    return covered_deg(angle_deg) >= FULL_DEG


def fit_circle_readings(plan: BenchPlan, readings: Array) -> CircleFit:
    """Fit centre, radius and ellipse to the readings, [m], µm, of a circular plan.

    Its marks are angle_deg, sense, along and up (the direction of the bar along the two axes of the
    plane). With the mark as_read the centre is an error of the machine
    and stays in: a ball beside a rotary axis turns with it.

    Notes
    -----
    Least squares of ``1, cos φ, sin φ, cos 2φ, sin 2φ``; of the first three where the arc is
    shorter than half a circle. A squareness γ gives ∓γ·R/2·sin 2φ. G and G(b) are ranges about the
    least-squares centre, never less than the width of the narrowest ring about the path; which of
    the two ISO 230-4 means is not verified.
    """
    marks, sense = plan.marks, plan.marks["sense"]

    def centred(rows: NDArray[np.bool_]) -> tuple[Array, Array]:
        return fit_centre(plan, readings, rows)

    fit, radial = centred(np.ones(len(readings), dtype=bool))
    elliptic = len(fit) == 5
    senses = [sign for sign in (1.0, -1.0) if (sense == sign).any()]
    both_senses = len(senses) == 2
    return CircleFit(
        radial,
        (float(fit[1]), float(fit[2])),
        float(fit[0]),
        float(np.ptp(radial)),
        {sign: float(np.ptp(centred(sense == sign)[1])) for sign in senses},
        float(_circle_radius(plan, readings)) if both_senses else None,
        _hysteresis(marks["angle_deg"], sense, radial) if both_senses else None,
        float(fit[4]) if elliptic else None,
        2.0 * float(fit[3]) if elliptic else 0.0,
    )


def fit_centre(plan: BenchPlan, readings: Array, rows: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Fit circle and ellipse to some readings, [m, ...]; return the fit and them centred."""
    marks, radial = plan.marks, readings[rows]
    elliptic = covered_deg(marks["angle_deg"][rows]) >= HALF_DEG - 1e-6
    part = _circle_design(plan)[rows, : 5 if elliptic else 3]
    fit = np.linalg.pinv(part) @ radial
    return fit, radial if "as_read" in marks else radial - part[:, 1:3] @ fit[1:3]


def _circle_design(plan: BenchPlan) -> Array:
    along, up = plan.marks["along"], plan.marks["up"]
    return np.stack([np.ones(len(along)), along, up, along**2 - up**2, 2.0 * along * up], -1)


def _circle_radius(plan: BenchPlan, readings: Array) -> Array:
    return np.linalg.lstsq(_circle_design(plan)[:, :3], readings, rcond=None)[0][0]


def circle_forms(plan: BenchPlan, readings: Array) -> dict[str, LinearForm]:
    """Build the forms of circular deviation, radius and the sin 2φ part of a full circle."""
    fit, radial = fit_centre(plan, readings, np.ones(plan.readings, dtype=bool))
    forms = {"circular_deviation_um": zone(radial), "radius_um": absolute(fit[:1])}
    return forms | ({"shear_um": absolute(fit[4:])} if len(fit) == 5 else {})


def _hysteresis(angle_deg: Array, sense: Array, radial: Array) -> float:
    turned = np.mod(angle_deg, 360.0)
    forward, backward = sense > 0.0, sense < 0.0
    order = np.argsort(turned[backward], kind="stable")
    interpolated = np.interp(
        turned[forward], turned[backward][order], radial[backward][order], period=360.0
    )
    return float(np.abs(radial[forward] - interpolated).max())


@dataclass(frozen=True, kw_only=True)
class Circular(BenchTest):
    """Circular test with a ball bar."""

    name = "circular"
    title = "Circular test"
    standard = "ISO 230-4"
    description = (
        "A ball bar reads the distance of the tool from a ball on the table while two axes run a"
        " circle or an arc, counter-clockwise and back. Circular deviation is the largest minus"
        " the smallest radial deviation about the least-squares centre: G of one sense about its"
        " own, G(b) of both about the common one. Radial deviations Fmax and Fmin are as read,"
        " about the centre of the instrument. An ellipse at 45° is squareness, one along the axes"
        " a difference of their scales, a step where an axis reverses its backlash. With a rotary"
        " axis the linear axes follow a ball on it, and the bar stands in the radial, tangential or"
        " axial direction of its circle; these readings are evaluated as read."
    )
    columns = (DIRECTION, ANGLE, DataColumn("radial_um"))
    plane: Literal["XY", "XZ", "YZ"] = option("XY", "Plane of the circle")
    radius_mm: float = option(100.0, "Radius of the circle", unit="mm")
    start_deg: float = option(
        0.0, "Start of the arc, from the first axis towards the second", unit="°"
    )
    end_deg: float = option(TURN, "End of the arc; 360 for a full circle", unit="°")
    points: int = option(DEFAULT_POINTS, "Points of the circle", low=MIN_POINTS, high=MAX_POINTS)
    rotary: Axis = option(
        "", "Rotary axis that the linear axes follow, in place of the circle in a plane"
    )
    bar: Literal["radial", "tangential", "axial"] = option(
        "radial", "Direction of the bar, with a rotary axis"
    )

    def plan(self, scene: Scene) -> BenchPlan:
        span = self.end_deg - self.start_deg
        if not 0.0 < span <= TURN:
            raise OptionError(
                f"arc from {self.start_deg:g} to {self.end_deg:g}°; expected above 0 and at most"
                " 360°"
            )
        angle = self.start_deg + np.linspace(0.0, span, self.points, endpoint=span < TURN)
        angle, sense = np.concatenate([angle, angle[::-1]]), np.repeat([1.0, -1.0], self.points)
        return self._lay(scene, angle, sense)

    def plan_data(self, scene: Scene, table: ReadingsFile) -> tuple[BenchPlan, Array]:
        if len(table) < MIN_POINTS:
            raise table.refuse(f"has {len(table)} readings; expected at least {MIN_POINTS}")
        if np.ptp(table["angle_deg"]) < 1.0:
            raise table.refuse(
                f"all readings are at {table['angle_deg'][0]:g}°; expected angles along an arc"
            )
        return self._lay(scene, table["angle_deg"], table["direction"]), table["radial_um"]

    def data_notes(self, table: ReadingsFile) -> tuple[str, ...]:
        angle = np.unique(table["angle_deg"])
        leeway = max(LEEWAY_DEG, 1.5 * float(np.median(np.diff(angle))))
        ends = float(angle[0]), float(angle[-1])
        if max(abs(ends[0] - self.start_deg), abs(ends[1] - self.end_deg)) <= leeway:
            return ()
        run = f"the readings run {ends[0]:g} … {ends[1]:g}°, the test is set to"
        return (f"{run} {self.start_deg:g} … {self.end_deg:g}°: the figures are of the readings",)

    def _lay(self, scene: Scene, angle_deg: Array, sense: Array) -> BenchPlan:
        if self.rotary:
            return self._lay_about_axis(scene, angle_deg, sense)
        first, second = placing.plane_axes(scene.machine, self.plane)
        if not 0.0 < self.radius_mm < np.inf:
            raise OptionError(f"radius: {self.radius_mm:g} mm; expected above 0")
        model, stand = self.model(scene), self.axis_positions(scene)
        middle = {name: float(value) for name, value in stand.items()}
        check_circle(scene.workspace, middle, (first, second), self.radius_mm, angle_deg)
        plane = placing.find_plane(model, stand, self.plane)
        theta, count = np.deg2rad(angle_deg), len(angle_deg)
        coordinates = {  # the last site is the centre
            **stand,
            first: middle[first] + self.radius_mm * np.append(np.cos(theta), 0.0),
            second: middle[second] + self.radius_mm * np.append(np.sin(theta), 0.0),
        }
        relative = placing.tool_offset(model, coordinates)
        outward = relative[:-1] - relative[-1]
        outward = outward / np.linalg.norm(outward, axis=-1, keepdims=True)
        # slightly ahead: at a point of reversal an axis is about to move
        ahead = theta + sense * 1e-6
        return build_plan(
            coordinates,
            placing.tool_points(model, coordinates, count + 1),
            outward,
            place=f"{self.plane} plane · radius {self.radius_mm:g} mm · centre "
            + ", ".join(f"{name} {value:g}" for name, value in middle.items()),
            marks={
                "angle_deg": angle_deg, "sense": sense,
                "along": outward @ plane.first_direction, "up": outward @ plane.second_direction,
                "gain_sign": np.full(count, plane.sign),
            },
            site=np.arange(count), against=np.full(count, count), length_mm=self.radius_mm,
            travel={
                first: np.append(-np.sin(ahead) * sense, 0.0),
                second: np.append(np.cos(ahead) * sense, 0.0),
            },
            setup={
                f"centre_{first}_um": outward @ plane.first_direction,
                f"centre_{second}_um": outward @ plane.second_direction,
                "bar_um": np.ones(count),
            },
            path=(np.arange(count),), squareness_key=plane.key,
        )  # fmt: skip

    def _lay_about_axis(self, scene: Scene, angle_deg: Array, sense: Array) -> BenchPlan:
        axis = placing.find_axis(scene.machine, self.rotary, "rotary")
        model, stand, count = self.model(scene), self.axis_positions(scene), len(angle_deg)
        ball = placing.default_ball(scene, model, axis, stand, self.radius_mm)
        coordinates = placing.follow(model, {**stand, axis: angle_deg}, ball)
        placing.check_travel(scene, coordinates, f"the path about {axis}")
        point = placing.tool_points(model, coordinates, count)
        line = placing.axis_line(model, coordinates, axis)
        axial = np.broadcast_to(line.direction, point.shape)
        arm = point - line.origin_mm
        arm = arm - np.sum(arm * axial, axis=-1, keepdims=True) * axial
        length = np.linalg.norm(arm, axis=-1, keepdims=True)
        if length.min() < 1e-3:
            raise OptionError(f"the ball lies on {axis}; expected a distance from it")
        radial = arm / length
        tangential: Array = np.asarray(np.cross(axial, radial), dtype=np.float64)
        bars = {"radial": radial, "tangential": tangential, "axial": axial}
        theta = np.deg2rad(angle_deg)
        return build_plan(
            coordinates,
            point,
            bars[self.bar],
            place=f"{axis} turns · ball {self.radius_mm:g} mm from it · {self.bar} bar",
            marks={
                "angle_deg": angle_deg, "sense": sense,
                "along": np.cos(theta), "up": np.sin(theta), "as_read": np.ones(count),
            },
            length_mm=BAR_MM,
            travel=placing.travel_directions(coordinates, sense),
            setup={
                **placing.ball_setup(model, coordinates, bars[self.bar]), "bar_um": np.ones(count),
            },
        )  # fmt: skip

    def evaluate(self, plan: BenchPlan, readings: Array) -> Outcome:
        fit = fit_circle_readings(plan, readings)
        bar = self.bar if self.rotary else "radial"
        letter = "G" if fit.mean_radial_um is None else "G(b)"
        rows = [("circular_deviation_um", f"circular deviation {letter}", fit.deviation_um)]
        for sense, value in fit.by_sense.items():
            key = f"circular_deviation_{SENSES[sense].replace('-', '_')}_um"
            rows.append((key, f"G, {SENSES[sense]}", value))
        rows += [
            ("radial_deviation_max_um", f"{bar} deviation Fmax", float(readings.max())),
            ("radial_deviation_min_um", f"{bar} deviation Fmin", float(readings.min())),
        ]
        if fit.mean_radial_um is not None and fit.hysteresis_um is not None:
            label = f"mean bi-directional {bar} deviation D"
            rows.append(("mean_radial_deviation_um", label, fit.mean_radial_um))
            rows.append(("hysteresis_um", "hysteresis H", fit.hysteresis_um))
        rows.append(("radius_um", "mean radius − nominal", fit.radius_um))
        details: dict[str, object] = {}
        if fit.shear_um is not None and not self.rotary:
            key, lever = plan.squareness_key, self.radius_mm * UM_PER_MM_URAD
            squareness = 2.0 * fit.shear_um / (float(plan.marks["gain_sign"][0]) * lever)
            label = f"radius along {self.plane[0]} − radius along {self.plane[1]}"
            rows.append(("squareness_urad", f"squareness {key}", squareness))
            rows.append(("radius_difference_um", label, fit.radius_difference_um))
            details["squareness_key"] = key
        return build_outcome(rows, details | fit.details(plan))

    def linear_forms(self, plan: BenchPlan, readings: Array) -> Mapping[str, LinearForm]:
        forms = circle_forms(plan, readings)
        shear = forms.pop("shear_um", None)
        if shear and not self.rotary:
            per_shear = 2.0 / (self.radius_mm * UM_PER_MM_URAD)
            forms["squareness_urad"] = absolute(per_shear * shear.rows)
        return forms

    def charts(self, runs: Sequence[BenchRun]) -> tuple[Lines, ...]:
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
                name, full = "both directions" if alike else word, is_full(x)
                curves.append(run.curve(name, x, y, row, once_round=full))
        fit = fit_circle_readings(runs[0].plan, runs[0].readings)
        if fit.shear_um is not None and not self.rotary:
            turn = np.linspace(0.0, TURN, 181)
            ellipse = fit.radius_um + fit.shear_um * np.sin(2.0 * np.deg2rad(turn))
            name = "mean radius and squareness only"
            curves.append(Curve(name, turn, ellipse, 2, "dashed"))
        title = f"{self.bar} deviation along the circle about {self.rotary}"
        if not self.rotary:
            title = f"{self.plane} plane, 0° at +{self.plane[0]}, 90° at +{self.plane[1]}"
        note = "As read." if self.rotary else "About the least-squares centre."
        return (Lines("polar", title, "angle [°]", "deviation [µm]", tuple(curves), note=note),)


def check_circle(
    workspace: Workspace,
    centre: Mapping[str, float],
    axes: tuple[str, str],
    radius_mm: float,
    angle_deg: Array,
) -> None:
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
        lowest, highest = (-1.0, 1.0) if full else (float(reach.min()), float(reach.max()))
        first, last = value + radius_mm * lowest, value + radius_mm * highest
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
