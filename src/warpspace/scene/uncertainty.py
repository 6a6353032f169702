"""What the standard uncertainties of a scene's errors do to its field, and to its |E|."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from warpspace.analysis import uncertain
from warpspace.analysis.draws import Distribution, loop_keys
from warpspace.analysis.montecarlo import MonteCarlo, Plan, Progress, Take
from warpspace.analysis.uncertain import FieldUncertainty
from warpspace.exceptions import SceneError
from warpspace.field.grid import DEFAULT_NODES, build_grid
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.machine.errors import ErrorFunction
from warpspace.scene.model import Scene
from warpspace.scene.pipeline import choose_view


def scene_uncertainty(scene: Scene, loop: Loop) -> Mapping[str, ErrorFunction]:
    """Collect the standard uncertainties of the errors that act in a loop of a scene.

    Raises
    ------
    SceneError
        If the scene has none.
    """
    if not scene.uncertainty:
        problem = "has no uncertainties; expected an [uncertainty] section, for instance EXX = 0.4"
        raise SceneError(scene.name, [problem])
    keys = loop_keys(scene.model, loop, tuple(scene.uncertainty))
    return {key: scene.uncertainty[key] for key in keys}


def evaluate_uncertainty(
    scene: Scene,
    *,
    at: Mapping[str, ArrayLike] | None = None,
    grid: int | Sequence[int] | None = None,
    loop: Loop | str = Loop.TOOL,
    frame: str = "machine",
) -> FieldUncertainty:
    """Propagate the standard uncertainties of a scene to its field, to first order.

    See `warpspace.scene.pipeline.evaluate` for the parameters.

    Returns
    -------
    FieldUncertainty
        Of the points that `evaluate` gives for the same arguments.

    Raises
    ------
    SceneError
        If the scene has no uncertainties.
    OptionError, UnknownNameError
        If an argument names something that does not exist.
    """
    view = choose_view(scene, loop, frame)
    own = scene_uncertainty(scene, view.loop)
    if at is not None:
        coordinates = complete_coordinates(scene.machine, at, scene.workspace.positions)
        return uncertain.field_uncertainty(scene.model, scene.errors, own, coordinates, view)
    nodes = build_grid(scene.model, scene.workspace, DEFAULT_NODES if grid is None else grid)
    return uncertain.field_uncertainty(
        scene.model, scene.errors, own, nodes.coordinates, view, nodes.point_mm
    )


def uncertain_montecarlo(
    scene: Scene,
    plan: Plan | None = None,
    *,
    loop: Loop | str = Loop.TOOL,
    distribution: Distribution | str = Distribution.NORMAL,
    progress: Progress | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    take: Take | None = None,
) -> MonteCarlo:
    """Sample what a measured machine may be: its errors, each off by its standard uncertainty.

    Parameters
    ----------
    scene : Scene
    plan : Plan, optional
    loop : Loop or str, optional
    distribution : Distribution or str, optional
        "normal", or "uniform" with the same standard uncertainty.
    progress : callable, optional
        Called with the number of machines done since the last call.
    workers, executor, take : optional
        See `warpspace.analysis.montecarlo.montecarlo_each`.

    Returns
    -------
    MonteCarlo

    Raises
    ------
    SceneError
        If the scene has no uncertainties.
    OptionError
        If an argument is out of range.
    """
    view = choose_view(scene, loop)
    return uncertain.uncertain_montecarlo(
        scene.model,
        scene.errors,
        scene_uncertainty(scene, view.loop),
        scene.workspace,
        view,
        plan,
        Distribution(distribution),
        progress,
        workers=workers,
        executor=executor,
        take=take,
    )


def flat_uncertainty(found: FieldUncertainty) -> FieldUncertainty:
    """Give the points of a field one below the other, [n, 3]."""
    return replace(
        found,
        error_um=found.error_um.reshape(-1, 3),
        norm_um=np.ravel(found.norm_um),
        orientation_urad=found.orientation_urad.reshape(-1, 3),
    )
