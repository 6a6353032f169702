"""Several machines side by side with the same tolerances, to choose between concepts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from string import ascii_uppercase

import numpy as np

from warpspace.analysis import contributions as variances
from warpspace.analysis import montecarlo as sampling
from warpspace.analysis.draws import Distribution
from warpspace.analysis.nodes import Over
from warpspace.exceptions import OptionError, SceneError
from warpspace.field.basis import ErrorField
from warpspace.field.evaluate import build_basis
from warpspace.field.grid import Grid
from warpspace.kinematics.model import Loop
from warpspace.machine.errors import ErrorSet
from warpspace.machine.limits import MOST_CONCEPTS
from warpspace.machine.parameters import parameter
from warpspace.machine.tolerances import TOLERANCE_CLASSES, ToleranceSet
from warpspace.scene import verbs
from warpspace.scene.model import Scene
from warpspace.scene.pipeline import choose_view
from warpspace.units import Array

NAMED = 3
"""Errors that are named of each machine."""
LETTERS = ascii_uppercase[:MOST_CONCEPTS]
"""What the machines are called, in their order."""


@dataclass(frozen=True, slots=True)
class ConceptPlan:
    """How machines are compared.

    Attributes
    ----------
    limit_um : float or None, µm
        Of |E|, whose probability is asked for.
    own_tolerances : bool
        Whether each scene has its own tolerances; else all have those of the first one by class.
    samples, seed : int
    distribution : Distribution or str
    clip : bool
        Whether the normal distribution ends at the limits.
    over : Over or str
        |E| at one random point of each sampled machine, or its largest over the volume.
    workers : int or None
        Threads that sample; None for one per core. The numbers are the same.
    """

    limit_um: float | None = None
    own_tolerances: bool = False
    samples: int = sampling.DEFAULT_SAMPLES
    seed: int = 0
    distribution: Distribution | str = Distribution.UNIFORM
    clip: bool = False
    over: Over | str = Over.SAMPLED
    workers: int | None = None


@dataclass(frozen=True, slots=True)
class Concept:
    """One machine among others.

    Attributes
    ----------
    scene : Scene
        With the tolerances that were taken, its errors absolute.
    sampled : MonteCarlo
        |E| of machines within tolerance.
    shares : Contributions
        What each tolerance adds to the variance of E, the largest first.
    """

    scene: Scene
    sampled: sampling.MonteCarlo
    shares: variances.Contributions

    @property
    def leading(self) -> tuple[variances.Contribution, ...]:
        """The three errors that matter most."""
        return self.shares.rows[:NAMED]


def compare_concepts(
    scenes: Sequence[Scene],
    plan: ConceptPlan | None = None,
    *,
    loop: Loop | str = Loop.RELATIVE,
    progress: sampling.Progress | None = None,
) -> tuple[Concept, ...]:
    """Sample machines of several scenes within the same tolerances.

    Parameters
    ----------
    scenes : sequence of Scene
    plan : ConceptPlan, optional
    loop : Loop or str, optional
        The tool relative to the workpiece by default: axes count on whichever side they are.
    progress : callable, optional
        Called with the number of sampled machines since the last call.

    Returns
    -------
    tuple of Concept
        In the order of the scenes.

    Raises
    ------
    SceneError
        If tolerances are missing.
    OptionError
        If an argument is out of range, or no tolerance of a scene has a width.
    """
    plan = plan or ConceptPlan()
    if plan.limit_um is not None and not 0.0 < plan.limit_um < np.inf:
        raise OptionError(f"limit: {plan.limit_um:g} µm; expected above 0")
    found: list[Concept] = []
    for scene in with_equal_tolerances(scenes, own=plan.own_tolerances):
        view = choose_view(scene, loop)
        draws = verbs.scene_draws(scene, view.loop, plan.distribution, clip=plan.clip)
        settings = sampling.Plan(
            plan.samples, plan.seed, plan.over, spec_um=plan.limit_um, workers=plan.workers
        )
        settings.check()
        if not draws.variance.any():
            problem = f"tolerances: none of the {view.loop} loop has a width; expected one above 0"
            raise SceneError(scene.name, [problem])
        parts = (scene.model, draws, scene.workspace, view, settings)
        sampled = sampling.montecarlo(*parts, progress)
        found.append(Concept(scene, sampled, variances.variance_contributions(*parts)))
    return tuple(found)


def with_equal_tolerances(scenes: Sequence[Scene], *, own: bool = False) -> tuple[Scene, ...]:
    """Give scenes the tolerances of the first one by class, and no point held still.

    Parameters
    ----------
    scenes : sequence of Scene
    own : bool, optional
        Whether each keeps its own tolerances.

    Returns
    -------
    tuple of Scene

    Raises
    ------
    SceneError
        If the first one has no tolerance for a class that one of the machines needs.
    """
    absolute = [replace(scene, reference=None) for scene in scenes]
    if own or not scenes:
        return tuple(absolute)
    default = scenes[0].tolerances.default
    needed = {parameter(key).tolerance_class for scene in scenes for key in scene.parameter_keys}
    if missing := [name for name in TOLERANCE_CLASSES if name in needed and name not in default]:
        problem = (
            f"tolerances.default has no {', '.join(missing)}; expected a half width for each class,"
            " which all machines then have (--own-tolerances takes those of each scene)"
        )
        raise SceneError(scenes[0].name, [problem])
    equal = ToleranceSet(dict(default))
    return tuple(replace(scene, tolerances=equal) for scene in absolute)


def expected_um(concept: Concept, grid: Grid) -> Array:
    """Compute the RMS of |E| of machines within tolerance at each node.

    Parameters
    ----------
    concept : Concept
    grid : Grid
        Of the concept's scene.

    Returns
    -------
    ndarray, [nx, ny, nz], µm
        Exact for the linear model: √(Σ var(aₖ)·|Jₖ|² + |J·centre|²).
    """
    draws, view = concept.sampled.draws, concept.sampled.view
    basis = build_basis(
        concept.scene.model, ErrorSet(), draws.keys, grid.coordinates, view, grid.point_mm
    )
    square = np.einsum("k,k...c->...", draws.variance, basis.position**2)
    middle = np.einsum("k,k...c->...c", draws.centre, basis.position)
    return np.broadcast_to(np.sqrt(square + np.sum(middle**2, axis=-1)), grid.shape)


def zero_field(grid: Grid) -> ErrorField:
    """Give the field of a machine without errors over a grid."""
    zero = np.zeros(grid.nominal_mm.shape)
    return ErrorField(grid.nominal_mm, zero, zero)
