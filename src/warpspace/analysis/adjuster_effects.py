"""Effects of adjusters on the errors of a machine, to first order."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.kinematics.chain import branch_frames
from warpspace.kinematics.model import AxisFrames, Model
from warpspace.machine.adjusters import FRAME, Adjuster, AdjusterKind, rigid_map, support_rows
from warpspace.machine.axes import Parameter, axis_parameters, is_linear, parameter
from warpspace.machine.curves.curve import OWN_AXIS, Span
from warpspace.machine.curves.polynomial_pieces import fit_curves
from warpspace.machine.definition import URAD_PER_UM_OVER_MM
from warpspace.machine.errors import Constant, Directional, ErrorFunction, ErrorSet, Poly
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, UM_PER_MM_URAD, Array

NO_EFFECT = 1e-9  # µm or µrad per unit: an effect below it is rounding
ACROSS = 0.1  # cosine between guide and supports up to which the guide lies on them


class SupportMotion(NamedTuple):
    """Small motion of a body at each of its positions."""

    point_mm: Array  # [m, 3] or [3]; in R
    shift_um: Array  # [m, 3] or [3]; of that point
    turn_urad: Array  # [m, 3] or [3]

    def shift_at(self, point_mm: Array) -> Array:
        lever = point_mm - self.point_mm
        return self.shift_um + np.cross(self.turn_urad, lever) * UM_PER_MM_URAD


def adjuster_effects(scene: Scene, factors: Mapping[str, float] | None = None) -> list[ErrorSet]:
    """Compute the errors that each adjuster of a machine adds per unit of its change.

    Three or more supports under the guides of an axis move it as a rigid body: its orientation
    changes; its shift is taken up by zero points and rotary centres. Bolts along a guide also bend
    it by the natural cubic spline through them, linear beyond its ends and between two rows. Gibs
    turn and shift the carriage. Supports of the bed move everything together; more than three also
    bend it by such a surface, less its plane of best fit: guides on it are bent, other first axes
    turned. Carriages stand at the origins of their frames; their shift at position 0 is taken up.

    Parameters
    ----------
    scene : Scene
    factors : mapping of str to float, optional
        Measured effect of an adjuster relative to the geometric one, by name.
    """
    effects: list[ErrorSet] = []
    for adjuster in scene.machine.adjusters:
        scale = adjuster.travel_per_unit * (factors or {}).get(adjuster.name, 1.0)
        functions: dict[str, ErrorFunction] = {}
        for key, function in _effect(scene, adjuster).items():
            scaled = function.scaled(scale)
            positions = np.linspace(*scene.axis_span(parameter(key).axis), 9)
            if np.abs(scaled.evaluate(positions)).max() > NO_EFFECT:
                functions[key] = scaled
        effects.append(ErrorSet(functions))
    return effects


def _effect(scene: Scene, adjuster: Adjuster) -> dict[str, ErrorFunction]:
    machine, axis = scene.machine, adjuster.body
    if adjuster.kind.is_parameter:
        moved = machine.axes[axis]
        letter, sign = "XYZABC"[moved.index + 3 * (not moved.is_linear)], float(moved.direction)
        if adjuster.kind is AdjusterKind.OFFSET:
            return {f"E{letter}0{axis}": Constant(moved.travel, sign)}
        return {f"E{letter}{axis}": Poly(scene.axis_span(axis), (0.0, sign * MM_PER_UM))}
    members = [other for other in machine.adjusters if other.joint == adjuster.joint]
    index = members.index(adjuster)
    motion, centre = rigid_map(members)
    rigid = SupportMotion(centre, motion[:3, index], motion[3:, index])
    if adjuster.kind is AdjusterKind.GIB:
        start = _frames(scene.model, axis, np.zeros(())).after[:3, 3]
        return _carriage_errors(
            scene, axis, lambda origin: rigid._replace(point_mm=centre + origin - start)
        )
    functions = {} if axis == FRAME else _constant_errors(scene, axis, rigid)
    if adjuster.kind is not AdjusterKind.RAIL_BOLT and (axis != FRAME or len(members) <= 3):
        return functions
    travel = np.eye(len(members))[index]
    for number, support in enumerate(members):
        normal = np.array(support.direction)
        travel[number] -= normal @ rigid.shift_at(np.array(support.at_mm))
    chain = machine.chain
    first = [*chain.tool[:1], *chain.workpiece[:1]]
    for guide in first if axis == FRAME else [axis]:
        before = _frames(scene.model, guide, np.zeros(())).before
        along = before[:3, machine.axes[guide].index] @ np.array(adjuster.direction)
        bent = partial(_bent, members, travel)
        if machine.axes[guide].is_linear and abs(along) <= ACROSS:
            functions |= _carriage_errors(scene, guide, bent, members)
        else:
            functions |= _constant_errors(scene, guide, bent(before[None, :3, 3]))
    return functions


def _bent(members: Sequence[Adjuster], travel_um: Array, origin_mm: Array) -> SupportMotion:
    """Compute the motion of a carriage on a bed or guide that supports bend by their travels."""
    placed = support_rows(members)
    if placed is None:
        raise OptionError(f"{members[0].name}: its supports form no rows along x, y or z")
    axes, rows = placed
    normal = np.array(members[0].direction)
    at = np.array([adjuster.at_mm for adjuster in members])
    s, t = axes @ at.T
    place = origin_mm @ axes.T
    curves = [_spline(s[list(row)], travel_um[list(row)], place[:, 0]) for row in rows]
    (height, slope), (other_height, other_slope) = curves[0], curves[-1]
    across, share = np.zeros_like(height), 0.0
    if len(rows) > 1:
        first, last = (float(t[list(row)].mean()) for row in rows)
        across, share = (other_height - height) / (last - first), (place[:, 1] - first)
        share /= last - first
    height, slope = (a + share * (b - a) for a, b in ((height, other_height), (slope, other_slope)))
    turn = np.cross(np.column_stack([slope, across]) @ axes, normal) * URAD_PER_UM_OVER_MM
    lever = (origin_mm - at.mean(axis=0)) @ normal
    return SupportMotion(origin_mm - lever[:, None] * normal, height[:, None] * normal, turn)


def _spline(at: Array, height: Array, place: Array) -> tuple[Array, Array]:
    """Evaluate the natural cubic spline through supports, and its slope; linear beyond them.

    Moments m, the second derivatives at the supports, continue the slope: with intervals h,
    h₋ m₋ + 2 (h₋ + h₊) m + h₊ m₊ = 6 (Δ₊ / h₊ − Δ₋ / h₋), and m is zero at both ends.
    """
    width, rise = np.diff(at), np.diff(height) / np.diff(at)
    moment = np.zeros(len(at))
    if len(at) > 2:
        inner = width[1:-1]
        matrix = np.diag(2.0 * (width[:-1] + width[1:])) + np.diag(inner, 1) + np.diag(inner, -1)
        moment[1:-1] = np.linalg.solve(matrix, 6.0 * np.diff(rise))
    inside = np.clip(place, at[0], at[-1])
    interval = np.clip(np.searchsorted(at, inside, "right") - 1, 0, len(width) - 1)
    h, d, m, n = width[interval], inside - at[interval], *moment[[interval, interval + 1]]
    start = rise[interval] - h * (2.0 * m + n) / 6.0
    slope = start + d * m + d * d * (n - m) / (2.0 * h)
    value = height[interval] + d * (start + d * (m / 2.0 + d * (n - m) / (6.0 * h)))
    return value + slope * (place - inside), slope


def _frames(model: Model, axis: str, position: Array) -> AxisFrames:
    """Build the frames of an axis at its positions, all other axes at zero."""
    at = dict.fromkeys(model.machine.axes, np.zeros(())) | {axis: position}
    side = "tool" if axis in model.machine.chain.tool else "workpiece"
    return next(frames for frames in branch_frames(model, side, at) if frames.axis.name == axis)


def _project(
    scene: Scene, motion: SupportMotion, frames: AxisFrames, rows: Sequence[Parameter]
) -> Array:
    """Split a motion of a body into errors of an axis, [..., K], µm and µrad."""
    columns: list[Array] = []
    for row in rows:
        pose = scene.model.convention(row.axis).frame(frames, row)
        vector = motion.turn_urad if row.is_rotation else motion.shift_at(pose[..., :3, 3])
        columns.append(np.sum(pose[..., :3, row.direction] * vector, axis=-1))
    return np.stack(np.broadcast_arrays(*columns), axis=-1)


def _constant_errors(scene: Scene, axis: str, motion: SupportMotion) -> dict[str, ErrorFunction]:
    """Return the constant errors of an axis whose guide moves."""
    rows = [row for row in axis_parameters(axis) if row.is_constant and row.is_rotation]
    values = _project(scene, motion, _frames(scene.model, axis, np.zeros(())), rows)
    travel = scene.machine.axes[axis].travel
    pairs = zip(rows, values.reshape(-1), strict=True)
    return {row.key: Constant(travel, float(value)) for row, value in pairs}


def _carriage_errors(
    scene: Scene,
    axis: str,
    motion_at: Callable[[Array], SupportMotion],
    supports: Sequence[Adjuster] = (),
) -> dict[str, ErrorFunction]:
    """Return the component errors of an axis whose carriage moves, by its origins in R, [m, 3]."""
    rows, span = (
        [row for row in axis_parameters(axis) if not row.is_constant],
        scene.axis_span(axis),
    )
    before = _frames(scene.model, axis, np.zeros(())).before
    along = before[:3, scene.machine.axes[axis].index] * scene.machine.axes[axis].direction
    kinks = np.array([(np.array(s.at_mm) - before[:3, 3]) @ along for s in supports])

    def errors_at(position: Array) -> Array:
        frames = _frames(scene.model, axis, position)
        return _project(scene, motion_at(frames.after[..., :3, 3]), frames, rows)

    zero = errors_at(np.zeros(1)) * [is_linear(axis) and not row.is_rotation for row in rows]
    curves = fit_curves(lambda position: errors_at(position) - zero, span, kinks)
    return {row.key: curve for row, curve in zip(rows, curves, strict=True) if curve is not None}


def add_effects(scene: Scene, effects: Sequence[ErrorSet], changes: Sequence[float]) -> ErrorSet:
    """Add the effects of changes, in the units of the adjusters, to the errors of a scene."""
    functions = dict(scene.errors.functions)
    for effect, change in zip(effects, changes, strict=True):
        for key, function in effect.functions.items() if change else ():
            span = scene.axis_span(parameter(key).axis)
            added = function.scaled(change)
            functions[key] = _sum(functions[key], added, span, key) if key in functions else added
    return ErrorSet(functions)


def _sum(present: ErrorFunction, added: ErrorFunction, span: Span, key: str) -> ErrorFunction:
    if parameter(key).is_constant:
        return present.with_amplitude(present.amplitude + added.amplitude)
    if isinstance(present, Directional):
        curves = (_sum(curve, added, span, key) for curve in (present.forward, present.backward))
        return Directional(present.span, *curves)
    if set(present.arguments) - {OWN_AXIS}:
        raise OptionError(f"{key} depends on two axes; an adjuster that changes it cannot be used")
    kinks = np.array([*present.kinks, *added.kinks])
    (curve,) = fit_curves(
        lambda at: (present.evaluate(at) + added.evaluate(at))[:, None], span, kinks
    )
    return curve or Constant(span)
