"""Corrections that a table requires at its points, averaged where it has fewer axes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from warpspace.exceptions import OptionError
from warpspace.field.evaluate import Turn, View, error_values, evaluate_exact, placement_effect
from warpspace.field.grid import shares
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, nominal_point, tool_axis
from warpspace.kinematics.model import Coordinates, Loop, Model, batch_shape
from warpspace.machine.axes import TravelDirection, direction_index, is_linear, parameter
from warpspace.machine.curves.simple import Directional
from warpspace.machine.errors import ErrorSet
from warpspace.scene.model import Scene, choose_view
from warpspace.units import MM_PER_UM, RAD_PER_URAD, Array

NEWTON_STEPS = 3  # each leaves a hundredth of a correction where bodies are inclined by 10 mrad
FIT_STEPS = 2  # of a linear fit
SMALL_MM, SMALL_DEG = 1e-2, 1e-3  # moves by which the response of the tool to an axis is measured
RELATIVE_CUTOFF = 1e-3  # smallest singular value that is inverted, relative to the largest


@dataclass(frozen=True)
class MovedPoints:
    """Points of a machine after moves of its axes, without errors."""

    model: Model
    loop: Loop
    coordinates: Coordinates  # [...], mm or degrees; after the moves
    point_mm: Array  # [..., 3]; nominal positions after the moves
    # [..., 3]; displacement from the commanded positions, in the structural loop
    shift_mm: Array
    turn_rad: Array  # [..., 3]; rotation of the tool axis

    def residual(self, errors: ErrorSet, placement: Array | None = None) -> tuple[Array, Array]:
        """Compute the residual error, mm and rad, less the effect of a placement.

        In the relative loop it is that on the part, which its own errors rotate.
        """
        at, point_mm = self.coordinates, self.point_mm
        field = evaluate_exact(self.model, errors, at, View(self.loop), point_mm)
        error_um = field.error_um
        carried = self.model.machine.chain.workpiece
        if self.loop is Loop.RELATIVE and any(parameter(key).axis in carried for key in errors):
            values = error_values(self.model, errors, at)
            nominal, actual = (
                branch_pose(self.model, "workpiece", at, rotated)[..., :3, :3]
                for rotated in (None, values)
            )
            error_um = transforms.rotate(nominal @ np.swapaxes(actual, -1, -2), error_um)
        position = self.shift_mm + error_um * MM_PER_UM
        orientation = self.turn_rad + field.orientation_urad * RAD_PER_URAD
        if placement is not None:
            nominal_mm = point_mm - self.shift_mm  # before the moves, on the workpiece
            shift_um, turn_urad = placement_effect(
                self.model, placement, at, nominal_mm, Turn.ON_PART
            )
            position = position - shift_um * MM_PER_UM
            orientation = orientation - turn_urad * RAD_PER_URAD
        return position, orientation


@dataclass(frozen=True)
class Corrector:
    """A machine with its errors and the axes that correct them."""

    model: Model
    errors: ErrorSet
    loop: Loop  # tool, or tool relative to workpiece
    axes: tuple[str, ...]  # axes that correct the position
    # rotary axes that correct the tilt of the tool axis as far as possible; those of `axes` then
    # compensate the displacement of the tool point
    tilting: tuple[str, ...] = ()
    # [6], or None; placement of the workpiece from `fit_placement`: its effect is not corrected
    placement: Array | None = None

    @property
    def moved(self) -> tuple[str, ...]:
        return (*self.axes, *self.tilting)

    def residual(self, coordinates: Coordinates, moves: Mapping[str, Array]) -> tuple[Array, Array]:
        """Compute the residual error at commanded positions after moves of the axes."""
        return self.move(coordinates, moves).residual(self.errors, self.placement)

    def move(
        self,
        coordinates: Coordinates,
        moves: Mapping[str, Array | float],
        point_mm: Array | None = None,
    ) -> MovedPoints:
        """Compute the part of a residual that does not depend on the errors; see `residual`.

        The default point is the tool point. In the workpiece loop it is fixed to the workpiece; in
        the relative loop the displacement is that of the tool relative to the workpiece.
        """
        model = self.model
        after = {axis: q + moves[axis] if axis in moves else q for axis, q in coordinates.items()}
        start = nominal_point(model, Loop.TOOL, coordinates) if point_mm is None else point_mm
        aim = tool_axis(model, coordinates)
        carried, turned = start, aim  # by the workpiece
        if self.loop is not Loop.TOOL:
            motion = self._motion("workpiece", coordinates, after)
            carried = transforms.apply(motion, start)
            turned = transforms.rotate(motion[..., :3, :3], aim)
        if self.loop is Loop.WORKPIECE:
            shift, turn = carried - start, np.cross(aim, turned)
            return MovedPoints(model, self.loop, after, carried, shift, turn)
        point = (
            nominal_point(model, Loop.TOOL, after)
            if point_mm is None
            else transforms.apply(self._motion("tool", coordinates, after), point_mm)
        )
        turn = np.cross(turned, tool_axis(model, after))
        return MovedPoints(model, self.loop, after, point, point - carried, turn)

    def _motion(self, side: str, before: Coordinates, after: Coordinates) -> Array:
        return branch_pose(self.model, side, after) @ transforms.inverse(
            branch_pose(self.model, side, before)
        )

    def moves(self, coordinates: Coordinates) -> dict[str, Array]:
        shape = batch_shape(coordinates)
        total = {axis: np.zeros(shape) for axis in self.moved}
        shift, _ = self.response(coordinates, self.axes)
        carried, turn = self.response(coordinates, self.tilting)
        inverse_shift, upright = (
            np.linalg.pinv(response, rcond=RELATIVE_CUTOFF) for response in (shift, turn)
        )
        for _ in range(NEWTON_STEPS):
            position, orientation = self.residual(coordinates, total)
            if self.tilting:
                tilt = -_times(upright, orientation)
                position = position + _times(carried, tilt)
                total |= {a: total[a] + tilt[..., i] for i, a in enumerate(self.tilting)}
            step = -_times(inverse_shift, position)
            total |= {a: total[a] + step[..., i] for i, a in enumerate(self.axes)}
        return total

    def response(self, coordinates: Coordinates, axes: Sequence[str]) -> tuple[Array, Array]:
        """Compute displacement and rotation of the tool per move of each axis,[..., 3, axes]."""
        shift, turn = np.zeros((2, *batch_shape(coordinates), 3, len(axes)))
        for index, axis in enumerate(axes):
            small = SMALL_MM if is_linear(axis) else SMALL_DEG
            plus, minus = (self.move(coordinates, {axis: step}) for step in (small, -small))
            shift[..., index] = (plus.shift_mm - minus.shift_mm) / (2.0 * small)
            turn[..., index] = (plus.turn_rad - minus.turn_rad) / (2.0 * small)
        return shift, turn


def _times(matrix: Any, vector: Array) -> Array:
    return np.einsum("...ij,...j->...i", matrix, vector)


def build_corrector(scene: Scene, loop: str = "", *, orientation: bool = False) -> Corrector:
    machine = scene.machine
    linear = tuple(axis for axis in machine.axes if is_linear(axis))
    rotary = tuple(axis for axis in machine.axes if not is_linear(axis))
    if not linear:
        raise OptionError(f"the machine {machine.chain} has no linear axis to correct")
    if orientation and not rotary:
        raise OptionError(
            f"the machine {machine.chain} has no rotary axis; {{orientation}} needs one"
        )
    chosen = choose_view(scene, loop).loop
    if chosen is Loop.TOOL:
        linear = tuple(axis for axis in linear if axis in machine.chain.tool)
        rotary = tuple(axis for axis in rotary if axis in machine.chain.tool)
        if not linear or (orientation and not rotary):
            raise OptionError(
                "loop tool: no axis that could correct it carries the tool; expected loop relative"
            )
    spanning = tuple(axis for axis in rotary if axis in scene.workspace.volume_axes)
    axes = (*_independent(linear, scene), *spanning)
    tilting = tuple(axis for axis in rotary if axis not in spanning) if orientation else ()
    return Corrector(scene.model, scene.errors, chosen, axes, tilting)


def _independent(linear: Sequence[str], scene: Scene) -> tuple[str, ...]:
    spanning = scene.workspace.volume_axes
    axis_by_direction: dict[int, str] = {}
    for axis in sorted(linear, key=lambda name: name not in spanning):
        axis_by_direction.setdefault(direction_index(axis), axis)
    return tuple(axis for axis in linear if axis in axis_by_direction.values())


AXES = ("X", "Y", "Z")
OTHER_NODES = 9  # positions of the other axes that a table of one axis is averaged over


@dataclass(frozen=True)
class RequiredCorrections:
    """Corrections that a table requires, and its resolution."""

    scene: Scene
    corrector: Corrector
    points: Mapping[str, int]  # points of the table along each axis of the volume
    resolution: float = 0.0  # of a value, mm or degrees; 0 for all printed digits
    # "error" or "correction"; empty for the sign that the manual of the controller states
    sign: str = ""
    stem: str = "compensation"  # name of the files, without suffix

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes that span the volume, in the order of the machine."""
        spanning = self.scene.workspace.volume_axes
        return tuple(axis for axis in self.scene.machine.axes if axis in spanning)

    def positions(self, axis: str) -> Array:
        return np.linspace(*self.scene.workspace.ranges[axis], self.points[axis])

    def factor(self, usual: str) -> float:
        """Return the factor from a correction to a number of the table."""
        return -1.0 if (self.sign or usual) == "error" else 1.0

    def round(self, values: ArrayLike) -> Array:
        step = self.resolution
        exact = np.asarray(values, dtype=float)
        return np.round(exact / step) * step if step else exact

    @property
    def directional_axes(self) -> tuple[str, ...]:
        """Axes of the volume whose errors depend on the direction of travel."""
        functions = self.corrector.errors.functions
        directional = {
            parameter(key).axis for key, curve in functions.items() if curve.has_directions
        }
        return tuple(axis for axis in self.axes if axis in directional)

    def for_direction(self, direction: str, axis: str = "") -> "RequiredCorrections":
        """Return the corrections for one direction of travel, of all axes or of a single one."""
        model, errors = self.corrector.model, self.corrector.errors
        if not axis:
            corrector = replace(self.corrector, model=replace(model, direction=direction))
            return replace(self, corrector=corrector)
        curves = {
            key: curve.forward if direction == TravelDirection.FORWARD else curve.backward
            for key, curve in errors.functions.items()
            if isinstance(curve, Directional) and parameter(key).axis == axis
        }
        changed = ErrorSet({**errors.functions, **curves})
        return replace(self, corrector=replace(self.corrector, errors=changed))

    def corrections(self, places: Mapping[str, Array]) -> dict[str, Array]:
        """Compute the corrections of all axes on a grid over the volume."""
        still = self.scene.workspace.positions
        meshed = np.meshgrid(*(places[axis] for axis in self.axes), indexing="ij")
        coordinates = {name: np.asarray(still[name]) for name in self.scene.machine.axes}
        coordinates |= dict(zip(self.axes, meshed, strict=True))
        return self.corrector.moves(coordinates)

    @property
    def _coarse_positions(self) -> dict[str, Array]:
        ranges = self.scene.workspace.ranges
        return {axis: np.linspace(*ranges[axis], OTHER_NODES) for axis in self.axes}

    def averaged(self, axes: Sequence[str]) -> dict[str, Array]:
        places = self._coarse_positions | {axis: self.positions(axis) for axis in axes}
        weights = shares(OTHER_NODES)
        averages = self.corrections(places)
        for index in reversed(range(len(self.axes))):
            if self.axes[index] not in axes:
                averages = {
                    axis: np.moveaxis(moves, index, -1) @ weights
                    for axis, moves in averages.items()
                }
        return averages

    def linear_fit(self, allowed: Sequence[tuple[str, str]]) -> dict[tuple[str, str], float]:
        """Fit corrections of one axis in proportion to the position of another.

        The RMS residual error over the volume is minimised; where the placement of the workpiece is
        fitted out, over its six numbers as well.
        """
        scene, machine = self.scene, self.scene.machine
        missing = next((axis for axis in AXES if axis not in machine.axes), "")
        if missing:
            axes = ", ".join(machine.axes)
            raise OptionError(
                f"the matrix is of X, Y and Z; the machine {machine.chain} has {axes}, no {missing}"
            )
        corrector, axes = self.corrector, self.axes
        places = self._coarse_positions
        still = {name: np.asarray(q) for name, q in scene.workspace.positions.items()}
        meshed = np.meshgrid(*(places[axis] for axis in axes), indexing="ij")
        nodes = still | {axis: q.ravel() for axis, q in zip(axes, meshed, strict=True)}
        root = np.ones(())
        for _ in axes:
            root = root[..., None] * np.sqrt(shares(OTHER_NODES))
        pairs = [pair for pair in allowed if pair[0] in corrector.moved and pair[1] in axes]
        targets = list(dict.fromkeys(target for target, _ in pairs))

        def weighted(evaluate: Callable[[Coordinates], Array]) -> Array:
            """Evaluate vectors at the nodes, [..., n, 3], less those of the reference point."""
            values = evaluate(nodes)
            if scene.reference:
                point = {**still, **{axis: np.asarray(q) for axis, q in scene.reference.items()}}
                values = values - evaluate(point)[..., None, :]
            return (values * root.ravel()[:, None]).reshape(*values.shape[:-2], -1)

        def effects(at: Coordinates) -> Array:
            response, _ = corrector.response(at, targets)
            columns = [response[..., targets.index(t)] * at[s][..., None] for t, s in pairs]
            if scene.view(corrector.loop).placed_over is not None:
                point = nominal_point(corrector.model, Loop.TOOL, at)
                shifts, _ = placement_effect(corrector.model, np.eye(6), at, point)
                columns += [-shift * MM_PER_UM for shift in shifts]
            return np.stack(columns)

        def residual(factors: Array, at: Coordinates) -> Array:
            moves = {target: np.zeros(()) for target in targets}
            for (target, source), factor in zip(pairs, factors, strict=True):
                moves[target] = moves[target] + factor * at[source]
            return corrector.residual(at, moves)[0]

        design, solved = weighted(effects).T, np.zeros(len(pairs))
        for _ in range(FIT_STEPS):
            remaining = weighted(partial(residual, solved))
            solved = solved - np.linalg.lstsq(design, remaining, rcond=None)[0][: len(pairs)]
        return dict(zip(pairs, solved.tolist(), strict=True))
