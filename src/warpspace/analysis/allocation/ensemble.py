"""Sampled machines before their tolerances are known: what is random is drawn once.

Every machine keeps its unit draws (where in each tolerance it lies) and its point. Other tolerances
are then one product of what was precomputed with the vectors of centres and half widths, and since
the machines stay the same, the result moves smoothly with the tolerances.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.draws import Distribution, build_draws
from warpspace.analysis.nodes import Over, node_gains
from warpspace.analysis.points import Cylinder, choose_cylinder, extreme_places, random_places
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import View
from warpspace.field.grid import Workspace
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.tolerances import Tolerance, ToleranceSet
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

    @property
    def mean_square_gain(self) -> Array:
        """Square of the gains, averaged over machines or points, [K], µm² per µm² or µrad²."""
        if self.spread is not None:
            return np.einsum("csk,csk->k", self.gains, self.gains) / len(self.unit)
        return np.einsum("ckn,ckn->k", self.gains, self.gains) / self.gains.shape[2]

    def error_um(self, centre: Array, half_width: Array) -> Floats:
        """Evaluate the error of every machine at its point, or at each of the common points.

        Parameters
        ----------
        centre, half_width : ndarray, [K], µm or µrad

        Returns
        -------
        ndarray of float32, [3, S] or [3, S, N], µm
        """
        middle, half = centre.astype(np.float32), half_width.astype(np.float32)
        if self.spread is not None:
            error = self.spread @ half + self.gains @ middle
        else:
            error = (middle + half * self.unit) @ self.gains
        return error.astype(np.float32, copy=False)

    def norm_um(self, centre: Array, half_width: Array) -> Array:
        """Evaluate |E| of every machine, [S], µm; see `error_um` for the parameters."""
        error = self.error_um(centre, half_width)
        square = np.einsum("c...,c...->...", error, error)
        return np.sqrt(square if square.ndim == 1 else square.max(axis=1)).astype(float)

    def norm_and_slope(
        self, centre: Array, half_width: Array
    ) -> tuple[Array, "Floats", NDArray[np.intp] | None]:
        """Evaluate |E| of every machine, and what its slope in each half width follows from.

        Returns
        -------
        norm_um : ndarray, [S], µm
        direction : ndarray of float32, [3, S]
            Unit vector of the error of each machine at the point that counts.
        at : ndarray of int, [S], or None
            Which of the common points counts.
        """
        error = self.error_um(centre, half_width)
        at = None
        if error.ndim == 3:
            at = np.argmax(np.einsum("csn,csn->sn", error, error), axis=1)
            error = error[:, np.arange(len(at)), at]
        norm = np.sqrt(np.einsum("cs,cs->s", error, error))
        return norm.astype(float), error / np.maximum(norm, np.float32(1e-12)), at

    def slope(self, pull: Floats, at: NDArray[np.intp] | None) -> Array:
        """Add up the slopes of |E| in each half width over the machines.

        Parameters
        ----------
        pull : ndarray of float32, [3, S]
            Unit vector of the error of each machine, times what the machine counts.
        at : ndarray of int, [S], or None
            See `norm_and_slope`.

        Returns
        -------
        ndarray, [K], µm per µm or µrad
        """
        if at is None:
            assert self.spread is not None  # noqa: S101 - each machine has a point of its own
            return np.einsum("cs,csk->k", pull, self.spread, optimize=True).astype(float)
        found = np.zeros(len(self.keys))
        for node in range(self.gains.shape[2]):
            chosen = at == node
            by_parameter = pull[:, chosen] @ self.unit[chosen]
            found += np.einsum("ck,ck->k", by_parameter, self.gains[:, :, node])
        return found


def build_ensemble(
    model: Model,
    keys: Sequence[str],
    workspace: Workspace,
    view: View,
    over: Over = Over.SAMPLED,
    distribution: Distribution = Distribution.UNIFORM,
    *,
    clip: bool = False,
    cylinder: Cylinder | None = None,
    samples: int = SAMPLES,
    seed: int = SEED,
) -> Ensemble:
    """Draw machines whose tolerances are not known yet.

    Parameters
    ----------
    model : Model
    keys : sequence of str, (K,)
        Parameters of the loop.
    workspace : Workspace
    view : View
    over : Over, optional
        `sampled` or `max`.
    distribution : Distribution, optional
        The normal one has 3σ at the limits.
    clip : bool, optional
        Whether the normal distribution ends at the limits.
    cylinder : Cylinder, optional
        Largest workpiece, for the workpiece loop.
    samples, seed : int, optional

    Returns
    -------
    Ensemble

    Raises
    ------
    OptionError
        If the loop has no axis, or its worst point lies among too many to be found live.
    """
    size = choose_cylinder(model, cylinder) if view.loop is Loop.WORKPIECE else None
    rng = np.random.default_rng(seed)
    ones = ToleranceSet({}, dict.fromkeys(keys, Tolerance(0.0, 1.0)))
    draws = build_draws(ones, keys, distribution, clip=clip)
    unit = draws.draw(rng, samples).astype(np.float32)
    if over is Over.SAMPLED:
        places = random_places(model, view.loop, workspace, size, rng, samples)
        by_key = node_gains(model, keys, view, places).astype(np.float32)
        gains = np.ascontiguousarray(np.swapaxes(by_key, 1, 2))
        return Ensemble(tuple(keys), unit, gains, gains * unit, over)
    refuse_many_points(view.loop)
    places = extreme_places(model, view.loop, workspace, size, CORNER_NODES)
    gains = node_gains(model, keys, view, places).astype(np.float32)
    return Ensemble(tuple(keys), unit, gains, None, over)


def refuse_many_points(loop: Loop) -> None:
    """Refuse the loop in which the worst point of a machine lies among too many points.

    Raises
    ------
    OptionError
        With a way out.
    """
    if loop is Loop.WORKPIECE:
        raise OptionError(
            "the worst point of the workpiece loop lies among all turns of the table:"
            " ask for one random point per machine, or use the command montecarlo --over max"
        )
