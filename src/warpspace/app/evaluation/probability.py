"""Live Monte Carlo of a scene's tolerances: they move freely, the machines stay the same."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.analysis.allocating import SAMPLES, Ensemble
from warpspace.analysis.allocating import build_ensemble as draw_ensemble
from warpspace.analysis.cases import LIMIT_OVER, Case, Over, Plan
from warpspace.analysis.distribution import (
    Distribution,
    Draws,
    Histogram,
    Probability,
    Stream,
    loop_keys,
)
from warpspace.kinematics.model import Loop
from warpspace.machine.errors import Tolerance, ToleranceSet
from warpspace.scene.model import Scene


@dataclass(frozen=True, slots=True)
class Estimate:
    """What a tolerance set is likely to give."""

    over: Over
    samples: int
    mean_um: float
    p95_um: float
    max_um: float
    histogram: Histogram
    # of staying within the specification, with its 95 % confidence interval
    probability: Probability


def build_ensemble(
    scene: Scene,
    loop: Loop = Loop.TOOL,
    *,
    over: Over = LIMIT_OVER,
    distribution: Distribution = Distribution.UNIFORM,
    positions: Mapping[str, float] | None = None,
    samples: int = SAMPLES,
    seed: int = 0,
) -> Ensemble:
    """Draw the machines of a scene."""
    keys = loop_keys(scene.model, loop, scene.parameter_keys)
    none = np.zeros(len(keys))
    draws = Draws(keys, none, none, distribution)
    workspace = scene.workspace.moved(positions or {})
    plan = Plan(samples, seed, over)
    return draw_ensemble(Case(scene.model, draws, workspace, scene.view(loop), plan))


def estimate(ensemble: Ensemble, tolerances: ToleranceSet, spec_um: float) -> Estimate:
    """Work out what a tolerance set gives."""
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
    """Say how much each tolerance adds to the scatter of the error."""
    half = np.array(
        [found.half_width if (found := tolerances.get(key)) else 0.0 for key in ensemble.keys]
    )
    parts = half**2 * ensemble.mean_square_gain
    total = float(parts.sum()) or 1.0
    by_key = dict(zip(ensemble.keys, (parts / total).tolist(), strict=True))
    return {key: by_key.get(key, 0.0) for key in keys}
