"""By how much the axes of a machine are moved so that no error is left."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.evaluate import View, evaluate_exact
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, nominal_point, tool_axis
from warpspace.kinematics.model import Coordinates, Loop, Model, batch_shape
from warpspace.machine.axes import direction_index, is_linear
from warpspace.machine.errors import ErrorSet
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, RAD_PER_URAD, Array

STEPS = 2
"""Newton steps: an error grows by a ten-thousandth of the correction at most."""
SMALL_MM, SMALL_DEG = 1e-2, 1e-3
"""Moves by which the response of the tool to an axis is measured."""
CUT = 1e-3
"""Moves that act less than this share of the best one are not used."""
LOOPS = (Loop.TOOL, Loop.RELATIVE)


@dataclass(frozen=True)
class Moved:
    """Points of a machine whose axes were moved, before its errors count.

    Attributes
    ----------
    model : Model
    loop : Loop
    coordinates : mapping of str to ndarray, [...], mm or degrees
        Where the axes stand after the moves.
    point_mm : ndarray, [..., 3], mm
        Where the points nominally are then.
    shift_mm : ndarray, [..., 3], mm
        By how much they have moved from where they were commanded, as the loop sees it.
    turn_rad : ndarray, [..., 3], rad
        By how much the tool axis has turned.
    """

    model: Model
    loop: Loop
    coordinates: Coordinates
    point_mm: Array
    shift_mm: Array
    turn_rad: Array

    def residual(self, errors: ErrorSet) -> tuple[Array, Array]:
        """Give what is left with errors; see `Corrector.residual`."""
        view = View(self.loop)
        field = evaluate_exact(self.model, errors, self.coordinates, view, self.point_mm)
        return (
            self.shift_mm + field.error_um * MM_PER_UM,
            self.turn_rad + field.orientation_urad * RAD_PER_URAD,
        )


@dataclass(frozen=True)
class Corrector:
    """A machine with its errors and the axes that may be moved against them.

    Attributes
    ----------
    model : Model
    errors : ErrorSet
    loop : Loop
        Tool, or tool relative to workpiece.
    axes : tuple of str
        Axes that correct the position.
    tilting : tuple of str
        Rotary axes that correct the tilt of the tool axis, as far as they can; those of `axes`
        then take back what they move the tool point by.
    """

    model: Model
    errors: ErrorSet
    loop: Loop
    axes: tuple[str, ...]
    tilting: tuple[str, ...] = ()

    @property
    def moved(self) -> tuple[str, ...]:
        """All axes that are corrected."""
        return (*self.axes, *self.tilting)

    def residual(
        self, coordinates: Coordinates, moves: Mapping[str, Array], point_mm: Array | None = None
    ) -> tuple[Array, Array]:
        """Give what is left at commanded positions after moves of the axes.

        Parameters
        ----------
        coordinates : mapping of str to ndarray, [...], mm or degrees
        moves : mapping of str to ndarray, [...], mm or degrees
        point_mm : ndarray, [..., 3], mm, optional
            Nominal points in R at the commanded positions; by default the tool point.

        Returns
        -------
        position_mm : ndarray, [..., 3], mm
        orientation_rad : ndarray, [..., 3], rad
            Rotation vector without the part about the tool axis.
        """
        return self.move(coordinates, moves, point_mm).residual(self.errors)

    def move(
        self, coordinates: Coordinates, moves: Mapping[str, Array], point_mm: Array | None = None
    ) -> "Moved":
        """Work out all of a residual that does not depend on the errors; see `residual`."""
        after = {axis: q + moves[axis] if axis in moves else q for axis, q in coordinates.items()}
        return Moved(
            self.model, self.loop, after, *self._nominal_motion(coordinates, after, point_mm)
        )

    def _nominal_motion(
        self, before: Coordinates, after: Coordinates, point_mm: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """Place of a point after a move, its displacement, and the turn of the tool axis.

        The point is the tool point by default. In the workpiece loop it rides on the workpiece, in
        the relative loop the displacement is that of the tool against the workpiece.
        """
        start = nominal_point(self.model, Loop.TOOL, before) if point_mm is None else point_mm
        aim, end = tool_axis(self.model, before), tool_axis(self.model, after)
        if self.loop is Loop.TOOL:
            point = self._tool_point(before, after, point_mm)
            return point, point - start, np.cross(aim, end)
        carried = self._carried("workpiece", before, after)
        rides, turned = transforms.apply(carried, start), transforms.rotate(_turn(carried), aim)
        if self.loop is Loop.WORKPIECE:
            return rides, rides - start, np.cross(aim, turned)
        point = self._tool_point(before, after, point_mm)
        return point, point - rides, np.cross(turned, end)

    def _tool_point(self, before: Coordinates, after: Coordinates, point_mm: Array | None) -> Array:
        """Give where a point of the tool side nominally is after a move, [..., 3], mm."""
        if point_mm is None:
            return nominal_point(self.model, Loop.TOOL, after)
        return transforms.apply(self._carried("tool", before, after), point_mm)

    def _carried(self, side: str, before: Coordinates, after: Coordinates) -> Array:
        """Motion in R of what rides on a branch, [..., 4, 4]."""
        return branch_pose(self.model, side, after) @ transforms.inverse(
            branch_pose(self.model, side, before)
        )

    def moves(self, coordinates: Coordinates) -> dict[str, Array]:
        """Give the moves of the axes that leave nothing, or as little as they can.

        Parameters
        ----------
        coordinates : mapping of str to ndarray, [...], mm or degrees

        Returns
        -------
        dict of str to ndarray, [...], mm or degrees
        """
        shape = batch_shape(coordinates)
        total = {axis: np.zeros(shape) for axis in self.moved}
        shift, _ = self._response(coordinates, self.axes)
        back = _inverse(shift)
        carried, turn = self._response(coordinates, self.tilting)
        upright = _inverse(turn)
        for _ in range(STEPS):
            position, orientation = self.residual(coordinates, total)
            if self.tilting:
                tilt = -_times(upright, orientation)
                position = position + _times(carried, tilt)
                total |= {a: total[a] + tilt[..., i] for i, a in enumerate(self.tilting)}
            step = -_times(back, position)
            total |= {a: total[a] + step[..., i] for i, a in enumerate(self.axes)}
        return total

    def _response(self, coordinates: Coordinates, axes: Sequence[str]) -> tuple[Array, Array]:
        """Displacement and turn of the tool per move of each axis, [..., 3, K] twice."""
        shifts: list[Array] = []
        turns: list[Array] = []
        shape = (*batch_shape(coordinates), 3)
        for axis in axes:
            small = SMALL_MM if is_linear(axis) else SMALL_DEG
            up, down = (
                self._nominal_motion(
                    coordinates, {**coordinates, axis: coordinates[axis] + way * small}
                )
                for way in (1.0, -1.0)
            )
            for found, one, other in ((shifts, up[1], down[1]), (turns, up[2], down[2])):
                found.append(np.broadcast_to((one - other) / (2.0 * small), shape))
        none = np.zeros((*shape, 0))
        return (
            np.stack(shifts, -1) if shifts else none,
            np.stack(turns, -1) if turns else none,
        )


def _turn(pose: Array) -> Array:
    """Give the rotation of a pose, [..., 3, 3]."""
    return pose[..., :3, :3]


def _inverse(matrix: Array) -> Array:
    """Invert, as far as it can be, without directions that hardly act, [..., n, m]."""
    if not matrix.shape[-1]:
        return np.swapaxes(matrix, -1, -2)
    return np.asarray(np.linalg.pinv(matrix, rcond=CUT), dtype=np.float64)


def _times(matrix: Array, vector: Array) -> Array:
    """Multiply matrices with vectors, [..., n]."""
    return np.einsum("...ij,...j->...i", matrix, vector)


def build_corrector(scene: Scene, loop: str = "", *, orientation: bool = False) -> Corrector:
    """Build the corrector of a scene: its linear axes, with its rotary ones for the orientation.

    Parameters
    ----------
    scene : Scene
    loop : str, optional
        "tool" or "relative"; by default relative where a linear axis carries the workpiece, or
        where the orientation is corrected and every rotary axis does.
    orientation : bool, optional

    Returns
    -------
    Corrector

    Raises
    ------
    OptionError
        If there is nothing that could be corrected, or the loop is no one that axes can correct.
    """
    machine = scene.machine
    linear = tuple(axis for axis in machine.axes if is_linear(axis))
    rotary = tuple(axis for axis in machine.axes if not is_linear(axis))
    if not linear:
        raise OptionError(f"the machine {machine.chain} has no linear axis to correct")
    if orientation and not rotary:
        raise OptionError(
            f"the machine {machine.chain} has no rotary axis; --orientation needs one"
        )
    carried: set[str] = set(linear) & set(machine.chain.workpiece)
    if orientation and not set(rotary) & set(machine.chain.tool):
        carried |= set(rotary)
    chosen = Loop(loop) if loop else Loop.RELATIVE if carried else Loop.TOOL
    if chosen not in LOOPS:
        raise OptionError(f"loop {chosen}; expected tool or relative for a compensation")
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
    """Keep one axis along each direction: the one that spans the volume."""
    spanning = scene.workspace.volume_axes
    found: dict[int, str] = {}
    for axis in sorted(linear, key=lambda name: name not in spanning):
        found.setdefault(direction_index(axis), axis)
    return tuple(axis for axis in linear if axis in found.values())
