"""Error gains: how much of each error parameter arrives at the functional point, and why."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from warpspace.analysis.draws import loop_keys
from warpspace.analysis.levers import Part, lever_parts, vector
from warpspace.exceptions import OptionError
from warpspace.kinematics.chain import nominal_point
from warpspace.kinematics.firstorder import Column, columns
from warpspace.kinematics.model import Loop, Model, complete_coordinates
from warpspace.machine.parameters import Parameter, parameter
from warpspace.units import Array

DEFAULT_SHARE = 0.8
DEFAULT_STEPS_DEG = (1.0, 5.0, 10.0, 15.0, 30.0, 45.0, 90.0)
"""Of rotary axes: the finest that keeps to `MAX_DEFAULT_NODES` positions; 1° for two axes."""
MAX_NODES = 5_000_000
MAX_DEFAULT_NODES = 500_000


@dataclass(frozen=True, slots=True)
class Gain:
    """Gain of one parameter.

    Attributes
    ----------
    key : str
    x, y, z : float, µm/µm or µm/µrad
        In R: signed at a point, largest absolute value over the travel.
    norm : float
        Length; over the travel the largest, which need not be where the components are largest.
    lever_mm : tuple of float, (3,), mm
        From the origin of the frame the error sits in to the point, in R; over the travel where the
        norm is largest.
    at : mapping of str to float, mm or degrees
        Axis positions that belong to the lever.
    lever_parts_mm : tuple of (str, tuple of float), mm
        The lever taken apart: motions and offsets it is made of, in R; empty for a workpiece-side
        parameter in the relative loop, where the point belongs to the other branch.
    is_key : bool
        Whether it is one of the key errors, see `mark_key_errors`.
    """

    key: str
    x: float
    y: float
    z: float
    norm: float
    lever_mm: tuple[float, float, float]
    at: Mapping[str, float]
    lever_parts_mm: tuple[Part, ...] = ()
    is_key: bool = False

    @property
    def parameter(self) -> Parameter:
        """The row of the parameter table."""
        return parameter(self.key)

    @property
    def unit(self) -> str:
        """Unit of the gain."""
        return f"µm/{self.parameter.unit}"


def gains_at(
    model: Model,
    loop: Loop,
    keys: Sequence[str],
    at: Mapping[str, ArrayLike],
    share: float = DEFAULT_SHARE,
) -> tuple[Gain, ...]:
    """Compute the gains at one position of the machine.

    Parameters
    ----------
    model : Model
    loop : Loop
        The functional point is the workpiece point in the workpiece loop, else the tool point.
    keys : sequence of str
        Those whose axis is not in the loop are left out.
    at : mapping of str to float, mm or degrees
        Axis positions; absent axes stand at zero.
    share : float, optional
        Share of the sum of squares that the key errors make up.

    Returns
    -------
    tuple of Gain
        Largest first.

    Raises
    ------
    OptionError
        If the loop has no axis or the share is out of range.
    UnknownNameError
        If an axis does not exist.
    """
    chosen = loop_keys(model, loop, keys)
    coordinates = complete_coordinates(model.machine, at)
    point = nominal_point(model, loop, coordinates)
    found = columns(model, loop, chosen, coordinates, point)
    here = {name: float(value) for name, value in coordinates.items()}
    rows = [_gain(model, loop, key, found[key], here) for key in chosen]
    return mark_key_errors(rows, share)


def gains_max(
    model: Model,
    loop: Loop,
    keys: Sequence[str],
    ranges: Mapping[str, tuple[float, float]],
    step_deg: float | None = None,
    share: float = DEFAULT_SHARE,
) -> tuple[Gain, ...]:
    """Compute the largest absolute gains over the travel.

    Parameters
    ----------
    model : Model
    loop : Loop
    keys : sequence of str
    ranges : mapping of str to tuple of float, (2,), mm or degrees
        Travel of each axis; those whose axis is not in the loop have no influence.
    step_deg : float, optional
        Step of rotary axes; 1° by default, which misses at most 0.004 % of the lever.
    share : float, optional

    Returns
    -------
    tuple of Gain
        Largest first. Components and norm are each the largest over the travel.

    Raises
    ------
    OptionError
        If the step is out of range or the loop has no axis.

    Notes
    -----
    A gain is affine in the linear axes, hence largest at an end of their ranges: two positions each
    are exact. Table 4-4 of the thesis has steps of 10°.
    """
    chosen = loop_keys(model, loop, keys)
    best: dict[str, Gain] = {}
    for coordinates in _sweep(model, loop, ranges, step_deg):
        point = nominal_point(model, loop, coordinates)
        found = columns(model, loop, chosen, coordinates, point)
        for key in chosen:
            best[key] = _larger(model, loop, key, found[key], coordinates, best.get(key))
    return mark_key_errors(list(best.values()), share)


def mark_key_errors(rows: Sequence[Gain], share: float = DEFAULT_SHARE) -> tuple[Gain, ...]:
    """Sort by norm and mark the largest that together make up a share of the sum of squares.

    One µm and one µrad count the same, as in the thesis (section 4.2).

    Raises
    ------
    OptionError
        If the share is not above 0 and at most 1.
    """
    if not 0.0 < share <= 1.0:
        raise OptionError(f"share: {share:g}; expected above 0, at most 1, for instance 0.8")
    # Rounded, so that gains that are equal but for rounding errors keep the order of the table.
    ranked = sorted(rows, key=lambda row: -round(row.norm, 9))
    squares = np.array([row.norm**2 for row in ranked])
    before = np.cumsum(squares) - squares
    limit = share * squares.sum() * (1.0 - 1e-12)
    return tuple(
        replace(row, is_key=bool(row.norm > 0.0 and done < limit))
        for row, done in zip(ranked, before, strict=True)
    )


def _gain(model: Model, loop: Loop, key: str, col: Column, here: Mapping[str, float]) -> Gain:
    """Put the row of one parameter at one position together."""
    position = np.broadcast_to(col.position, (3,))
    x, y, z = vector(position)
    norm = float(np.linalg.norm(position))
    parts = lever_parts(model, loop, key, here)
    return Gain(key, x, y, z, norm, vector(np.broadcast_to(col.lever_mm, (3,))), here, parts)


def _larger(
    model: Model,
    loop: Loop,
    key: str,
    col: Column,
    coordinates: Mapping[str, Array],
    best: Gain | None,
) -> Gain:
    """Merge the largest gains of a batch of positions into those found so far."""
    shape = np.broadcast_shapes(*(values.shape for values in coordinates.values()))
    size = np.abs(np.broadcast_to(col.position, (*shape, 3)))
    norms = np.linalg.norm(size, axis=-1)
    top = size.reshape(-1, 3).max(axis=0)
    # Rounded, so that of positions that are equal but for rounding errors the first is taken.
    index = np.unravel_index(int(np.argmax(np.round(norms, 9))), shape)
    norm = float(norms[index])
    if best is not None:
        top = np.maximum(top, (best.x, best.y, best.z))
    x, y, z = vector(top)
    if best is not None and norm <= best.norm + 1e-9:
        return replace(best, x=x, y=y, z=z)
    here = {
        name: float(np.broadcast_to(values, shape)[index]) for name, values in coordinates.items()
    }
    lever = vector(np.broadcast_to(col.lever_mm, (*shape, 3))[index])
    return Gain(key, x, y, z, norm, lever, here, lever_parts(model, loop, key, here))


def _sweep(
    model: Model,
    loop: Loop,
    ranges: Mapping[str, tuple[float, float]],
    step_deg: float | None,
) -> Iterator[dict[str, Array]]:
    """Give batches of positions that cover the travel of the axes in a loop."""
    sides = ("tool", "workpiece") if loop is Loop.RELATIVE else (str(loop),)
    axes = [axis for side in sides for axis in model.machine.branch(side)]
    rotary = [axis.name for axis in axes if not axis.is_linear]
    step = _default_step(ranges, rotary) if step_deg is None else step_deg
    if not 0.0 < step <= 90.0:
        raise OptionError(f"step: {step:g}°; expected above 0, at most 90")
    turns: dict[str, Array] = {}
    for name in rotary:
        low, high = ranges[name]
        steps = int(np.ceil((high - low) / step - 1e-9))
        turns[name] = np.linspace(low, high, steps + 1)
    count = int(np.prod([len(values) for values in turns.values()]))
    if count > MAX_NODES:
        raise OptionError(
            f"step: {step:g}° gives {count:,} positions; expected at most {MAX_NODES:,}"
        )
    linear = [axis.name for axis in axes if axis.is_linear]
    outer, inner = rotary[:1], rotary[1:]
    mesh = dict(zip(inner, np.meshgrid(*(turns[name] for name in inner)), strict=True))
    for ends in product(*(dict.fromkeys(ranges[name]) for name in linear)):
        for first in product(*(turns[name] for name in outer)):
            fixed = zip((*linear, *outer), (*ends, *first), strict=True)
            given = {**mesh, **{name: np.asarray(value) for name, value in fixed}}
            yield complete_coordinates(model.machine, given)


def _default_step(ranges: Mapping[str, tuple[float, float]], rotary: Sequence[str]) -> float:
    """Choose the step of rotary axes, degrees, so that there are not too many positions."""
    spans = [ranges[name][1] - ranges[name][0] for name in rotary]
    for step in DEFAULT_STEPS_DEG:
        if math.prod(math.ceil(span / step) + 1 for span in spans) <= MAX_DEFAULT_NODES:
            return step
    return DEFAULT_STEPS_DEG[-1]
