"""Live Monte Carlo of a scene's tolerances: they move freely, the machines stay the same."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.analysis.allocation import Ensemble
from warpspace.analysis.allocation import build_ensemble as draw_ensemble
from warpspace.analysis.allocation.ensemble import SAMPLES, SEED
from warpspace.analysis.distribution import Histogram, Probability, Stream
from warpspace.analysis.draws import Distribution, loop_keys
from warpspace.analysis.nodes import Over
from warpspace.kinematics.model import Loop
from warpspace.machine.tolerances import Tolerance, ToleranceSet
from warpspace.scene.model import Scene


@dataclass(frozen=True, slots=True)
class Estimate:
    """What a tolerance set is likely to give.

    Attributes
    ----------
    over : Over
    samples : int
    mean_um, p95_um, max_um : float, µm
    histogram : Histogram
    probability : Probability
        Of staying within the specification, with its 95 % confidence interval.
    """

    over: Over
    samples: int
    mean_um: float
    p95_um: float
    max_um: float
    histogram: Histogram
    probability: Probability


def build_ensemble(
    scene: Scene,
    loop: Loop = Loop.TOOL,
    *,
    over: Over = Over.SAMPLED,
    distribution: Distribution = Distribution.UNIFORM,
    positions: Mapping[str, float] | None = None,
    samples: int = SAMPLES,
    seed: int = SEED,
) -> Ensemble:
    """Draw the machines of a scene.

    Parameters
    ----------
    scene : Scene
    loop : Loop, optional
    over : Over, optional
        `sampled` or `max`.
    distribution : Distribution, optional
        The normal one has 3σ at the limits.
    positions : mapping of str to float, degrees, optional
        Where the rotary axes stand, if elsewhere than in the scene.
    samples, seed : int, optional

    Returns
    -------
    Ensemble

    Raises
    ------
    OptionError
        If the loop has no axis, or its worst point lies among too many to be found live.
    """
    return draw_ensemble(
        scene.model,
        loop_keys(scene.model, loop, scene.parameter_keys),
        scene.workspace.moved(positions or {}),
        scene.view(loop),
        over,
        distribution,
        samples=samples,
        seed=seed,
    )


def estimate(ensemble: Ensemble, tolerances: ToleranceSet, spec_um: float) -> Estimate:
    """Work out what a tolerance set gives.

    Parameters
    ----------
    ensemble : Ensemble
    tolerances : ToleranceSet
        A parameter without a tolerance is held at zero.
    spec_um : float, µm
        The largest |E| allowed.

    Returns
    -------
    Estimate
    """
    none = Tolerance(0.0, 0.0)
    found = [tolerances.get(key) or none for key in ensemble.keys]
    norm = ensemble.norm_um(
        np.array([tolerance.centre for tolerance in found]),
        np.array([tolerance.half_width for tolerance in found]),
    )
    stream = Stream(len(norm), spec_um)
    stream.add(norm)
    probability = stream.probability()
    assert probability is not None  # noqa: S101 - a specification was given
    return Estimate(
        ensemble.over,
        len(norm),
        stream.mean_um,
        stream.quantile(0.95),
        stream.max_um,
        stream.display_histogram(),
        probability,
    )


def tolerance_shares(
    ensemble: Ensemble, tolerances: ToleranceSet, keys: Sequence[str]
) -> dict[str, float]:
    """Say how much each tolerance adds to the scatter of the error.

    Parameters
    ----------
    ensemble : Ensemble
    tolerances : ToleranceSet
    keys : sequence of str
        Parameters asked for.

    Returns
    -------
    dict of str to float
        Share of the variance of E (its three components added) over all machines and points,
        between 0 and 1; they add up to 1 over all parameters of the loop.
    """
    half = np.array(
        [found.half_width if (found := tolerances.get(key)) else 0.0 for key in ensemble.keys]
    )
    parts = half**2 * ensemble.mean_square_gain
    total = float(parts.sum()) or 1.0
    by_key = dict(zip(ensemble.keys, (parts / total).tolist(), strict=True))
    return {key: by_key.get(key, 0.0) for key in keys}
