"""The correction that a machine needs: by how much its axes are moved so that no error is left."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.basis import ErrorField
from warpspace.field.evaluate import View, evaluate_exact
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, nominal_point, tool_axis
from warpspace.kinematics.model import Coordinates, Loop, Model, batch_shape
from warpspace.machine.axes import is_linear
from warpspace.machine.errors import ErrorSet
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, RAD_PER_URAD, UM_PER_MM, URAD_PER_RAD, Array

STEPS = 2
"""Newton steps: an error grows by a hundred-thousandth of the correction at most."""
SMALL_MM, SMALL_DEG = 1e-2, 1e-3
"""Moves by which the response of the tool to an axis is measured."""
ARM_MM = 100.0
"""Length by which a tilt counts as a displacement where both are corrected together."""
CUT = 1e-3
"""Moves that shift the tool less than this share of the best one are not used."""
OTHER_NODES = 9
"""Positions of the other axes that a table of one axis is averaged over."""
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
        Axes that are corrected.
    orientation : bool
        Whether the tilt of the tool axis is corrected too, as far as the axes can.
    """

    model: Model
    errors: ErrorSet
    loop: Loop
    axes: tuple[str, ...]
    orientation: bool = False

    def residual(
        self, coordinates: Coordinates, moves: Mapping[str, Array]
    ) -> tuple[Array, Array]:
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
        total = np.zeros((*shape, len(self.axes)))
        back = np.linalg.pinv(self._response(coordinates), rcond=CUT)
        for _ in range(STEPS):
            left = self._stacked(self.residual(coordinates, self._by_axis(total)))
            total = total - np.einsum("...ij,...j->...i", back, left)
        return self._by_axis(total)

    def _by_axis(self, total: Array) -> dict[str, Array]:
        """Split moves, [..., K], by axis."""
        return {axis: total[..., index] for index, axis in enumerate(self.axes)}

    def _stacked(self, left: tuple[Array, Array]) -> Array:
        """Give position, and tilt times its arm, as one vector, mm."""
        position, orientation = left
        return np.concatenate([position, ARM_MM * orientation], -1) if self.orientation else position

    def _response(self, coordinates: Coordinates) -> Array:
        """Displacement and tilt of the tool per move of each axis, [..., 3 or 6, K]."""
        columns: list[Array] = []
        for axis in self.axes:
            small = SMALL_MM if is_linear(axis) else SMALL_DEG
            ends = [
                self._stacked(
                    self._nominal_motion(
                        coordinates, {**coordinates, axis: coordinates[axis] + way * small}
                    )
                )
                for way in (1.0, -1.0)
            ]
            columns.append((ends[0] - ends[1]) / (2.0 * small))
        shape = (*batch_shape(coordinates), columns[0].shape[-1])
        return np.stack([np.broadcast_to(column, shape) for column in columns], -1)


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
    axes = _independent(linear, scene) + (rotary if orientation else ())
    return Corrector(scene.model, scene.errors, chosen, axes, orientation)


def _independent(linear: Sequence[str], scene: Scene) -> tuple[str, ...]:
    """Keep one axis along each direction: the one that spans the volume."""
    from warpspace.machine.axes import direction_index

    spanning = scene.workspace.volume_axes
    found: dict[int, str] = {}
    for axis in sorted(linear, key=lambda name: name not in spanning):
        found.setdefault(direction_index(axis), axis)
    return tuple(axis for axis in linear if axis in found.values())


@dataclass(frozen=True)
class Wanted:
    """What a table is to correct, and how fine it may be.

    Attributes
    ----------
    scene : Scene
    corrector : Corrector
    points : mapping of str to int
        Points of the table along each axis of the volume.
    resolution : float
        Smallest step of a value, mm or degrees; 0 for as many digits as are printed.
    sign : str
        What the values are: "error" or "correction"; empty for what the format's manual says.
    stem : str
        Name of the files to write, without an ending.
    """

    scene: Scene
    corrector: Corrector
    points: Mapping[str, int]
    resolution: float = 0.0
    sign: str = ""
    stem: str = "compensation"

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes that span the volume, in the order of the machine."""
        spanning = self.scene.workspace.volume_axes
        return tuple(axis for axis in self.scene.machine.axes if axis in spanning)

    def places(self, axis: str) -> Array:
        """Give the positions of a table along an axis, equal steps over the working volume."""
        return np.linspace(*self.scene.workspace.ranges[axis], self.points[axis])

    def factor(self, usual: str) -> float:
        """Give the factor from a correction to a number of the table."""
        return -1.0 if (self.sign or usual) == "error" else 1.0

    def round(self, values: Array) -> Array:
        """Round values to the resolution."""
        step = self.resolution
        return np.round(values / step) * step if step else np.asarray(values)

    def toward(self, direction: str) -> "Wanted":
        """Give what is wanted for one direction of travel, "forward" or "backward"."""
        model = replace(self.corrector.model, direction=direction)
        return replace(self, corrector=replace(self.corrector, model=model))

    def corrections(self, places: Mapping[str, Array]) -> dict[str, Array]:
        """Give the corrections of all axes on a grid of places along the axes of the volume.

        Parameters
        ----------
        places : mapping of str to ndarray, (n,)

        Returns
        -------
        dict of str to ndarray, [n1, n2, …]
            In the order of `axes`.
        """
        still = self.scene.workspace.positions
        meshed = np.meshgrid(*(places[axis] for axis in self.axes), indexing="ij")
        coordinates = {name: np.asarray(still[name]) for name in self.scene.machine.axes}
        coordinates |= dict(zip(self.axes, meshed, strict=True))
        return self.corrector.moves(coordinates)

    def averaged(self, kept: Sequence[str]) -> dict[str, Array]:
        """Give the corrections over some axes, averaged over the volume along all others.

        Parameters
        ----------
        kept : sequence of str
            In the order of `axes`.

        Returns
        -------
        dict of str to ndarray, [n1, …]
            By corrected axis: the table of these axes that leaves the smallest RMS.
        """
        places = {
            axis: self.places(axis)
            if axis in kept
            else np.linspace(*self.scene.workspace.ranges[axis], OTHER_NODES)
            for axis in self.axes
        }
        weights = np.ones(OTHER_NODES)
        weights[[0, -1]] = 0.5
        weights /= weights.sum()
        found = self.corrections(places)
        for index in reversed(range(len(self.axes))):
            if self.axes[index] not in kept:
                found = {
                    axis: np.tensordot(value, weights, axes=([index], [0]))
                    for axis, value in found.items()
                }
        return found


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
