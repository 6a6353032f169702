"""The working volume and the grid of axis positions laid over it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import index as whole_number

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.pieces import cut, pieces
from warpspace.kinematics.chain import carry_inwards, carry_outwards, nominal_point
from warpspace.kinematics.components import join, split
from warpspace.kinematics.model import Coordinates, Loop, Model
from warpspace.machine.axes import direction_index, is_linear, sort_axes
from warpspace.machine.limits import GRID_NODES
from warpspace.units import Array

DEFAULT_NODES = 21
MIN_NODES, MAX_NODES = GRID_NODES
DIMENSIONS = 3
VolumeAxes = tuple[str, str, str]
"""The axis that runs along each direction of a volume; empty where none does."""


def find_volume_axes(ranges: Mapping[str, tuple[float, float]]) -> VolumeAxes:
    """Find the axes that span a volume, by direction.

    Linear axes take the direction they move along; rotary ones with a range take what is left, in
    the order of their names: the volume of a robot with two rotary axes in series is curved.

    Parameters
    ----------
    ranges : mapping of str to tuple of float, (2,), mm or degrees

    Returns
    -------
    tuple of str, (3,)
        Empty where no axis runs along a direction.

    Raises
    ------
    OptionError
        If two linear axes with a range move along one direction, or more than three have one.
    """
    slots = ["", "", ""]
    for axis in sort_axes(axis for axis, (low, high) in ranges.items() if low < high):
        wanted = [direction_index(axis)] if is_linear(axis) else range(DIMENSIONS)
        free = [slot for slot in wanted if not slots[slot]]
        if not free:
            taken = ", ".join(slots[slot] for slot in wanted)
            expected = "expected one position for one of them"
            raise OptionError(f"{axis} has a range beside {taken}; {expected}")
        slots[free[0]] = axis
    return slots[0], slots[1], slots[2]


@dataclass(frozen=True, slots=True)
class Workspace:
    """Axis coordinates of the working volume, and the positions it is drawn at.

    Attributes
    ----------
    ranges : mapping of str to tuple of float, (2,), mm or degrees
        Lower and upper end per axis; equal where the axis stands still.
    """

    ranges: Mapping[str, tuple[float, float]]

    @property
    def positions(self) -> dict[str, float]:
        """Position of the axes that stand still, the middle of those that move."""
        return {axis: (low + high) / 2.0 for axis, (low, high) in self.ranges.items()}

    @property
    def volume_axes(self) -> VolumeAxes:
        """Axes that span the volume, by direction; see `find_volume_axes`."""
        return find_volume_axes(self.ranges)

    def moved(self, positions: Mapping[str, float]) -> "Workspace":
        """Give the workspace with some axes standing at other positions, mm or degrees."""
        moved = {axis: (value, value) for axis, value in positions.items()}
        return Workspace({**self.ranges, **moved})


@dataclass(frozen=True)
class Grid:
    """Nodes of the working volume.

    Attributes
    ----------
    coordinates : dict of str to ndarray, mm or degrees
        Axis positions, shaped to broadcast to `shape`.
    shape : tuple of int, (3,)
        Nodes along x, y and z of the volume.
    nominal_mm : ndarray, [nx, ny, nz, 3], mm
        Where each node is drawn: the nominal tool point as the workpiece sees it, in R while the
        linear axes that carry the workpiece stand in the middle of their ranges.
    point_mm : ndarray, [nx, ny, nz, 3], mm
        Nominal tool point in R at each node, where its error is evaluated. The same as
        `nominal_mm` on a machine whose linear axes all carry the tool.
    axes : tuple of str, (3,)
        The axis that runs along each direction of the grid; empty where there is one node.
    """

    coordinates: dict[str, Array]
    shape: tuple[int, int, int]
    nominal_mm: Array
    point_mm: Array
    axes: VolumeAxes = ("X", "Y", "Z")

    @cached_property
    def bounds_mm(self) -> Array:
        """Lower and upper corner of the nominal volume in R, [2, 3], mm."""
        steps = [max(n - 1, 1) for n in self.shape]
        if any(axis and not is_linear(axis) for axis in self.axes):  # its faces are curved
            steps = [1, 1, 1]
        x, y, z = steps
        corners = self.nominal_mm[::x, ::y, ::z].reshape(-1, 3)
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    @cached_property
    def ways(self) -> Array:
        """Which way the nodes run along x, y and z, [3]: +1, or −1 where from upper to lower."""
        along = self.nominal_mm[-1, -1, -1] - self.nominal_mm[0, 0, 0]
        return np.where(along < 0.0, -1.0, 1.0)

    @cached_property
    def weights(self) -> Array:
        """Share of the volume that belongs to each node, [nx, ny, nz], trapezoidal; sums to 1."""
        weights = np.ones(())
        for nodes in self.shape:
            along = np.ones(nodes)
            if nodes > 1:
                along[[0, -1]] = 0.5
            weights = weights[..., None] * (along / along.sum())
        return weights

    @cached_property
    def extent_mm(self) -> Array:
        """Edge lengths of the nominal volume in R, [3], mm."""
        return self.bounds_mm[1] - self.bounds_mm[0]

    @cached_property
    def longest_edge_mm(self) -> float:
        """Longest edge of the nominal volume, mm."""
        return float(self.extent_mm.max())


def node_counts(nodes: int | Sequence[int]) -> tuple[int, int, int]:
    """Check the number of nodes per axis.

    Parameters
    ----------
    nodes : int or sequence of int, (3,)

    Returns
    -------
    tuple of int, (3,)

    Raises
    ------
    OptionError
        If a count is outside 2 … 101.
    """
    try:
        counts = _counts(nodes)
    except TypeError:
        raise OptionError(f"grid: {nodes!r}; expected whole numbers of nodes") from None
    if len(counts) != DIMENSIONS or any(not MIN_NODES <= n <= MAX_NODES for n in counts):
        given = " × ".join(map(str, counts)) if isinstance(nodes, Sequence) else nodes
        raise OptionError(f"grid: {given} nodes; expected {MIN_NODES} to {MAX_NODES} per axis")
    return counts[0], counts[1], counts[2]


def _counts(nodes: int | Sequence[int]) -> tuple[int, ...]:
    """Give one whole number per linear axis, whatever kind of integer was given."""
    if isinstance(nodes, Sequence):
        return tuple(map(whole_number, nodes))
    return (whole_number(nodes),) * DIMENSIONS


def build_grid(
    model: Model, workspace: Workspace, nodes: int | Sequence[int] = DEFAULT_NODES
) -> Grid:
    """Lay a grid over the working volume.

    Parameters
    ----------
    model : Model
    workspace : Workspace
        Axes with a range are gridded; every other axis stands at its position.
    nodes : int or sequence of int, (3,), optional
        Nodes along x, y and z; a direction that no axis runs along has one.

    Returns
    -------
    Grid

    Raises
    ------
    OptionError
        If the number of nodes is out of range, or the axes span no volume.
    """
    counts = node_counts(nodes)
    axes = workspace.volume_axes
    positions = workspace.positions
    coordinates = {name: np.asarray(positions.get(name, 0.0)) for name in model.machine.axes}
    shape = [1, 1, 1]
    for index, name in enumerate(axes):
        if name not in model.machine.axes:
            continue
        low, high = workspace.ranges[name]
        shape[index] = counts[index]
        along = [1, 1, 1]
        along[index] = counts[index]
        coordinates[name] = np.linspace(low, high, counts[index]).reshape(along)
    full = (shape[0], shape[1], shape[2])
    point = np.broadcast_to(nominal_point(model, Loop.TOOL, coordinates), (*full, 3)).copy()
    seen = seen_from_workpiece(model, coordinates, workspace, point)
    return Grid(coordinates, full, seen, point, axes)


def seen_from_workpiece(
    model: Model, coordinates: Coordinates, workspace: Workspace, point_mm: Array
) -> Array:
    """Move points with the axes that carry the workpiece back to the middle of their ranges.

    Parameters
    ----------
    model : Model
    coordinates : mapping of str to ndarray, [...], mm or degrees
        Where the axes stand.
    workspace : Workspace
        Linear axes that carry the workpiece go back, and rotary ones that span this volume.
    point_mm : ndarray, [..., 3], mm
        In R.

    Returns
    -------
    ndarray, [..., 3], mm
        Where they are drawn; see `Grid.nominal_mm`.
    """
    axes, middle = workspace.volume_axes, workspace.positions
    branch = model.machine.branch("workpiece")
    carrying = [axis.name for axis in branch if axis.is_linear or axis.name in axes]
    if not carrying:
        return point_mm
    home = {**coordinates, **{name: np.asarray(middle.get(name, 0.0)) for name in carrying}}
    seen = np.empty_like(point_mm)
    for piece in pieces(point_mm.shape[:-1]):
        nodes = (*piece, slice(None))
        here = {name: cut(values, piece) for name, values in coordinates.items()}
        there = {name: cut(values, piece) for name, values in home.items()}
        point = carry_outwards(model, "workpiece", here, split(point_mm[nodes]))
        join(carry_inwards(model, "workpiece", there, point), seen[nodes])
    return seen
