"""Where sampled machines are looked at: the working volume, or the largest workpiece."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from warpspace.exceptions import OptionError
from warpspace.field.grid import Workspace, build_grid, node_counts
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, nominal_point
from warpspace.kinematics.model import Loop, Model, complete_coordinates
from warpspace.machine.axes import is_linear, is_rotary
from warpspace.units import Array

MAX_CYLINDER_MM = 1e5
FULL_TURN = 360.0
AVERAGE_POWER = 14
ROTARY_PARTS = 16


@dataclass(frozen=True, slots=True)
class Cylinder:
    """The largest workpiece: a cylinder standing on the origin of the workpiece frame.

    Attributes
    ----------
    diameter_mm, height_mm : float, mm
    """

    diameter_mm: float
    height_mm: float

    def __str__(self) -> str:
        """Write its size."""
        return f"Ø{self.diameter_mm:g} × {self.height_mm:g} mm"


@dataclass(frozen=True, slots=True)
class Places:
    """Positions of a machine and the points looked at there.

    Attributes
    ----------
    coordinates : dict of str to ndarray, [...], mm or degrees
    point_mm : ndarray, [..., 3], mm
        Nominal points in R.
    weights : ndarray, [N], or None
        What each point counts for in a mean over the volume, in the order of the points; None
        where all count alike.
    """

    coordinates: dict[str, Array]
    point_mm: Array
    weights: Array | None = None


def choose_cylinder(model: Model, cylinder: Cylinder | None = None) -> Cylinder:
    """Give the cylinder that workpiece points are spread over.

    Parameters
    ----------
    model : Model
        Its functional workpiece point is taken as a point of the top rim of the largest workpiece;
        (0, 275, 450) mm on the DVF5000, hence Ø550 × 450 mm.
    cylinder : Cylinder, optional
        A user's own.

    Returns
    -------
    Cylinder

    Raises
    ------
    OptionError
        If it is empty or absurd, or none is given and the workpiece point stands for none.
    """
    if cylinder is None:
        x, y, z = model.workpiece_point_mm
        cylinder = Cylinder(2.0 * math.hypot(x, y), z)
        if not (cylinder.diameter_mm > 0.0 and cylinder.height_mm > 0.0):
            raise OptionError(
                f"the workpiece point {model.workpiece_point_mm} mm of the scene is no point on the"
                " top rim of a workpiece; expected the size of the largest workpiece,"
                " --cylinder DIAMETERxHEIGHT in mm"
            )
    for name, value in (("diameter", cylinder.diameter_mm), ("height", cylinder.height_mm)):
        if not 0.0 < value <= MAX_CYLINDER_MM:
            raise OptionError(f"cylinder: {name} {value:g} mm; expected above 0, at most 100000")
    return cylinder


def random_places(
    model: Model,
    loop: Loop,
    workspace: Workspace,
    cylinder: Cylinder | None,
    rng: np.random.Generator,
    count: int,
) -> Places:
    """Spread points uniformly.

    Tool and relative loop: over the working volume, other axes at their place in the workspace.
    Workpiece loop: over the volume of the cylinder in the workpiece frame, its rotary axes over
    their travel.

    Parameters
    ----------
    model : Model
    loop : Loop
    workspace : Workspace
    cylinder : Cylinder or None
        Needed for the workpiece loop only.
    rng : numpy.random.Generator
    count : int

    Returns
    -------
    Places
        Of shape [count].
    """
    ranges = moving_ranges(model, loop, workspace)
    unit = rng.random((count, len(ranges) + (3 if loop is Loop.WORKPIECE else 0)))
    return _places(model, loop, workspace, cylinder, unit)


def spread_places(
    model: Model, loop: Loop, workspace: Workspace, cylinder: Cylinder | None, nodes: int
) -> Places:
    """Give the nodes that a mean over the points of one machine is taken over.

    The grid of the working volume, each node with its share of the volume. For the workpiece loop
    nodes³ low-discrepancy points (Sobol sequence) over cylinder and rotary travel, since a
    five-dimensional grid would be either coarse or huge.

    Returns
    -------
    Places
        Of shape [nodes, nodes, nodes] or [nodes³]; see `random_places` for the parameters.
    """
    if loop is not Loop.WORKPIECE:
        grid = build_grid(model, workspace, nodes)
        return Places(grid.coordinates, grid.nominal_mm, grid.weights.reshape(-1))
    count = node_counts(nodes)[0] ** 3
    dimensions = len(moving_ranges(model, loop, workspace)) + 3
    # Whole powers of two keep the balance of the sequence; the surplus is cut off.
    power = math.ceil(math.log2(count))
    unit = qmc.Sobol(dimensions, scramble=True, rng=0).random_base2(power)[:count]
    return _places(model, loop, workspace, cylinder, unit)


def extreme_places(
    model: Model, loop: Loop, workspace: Workspace, cylinder: Cylinder | None, nodes: int
) -> Places:
    """Give the nodes among which one machine's largest error is.

    For constant parameters E is affine in the linear axes and in the point of the workpiece, so
    that |E| is convex in them and largest at a corner of the volume or on a rim of the cylinder:
    those give exactly the maximum over any grid. Rotary axes, and the angle round the rim, are
    covered with `nodes` positions.

    Returns
    -------
    Places
        Of shape [M]; see `random_places` for the parameters.
    """
    node_counts(nodes)
    ranges = moving_ranges(model, loop, workspace)
    along = {
        name: _rotary_nodes(low, high, nodes) if is_rotary(name) else np.array([low, high])
        for name, (low, high) in ranges.items()
    }
    if loop is not Loop.WORKPIECE:
        axes = dict(zip(along, np.meshgrid(*along.values()), strict=True))
        coordinates = complete_coordinates(model.machine, axes, workspace.positions)
        flat = {name: np.ravel(values) for name, values in coordinates.items()}
        return Places(flat, nominal_point(model, Loop.TOOL, flat))
    size = choose_cylinder(model, cylinder)
    turn = _rotary_nodes(0.0, FULL_TURN, nodes)
    mesh = np.meshgrid(*along.values(), np.array([0.0, size.height_mm]), turn)
    *moving, height, angle = (values.ravel() for values in mesh)
    axes = dict(zip(along, moving, strict=True))
    return _on_workpiece(model, workspace, axes, (size.diameter_mm / 2.0, angle, height))


def average_places(
    model: Model, loop: Loop, workspace: Workspace, cylinder: Cylinder | None
) -> Places:
    """Give places whose plain mean is the mean over all points of anything quadratic in them.

    Two Gauss points per linear axis, which is exact for the square of an error, and the middles of
    16 parts of the range of a rotary one; for the workpiece loop 2¹⁴ points of a Sobol sequence,
    which is good to about 0.01 %.

    Returns
    -------
    Places
        Of shape [M]; see `random_places` for the parameters.
    """
    if loop is Loop.WORKPIECE:
        dimensions = len(moving_ranges(model, loop, workspace)) + 3
        unit = qmc.Sobol(dimensions, scramble=True, rng=0).random_base2(AVERAGE_POWER)
    else:
        gauss = 0.5 + np.array([-0.5, 0.5]) / math.sqrt(3.0)
        middles = (np.arange(ROTARY_PARTS) + 0.5) / ROTARY_PARTS
        axes = moving_ranges(model, loop, workspace)
        mesh = np.meshgrid(*(gauss if is_linear(name) else middles for name in axes))
        unit = np.stack([values.ravel() for values in mesh], -1) if axes else np.zeros((1, 0))
    return _places(model, loop, workspace, cylinder, unit)


def moving_ranges(model: Model, loop: Loop, workspace: Workspace) -> dict[str, tuple[float, float]]:
    """Give the axes that vary, and over which range.

    Parameters
    ----------
    model : Model
    loop : Loop
    workspace : Workspace

    Returns
    -------
    dict of str to tuple of float, (2,), mm or degrees
        The axes that span the working volume; for the workpiece loop the axes that carry the
        workpiece, rotary ones over their travel.
    """
    if loop is not Loop.WORKPIECE:
        return {
            name: span
            for name, span in workspace.ranges.items()
            if name in model.machine.axes and span[0] < span[1]
        }
    return {
        axis.name: workspace.ranges[axis.name] if axis.is_linear else axis.travel
        for axis in model.machine.branch("workpiece")
    }


def _rotary_nodes(low: float, high: float, nodes: int) -> Array:
    """Spread positions over a rotary range; a full turn has its end once."""
    full = high - low >= FULL_TURN
    return np.linspace(low, low + FULL_TURN if full else high, nodes, endpoint=not full)


def _places(
    model: Model, loop: Loop, workspace: Workspace, cylinder: Cylinder | None, unit: Array
) -> Places:
    """Turn numbers between 0 and 1, [n, dimensions], into places."""
    ranges = moving_ranges(model, loop, workspace)
    axes = {
        name: low + (high - low) * unit[:, index]
        for index, (name, (low, high)) in enumerate(ranges.items())
    }
    if loop is not Loop.WORKPIECE:
        coordinates = complete_coordinates(model.machine, axes, workspace.positions)
        return Places(coordinates, nominal_point(model, Loop.TOOL, coordinates))
    size = choose_cylinder(model, cylinder)
    radius = size.diameter_mm / 2.0 * np.sqrt(unit[:, -3])
    point = (radius, FULL_TURN * unit[:, -2], size.height_mm * unit[:, -1])
    return _on_workpiece(model, workspace, axes, point)


def _on_workpiece(
    model: Model,
    workspace: Workspace,
    axes: dict[str, Array],
    point: tuple[Array | float, Array, Array],
) -> Places:
    """Place points of the workpiece, given as radius [mm], angle [degrees] and height [mm]."""
    coordinates = complete_coordinates(model.machine, axes, workspace.positions)
    radius, degrees, height = point
    angle = np.deg2rad(degrees)
    local = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], -1)
    pose = branch_pose(model, "workpiece", coordinates)
    return Places(coordinates, transforms.apply(pose, local))
