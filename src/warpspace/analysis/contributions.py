"""Which tolerances matter: how the parameters share the variance of the volumetric error."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warpspace.analysis.draws import Draws
from warpspace.analysis.montecarlo import Plan
from warpspace.analysis.nodes import Over, node_gains, reduce_nodes
from warpspace.analysis.points import Places, average_places, choose_cylinder, spread_places
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import View
from warpspace.field.grid import Workspace
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.parameters import parameter
from warpspace.units import Array

CHECK_MACHINES = 20_000
CHECK_NODES = 512
SOBOL_NODES = 5
DEFAULT_SOBOL, MAX_SOBOL = 1024, 65_536


@dataclass(frozen=True, slots=True)
class Contribution:
    """What one parameter's tolerance adds.

    Attributes
    ----------
    key : str
    half_width : float, µm or µrad
    variance_um2 : float, µm²
        Its part of trace(J Σ Jᵀ), averaged over the points.
    share : float
        The same over the sum of all.
    sampled_share : float
        The share estimated from sampled machines, see `variance_contributions`.
    sobol_first, sobol_total, sobol_total_confidence : float or None
        Sobol indices of the mean |E| of a machine; half width of the 95 % interval of the total.
    """

    key: str
    half_width: float
    variance_um2: float
    share: float
    sampled_share: float
    sobol_first: float | None = None
    sobol_total: float | None = None
    sobol_total_confidence: float | None = None

    @property
    def unit(self) -> str:
        """Unit of the half width."""
        return parameter(self.key).unit


@dataclass(frozen=True, slots=True)
class Contributions:
    """Variance shares of all parameters.

    Attributes
    ----------
    rows : tuple of Contribution
        Largest share first.
    variance_um2 : float, µm²
        trace(J Σ Jᵀ) averaged over the points: the variance of E between machines.
    rms_um : float, µm
        Root of E|E|²: the variance, and the mean error that centres off zero give, together.
    """

    rows: tuple[Contribution, ...]
    variance_um2: float
    rms_um: float


def expected_square(
    model: Model, draws: Draws, workspace: Workspace, view: View, plan: Plan
) -> tuple[Array, float]:
    """Compute E|E|² of the linear model without sampling.

    Parameters
    ----------
    model : Model
    draws : Draws
    workspace : Workspace
    view : View
    plan : Plan
        Its cylinder is used for the workpiece loop.

    Returns
    -------
    variance_um2 : ndarray, [K], µm²
        Diagonal part of each parameter: var(aₖ)·|Jₖ|², averaged over the points.
    offset_um2 : float, µm²
        |J·centre|², averaged over the points.
    """
    cylinder = choose_cylinder(model, plan.cylinder) if view.loop is Loop.WORKPIECE else None
    places = average_places(model, view.loop, workspace, cylinder)
    gains = node_gains(model, draws.keys, view, places)
    variance = draws.variance * np.mean(np.sum(gains**2, axis=0), axis=1)
    middle = np.einsum("k,ckn->cn", draws.centre, gains)
    return variance, float(np.mean(np.sum(middle**2, axis=0)))


def variance_contributions(
    model: Model,
    draws: Draws,
    workspace: Workspace,
    view: View | None = None,
    plan: Plan | None = None,
    sobol: int | None = None,
) -> Contributions:
    """Share out the variance of the volumetric error.

    Parameters
    ----------
    model : Model
    draws : Draws
    workspace : Workspace
    view : View, optional
    plan : Plan, optional
        Seed and cylinder.
    sobol : int, optional
        Base samples (a power of two) of a Sobol analysis of the mean |E|; absent is none.

    Returns
    -------
    Contributions

    Raises
    ------
    OptionError
        If no tolerance has a width or `sobol` is out of range.

    Notes
    -----
    The model is linear and the draws independent, so that the shares are exact: no sampling is
    behind them. `sampled_share` repeats them from 20,000 sampled machines through the covariance of
    each parameter with E, cov(aₖ, E)² / var aₖ.
    """
    view, plan = view or View(), plan or Plan()
    variance, offset = expected_square(model, draws, workspace, view, plan)
    total = float(variance.sum())
    if not total > 0.0:
        raise OptionError("no parameter of this loop has a tolerance above zero")
    sampled = _sampled_variance(model, draws, workspace, view, plan)
    indices = _sobol(model, draws, workspace, view, plan, sobol) if sobol else {}
    rows = [
        Contribution(
            key,
            float(draws.half_width[index]),
            float(variance[index]),
            float(variance[index] / total),
            float(sampled[index] / sampled.sum()),
            *indices.get(key, (None, None, None)),
        )
        for index, key in enumerate(draws.keys)
    ]
    rows.sort(key=lambda row: -row.share)
    return Contributions(tuple(rows), total, float(np.sqrt(total + offset)))


def _spread(model: Model, workspace: Workspace, view: View, plan: Plan, nodes: int) -> Places:
    """Give the places that a mean over the points of a machine is taken over."""
    cylinder = choose_cylinder(model, plan.cylinder) if view.loop is Loop.WORKPIECE else None
    return spread_places(model, view.loop, workspace, cylinder, nodes)


def _sampled_variance(
    model: Model, draws: Draws, workspace: Workspace, view: View, plan: Plan
) -> Array:
    """Estimate each parameter's variance of E from sampled machines, [K], µm²."""
    cylinder = choose_cylinder(model, plan.cylinder) if view.loop is Loop.WORKPIECE else None
    places = average_places(model, view.loop, workspace, cylinder)
    gains = node_gains(model, draws.keys, view, places)
    gains = gains[:, :, :: max(1, gains.shape[2] // CHECK_NODES)]
    values = draws.draw(np.random.default_rng(plan.seed), CHECK_MACHINES)
    centred = values - values.mean(axis=0)
    spread = centred.var(axis=0)
    spread = np.where(spread > 0.0, spread, 1.0)
    found = np.zeros(len(draws.keys))
    for gain in gains:
        covariance = centred.T @ (values @ gain) / CHECK_MACHINES
        found += np.mean(covariance**2, axis=1) / spread
    return found


def _sobol(
    model: Model, draws: Draws, workspace: Workspace, view: View, plan: Plan, base: int
) -> Mapping[str, tuple[float, float, float]]:
    """Run a Sobol analysis of a machine's mean |E| through SALib.

    Returns
    -------
    mapping of str to (first order, total, half width of the total's 95 % interval)
    """
    from SALib.analyze import sobol as analysis
    from SALib.sample import sobol as sampling

    if not 2 <= base <= MAX_SOBOL or base & (base - 1):
        raise OptionError(f"sobol: {base}; expected a power of two from 2 to {MAX_SOBOL:,}")
    seed = plan.seed + 1  # SALib takes 0 for no seed
    wide = [index for index, width in enumerate(draws.half_width) if width > 0.0]
    problem = {
        "num_vars": len(wide),
        "names": [draws.keys[index] for index in wide],
        "bounds": [[0.0, 1.0]] * len(wide),
    }
    unit = np.full((1, len(draws.keys)), 0.5)
    drawn = sampling.sample(problem, base, calc_second_order=False, seed=seed)
    unit = np.repeat(unit, len(drawn), axis=0)
    unit[:, wide] = drawn
    places = _spread(model, workspace, view, plan, SOBOL_NODES)
    gains = node_gains(model, draws.keys, view, places)
    result = reduce_nodes(draws.from_unit(unit), gains, Over.MEAN, places.weights)
    found = analysis.analyze(problem, result, calc_second_order=False, seed=seed)
    columns = zip(found["S1"], found["ST"], found["ST_conf"], strict=True)
    return {
        draws.keys[index]: (float(first), float(total), float(spread))
        for index, (first, total, spread) in zip(wide, columns, strict=True)
    }
