"""The numbers of a design review: everything is evaluated here, nothing is worded."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.analysis.contributions import Contributions, variance_contributions
from warpspace.analysis.draws import Distribution, build_draws, loop_keys
from warpspace.analysis.explain import Explanation, explain
from warpspace.analysis.gains import Gain, gains_max
from warpspace.analysis.montecarlo import MonteCarlo, Plan, montecarlo
from warpspace.analysis.nodes import Over
from warpspace.analysis.repair import Repairs
from warpspace.analysis.statistics import Statistics
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.kinematics.model import Loop
from warpspace.machine.limits import REPAIR_NODES
from warpspace.picture.comparison import scene_change, share_exaggeration
from warpspace.picture.exaggeration import Exaggeration
from warpspace.picture.model import same_nodes
from warpspace.picture.scene_picture import ScenePicture, evaluate_picture
from warpspace.scene import repairs as scene_repairs
from warpspace.scene.model import Scene
from warpspace.scene.pipeline import linearisation_error_um

WORST_SAMPLES = 20_000
"""Machines of which the worst point is looked for; one random point is taken of many more."""


@dataclass(frozen=True, slots=True)
class ReportSettings:
    """Choices of a report.

    Attributes
    ----------
    loop : str
        "tool", "workpiece" or "relative".
    grid : int
        Nodes per axis of the working volume.
    exaggeration : float, "auto" or None
        Display factor; None takes the first scene's.
    spec_um : float or None
        Specification of the volumetric error, µm.
    samples, seed : int
        Of the Monte Carlo.
    distribution : str
        "uniform" or "normal".
    """

    loop: str = "tool"
    grid: int = 21
    exaggeration: Exaggeration = None
    spec_um: float | None = None
    samples: int = 100_000
    seed: int = 0
    distribution: str = "uniform"


@dataclass(frozen=True, slots=True)
class Sampling:
    """What the tolerances of a scene promise.

    Attributes
    ----------
    sampled : MonteCarlo
        One random point of every machine.
    worst : MonteCarlo
        The worst point of every machine.
    shares : Contributions
        Which tolerances matter.
    """

    sampled: MonteCarlo
    worst: MonteCarlo
    shares: Contributions


@dataclass(frozen=True, slots=True)
class Reviewed:
    """One scene, reviewed.

    Attributes
    ----------
    picture : ScenePicture
        Evaluated scene with the display factor all scenes of the report share.
    worst_at : dict of str to float, mm or degrees
        Axis positions of the worst node.
    explanation : Explanation
        Why it is the worst.
    gains : tuple of Gain
        Largest over the working volume (rotary axes: over their travel), largest first.
    sampling : Sampling or None
        None without tolerances for every parameter of the loop; `why_not_sampled` says which lack.
    linearisation_um : float, µm
        Largest difference between the exact chain and the first order.
    repairs : Repairs
        What adjusting squareness and alignment gives for the whole volume.
    """

    picture: ScenePicture
    worst_at: dict[str, float]
    explanation: Explanation
    gains: tuple[Gain, ...]
    sampling: Sampling | None
    why_not_sampled: str
    linearisation_um: float
    repairs: Repairs

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.picture.scene

    @property
    def statistics(self) -> Statistics:
        """Statistics of its field."""
        return self.picture.statistics


@dataclass(frozen=True, slots=True)
class Review:
    """One scene or two, with their difference where they share a working volume.

    Attributes
    ----------
    settings : ReportSettings
    scenes : tuple of Reviewed
    exaggeration : float
    largest_um : float, µm
        Largest error of all scenes: the end of the colour scale they share.
    difference : Statistics or None
        Of |E_B − E_A|: the length of second minus first, as vectors, node by node.
    """

    settings: ReportSettings
    scenes: tuple[Reviewed, ...]
    exaggeration: float
    largest_um: float
    difference: Statistics | None


def build_review(scenes: tuple[Scene, ...], settings: ReportSettings) -> Review:
    """Evaluate everything a report tells.

    Parameters
    ----------
    scenes : tuple of Scene
        One or two.
    settings : ReportSettings

    Returns
    -------
    Review

    Raises
    ------
    OptionError
        If there are none or more than two scenes, or a setting is out of range.
    """
    if not 1 <= len(scenes) <= 2:
        raise OptionError(f"a report is about one scene or two; given {len(scenes)}")
    Plan(settings.samples, settings.seed, spec_um=settings.spec_um).check()
    pictures = share_exaggeration(
        [evaluate_picture(scene, grid=settings.grid, loop=settings.loop) for scene in scenes],
        settings.exaggeration,
        scenes[0].exaggeration,
    )
    return Review(
        settings,
        tuple(_review_scene(picture, settings) for picture in pictures),
        pictures[0].exaggeration,
        max(picture.statistics.max_um for picture in pictures),
        _difference(pictures),
    )


def _review_scene(picture: ScenePicture, settings: ReportSettings) -> Reviewed:
    """Evaluate all that a report says of one scene."""
    scene = picture.scene
    index = np.unravel_index(int(np.argmax(picture.field.norm_um)), picture.grid.shape)
    at = {
        name: np.broadcast_to(values, picture.grid.shape)[index]
        for name, values in picture.grid.coordinates.items()
    }
    explanation = explain(scene.model, scene.errors, at, picture.view, picture.grid.point_mm[index])
    sampling, why = _sample(scene, settings)
    return Reviewed(
        picture,
        {name: float(value) for name, value in at.items()},
        explanation,
        _gains(scene, picture.view.loop),
        sampling,
        why,
        linearisation_error_um(scene, 5),
        scene_repairs.repair(scene, loop=settings.loop, grid=min(settings.grid, REPAIR_NODES[1])),
    )


def _gains(scene: Scene, loop: Loop) -> tuple[Gain, ...]:
    """Largest gains over the working volume; none where the loop has no axis."""
    axes = scene.machine.axes
    ranges = {
        name: span if axes[name].is_linear else axes[name].travel
        for name, span in scene.workspace.ranges.items()
    }
    try:
        return gains_max(scene.model, loop, scene.parameter_keys, ranges)
    except OptionError:
        return ()


def _sample(scene: Scene, settings: ReportSettings) -> tuple[Sampling | None, str]:
    """Sample machines from the tolerances of a scene; why not, where that is impossible."""
    if not scene.tolerances:
        return None, "The scene has no tolerances."
    view = scene.view(Loop(settings.loop))
    try:
        keys = loop_keys(scene.model, view.loop, scene.parameter_keys)
        draws = build_draws(
            scene.tolerances, keys, Distribution(settings.distribution), source=scene.name
        )

        def run(over: Over, samples: int) -> MonteCarlo:
            plan = Plan(samples, settings.seed, over, spec_um=settings.spec_um)
            return montecarlo(scene.model, draws, scene.workspace, view, plan)

        return (
            Sampling(
                run(Over.SAMPLED, settings.samples),
                run(Over.MAX, min(settings.samples, WORST_SAMPLES)),
                variance_contributions(scene.model, draws, scene.workspace, view),
            ),
            "",
        )
    except WarpspaceError as error:
        return None, str(error)


def _difference(pictures: Sequence[ScenePicture]) -> Statistics | None:
    """Statistics of second minus first where the nodes are the same."""
    if len(pictures) != 2:
        return None
    first, second = pictures
    if not same_nodes(first.field.nominal_mm, second.field.nominal_mm):
        return None
    return scene_change(first, second).statistics
