"""Live Monte Carlo of a scene's tolerances: what is random is drawn once, tolerances move freely.

Every sampled machine keeps its unit draws (where in each tolerance it lies) and its point. Moving a
tolerance is then one product of what was precomputed with the vectors of centres and half widths,
and since the machines stay the same, the result moves smoothly with the tolerance.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.distribution import Histogram, Probability, Stream
from warpspace.analysis.draws import Distribution, build_draws, loop_keys
from warpspace.analysis.montecarlo import Over, node_gains
from warpspace.analysis.points import choose_cylinder, extreme_places, random_places
from warpspace.exceptions import OptionError
from warpspace.kinematics.model import Loop
from warpspace.machine.tolerances import Tolerance, ToleranceSet
from warpspace.scene.model import Scene
from warpspace.units import Array

SAMPLES = 20_000
SEED = 20_240_601
CORNER_NODES = 2
Floats = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Ensemble:
    """Sampled machines before their tolerances are known.

    Attributes
    ----------
    keys : tuple of str, (K,)
        Parameters of the loop.
    unit : ndarray of float32, [S, K]
        Place of each parameter in its tolerance: 0 in the centre, ±1 at the limits.
    gains : ndarray of float32, [3, S, K] or [3, K, N]
        µm per µm or µrad: at the one point of each machine, or at the N points common to all.
    spread : ndarray of float32, [3, S, K], or None
        Gains times unit draws, where each machine has one point.
    over : Over
        `sampled` for one random point per machine, `max` for the worst point of each.
    """

    keys: tuple[str, ...]
    unit: Floats
    gains: Floats
    spread: Floats | None
    over: Over

    @property
    def size(self) -> int:
        """Bytes it holds."""
        spread = 0 if self.spread is None else self.spread.nbytes
        return self.unit.nbytes + self.gains.nbytes + spread

    def norm_um(self, centre: Array, half_width: Array) -> Array:
        """Evaluate |E| of every machine.

        Parameters
        ----------
        centre, half_width : ndarray, [K], µm or µrad

        Returns
        -------
        ndarray, [S], µm
        """
        middle, half = centre.astype(np.float32), half_width.astype(np.float32)
        if self.spread is not None:
            error = self.spread @ half + self.gains @ middle
            return np.sqrt(np.einsum("cs,cs->s", error, error)).astype(float)
        amplitudes = middle + half * self.unit
        square = np.zeros((len(self.unit), self.gains.shape[2]), dtype=np.float32)
        for gain in self.gains:
            error = amplitudes @ gain
            square += error * error
        return np.sqrt(square.max(axis=1)).astype(float)


@dataclass(frozen=True, slots=True)
class Chance:
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
    keys = loop_keys(scene.model, loop, scene.parameter_keys)
    workspace = scene.workspace.moved(positions or {})
    view = scene.view(loop)
    cylinder = choose_cylinder(scene.model) if loop is Loop.WORKPIECE else None
    rng = np.random.default_rng(seed)
    ones = ToleranceSet({}, dict.fromkeys(keys, Tolerance(0.0, 1.0)))
    unit = build_draws(ones, keys, distribution).draw(rng, samples).astype(np.float32)
    if over is Over.SAMPLED:
        places = random_places(scene.model, loop, workspace, cylinder, rng, samples)
        by_key = node_gains(scene.model, keys, view, places).astype(np.float32)
        gains = np.ascontiguousarray(np.swapaxes(by_key, 1, 2))
        return Ensemble(keys, unit, gains, gains * unit, over)
    if loop is Loop.WORKPIECE:
        raise OptionError(
            "the worst point of the workpiece loop lies among all turns of the table:"
            " ask for one random point per machine, or use the command montecarlo --over max"
        )
    places = extreme_places(scene.model, loop, workspace, cylinder, CORNER_NODES)
    gains = node_gains(scene.model, keys, view, places).astype(np.float32)
    return Ensemble(keys, unit, gains, None, over)


def estimate(ensemble: Ensemble, tolerances: ToleranceSet, spec_um: float) -> Chance:
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
    Chance
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
    return Chance(
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
    if ensemble.spread is not None:
        square = np.einsum("csk,csk->k", ensemble.gains, ensemble.gains) / len(ensemble.unit)
    else:
        square = np.einsum("ckn,ckn->k", ensemble.gains, ensemble.gains) / ensemble.gains.shape[2]
    half = np.array(
        [found.half_width if (found := tolerances.get(key)) else 0.0 for key in ensemble.keys]
    )
    parts = half**2 * square
    total = float(parts.sum()) or 1.0
    by_key = dict(zip(ensemble.keys, (parts / total).tolist(), strict=True))
    return {key: by_key.get(key, 0.0) for key in keys}
