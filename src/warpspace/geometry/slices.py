"""Planar slices through the working volume: grids of their own, evaluated where they lie.

A slice at any position is a grid of n × 1 × m nodes with one axis standing still, so that its
errors come from the model and not from interpolation between the nodes of the volume.
"""

from collections.abc import Mapping
from dataclasses import replace

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.field.grid import DEFAULT_NODES, Grid, Workspace, build_grid
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Model, complete_coordinates

PLANES: Mapping[str, str] = {"X": "YZ", "Y": "XZ", "Z": "XY"}
"""Axis that stands still, and the plane it leaves."""


def slice_ranges(model: Model, workspace: Workspace) -> dict[str, tuple[float, float]]:
    """List where slices can lie.

    Parameters
    ----------
    model : Model
    workspace : Workspace

    Returns
    -------
    dict of str to tuple of float, (2,), mm
        Lower and upper position of the axis that stands still; axes that do not move in the
        workspace are left out, and all of them where X, Y and Z do not span the volume.
    """
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
    """Lay a grid over one plane of the working volume.

    Parameters
    ----------
    model : Model
    workspace : Workspace
    axis : str
        X, Y or Z: the axis that stands still.
    position_mm : float, mm
        Where it stands, within its range.
    nodes : int, optional
        Nodes along each of the other two axes.

    Returns
    -------
    Grid
        One node along the axis of the slice.

    Raises
    ------
    UnknownNameError
        If the volume has no slice across such an axis.
    OptionError
        If the position is outside the volume.
    """
    ranges = slice_ranges(model, workspace)
    if axis not in ranges:
        raise UnknownNameError("axis of a slice", axis, ranges)
    low, high = ranges[axis]
    if not low <= position_mm <= high:
        raise OptionError(f"slice at {axis} = {position_mm:g} mm; expected {low:g} to {high:g} mm")
    grid = build_grid(model, workspace.moved({axis: position_mm}), nodes)
    if axis not in {found.name for found in model.machine.branch("workpiece")}:
        return grid
    # the slice is drawn where the whole volume is: with the table in the middle of its range
    here, home = (
        branch_pose(model, "workpiece", complete_coordinates(model.machine, positions))
        for positions in (
            workspace.moved({axis: position_mm}).positions,
            workspace.positions,
        )
    )
    return replace(
        grid,
        nominal_mm=transforms.apply(home @ transforms.inverse(here), grid.nominal_mm),
    )
