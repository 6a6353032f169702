"""The whole flow in one screenful: scene → coordinates → basis or exact chain → field → numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from warpspace.exceptions import OptionError
from warpspace.field.basis import ErrorBasis, ErrorField
from warpspace.field.evaluate import (
    View,
    build_basis,
    error_values,
    evaluate_exact,
    evaluate_first_order,
)
from warpspace.field.grid import DEFAULT_NODES, Grid, build_grid
from warpspace.kinematics.model import Coordinates, Loop, complete_coordinates
from warpspace.machine.parameters import parameter
from warpspace.machine.travel import TravelDirection
from warpspace.scene.model import Scene
from warpspace.scene.schema import MAX_ERROR

FRAMES = ("machine", "workpiece")


def evaluate(
    scene: Scene,
    *,
    at: Mapping[str, ArrayLike] | None = None,
    grid: int | Sequence[int] | None = None,
    loop: Loop | str = Loop.TOOL,
    exact: bool = False,
    frame: str = "machine",
) -> ErrorField:
    """Evaluate the error field of a scene at points or over the grid of its working volume.

    Parameters
    ----------
    scene : Scene
    at : mapping of str to array_like, [...], mm or degrees, optional
        Axis positions; an axis that is not given stands at its position in the scene's workspace,
        the middle of a range. Without it the grid is evaluated.
    grid : int or sequence of int, (3,), optional
        Nodes per axis of the working volume; 21 by default.
    loop : Loop or str, optional
        "tool", "workpiece" or "relative". At points the workpiece loop takes the scene's functional
        workpiece point; over the grid the workpiece points that nominally coincide with the nodes.
    exact : bool, optional
        Full rotations and all products instead of the first order.
    frame : str, optional
        "machine" for results in R, "workpiece" for the nominal workpiece frame.

    Returns
    -------
    ErrorField
        Arrays of shape [..., 3], the batch being that of `at` or of the grid.

    Raises
    ------
    OptionError, UnknownNameError
        If an argument names something that does not exist.

    Examples
    --------
    >>> from warpspace import load_scene
    >>> scene = load_scene("dvf5000_first")
    >>> corner = evaluate(scene, at={"X": 275, "Y": -225, "Z": -480})
    >>> [round(float(part), 2) for part in corner.error_um]
    [3.94, 49.81, -13.39]
    >>> evaluate(scene, grid=11).error_um.shape
    (11, 11, 11, 3)
    """
    if at is not None and grid is not None:
        raise OptionError("give either points (at) or a grid, not both")
    view = choose_view(scene, loop, frame)
    if at is not None:
        solve = evaluate_exact if exact else evaluate_first_order
        given = complete_coordinates(scene.machine, at, scene.workspace.positions)
        _check_magnitude(scene, given)
        return solve(scene.model, scene.errors, given, view)
    nodes = build_grid(scene.model, scene.workspace, DEFAULT_NODES if grid is None else grid)
    return evaluate_grid(scene, nodes, view, exact=exact)


def evaluate_grid(scene: Scene, grid: Grid, view: View, *, exact: bool = False) -> ErrorField:
    """Evaluate the error field of a scene over a grid that is there already.

    Parameters
    ----------
    scene : Scene
    grid : Grid
    view : View
    exact : bool, optional

    Returns
    -------
    ErrorField
        Of the shape of the grid; its nominal points are where the nodes are drawn.
    """
    solve = evaluate_exact if exact else evaluate_first_order
    field = solve(scene.model, scene.errors, grid.coordinates, view, grid.point_mm)
    return replace(field, nominal_mm=grid.nominal_mm)


def _check_magnitude(scene: Scene, coordinates: Coordinates) -> None:
    """Refuse positions so far out that an error curve leaves what a rigid-body model holds."""
    for key, values in error_values(scene.model, scene.errors, coordinates).items():
        peak = np.abs(values).max(initial=0.0)
        if not peak <= MAX_ERROR:
            row = parameter(key)
            raise OptionError(
                f"{key} reaches {peak:.3g} {row.unit} at the positions given for {row.axis};"
                f" expected at most ±{MAX_ERROR:g}"
            )


def in_direction(scene: Scene, direction: str | None) -> Scene:
    """Give a scene whose errors are looked at for a direction of travel.

    Parameters
    ----------
    scene : Scene
    direction : str or None
        One of `TravelDirection`; None for that of the scene.

    Raises
    ------
    OptionError
        If there is no such direction.
    """
    if direction is None:
        return scene
    if direction not in [*TravelDirection]:
        known = ", ".join(TravelDirection)
        raise OptionError(f"direction {direction!r}; expected one of {known}")
    return replace(scene, model=replace(scene.model, direction=TravelDirection(direction)))


def choose_view(scene: Scene, loop: Loop | str, frame: str = "machine") -> View:
    """Build a view of a scene from a user's words.

    Raises
    ------
    OptionError
        If the loop or the frame does not exist.
    """
    if loop not in [*Loop]:
        raise OptionError(f"loop {loop!r}; expected one of {', '.join(Loop)}")
    if frame not in FRAMES:
        raise OptionError(f"frame {frame!r}; expected one of {', '.join(FRAMES)}")
    return scene.view(Loop(loop), frame)


def grid_basis(
    scene: Scene, grid: Grid, view: View | None = None, keys: Sequence[str] | None = None
) -> ErrorBasis:
    """Compute the response of every node of a grid to parameters of a scene.

    Parameters
    ----------
    scene : Scene
    grid : Grid
    view : View, optional
        The tool loop by default.
    keys : sequence of str, optional
        All parameters of the scene by default.

    Returns
    -------
    ErrorBasis
    """
    basis = build_basis(
        scene.model,
        scene.errors,
        scene.parameter_keys if keys is None else keys,
        grid.coordinates,
        view or scene.view(),
        grid.point_mm,
    )
    return replace(basis, nominal_mm=grid.nominal_mm)


def linearisation_error_um(scene: Scene, grid: int = DEFAULT_NODES) -> float:
    """Largest difference between the exact chain and the first order over the grid, µm."""
    exact = evaluate(scene, grid=grid, exact=True)
    return float(np.abs(exact.error_um - evaluate(scene, grid=grid).error_um).max())
