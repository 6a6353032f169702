"""The adjustments that help a scene most, and the scene with them."""

from collections.abc import Mapping
from dataclasses import replace

from warpspace.analysis.repair import RepairPlan, Repairs, find_repairs
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import amplitudes_of
from warpspace.field.grid import DEFAULT_NODES, build_grid
from warpspace.kinematics.model import Loop
from warpspace.machine.limits import MAX_TEXT, REPAIR_NODES
from warpspace.machine.parameters import parameter
from warpspace.scene.model import Scene
from warpspace.scene.pipeline import choose_view, grid_basis


def repair(
    scene: Scene,
    plan: RepairPlan | None = None,
    *,
    loop: Loop | str = Loop.TOOL,
    grid: int = DEFAULT_NODES,
) -> Repairs:
    """Find which errors of a scene to adjust, and to what.

    Parameters
    ----------
    scene : Scene
    plan : RepairPlan, optional
    loop : Loop or str, optional
    grid : int, optional
        Nodes per axis of the working volume.

    Returns
    -------
    Repairs

    Raises
    ------
    OptionError, UnknownNameError
        If an argument is out of range or names something that does not exist.
    """
    low, high = REPAIR_NODES
    if not low <= grid <= high:
        raise OptionError(f"grid: {grid} nodes; expected {low} to {high} per axis for a repair")
    nodes = build_grid(scene.model, scene.workspace, grid)
    basis = grid_basis(scene, nodes, choose_view(scene, loop))
    return find_repairs(basis, nodes, amplitudes_of(scene.errors, basis.keys), plan)


def repaired(scene: Scene, adjust: Mapping[str, float]) -> Scene:
    """Give a scene with some errors adjusted: new amplitudes by key, µm or µrad."""
    errors = scene.errors
    for key, value in adjust.items():
        errors = errors.with_amplitude(key, value, scene.axis_span(parameter(key).axis))
    return replace(scene, title=f"{scene.title}, repaired"[:MAX_TEXT], errors=errors)
