"""The working volume and the grid of axis positions laid over it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from math import prod
from operator import index as whole_number
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, carry_inwards, carry_outwards, nominal_point
from warpspace.kinematics.components import join, split
from warpspace.kinematics.model import Coordinates, Loop, Model, complete_coordinates
from warpspace.machine.axes import direction_index, is_linear, sort_axes
from warpspace.machine.limits import GRID_NODES
from warpspace.units import Array

NODES = 32_768  # points that are evaluated at a time: a number of each of them takes 256 kB

Piece: TypeAlias = tuple[slice, ...]  # one slice for each dimension of a batch
T = TypeVar("T")


def pieces(shape: tuple[int, ...]) -> Iterator[Piece]:
    """Cut a batch along its first dimensions into pieces of at most `NODES` points."""
    if not shape:
        yield ()
        return
    first, inner = shape[0], shape[1:]
    if prod(inner) > NODES:
        for index in range(first):
            for piece in pieces(inner):
                yield (slice(index, index + 1), *piece)
        return
    step = max(1, NODES // max(prod(inner), 1))
    for start in range(0, first, step):
        yield (slice(start, start + step), *(slice(None) for _ in inner))


def cut(array: Array, piece: Piece) -> Array:
    """Return the part of an array, [...] or broadcastable to it, that a piece needs."""
    trailing = piece[len(piece) - array.ndim :]
    return array[
        tuple(
            slice(None) if size == 1 else part
            for size, part in zip(array.shape, trailing, strict=True)
        )
    ]


def cut_all(values: T, piece: Piece) -> T:
    if isinstance(values, np.ndarray):
        return cast("T", cut(values, piece))
    if isinstance(values, tuple):
        parts = [cut_all(value, piece) for value in cast("tuple[object, ...]", values)]
        kind = cast("Any", type(values))
        return kind(*parts) if hasattr(kind, "_fields") else kind(parts)
    return values


DEFAULT_NODES = 21  # per axis, of every map and statistic of a volume unless stated otherwise
RESIDUAL_NODES = 28  # per axis, for residual errors: between the points of usual tables
MIN_NODES, MAX_NODES = GRID_NODES
DIMENSIONS = 3
VolumeAxes = tuple[str, str, str]
"""Axis along each direction of a volume; empty where there is none."""


def find_volume_axes(ranges: Mapping[str, tuple[float, float]]) -> VolumeAxes:
    """Find the axes that span a volume, by direction.

    Linear axes take the direction they move along; rotary ones with a range take the free ones, in
    the order of their names: the volume of a robot with two rotary axes in series is curved.
    """
    slots = ["", "", ""]
    for axis in sort_axes(axis for axis, (low, high) in ranges.items() if low < high):
        directions = [direction_index(axis)] if is_linear(axis) else range(DIMENSIONS)
        free = [slot for slot in directions if not slots[slot]]
        if not free:
            names = ", ".join(slots[slot] for slot in directions)
            expected = "expected one position for one of them"
            raise OptionError(f"{axis} has a range in addition to {names}; {expected}")
        slots[free[0]] = axis
    return slots[0], slots[1], slots[2]


@dataclass(frozen=True, slots=True)
class Workspace:
    """Axis coordinates of the working volume, and the positions at which it is drawn."""

    # mm or degrees; lower and upper end per axis; equal for a fixed axis
    ranges: Mapping[str, tuple[float, float]]

    @property
    def positions(self) -> dict[str, float]:
        """Position of fixed axes, the middle of the range of the others."""
        return {axis: (low + high) / 2.0 for axis, (low, high) in self.ranges.items()}

    @property
    def volume_axes(self) -> VolumeAxes:
        """Axes that span the volume, by direction; see `find_volume_axes`."""
        return find_volume_axes(self.ranges)

    def moved(self, positions: Mapping[str, float]) -> "Workspace":
        """Return the workspace with some axes fixed at other positions, mm or degrees."""
        moved = {axis: (value, value) for axis, value in positions.items()}
        return Workspace({**self.ranges, **moved})


@dataclass(frozen=True)
class Grid:
    """Nodes of the working volume."""

    coordinates: dict[str, Array]  # mm or degrees; axis positions, shaped to broadcast to `shape`
    shape: tuple[int, int, int]  # nodes along x, y and z of the volume
    # [nx, ny, nz, 3]; where each node is drawn: the nominal tool point as the workpiece sees it, in
    # R while the linear axes that carry the workpiece stand in the middle of their ranges
    nominal_mm: Array
    # [nx, ny, nz, 3]; nominal tool point in R at each node, where its error is evaluated. The same
    # as `nominal_mm` on a machine whose linear axes all carry the tool.
    point_mm: Array
    # the axis that runs along each direction of the grid; empty where there is one node
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
    def directions(self) -> Array:
        """Direction of the nodes along x, y and z, [3]: +1, or −1 from upper to lower."""
        along = self.nominal_mm[-1, -1, -1] - self.nominal_mm[0, 0, 0]
        return np.where(along < 0.0, -1.0, 1.0)

    @cached_property
    def weights(self) -> Array:
        """Share of the volume that belongs to each node, [nx, ny, nz], trapezoidal; sums to 1."""
        x, y, z = map(shares, self.shape)
        return x[:, None, None] * y[:, None] * z

    @cached_property
    def extent_mm(self) -> Array:
        """Edge lengths of the nominal volume in R, [3], mm."""
        return self.bounds_mm[1] - self.bounds_mm[0]

    @cached_property
    def longest_edge_mm(self) -> float:
        """Longest edge of the nominal volume, mm."""
        return float(self.extent_mm.max())


def shares(count: int) -> Array:
    """Compute the share of an axis of each of its points, trapezoidal, [n]."""
    weights = np.ones(count)
    if count > 1:
        weights[[0, -1]] = 0.5
    return weights / weights.sum()


def node_counts(nodes: int | Sequence[int]) -> tuple[int, int, int]:
    try:
        nodes_per_axis = nodes if isinstance(nodes, Sequence) else (nodes,) * DIMENSIONS
        counts = tuple(map(whole_number, nodes_per_axis))
    except TypeError:
        raise OptionError(f"grid: {nodes!r}; expected whole numbers of nodes") from None
    if len(counts) != DIMENSIONS or any(not MIN_NODES <= n <= MAX_NODES for n in counts):
        text = " × ".join(map(str, counts)) if isinstance(nodes, Sequence) else nodes
        raise OptionError(f"grid: {text} nodes; expected {MIN_NODES} to {MAX_NODES} per axis")
    return counts[0], counts[1], counts[2]


def build_grid(
    model: Model, workspace: Workspace, nodes: int | Sequence[int] = DEFAULT_NODES
) -> Grid:
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
    in_workpiece = seen_from_workpiece(model, coordinates, workspace, point)
    return Grid(coordinates, full, in_workpiece, point, axes)


def seen_from_workpiece(
    model: Model, coordinates: Coordinates, workspace: Workspace, point_mm: Array
) -> Array:
    """Move points of R with the axes that carry the workpiece to the middle of their ranges."""
    axes, middle = workspace.volume_axes, workspace.positions
    branch = model.machine.branch("workpiece")
    carrying = [axis.name for axis in branch if axis.is_linear or axis.name in axes]
    if not carrying:
        return point_mm
    home = {**coordinates, **{name: np.asarray(middle.get(name, 0.0)) for name in carrying}}
    in_workpiece = np.empty_like(point_mm)
    for piece in pieces(point_mm.shape[:-1]):
        nodes = (*piece, slice(None))
        positions = {name: cut(values, piece) for name, values in coordinates.items()}
        home_positions = {name: cut(values, piece) for name, values in home.items()}
        point = carry_outwards(model, "workpiece", positions, split(point_mm[nodes]))
        join(carry_inwards(model, "workpiece", home_positions, point), in_workpiece[nodes])
    return in_workpiece


# A slice at any position is a grid of n × 1 × m nodes with one axis fixed, so that its
# errors come from the model and not from interpolation between the nodes of the volume.

PLANES: Mapping[str, str] = {"X": "YZ", "Y": "XZ", "Z": "XY"}


def slice_ranges(model: Model, workspace: Workspace) -> dict[str, tuple[float, float]]:
    spanning = [axis for axis in workspace.volume_axes if axis in model.machine.axes]
    if tuple(spanning) != tuple(PLANES):
        return {}
    return {axis: workspace.ranges[axis] for axis in spanning}


def build_slice(
    model: Model,
    workspace: Workspace,
    axis: str,
    position_mm: float,
    nodes: int = DEFAULT_NODES,
) -> Grid:
    ranges = slice_ranges(model, workspace)
    if axis not in ranges:
        raise UnknownNameError("axis of a slice", axis, ranges)
    low, high = ranges[axis]
    if not low <= position_mm <= high:
        raise OptionError(f"slice at {axis} = {position_mm:g} mm; expected {low:g} to {high:g} mm")
    grid = build_grid(model, workspace.moved({axis: position_mm}), nodes)
    if axis not in {carried.name for carried in model.machine.branch("workpiece")}:
        return grid
    # the slice is drawn where the whole volume is: with the table in the middle of its range
    pose, home = (
        branch_pose(model, "workpiece", complete_coordinates(model.machine, volume.positions))
        for volume in (workspace.moved({axis: position_mm}), workspace)
    )
    step = home @ transforms.inverse(pose)
    return replace(grid, nominal_mm=transforms.apply(step, grid.nominal_mm))


# --- Values in cells of a volume ------------------------------------------------------------------

CELLS = 40  # about as many cells per axis; a coarse grid is subdivided


def cell_values(values: Array) -> Array:
    """Interpolate values at nodes, [x, y, z], to the middles of cells that are equally large."""
    x, y, z = (_to_cells(nodes) for nodes in values.shape)
    mean = y @ (values @ z.T)
    return np.tensordot(x, mean, axes=1)


@cache
def _to_cells(nodes: int) -> Array:
    if nodes == 1:
        return np.ones((1, 1))
    parts = max(1, round(CELLS / (nodes - 1)))
    share = (np.arange(parts) + 0.5) / parts
    weights = np.zeros((nodes - 1, parts, nodes))
    for cell in range(nodes - 1):
        weights[cell, :, cell], weights[cell, :, cell + 1] = 1.0 - share, share
    return weights.reshape(-1, nodes)
