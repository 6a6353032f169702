"""Machines drawn from a tolerance set: which parameters, and how they are distributed."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy import special

from warpspace.exceptions import OptionError, SceneError
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.parameters import parameter
from warpspace.machine.tolerances import ToleranceSet
from warpspace.units import Array

SIGMAS = 3.0
"""Standard deviations of a normal distribution between centre and limit (thesis, section 4.3)."""


class Distribution(StrEnum):
    """How a parameter falls into its tolerance."""

    UNIFORM = "uniform"
    NORMAL = "normal"


@dataclass(frozen=True, slots=True)
class Draws:
    """Independent random values of a machine's parameters.

    Attributes
    ----------
    keys : tuple of str, (K,)
        Parameter keys.
    centre, half_width : ndarray, [K], µm or µrad
    distribution : Distribution
        Uniform over centre ± half width, or normal with 3σ = half width.
    clip : bool
        Whether the normal distribution ends at the limits (values outside are drawn again); without
        it 0.27 % lie outside. Without effect on the uniform one.
    """

    keys: tuple[str, ...]
    centre: Array
    half_width: Array
    distribution: Distribution = Distribution.UNIFORM
    clip: bool = False

    @property
    def variance(self) -> Array:
        """Variance of each parameter, [K], µm² or µrad²."""
        if self.distribution is Distribution.UNIFORM:
            return self.half_width**2 / 3.0
        sigma = self.half_width / SIGMAS
        if not self.clip:
            return sigma**2
        inside = 1.0 - 2.0 * float(special.ndtr(-SIGMAS))
        density = math.exp(-(SIGMAS**2) / 2.0) / math.sqrt(2.0 * math.pi)
        return sigma**2 * (1.0 - 2.0 * SIGMAS * density / inside)

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Draw machines.

        Parameters
        ----------
        rng : numpy.random.Generator
        count : int

        Returns
        -------
        ndarray, [count, K], µm or µrad
        """
        shape = (count, len(self.keys))
        if self.distribution is Distribution.UNIFORM:
            return self.centre + self.half_width * rng.uniform(-1.0, 1.0, shape)
        unit = rng.standard_normal(shape)
        while self.clip and (outside := np.abs(unit) > SIGMAS).any():
            unit[outside] = rng.standard_normal(int(outside.sum()))
        return self.centre + self.half_width / SIGMAS * unit

    def from_unit(self, unit: Array) -> Array:
        """Turn numbers between 0 and 1 into parameter values through the inverse distribution.

        Parameters
        ----------
        unit : ndarray, [..., K]
            Between 0 and 1.

        Returns
        -------
        ndarray, [..., K], µm or µrad
        """
        if self.distribution is Distribution.UNIFORM:
            return self.centre + self.half_width * (2.0 * unit - 1.0)
        tail = float(special.ndtr(-SIGMAS)) if self.clip else 1e-12
        return self.centre + self.half_width / SIGMAS * special.ndtri(
            tail + unit * (1.0 - 2.0 * tail)
        )


def loop_keys(model: Model, loop: Loop, keys: Sequence[str]) -> tuple[str, ...]:
    """Keep the parameters whose axis lies in a loop.

    Parameters
    ----------
    model : Model
    loop : Loop
    keys : sequence of str

    Returns
    -------
    tuple of str

    Raises
    ------
    OptionError
        If the loop has no axis, so that nothing can go wrong in it.
    """
    sides = ("tool", "workpiece") if loop is Loop.RELATIVE else (str(loop),)
    axes = {axis.name for side in sides for axis in model.machine.branch(side)}
    if not axes:
        raise OptionError(f"loop {loop}: the machine {model.machine.chain} has no axis in it")
    return tuple(key for key in keys if parameter(key).axis in axes)


def build_draws(
    tolerances: ToleranceSet,
    keys: Sequence[str],
    distribution: Distribution | str = Distribution.UNIFORM,
    *,
    clip: bool = False,
    source: str = "tolerances",
) -> Draws:
    """Collect the distribution of every parameter.

    Parameters
    ----------
    tolerances : ToleranceSet
    keys : sequence of str, (K,)
    distribution : Distribution or str, optional
    clip : bool, optional
    source : str, optional
        What the tolerance set is called in messages.

    Returns
    -------
    Draws

    Raises
    ------
    SceneError
        If there are no tolerances, or not for every parameter, or a half width is negative.
    OptionError
        If there is no such distribution.
    """
    if distribution not in [*Distribution]:
        raise OptionError(
            f"distribution {distribution!r}; expected one of {', '.join(Distribution)}"
        )
    if not tolerances:
        problem = (
            "has no tolerances to sample machines from; expected a [tolerances] section, for"
            " instance default = { translation = 10, rotation = 20, squareness = 25 }"
        )
        raise SceneError(source, [problem])
    if missing := tolerances.missing(keys):
        problem = (
            f"tolerances: no half width for {', '.join(missing)}; expected one for each parameter"
            " of the loop, or a default for its class (0 holds it at its centre)"
        )
        raise SceneError(source, [problem])
    found = [tolerance for key in keys if (tolerance := tolerances.get(key)) is not None]
    for key, tolerance in zip(keys, found, strict=True):
        if not tolerance.half_width >= 0.0:
            raise SceneError(
                source, [f"tolerances.{key}: half width {tolerance.half_width:g}; expected ≥ 0"]
            )
    return Draws(
        tuple(keys),
        np.array([tolerance.centre for tolerance in found], dtype=float),
        np.array([tolerance.half_width for tolerance in found], dtype=float),
        Distribution(distribution),
        clip,
    )
