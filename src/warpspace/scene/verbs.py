"""What can be asked of a scene beside its field: the analyses, joined with what a scene holds."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor

from warpspace.analysis import allocation as allocating
from warpspace.analysis import contributions as shares
from warpspace.analysis import gains as levers
from warpspace.analysis import measured as machines
from warpspace.analysis import montecarlo as sampling
from warpspace.analysis import thesis as print_
from warpspace.analysis.draws import Distribution, Draws, build_draws, loop_keys
from warpspace.analysis.nodes import Over
from warpspace.analysis.points import Cylinder
from warpspace.analysis.thesis import Row, ThesisCase
from warpspace.kinematics.model import Loop
from warpspace.machine.tolerances import ToleranceSet
from warpspace.scene.library import load_scene
from warpspace.scene.model import Scene
from warpspace.scene.pipeline import choose_view

THESIS_SCENES = ("dvf5000_general", "dvf5000_proposed", "dvf5000_first", "dvf5000_second")


def gains(
    scene: Scene,
    *,
    at: Mapping[str, float] | None = None,
    loop: Loop | str = Loop.TOOL,
    over_travel: bool = False,
    step_deg: float | None = None,
    share: float = levers.DEFAULT_SHARE,
) -> tuple[levers.Gain, ...]:
    """Compute the error gains of a scene's machine, largest first.

    Parameters
    ----------
    scene : Scene
    at : mapping of str to float, mm or degrees, optional
        Axis positions; absent axes stand at their place in the scene (the middle of a range).
    loop : Loop or str, optional
        "tool", "workpiece" or "relative".
    over_travel : bool, optional
        The largest absolute gains over the machine's travel instead of those at a point.
    step_deg : float, optional
        Step of rotary axes over the travel; 1° by default.
    share : float, optional
        Share of the sum of squares that the key errors make up.

    Returns
    -------
    tuple of Gain

    Raises
    ------
    OptionError, UnknownNameError
        If an argument is out of range or names something that does not exist.

    Examples
    --------
    >>> from warpspace import load_scene
    >>> largest = gains(load_scene("dvf5000_nominal"), at={"X": 0, "Y": -225, "Z": -480})[0]
    >>> largest.key, largest.lever_mm, round(largest.norm, 2)
    ('EA0Z', (0.0, -242.0, -1440.0), 1.46)
    """
    chosen = choose_view(scene, loop).loop
    if over_travel:
        travel = {name: axis.travel for name, axis in scene.machine.axes.items()}
        return levers.gains_max(scene.model, chosen, scene.parameter_keys, travel, step_deg, share)
    place = {**scene.workspace.positions, **(at or {})}
    return levers.gains_at(scene.model, chosen, scene.parameter_keys, place, share)


def scene_draws(scene: Scene, loop: Loop, distribution: Distribution | str, *, clip: bool) -> Draws:
    """Collect the distributions of the parameters that act in a loop of a scene.

    Raises
    ------
    SceneError
        If the scene has no tolerances, or not for every parameter.
    OptionError
        If there is no such distribution, or no axis in the loop.
    """
    keys = loop_keys(scene.model, loop, scene.parameter_keys)
    return build_draws(scene.tolerances, keys, distribution, clip=clip, source=scene.name)


def montecarlo(
    scene: Scene,
    *,
    samples: int = sampling.DEFAULT_SAMPLES,
    seed: int = 0,
    distribution: Distribution | str = Distribution.UNIFORM,
    clip: bool = False,
    loop: Loop | str = Loop.TOOL,
    over: Over | str = Over.SAMPLED,
    grid: int = sampling.DEFAULT_NODES,
    spec_um: float | None = None,
    cylinder: Cylinder | None = None,
    workers: int | None = None,
    progress: sampling.Progress | None = None,
    executor: Executor | None = None,
    take: sampling.Take | None = None,
) -> sampling.MonteCarlo:
    """Sample machines from the tolerances of a scene.

    Parameters
    ----------
    scene : Scene
    samples, seed : int, optional
    distribution : Distribution or str, optional
        "uniform" over the tolerance, or "normal" with 3σ = half width.
    clip : bool, optional
        Whether the normal distribution ends at the limits.
    loop : Loop or str, optional
    over : Over or str, optional
        "sampled": |E| at one random point per machine; "max", "mean": over the points of a machine.
    grid : int, optional
        Nodes per axis for "max" and "mean".
    spec_um : float, optional
        Specification whose probability is asked for, µm.
    cylinder : Cylinder, optional
        Largest workpiece, for the workpiece loop; by default the one whose top rim the scene's
        workpiece point lies on.
    workers : int, optional
        Threads, or workers of the executor; the result does not depend on it.
    progress : callable, optional
        Called with the number of machines done since the last call.
    executor : concurrent.futures.Executor, optional
        Does the work instead of threads: a pool of processes, or a cluster's.
    take : callable, optional
        Called with 0 and |E| of the next machines, in order.

    Returns
    -------
    MonteCarlo

    Raises
    ------
    SceneError
        If the scene has no tolerances, or not for every parameter.
    OptionError
        If an argument is out of range.

    Examples
    --------
    >>> from warpspace import load_scene
    >>> result = montecarlo(load_scene("dvf5000_general"), samples=20_000, seed=1)
    >>> 40 < result.mean_um < 43
    True
    """
    view = choose_view(scene, loop)
    plan = sampling.Plan(samples, seed, over, grid, spec_um, cylinder, workers)
    plan.check()
    draws = scene_draws(scene, view.loop, distribution, clip=clip)
    return sampling.montecarlo(
        scene.model, draws, scene.workspace, view, plan, progress, executor=executor, take=take
    )


def allocate(
    scene: Scene,
    wish: allocating.Wish,
    *,
    samples: int = sampling.DEFAULT_SAMPLES,
    seed: int = 0,
    distribution: Distribution | str = Distribution.UNIFORM,
    clip: bool = False,
    loop: Loop | str = Loop.TOOL,
    over: Over | str = Over.SAMPLED,
    cylinder: Cylinder | None = None,
    workers: int | None = None,
    progress: allocating.Progress | None = None,
) -> allocating.Allocation:
    """Find the widest tolerances of a scene that keep a limit of |E| with a probability.

    See `montecarlo` for the other parameters; `progress` is called with the share of the work that
    was done since the last call.

    Parameters
    ----------
    scene : Scene
    wish : Wish
        Limit, probability, costs, and what is fixed.

    Returns
    -------
    Allocation

    Raises
    ------
    SceneError
        If the scene has no tolerances, or not for every parameter.
    OptionError, UnknownNameError
        If an argument is out of range, nothing is free, or what is fixed does not keep the limit.
    """
    view = choose_view(scene, loop)
    plan = sampling.Plan(samples, seed, over, cylinder=cylinder, workers=workers)
    plan.check()
    draws = scene_draws(scene, view.loop, distribution, clip=clip)
    return allocating.allocate(
        scene.model, draws, scene.workspace, wish, view, plan, progress=progress
    )


def contributions(
    scene: Scene,
    *,
    loop: Loop | str = Loop.TOOL,
    distribution: Distribution | str = Distribution.UNIFORM,
    clip: bool = False,
    seed: int = 0,
    cylinder: Cylinder | None = None,
    sobol: int | None = None,
) -> shares.Contributions:
    """Share out the variance of the volumetric error over the tolerances of a scene.

    See `montecarlo` for the parameters and errors; `sobol` is the number of base samples of a Sobol
    analysis of the mean |E|, a power of two.
    """
    view = choose_view(scene, loop)
    draws = scene_draws(scene, view.loop, distribution, clip=clip)
    plan = sampling.Plan(seed=seed, cylinder=cylinder)
    plan.check()
    return shares.variance_contributions(scene.model, draws, scene.workspace, view, plan, sobol)


def measured(
    scene: Scene,
    *,
    tolerances: ToleranceSet | None = None,
    loop: Loop | str = Loop.TOOL,
    grid: int | Sequence[int] = machines.DEFAULT_NODES,
) -> machines.Measured:
    """Judge the errors of a scene against tolerances and predict its volumetric error.

    Parameters
    ----------
    scene : Scene
    tolerances : ToleranceSet, optional
        The scene's own by default.
    loop : Loop or str, optional
    grid : int or sequence of int, (3,), optional
        Nodes per axis of the predicted map.

    Returns
    -------
    Measured
    """
    chosen = scene.tolerances if tolerances is None else tolerances
    view = choose_view(scene, loop)
    return machines.measured(scene.model, scene.errors, chosen, scene.workspace, view, grid)


def thesis_case() -> ThesisCase:
    """Collect what the thesis's tables are recomputed from: the bundled scenes of its machine."""
    general, proposed, first, second = (load_scene(name) for name in THESIS_SCENES)
    return ThesisCase(
        general.model,
        general.workspace,
        general.tolerances,
        proposed.tolerances,
        first.errors,
        second.errors,
    )


def thesis() -> tuple[Row, ...]:
    """Set every number printed in the thesis beside ours.

    Returns
    -------
    tuple of Row
    """
    return print_.thesis_rows(thesis_case())
