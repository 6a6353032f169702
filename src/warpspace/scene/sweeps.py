"""Many Monte Carlo runs in one: fleets of scenes, and tolerances in steps."""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import product
from math import prod

from warpspace.analysis import montecarlo as sampling
from warpspace.analysis.draws import Distribution
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.kinematics.model import Loop
from warpspace.machine.limits import MAX_ERROR, MIN_HALF_WIDTH, SWEEP_CASES
from warpspace.machine.tolerances import TOLERANCE_CLASSES
from warpspace.scene.model import Scene
from warpspace.scene.pipeline import choose_view
from warpspace.scene.verbs import scene_draws


@dataclass(frozen=True, slots=True)
class SweepPoint:
    """One scene with one choice of half widths.

    Attributes
    ----------
    scene : Scene
        With the tolerances that were taken.
    half_widths : mapping of str to float, µm or µrad
        Those that are swept, by key or class.
    sampled : MonteCarlo
    """

    scene: Scene
    half_widths: Mapping[str, float]
    sampled: sampling.MonteCarlo


def sweep(
    scenes: Iterable[Scene],
    half_widths: Mapping[str, Sequence[float]] | None = None,
    *,
    plan: sampling.Plan | None = None,
    distribution: Distribution | str = Distribution.UNIFORM,
    clip: bool = False,
    loop: Loop | str = Loop.TOOL,
    workers: int | None = None,
    executor: Executor | None = None,
    progress: sampling.Progress | None = None,
    take: sampling.Take | None = None,
) -> Iterator[SweepPoint]:
    """Sample machines of many scenes, with every combination of some half widths.

    Parameters
    ----------
    scenes : iterable of Scene
        Taken as they are needed.
    half_widths : mapping of str to sequence of float, µm or µrad, optional
        For a parameter key, or for a class (translation, rotation, squareness); parameters with a
        tolerance of their own are not touched by that of their class. None: as the scenes are.
    plan : Plan, optional
        Samples, seed and specification. Every point has the same seed, so that points
        differ by their half widths and not by chance.
    distribution, clip, loop : optional
        As in `montecarlo`.
    workers, executor, progress, take : optional
        As in `warpspace.analysis.montecarlo.montecarlo_each`.

    Yields
    ------
    SweepPoint
        Scene by scene; of the half widths, the last one changes first.

    Raises
    ------
    SceneError
        If a scene has no tolerances, or not for every parameter.
    OptionError, UnknownNameError
        If an argument is out of range, or a scene has no such parameter.
    """
    steps, plan = dict(half_widths or {}), plan or sampling.Plan()
    plan.check()
    check_half_widths(steps)
    waiting: deque[tuple[Scene, Mapping[str, float]]] = deque()

    def cases() -> Iterator[sampling.Case]:
        for scene in scenes:
            for values in product(*steps.values()):
                point = dict(zip(steps, values, strict=True))
                chosen_scene = with_half_widths(scene, point)
                view = choose_view(chosen_scene, loop)
                draws = scene_draws(chosen_scene, view.loop, distribution, clip=clip)
                waiting.append((chosen_scene, point))
                yield sampling.Case(chosen_scene.model, draws, chosen_scene.workspace, view, plan)

    found = sampling.montecarlo_each(
        cases(), workers=workers, executor=executor, progress=progress, take=take
    )
    for sampled in found:
        scene, point = waiting.popleft()
        yield SweepPoint(scene, point, sampled)


def count_points(half_widths: Mapping[str, Sequence[float]]) -> int:
    """Count the combinations of half widths."""
    return prod(len(values) for values in half_widths.values())


def check_half_widths(half_widths: Mapping[str, Sequence[float]]) -> None:
    """Refuse half widths that no tolerance can have, and more combinations than can be listed.

    Raises
    ------
    OptionError
        Naming key and value.
    """
    for key, values in half_widths.items():
        if not values:
            raise OptionError(f"tolerance {key}: no half width; expected one at least")
        for value in values:
            if not (value == 0.0 or MIN_HALF_WIDTH <= value <= MAX_ERROR):
                raise OptionError(
                    f"tolerance {key}: half width {value:g}; expected 0, or {MIN_HALF_WIDTH:g} to"
                    f" {MAX_ERROR:g} µm or µrad"
                )
    if (points := count_points(half_widths)) > SWEEP_CASES:
        raise OptionError(
            f"{points:,} combinations of half widths; expected at most {SWEEP_CASES:,}"
        )


def with_half_widths(scene: Scene, half_widths: Mapping[str, float]) -> Scene:
    """Give a scene other half widths, by parameter key or class.

    Raises
    ------
    UnknownNameError
        If the scene's machine has no such parameter.
    """
    if not half_widths:
        return scene
    tolerances = scene.tolerances
    classes = {key: value for key, value in half_widths.items() if key in TOLERANCE_CLASSES}
    own = {key: value for key, value in half_widths.items() if key not in classes}
    for key in own:
        if key not in scene.machine.allowed_keys:
            known = (*scene.parameter_keys, *TOLERANCE_CLASSES)
            raise UnknownNameError("parameter or tolerance class", key, known)
    tolerances = replace(tolerances, default={**tolerances.default, **classes})
    return replace(scene, tolerances=tolerances.with_half_widths(own))
