"""By how much the axes of a machine are moved so that no error is left."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.basis import ErrorField
from warpspace.field.evaluate import View, evaluate_exact
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, nominal_point, tool_axis
from warpspace.kinematics.model import Coordinates, Loop, Model, batch_shape
from warpspace.machine.axes import direction_index, is_linear
from warpspace.machine.errors import ErrorSet
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, RAD_PER_URAD, UM_PER_MM, URAD_PER_RAD, Array

STEPS = 2
"""Newton steps: an error grows by a ten-thousandth of the correction at most."""
SMALL_MM, SMALL_DEG = 1e-2, 1e-3
"""Moves by which the response of the tool to an axis is measured."""
CUT = 1e-3
"""Moves that act less than this share of the best one are not used."""
LOOPS = (Loop.TOOL, Loop.RELATIVE)


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

    def residual(self, coordinates: Coordinates, moves: Mapping[str, Array]) -> tuple[Array, Array]:
        """Give what is left at commanded positions after moves of the axes.

        Parameters
        ----------
        coordinates : mapping of str to ndarray, [...], mm or degrees
        moves : mapping of str to ndarray, [...], mm or degrees

        Returns
        -------
        position_mm : ndarray, [..., 3], mm
        orientation_rad : ndarray, [..., 3], rad
            Rotation vector without the part about the tool axis.
        """
        moved = {axis: q + moves[axis] if axis in moves else q for axis, q in coordinates.items()}
        field = evaluate_exact(self.model, self.errors, moved, View(self.loop))
        shift, turn = self._nominal_motion(coordinates, moved)
        return (
            shift + field.error_um * MM_PER_UM,
            turn + field.orientation_urad * RAD_PER_URAD,
        )

    def _nominal_motion(self, before: Coordinates, after: Coordinates) -> tuple[Array, Array]:
        """Displacement of the tool against the commanded point, and the turn of its axis."""
        start = nominal_point(self.model, Loop.TOOL, before)
        aim, end = tool_axis(self.model, before), tool_axis(self.model, after)
        if self.loop is Loop.RELATIVE:
            carried = branch_pose(self.model, "workpiece", after) @ transforms.inverse(
                branch_pose(self.model, "workpiece", before)
            )
            start = transforms.apply(carried, start)
            aim = transforms.rotate(carried[..., :3, :3], aim)
        return nominal_point(self.model, Loop.TOOL, after) - start, np.cross(aim, end)

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
            for found, one, other in ((shifts, up[0], down[0]), (turns, up[1], down[1])):
                found.append(np.broadcast_to((one - other) / (2.0 * small), shape))
        none = np.zeros((*shape, 0))
        return (
            np.stack(shifts, -1) if shifts else none,
            np.stack(turns, -1) if turns else none,
        )


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
        "tool" or "relative"; by default relative where a linear axis carries the workpiece.
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
    carried = set(linear) & set(machine.chain.workpiece)
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


def field_after(
    corrector: Corrector,
    coordinates: Coordinates,
    moves: Mapping[str, Array],
    nominal_mm: Array,
    reference: Coordinates | None,
    reference_moves: Mapping[str, Array],
) -> ErrorField:
    """Give the error field that a compensation leaves, µm and µrad.

    Parameters
    ----------
    corrector : Corrector
    coordinates : mapping of str to ndarray, [...]
        Commanded positions.
    moves : mapping of str to ndarray
        What the controller adds.
    nominal_mm : ndarray, [..., 3], mm
    reference : mapping of str to ndarray or None
        The point held still, None for absolute errors.
    reference_moves : mapping of str to ndarray
        What the controller adds there.

    Returns
    -------
    ErrorField
    """
    position, orientation = corrector.residual(coordinates, moves)
    if reference is not None:
        position = position - corrector.residual(reference, reference_moves)[0]
    shape = np.broadcast_shapes(position.shape, nominal_mm.shape)
    return ErrorField(
        np.broadcast_to(nominal_mm, shape),
        np.broadcast_to(position, shape) * UM_PER_MM,
        np.broadcast_to(orientation, shape) * URAD_PER_RAD,
    )
