"""What repairs a machine: each error left out or set best, and the best sets of adjustments."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from warpspace.analysis.repair.search import best_sets
from warpspace.analysis.repair.solve import Objective, least
from warpspace.analysis.repair.volume import Volume
from warpspace.analysis.statistics import Statistics
from warpspace.exceptions import OptionError
from warpspace.field.basis import ErrorBasis
from warpspace.field.grid import Grid
from warpspace.machine.limits import MAX_ERROR, MIN_HALF_WIDTH, REPAIR_COUNT
from warpspace.machine.parameters import Parameter, parameter
from warpspace.units import Array

DEFAULT_COUNT = 3
DEFAULT_LIMIT = 200.0
"""µm or µrad by which an error may be changed, unless somebody says otherwise."""


@dataclass(frozen=True, slots=True)
class RepairPlan:
    """What is asked for.

    Attributes
    ----------
    objective : Objective
        What is made smallest: the RMS of the volume, or its largest error.
    count : int
        Largest number of adjustments in one set.
    adjustable : sequence of str or None
        Keys that may be adjusted; None takes squareness and alignment, the constant errors.
    any_error : bool
        Whether every error of the loop may be adjusted instead, for compensation.
    limit : float, µm or µrad
        By how much an error may be changed.
    limits : mapping of str to float, µm or µrad
        Keys with a limit of their own.
    """

    objective: Objective = Objective.RMS
    count: int = DEFAULT_COUNT
    adjustable: Sequence[str] | None = None
    any_error: bool = False
    limit: float = DEFAULT_LIMIT
    limits: Mapping[str, float] = field(default_factory=dict[str, float])

    def limit_of(self, key: str) -> float:
        """Give the largest change of one error, µm or µrad."""
        return self.limits.get(key, self.limit)

    def check(self) -> None:
        """Check the numbers.

        Raises
        ------
        OptionError
            If one is out of range.
        """
        low, high = REPAIR_COUNT
        if not low <= self.count <= high:
            raise OptionError(f"{self.count} adjustments; expected {low} to {high}")
        for name, limit in (("all errors", self.limit), *self.limits.items()):
            if not MIN_HALF_WIDTH <= limit <= MAX_ERROR:
                raise OptionError(
                    f"limit of {name}: ±{limit:g}; expected {MIN_HALF_WIDTH:g} to {MAX_ERROR:g}"
                    " µm or µrad"
                )


@dataclass(frozen=True, slots=True)
class Outcome:
    """The whole volume for some values of the errors.

    Attributes
    ----------
    mean_um, rms_um, p95_um, max_um : float, µm
        Of the length of the error; each node weighs its share of the volume.
    """

    mean_um: float
    rms_um: float
    p95_um: float
    max_um: float


@dataclass(frozen=True, slots=True)
class Effect:
    """One error alone: left out, or at its best value, with all others as they are.

    Attributes
    ----------
    key : str
    present : float, µm or µrad
    left_out : Outcome
    best_value : float, µm or µrad
        Within its limit.
    best : Outcome
    adjustable : bool
        Whether it may be part of a repair.
    """

    key: str
    present: float
    left_out: Outcome
    best_value: float
    best: Outcome
    adjustable: bool

    @property
    def parameter(self) -> Parameter:
        """The row of the parameter table."""
        return parameter(self.key)


@dataclass(frozen=True, slots=True)
class Repair:
    """The best set of so many adjustments.

    Attributes
    ----------
    adjust : mapping of str to float, µm or µrad
        New values by key.
    outcome : Outcome
    proven : bool
        Whether all sets of this size were compared; else the set was built up and improved by
        swapping its members.
    """

    adjust: Mapping[str, float]
    outcome: Outcome
    proven: bool


@dataclass(frozen=True, slots=True)
class Repairs:
    """What repairs a machine.

    Attributes
    ----------
    plan : RepairPlan
    before : Outcome
    effects : tuple of Effect
        Every error that is not zero and acts in the loop; the one whose best value helps the
        objective most comes first.
    repairs : tuple of Repair
        The best sets of one, two, three … adjustments; none where no point is off.
    adjustable : tuple of str
        Keys that were tried.
    present : mapping of str to float, µm or µrad
        Value of each of them now.
    """

    plan: RepairPlan
    before: Outcome
    effects: tuple[Effect, ...]
    repairs: tuple[Repair, ...]
    adjustable: tuple[str, ...]
    present: Mapping[str, float]


def default_adjustable(keys: Sequence[str]) -> tuple[str, ...]:
    """Pick what can be realigned: squareness, orientation and location errors."""
    return tuple(key for key in keys if parameter(key).is_constant)


def find_repairs(
    basis: ErrorBasis, grid: Grid, amplitudes: Array, plan: RepairPlan | None = None
) -> Repairs:
    """Find what repairs a machine.

    Parameters
    ----------
    basis : ErrorBasis
        First-order response of the nodes of the grid.
    grid : Grid
    amplitudes : ndarray, [K], µm or µrad
        Present errors, in the order of `basis.keys`.
    plan : RepairPlan, optional

    Returns
    -------
    Repairs

    Raises
    ------
    OptionError
        If the plan names an error that the machine does not have or that does not act here, or a
        number of it is out of range.
    """
    plan = plan or RepairPlan()
    plan.check()
    volume = Volume(basis, grid, amplitudes)
    candidates = _candidates(volume, plan)
    bounds = _bounds(volume, plan)
    off = bool(np.any(volume.error_um))
    sets = best_sets(volume, plan.objective, candidates if off else (), bounds, plan.count)
    repairs = [
        Repair(
            {basis.keys[i]: float(v) for i, v in zip(found.indices, values, strict=True)},
            _outcome(volume, found.indices, values),
            proven,
        )
        for found, proven in sets
        for values in [amplitudes[list(found.indices)] + found.change]
    ]
    effects = [
        _effect(volume, plan, index, bounds, adjustable=index in candidates)
        for index in volume.acting
        if amplitudes[index] != 0.0
    ]
    wanted = f"{plan.objective}_um"
    ranked = sorted(effects, key=lambda effect: round(getattr(effect.best, wanted), 6))
    keys = tuple(basis.keys[index] for index in candidates)
    return Repairs(
        plan,
        _outcome(volume, (), np.empty(0)),
        tuple(ranked),
        tuple(repairs),
        keys,
        {key: float(amplitudes[index]) for key, index in zip(keys, candidates, strict=True)},
    )


def _candidates(volume: Volume, plan: RepairPlan) -> tuple[int, ...]:
    """Give the errors that may be adjusted, by their place in the basis."""
    keys = volume.basis.keys
    if plan.any_error:
        places = volume.acting
    elif plan.adjustable is None:
        chosen = default_adjustable(keys)
        places = tuple(index for index in volume.acting if keys[index] in chosen)
    else:
        places = tuple(sorted({_place(volume, key) for key in plan.adjustable}))
    tried = [keys[index] for index in places]
    for key in plan.limits:
        if key not in tried:
            known = ", ".join(tried) or "none"
            raise OptionError(
                f"limit of {key}: it is not among the errors that are adjusted ({known})"
            )
    return places


def _place(volume: Volume, key: str) -> int:
    """Find an error that somebody wants to adjust."""
    keys = volume.basis.keys
    acting = [keys[index] for index in volume.acting]
    if key in acting:
        return keys.index(key)
    parameter(key)
    known = ", ".join(acting) or "none"
    raise OptionError(f"adjustable {key}: it moves no point in this loop; expected some of {known}")


def _bounds(volume: Volume, plan: RepairPlan) -> Array:
    """Give the least and the largest change of every error, [K, 2], µm or µrad."""
    limits = np.array([plan.limit_of(key) for key in volume.basis.keys])
    low = np.maximum(-limits, -MAX_ERROR - volume.amplitudes)
    high = np.minimum(limits, MAX_ERROR - volume.amplitudes)
    return np.column_stack([np.minimum(low, 0.0), np.maximum(high, 0.0)])


def _effect(
    volume: Volume, plan: RepairPlan, index: int, bounds: Array, *, adjustable: bool
) -> Effect:
    """Leave one error out, and set it to its best value."""
    indices, present = (index,), float(volume.amplitudes[index])
    found = least(volume, plan.objective, indices, bounds)
    change = np.zeros(1) if found is None else found.change
    best = np.array([present]) + change
    return Effect(
        volume.basis.keys[index],
        present,
        _outcome(volume, indices, np.zeros(1)),
        float(best[0]),
        _outcome(volume, indices, best),
        adjustable,
    )


def _outcome(volume: Volume, indices: tuple[int, ...], values: Array) -> Outcome:
    """Summarise the volume with some amplitudes at other values."""
    found: Statistics = volume.statistics(volume.changed(indices, values))
    return Outcome(found.mean_um, found.rms_um, found.p95_um, found.max_um)
