"""Sphere centres, with TCP correction on or off."""

from dataclasses import replace

import numpy as np

from warpspace.analysis.axis_motion import fit_flat_circle
from warpspace.bench.placing import linear_axes
from warpspace.calibration.kinds import FreePlacementKind
from warpspace.calibration.readings import (
    Circle,
    Readings,
    ReadingTable,
    axis_columns,
    build_readings,
    check_spread,
)
from warpspace.exceptions import SceneError
from warpspace.kinematics.relative_motion import relative_point
from warpspace.machine.axes import direction_index, sort_axes
from warpspace.scene.model import Scene
from warpspace.units import Array

PLANES = {0: (1, 2), 1: (0, 2), 2: (0, 1)}
MIN_POSITIONS = 3  # of the rotary axis, for a circle
SPREAD_MM = 100.0
READ = ("x_mm", "y_mm", "z_mm")
TCP_SPREAD_MM = 20.0  # a larger spread of centres means that TCP correction was off


class Centres(FreePlacementKind):
    """Centres of one sphere at an unknown position."""

    place = "sphere"
    sign = -1.0

    def automatic_keys(self, readings: Readings, scene: Scene) -> tuple[str, ...]:
        """List location, orientation and zero errors of the rotary axes that move.

        For the last rotary axis on the tool side also the offset of the tool point: constant
        component translations, which rotate with it. The length comes before the zero positions,
        the lateral offsets last.
        """
        moving = [
            name
            for name in sort_axes(rotary_axes(scene))
            if np.ptp(readings.coordinates[name]) > 1e-9
        ]
        constants = [f"E{letter}0{axis}" for letter in "XYZABC" for axis in moving]
        usual = [key for key in constants if key in scene.parameter_keys]
        unusual = [key for key in constants if key not in usual]
        last = [axis.name for axis in scene.machine.branch("tool") if axis.name in moving][-1:]
        length = [f"EZ{axis}" for axis in last]
        sideways = [f"E{letter}{axis}" for letter in "XY" for axis in last]
        return (*usual, *length, *unusual, *sideways)


class SphereTcp(Centres):
    """Nominal tool point of the controller, each time the actual tool point is at the sphere.

    The controller moves the linear axes so that its nominal tool point is constant; the machine
    errors shift the actual tool point, and the reading by the same amount in the opposite sense.
    """

    name = "sphere-tcp"
    description = "centres of one sphere, TCP correction on (R-test, ISO 10791-6)"
    columns = "rotary positions (b_deg, c_deg), x_mm, y_mm, z_mm; u_um, session"

    def matches(self, table: ReadingTable, scene: Scene) -> bool:
        return has_centres(table, scene) and spread_mm(table) <= TCP_SPREAD_MM

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        observed = table.require(READ)
        rotary = rotary_axes(scene)
        coordinates, notes = axis_columns(table, scene, rotary, rotary)
        hint = "Were they measured with TCP correction off (kind sphere), or in another unit?"
        check_spread(spread_mm(table), TCP_SPREAD_MM, table.source, hint)
        coordinates = solve_linear(scene, coordinates, mean_centres(observed, table), table.source)
        return build_readings(self.name, scene, table, coordinates, observed, notes)


class SphereKind(Centres):
    """Positions of the linear axes, each time the tool point stands at the sphere."""

    name = "sphere"
    description = "centres of one sphere, TCP correction off: circles about rotary axes"
    columns = (
        "rotary positions (b_deg, c_deg), linear positions x_mm, y_mm, z_mm; u_um, session or run"
    )

    def matches(self, table: ReadingTable, scene: Scene) -> bool:
        return has_centres(table, scene) and spread_mm(table) > TCP_SPREAD_MM

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        table.require(READ)
        rotary = rotary_axes(scene)
        linear = tuple(name for name in ("X", "Y", "Z") if name in scene.machine.axes)
        if len(linear) < len(READ):
            raise table.refuse(
                "holds positions of X, Y and Z; expected a machine with these three axes"
            )
        coordinates, notes = axis_columns(table, scene, (*rotary, *linear), rotary)
        circles = circles_of(table, scene)
        for circle in circles:
            if circle.against:
                sense = np.where(np.isin(table.session, circle.sessions), -1.0, 1.0)
                coordinates[circle.axis] = sense * coordinates[circle.axis]
                note = (
                    f"run {', '.join(circle.sessions)}: {circle.axis} rotates opposite to that"
                    " of the scene; its positions are used with the opposite sign"
                )
                notes = (*notes, note)
        tip = relative_point(scene.model, coordinates)
        nominal = solve_linear(scene, coordinates, mean_centres(tip, table), table.source)
        readings = build_readings(self.name, scene, table, nominal, tip, notes)
        readings = replace(readings, circles=circles)
        from_centre = tip - self._members(readings, self.unknowns(readings)) @ self.start(readings)
        hint = "Are they in mm, and are the offsets of the scene those of the machine?"
        check_spread(float(np.abs(from_centre).max()), SPREAD_MM, table.source, hint)
        return readings


