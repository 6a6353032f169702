"""Plans of acts: whole steps of a few adjusters that reduce the volumetric error."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.adjuster_effects import add_effects, adjuster_effects
from warpspace.analysis.adjustment_search import SILENT, Objective, StepSearch, Volume
from warpspace.field.evaluate import ErrorBasis, View, fit_placement, placement_effect
from warpspace.field.grid import Grid
from warpspace.machine.adjusters import Adjuster
from warpspace.machine.axes import parameter
from warpspace.machine.errors import ErrorSet
from warpspace.scene.model import Scene, evaluate_grid
from warpspace.units import Array

PLACEMENT_ONLY = 1e-9  # share of its effect that remains of an error which is only a placement
MAX_DENOMINATOR = 64  # of a fraction of a turn
TOLERANCE_POSITIONS = 5  # along an axis at which a changed curve is compared with its tolerance


@dataclass(frozen=True, slots=True)
class Act:
    """Change of an adjuster, or of all adjusters of a group by the same amount."""

    json_keys: ClassVar[tuple[str, ...]] = ("adjuster", "change", "unit", "um")
    adjuster: str  # its name, or that of the group
    change: float
    unit: str  # turn, mm, µm/m or µrad
    um: float | None  # travel, µm; None for a parameter of the control
    members: tuple[Adjuster, ...]

    def __str__(self) -> str:
        """Write the change: ``rear left foot + 1/8 turn (125 µm)``."""
        sign, amount = "+" if self.change > 0.0 else "−", abs(self.change)
        size, um = f"{amount:.6g}", "" if self.um is None else f" ({abs(self.um):.4g} µm)"
        if self.unit == "turn":
            turns, fraction = divmod(Fraction(amount).limit_denominator(MAX_DENOMINATOR), 1)
            if abs(float(turns + fraction) - amount) < self.members[0].step / 100.0:
                size = " ".join(str(number) for number in (turns, fraction) if number)
        return f"{self.adjuster} {sign} {size} {self.unit}{um}"


class Plan(NamedTuple):
    """Acts, the errors after them, and whether they are proven to be the best."""

    acts: tuple[Act, ...]
    errors: ErrorSet
    error_um: Array  # [..., 3]; of the nodes, to first order
    proven: bool


@dataclass(frozen=True)
class Planner:
    """Acts that are possible on a machine, and their effect on its volume."""

    scene: Scene
    grid: Grid
    view: View
    factors: Mapping[str, float]  # effect of adjusters relative to the geometric one
    done: Mapping[str, float]  # changes of adjusters so far
    excluded: Collection[str] = ()  # errors that are not evaluated

    def members_of_acts(self) -> dict[str, list[int]]:
        """List the adjusters of each possible act: one, or those of a group."""
        members: dict[str, list[int]] = {}
        for index, adjuster in enumerate(self.scene.machine.adjusters):
            for name in (adjuster.name, *adjuster.groups):
                members.setdefault(name, []).append(index)
        return members

    def plan(
        self,
        error_um: Array,
        objective: Objective,
        count: int,
        *,
        constrained: bool,
        advance: Callable[[float], None],
    ) -> tuple[dict[str, float], tuple[str, ...], Iterator[Plan]]:
        """Plan the best one, two, … acts for the errors of the nodes, [..., 3].

        Return also the largest change of each act that is possible, and the names of adjusters
        that have no effect in this view.
        """
        scene, adjusters = self.scene, self.scene.machine.adjusters
        effects = [
            ErrorSet({k: f for k, f in effect.functions.items() if k not in self.excluded})
            for effect in adjuster_effects(scene, self.factors)
        ]
        step_sizes = np.array([adjuster.step for adjuster in adjusters])
        machines = [replace(scene, errors=effect) for effect in effects]
        fields = np.array([evaluate_grid(each, self.grid, self.view).error_um for each in machines])
        fields *= step_sizes[:, None, None, None, None]
        acts = self.members_of_acts()
        response = np.array([fields[members].sum(axis=0) for members in acts.values()])
        largest_um = np.abs(response).max(axis=(1, 2, 3, 4))
        active = (largest_um > SILENT) & ~is_placement(scene, self.grid, response)
        idle = tuple(name for name, is_active in zip(acts, active, strict=True) if not is_active)
        acts = {name: members for name, members in acts.items() if name not in idle}
        ranges = np.array([a.steps_left(self.done.get(a.name, 0.0)) for a in adjusters], float)
        bounds = [(ranges[m, 0].max(), ranges[m, 1].min()) for m in acts.values()]
        bounds = np.array(bounds).reshape(-1, 2)
        position = np.concatenate([error_um[None], response[active]])
        basis = ErrorBasis(("present", *acts), self.grid.nominal_mm, position, position)
        volume = Volume(basis, self.grid, np.eye(len(position))[0])
        share = np.zeros((len(ranges), len(acts)))
        for column, members in enumerate(acts.values()):
            share[members, column] = 1.0
        rows, limits, mean_um = share, ranges, np.inf
        if constrained:
            changes, allowed = self._tolerance_conditions(effects)
            rows = np.concatenate([rows, changes @ (step_sizes[:, None] * share)])
            limits = np.concatenate([limits, allowed])
            mean_um = volume.mean((), np.zeros(0))[0]
        search = StepSearch(volume, objective, bounds, rows, limits, mean_um)

        def plans() -> Iterator[Plan]:
            for steps, proven in search.best_sets(count, advance) if acts else ():
                changes = share @ steps * step_sizes
                chosen = tuple(
                    self._act(name, members, number)
                    for (name, members), number in zip(acts.items(), steps.tolist(), strict=True)
                    if number
                )
                errors = add_effects(scene, effects, changes.tolist())
                after_um = error_um + np.tensordot(steps, response[active], 1)
                yield Plan(chosen, errors, after_um, proven)

        largest_steps = np.abs(bounds).max(axis=1, initial=0.0)
        largest_changes = {
            name: float(number) * adjusters[members[0]].step
            for (name, members), number in zip(acts.items(), largest_steps, strict=True)
        }
        return largest_changes, idle, plans()

    def _act(self, name: str, members: Sequence[int], steps: float) -> Act:
        adjusters = tuple(self.scene.machine.adjusters[index] for index in members)
        change = round(steps * adjusters[0].step, 9)
        um = None if adjusters[0].kind.is_parameter else change * adjusters[0].travel_per_unit
        return Act(name, change, adjusters[0].unit, um, adjusters)

    def _tolerance_conditions(self, effects: Sequence[ErrorSet]) -> tuple[Array, Array]:
        """Return the change of each toleranced value by each adjuster, [R, J], and its limits.

        New values are within tolerance, or nearer to it than the present ones.
        """
        scene, rows, limits = self.scene, list[Array](), list[tuple[float, float]]()
        for key in dict.fromkeys(key for effect in effects for key in effect):
            tolerance, row = scene.tolerances.get(key), parameter(key)
            if tolerance is None:
                continue
            count = 1 if row.is_constant else TOLERANCE_POSITIONS
            at = np.linspace(*scene.axis_span(row.axis), count)
            present = np.broadcast_to(scene.errors.evaluate(key, at), at.shape)
            change = np.array([np.broadcast_to(e.evaluate(key, at), at.shape) for e in effects])
            for value, slope in zip(present.tolist(), change.T, strict=True):
                away = tolerance.centre - value
                width = tolerance.half_width
                limits.append((min(away - width, 0.0), max(away + width, 0.0)))
                rows.append(slope)
        return np.array(rows).reshape(-1, len(effects)), np.array(limits).reshape(-1, 2)


def is_placement(scene: Scene, grid: Grid, response: Array) -> NDArray[np.bool_]:
    """Find the responses, [K], that are those of a placement of the workpiece."""
    fitted = fit_placement(scene.model, grid, response)
    remaining = response - placement_effect(scene.model, fitted, grid.coordinates, grid.point_mm)[0]
    largest = [np.abs(part).max(axis=(1, 2, 3, 4), initial=0.0) for part in (remaining, response)]
    return np.less_equal(largest[0], PLACEMENT_ONLY * largest[1])