def rotary_axes(scene: Scene) -> tuple[str, ...]:
    return tuple(name for name, axis in scene.machine.axes.items() if not axis.is_linear)


def has_centres(table: ReadingTable, scene: Scene) -> bool:
    rotary = {f"{name.lower()}_deg" for name in rotary_axes(scene)}
    columns = set(table.columns)
    return set(READ) <= columns and bool(rotary & columns) and "length_mm" not in columns


def spread_mm(table: ReadingTable) -> float:
    observed, labels = table.require(READ), np.array(table.session)
    names = dict.fromkeys(table.session)
    return max(float(np.ptp(observed[labels == name], axis=0).max()) for name in names)


def mean_centres(observed_mm: Array, table: ReadingTable) -> Array:
    """Compute the mean centre of the session of each reading, [n, 3], mm.

    Errors are evaluated at nominal axis positions. Positions that included the reading itself would
    allow a scale error to explain any reading.
    """
    labels = np.array(table.session)
    means = {name: observed_mm[labels == name].mean(axis=0) for name in dict.fromkeys(labels)}
    return np.stack([means[name] for name in labels])


def solve_linear(
    scene: Scene, coordinates: dict[str, Array], target_mm: Array, source: str
) -> dict[str, Array]:
    """Find the positions of the linear axes that nominally bring the tool point to targets."""
    linear = list(linear_axes(scene.machine).values())
    zero = {**coordinates, **{name: np.zeros(len(target_mm)) for name in linear}}
    start = relative_point(scene.model, zero)
    ones = np.ones(len(target_mm))
    columns = [relative_point(scene.model, {**zero, name: ones}) - start for name in linear]
    system = np.stack(columns, -1) if columns else np.zeros((len(target_mm), 3, 0))
    solved = np.linalg.pinv(system) @ (target_mm - start)[..., None]
    missed_mm = float(np.abs(system @ solved - (target_mm - start)[..., None]).max())
    if missed_mm > 1e-6:
        names = ", ".join(linear) or "none"
        problem = f"is up to {missed_mm:.3g} mm out of reach of the linear axes ({names})"
        raise SceneError(source, [f"{problem}; expected a machine that reaches the sphere"])
    return {**zero, **{name: solved[:, at, 0] for at, name in enumerate(linear)}}


def circles_of(table: ReadingTable, scene: Scene) -> tuple[Circle, ...]:
    """Fit a circle per run in which one rotary axis turns, and one per axis to all such runs."""
    read, labels = table.require(READ), np.array(table.session)
    columns = {name: f"{name.lower()}_deg" for name in rotary_axes(scene)}
    positions = {name: table.column(column) for name, column in columns.items()}
    turned = {name: at for name, at in positions.items() if at is not None}
    runs: dict[str, list[str]] = {}
    for session in dict.fromkeys(labels.tolist()):
        members = labels == session
        moving = [name for name, values in turned.items() if np.ptp(values[members]) > 0.0]
        if len(moving) == 1 and len(np.unique(turned[moving[0]][members])) >= MIN_POSITIONS:
            runs.setdefault(moving[0], []).append(session)
    circles: list[Circle] = []
    for axis, sessions in runs.items():
        groups = dict.fromkeys([*((session,) for session in sessions), tuple(sessions)])
        for group in groups:
            members = np.isin(labels, group)
            circles.append(_fit(axis, group, read[members], turned[axis][members], scene))
    return tuple(circles)


def _fit(
    axis: str, sessions: tuple[str, ...], read_mm: Array, position_deg: Array, scene: Scene
) -> Circle:
    first, second = PLANES[direction_index(axis)]
    flat = read_mm[:, (first, second)]
    centre, radius = fit_flat_circle(flat)
    away = np.linalg.norm(flat - centre, axis=-1) - radius
    angle = np.deg2rad(position_deg) * scene.machine.axes[axis].direction
    across = -1.0 if direction_index(axis) == 1 else 1.0  # from z to x about y, not from x to z
    turn = np.exp(1j * across * angle)
    complex_mm = (flat - centre) @ np.array([1.0, 1j])
    along = abs(np.vdot(turn, complex_mm))
    against = abs(np.vdot(np.conj(turn), complex_mm))
    plane, middle = "XYZ"[first] + "XYZ"[second], (float(centre[0]), float(centre[1]))
    rms_mm = float(np.sqrt(np.mean(away**2)))
    is_against = bool(against > along)
    return Circle(axis, sessions, plane, middle, radius, rms_mm, len(flat), is_against)
