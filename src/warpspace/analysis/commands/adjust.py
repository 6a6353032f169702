"""Adjustment: errors to adjust, and their new values, that reduce the volumetric error."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from dataclasses import field as attribute
from typing import Annotated, Any, ClassVar

import numpy as np

from warpspace.analysis import description
from warpspace.analysis.act_planning import Act, Planner, is_placement
from warpspace.analysis.adjustment_log import Stiffness, extend_log, learn_stiffness, read_log
from warpspace.analysis.adjustment_search import Objective, Search, Volume
from warpspace.analysis.blocks import Bars, Block, Column, Panel, Series, Table, number_columns
from warpspace.analysis.options import (
    ALL,
    LOOP_HELP,
    LOOP_UNSET,
    PLACED_HELP,
    File,
    Grammar,
    Keys,
    Limits,
    option,
    typed_word,
)
from warpspace.analysis.statistics import Summary, volume_statistics
from warpspace.analysis.uncertainty import propagation
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import ErrorBasis, ErrorField, View, amplitudes_of, placed_words
from warpspace.field.grid import DEFAULT_NODES, Grid, build_grid
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import Parameter, parameter
from warpspace.machine.errors import ErrorSet, Tolerance
from warpspace.machine.limits import MAX_ERROR, MAX_TEXT, MIN_HALF_WIDTH, REPAIR_COUNT, REPAIR_NODES
from warpspace.scene.model import Scene, evaluate_grid, grid_basis, second_order, with_placement
from warpspace.units import Array, spell, spell_fixed, spell_short

DEFAULT_LIMIT = 200.0  # µm or µrad by which an error may be changed, unless somebody says otherwise
MOST_BARS, MOST_VALUES = 14, 3  # errors in a chart, and values beside a bar
WORTHWHILE = 0.01  # least gain of a proposed set over smaller ones, as a share of the present value
NO_TOLERANCE = Tolerance(0.0, np.inf)
OBJECTIVE_WORDS = {Objective.RMS: "RMS |E|", Objective.MAX: "largest |E|"}
FOUR = ("mean_um", "rms_um", "p95_um", "max_um")


@dataclass(frozen=True, slots=True, kw_only=True)
class Best(Summary):
    """Statistics of the volume with one error at its best value."""

    json_keys: ClassVar[tuple[str, ...]] = ("value", *FOUR, "expanded_uncertainty")
    value: float  # µm or µrad; within its limit


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """Effect of one error: omitted, or at its best value, with all others unchanged."""

    json_keys: ClassVar[tuple[str, ...]] = (
        "key", "unit", "present", "left_out", "best", "expanded_uncertainty",
    )  # fmt: skip
    key: str
    present: float  # µm or µrad
    left_out: Summary
    best: Best
    expanded_uncertainty: description.ExpandedUncertainty[float | None] = attribute(
        default_factory=description.ExpandedUncertainty[float | None]
    )

    @property
    def parameter(self) -> Parameter:
        return parameter(self.key)

    @property
    def unit(self) -> str:
        return self.parameter.unit


@dataclass(frozen=True, slots=True, kw_only=True)
class AdjustedSet(Summary):
    """Best set of adjustments of one size, and the statistics of the volume with it."""

    json_keys: ClassVar[tuple[str, ...]] = ("adjust", *FOUR, "exact", "expanded_uncertainty")
    adjust: Mapping[str, float]  # µm or µrad; new values by key
    # whether all sets of this size were compared; else the set was built up and improved by
    # swapping its members
    proven: bool
    exact: Summary  # by the exact chain

    @property
    def size(self) -> int:
        return len(self.adjust)

    @property
    def label(self) -> str:
        if len(self.adjust) > MOST_VALUES:
            return f"{len(self.adjust)} adjusted: {', '.join(self.adjust)}"
        return ", ".join(f"{key} → {spell(value)}" for key, value in self.adjust.items())

    def applied_to(self, scene: Scene) -> Scene:
        return apply_adjustments(scene, self.adjust)


@dataclass(frozen=True, slots=True, kw_only=True)
class ActSet(AdjustedSet):
    """Best acts on adjusters of one number, and the statistics of the volume after them."""

    json_keys: ClassVar[tuple[str, ...]] = (
        "acts", "adjust", *FOUR, "exact", "expanded_uncertainty",
    )  # fmt: skip
    acts: tuple[Act, ...]
    errors: ErrorSet  # of the machine after them
    error_um: Array = attribute(compare=False)  # [..., 3]; of the nodes, to first order

    @property
    def size(self) -> int:
        return len(self.acts)

    @property
    def label(self) -> str:
        return ", ".join(map(str, self.acts))

    def applied_to(self, scene: Scene) -> Scene:
        return replace(scene, title=f"{scene.title}, adjusted"[:MAX_TEXT], errors=self.errors)


@dataclass(frozen=True, kw_only=True)
class Adjust(description.Analysis):
    """Find which errors of SCENE to adjust, and to what.

    For each error stands what leaving it out, and what its best value, gives for the whole volume
    with all other errors as they are. Then follow the best sets of one, two, three … adjustments.
    RMS is made smallest by weighted least squares, max as a convex problem, to within 0.0001 µm.
    Model: first order; the sets found are evaluated again with the exact chain. Each node of the
    grid weighs its share of the volume. Sets keep the tolerances of the scene and do not increase
    the mean.

    If the machine has adjusters, sets are acts on them: whole steps of screws, shims and parameters
    within their ranges, the best by mixed-integer programming. --adjustable or --limit names errors
    instead.
    """

    name = "adjust"
    task = "improve"
    doing = "searching"
    has_chart = True
    makes_scenes = True
    scene_help = "Write the scene with the last set listed applied"
    loop: Loop | None = option(None, LOOP_HELP, unset=LOOP_UNSET)
    placed: bool = option(False, PLACED_HELP)
    objective: Objective = option(
        Objective.RMS,
        "Quantity to minimise over the volume: RMS or largest |E|",
        choice_labels={"rms": "RMS of the whole volume", "max": "largest |E| of the volume"},
    )
    count: int = option(
        3, "Largest number of adjustments in a set", low=REPAIR_COUNT[0], high=REPAIR_COUNT[1]
    )
    adjustable: Keys = option(
        (),
        "Errors that may be adjusted; of a curve the amplitude (compensation)",
        unset="squareness and alignment: the constant errors that no placement of the workpiece"
        " replaces",
    )
    limit: Limits = option(
        (), "Largest change of one error or of each, in µm or µrad", unset=f"±{DEFAULT_LIMIT:g}"
    )
    unconstrained: bool = option(
        False, "Also propose values beyond the tolerances, and sets that increase the mean"
    )
    grid: int = option(
        DEFAULT_NODES,
        "Nodes per axis of the working volume",
        low=REPAIR_NODES[0],
        high=REPAIR_NODES[1],
    )
    done: File = option(
        None, "Log of the acts so far, TOML; SCENE was measured after the last of them"
    )
    log: Annotated[str | None, Grammar("FILE", typed_word, is_extended=True)] = option(
        None, "Append the last acts listed, and the present errors, to this log"
    )

    def run(
        self, scene: Scene, watch: description.ProgressCallback = description.ignore_progress, /
    ) -> "AdjustResult":
        scene = with_placement(scene, self.loop, placed=self.placed)
        view = scene.view(self.loop)
        grid = build_grid(scene.model, scene.workspace, self.grid)
        basis = grid_basis(scene, grid, view, self.included(scene))
        amplitudes = amplitudes_of(scene.errors, basis.keys)
        volume = Volume(basis, grid, amplitudes)
        candidates = _candidates(scene, volume, self)
        limits = np.array([self.limit_of(key) for key in basis.keys])
        low = np.maximum(-limits, -MAX_ERROR - amplitudes)
        high = np.minimum(limits, MAX_ERROR - amplitudes)
        bounds = np.column_stack([np.minimum(low, 0.0), np.maximum(high, 0.0)])
        before = Summary(*volume.statistics(amplitudes).four)
        off = bool(np.any(volume.error_um))
        sets: list[AdjustedSet] = []
        each = search = Search(volume, self.objective, bounds)
        acts = self.uses_adjusters(scene)
        if not self.unconstrained:
            tolerated = self._within_tolerance(scene, basis.keys, amplitudes, bounds)
            search = replace(each, bounds=tolerated, mean_um=before.mean_um)
        candidates = tuple(index for index in candidates if np.ptp(search.bounds[index]))
        for best, proven in search.best_sets(candidates if off and not acts else (), self.count):
            values = amplitudes[list(best.indices)] + best.change
            adjust = {basis.keys[i]: float(v) for i, v in zip(best.indices, values, strict=True)}
            numbers = volume.statistics(volume.changed(best.indices, values))
            adjusted = apply_adjustments(scene, adjust)
            exact = volume_statistics(evaluate_grid(adjusted, grid, view, exact=True), grid)
            sets.append(
                AdjustedSet(*numbers.four, adjust=adjust, proven=proven, exact=Summary(*exact.four))
            )
            watch(len(sets) / (self.count + 1))
        errors = [_effect(each, i) for i in volume.active_indices if amplitudes[i] != 0.0]
        name = f"{self.objective}_um"
        keys = [basis.keys[index] for index in candidates]
        result = AdjustResult(
            analysis=self,
            scene=scene,
            before=before,
            errors=tuple(sorted(errors, key=lambda effect: round(getattr(effect.best, name), 6))),
            adjustments=tuple(sets),
            adjustable={key: self.limit_of(key) for key in keys},
            present={key: float(amplitudes[i]) for key, i in zip(keys, candidates, strict=True)},
            second_order=second_order(scene, view.loop),
        )
        error = basis.evaluate(amplitudes, orientation=False).error_um
        if acts:
            result = self._with_acts(result, grid, error, watch)
        at = grid.coordinates, view, grid.point_mm, grid.weights
        uncertainty = propagation.field_uncertainty(scene, error, *at)
        return result if uncertainty is None else _with_uncertainty(result, uncertainty, basis)

    def included(self, scene: Scene) -> Sequence[str]:
        return scene.parameter_keys

    def uses_adjusters(self, scene: Scene) -> bool:
        for name in ("done", "log"):
            if getattr(self, name) and (self.adjustable or self.limit):
                raise OptionError(
                    f"{{{name}}}: acts on adjusters; expected no {{adjustable}} or {{limit}}"
                )
            if getattr(self, name) and not scene.machine.adjusters:
                raise OptionError(f"{{{name}}}: {scene.machine.title} has no adjusters")
        return bool(scene.machine.adjusters) and not (self.adjustable or self.limit)

    def _with_acts(
        self,
        result: "AdjustResult",
        grid: Grid,
        error_um: Array,
        watch: description.ProgressCallback,
    ) -> "AdjustResult":
        scene, view = result.scene, result.view
        entries = read_log(self.done, scene) if self.done else ()
        stiffness = learn_stiffness(scene, entries, self.done or "")
        factors = {name: learnt.factor for name, learnt in stiffness.items()}
        done = Counter[str]()
        for entry in entries:
            done.update(entry.changes)
        excluded = {*scene.parameter_keys} - {*self.included(scene)}
        largest_changes, idle, plans = Planner(scene, grid, view, factors, done, excluded).plan(
            error_um,
            self.objective,
            self.count if error_um.any() else 0,
            constrained=not self.unconstrained,
            advance=watch,
        )
        sets: list[ActSet] = []
        for plan in plans:
            field = ErrorField(grid.nominal_mm, plan.error_um, plan.error_um)
            adjust = {
                key: plan.errors.amplitude(key)
                for key in plan.errors
                if plan.errors.functions[key] != scene.errors.functions.get(key)
            }
            adjusted = replace(scene, errors=plan.errors)
            exact = volume_statistics(evaluate_grid(adjusted, grid, view, exact=True), grid)
            sets.append(
                ActSet(
                    *volume_statistics(field, grid).four,
                    **plan._asdict(),
                    adjust=adjust,
                    exact=Summary(*exact.four),
                )
            )
        keys = dict.fromkeys(key for adjusted in sets for key in adjusted.adjust)
        return replace(
            result,
            adjustments=tuple(sets),
            adjustable=largest_changes,
            present={key: scene.errors.amplitude(key) for key in keys},
            idle=idle,
            stiffness=tuple(stiffness.values()) if entries else None,
        )

    def _within_tolerance(
        self, scene: Scene, keys: Sequence[str], amplitudes: Array, bounds: Array
    ) -> Array:
        """Restrict changes, [K, 2], to new values within tolerance, or towards it."""
        tolerances = [scene.tolerances.get(key) or NO_TOLERANCE for key in keys]
        centre = np.array([tolerance.centre for tolerance in tolerances]) - amplitudes
        half_width = np.array([tolerance.half_width for tolerance in tolerances])
        low, high = (np.clip(centre + side * half_width, *bounds.T) for side in (-1.0, 1.0))
        is_out_of_reach = low == high
        low[is_out_of_reach] = np.minimum(low[is_out_of_reach], 0.0)
        high[is_out_of_reach] = np.maximum(high[is_out_of_reach], 0.0)
        return np.column_stack([low, high])

    def limit_of(self, key: str) -> float:
        """Return the largest change of one error, µm or µrad."""
        limits = dict(self.limit)
        return limits.get(key, limits.get(ALL, DEFAULT_LIMIT))


@dataclass(frozen=True, kw_only=True)
class AdjustResult(description.Result):
    """Adjustments of a machine."""

    json_keys = ("objective", "before", "errors", "adjustable", "adjustments", "all_sets_compared")
    no_change = "there is nothing to adjust in this loop"
    analysis: Adjust
    scene: Scene
    before: Summary
    # every error that is not zero and acts in the loop; the one whose best value helps the
    # objective most comes first
    errors: tuple[Effect, ...]
    # the best sets of one, two, three … adjustments; none where no point is off
    adjustments: tuple[AdjustedSet, ...]
    adjustable: Mapping[str, float]  # largest change of each error that was tried, µm or µrad
    present: Mapping[str, float]  # value of each of them now, µm or µrad
    # of acts on adjusters; then `adjustable` has the largest change of each act, in its unit
    idle: tuple[str, ...] = ()  # acts without an effect in this loop
    stiffness: tuple[Stiffness, ...] | None = None  # learned from the log

    def json_fields(self) -> dict[str, Any]:
        learned = {} if self.stiffness is None else {"stiffness": self.stiffness}
        return super().json_fields() | description.to_json(learned)

    @property
    def objective(self) -> Objective:
        return self.analysis.objective

    @property
    def view(self) -> View:
        return self.scene.view(self.analysis.loop)

    @property
    def worthwhile(self) -> Sequence[int]:
        """Indices of the sets that gain at least `WORTHWHILE` over all smaller ones."""
        name, indices = f"{self.objective}_um", list[int]()
        least: float = getattr(self.before, name)
        for index, adjusted in enumerate(self.adjustments):
            if getattr(adjusted, name) < least - WORTHWHILE * getattr(self.before, name):
                indices.append(index)
                least = getattr(adjusted, name)
        return indices

    @property
    def all_sets_compared(self) -> list[bool]:
        return [adjusted.proven for adjusted in self.adjustments]

    def changes(self) -> Sequence[description.Change]:
        return [
            description.Change(
                f"after adjustment: {adjusted.label}",
                adjusted.applied_to(self.scene),
                tuple(map(str, adjusted.acts)) if isinstance(adjusted, ActSet) else (),
            )
            for adjusted in self.adjustments
        ]

    @property
    def is_acts(self) -> bool:
        return self.analysis.uses_adjusters(self.scene)

    def updated_files(self) -> Mapping[str, str]:
        """Return the log with the proposed acts; empty without --log."""
        if self.analysis.log is None or not self.adjustments:
            return {}
        last = self.adjustments[-1]
        acts = last.acts if isinstance(last, ActSet) else ()
        return {self.analysis.log: extend_log(self.analysis.log, self.scene, acts, last.adjust)}

    def blocks(self) -> Iterator[Block]:
        smallest = f"smallest {OBJECTIVE_WORDS[self.objective]}"
        yield " · ".join((self.scene.title, *self._where, smallest))
        mean, rms, p95, largest = (spell_fixed(getattr(self.before, name)) for name in FOUR)
        yield f"  before: mean {mean}, RMS {rms}, P95 {p95}, max {largest} µm"
        uncertainty = propagation.scene_uncertainty(self.scene, self.view.loop)
        yield from propagation.u95_lines(uncertainty, {"": self.before})
        columns = (
            Column("key", leads=True),
            Column("now", ".4g"),
            Column("unit"),
            *number_columns(("omitted: mean", "RMS", "max"), unit="µm"),
            Column("best value", ".1f"),
            *number_columns(("then: mean", "RMS", "max"), unit="µm"),
        )
        rows = [
            (
                effect.key,
                effect.present,
                effect.unit,
                *effect.left_out.three,
                effect.best.value,
                *effect.best.three,
            )
            for effect in self.errors
        ]
        yield Table(
            columns,
            rows,
            title="Each error alone, all others unchanged:",
            empty="  all errors that act in this loop are zero",
        )
        yield from self._set_blocks()
        for effect in self.errors:
            probability = effect.best.expanded_uncertainty.get("probability")
            if probability is not None:
                u95 = propagation.plus_minus(effect.expanded_uncertainty["u95_present"], ".3g")
                yield (
                    f"  {effect.key} {effect.present:.4g} {u95} {effect.unit}: best value"
                    f" {effect.best.value:.1f} improves with probability {probability:.1%}"
                )
        yield self.bars()

    @property
    def _where(self) -> tuple[str, ...]:
        return f"{self.view.loop} loop", *placed_words(self.view)

    def _set_blocks(self) -> Iterator[Block]:
        if not self.before.max_um:
            yield "The error is zero everywhere in this loop: there is nothing to adjust."
            return
        if not self.adjustments and self.is_acts:
            yield "No act on an adjuster reduces the error within its range and the tolerances."
            yield from self._act_remarks()
            return
        if not self.adjustments:
            yield "No squareness or alignment acts in this loop; other errors can be adjusted."
            return
        columns = (
            Column("set", "d", leads=True),
            *number_columns(("mean", "RMS", "P95", "max"), unit="µm"),
            Column("acts" if self.is_acts else "adjust", wraps=True),
        )
        rows = [
            (
                adjusted.size,
                *adjusted.four,
                adjusted.label if self.is_acts else self._adjustments(adjusted),
            )
            for adjusted in self.adjustments
        ]
        yield Table(columns, rows, title="Best sets of adjustments:")
        yield from self._act_remarks() if self.is_acts else self._bounds()
        worthwhile = self.worthwhile
        idle = [str(i + 1) for i in range(len(self.adjustments)) if i not in worthwhile]
        if idle:
            yield (
                f"  not proposed: set {', '.join(idle)} (gains less than {WORTHWHILE:.0%} of the"
                f" {OBJECTIVE_WORDS[self.objective]} over smaller sets)"
            )
        sizes = [str(adjusted.size) for adjusted in self.adjustments if not adjusted.proven]
        unproven = (
            f"  sets of {', '.join(sizes)}: not proven to be the best in the time of the search"
        )
        yield (
            "  all sets compared"
            if not sizes
            else unproven
            if self.is_acts
            else f"  sets of {', '.join(sizes)}: too many to compare all; built up one by one, with"
            " members swapped as long as that helped"
        )
        name = f"{self.objective}_um"
        exact: list[str] = []
        for adjusted in self.adjustments:
            um = getattr(adjusted.exact, name)
            change = round(um - getattr(adjusted, name), 3) + 0.0
            exact.append(f"set {adjusted.size}: {um:.3f} µm ({change:+.3f})")
        heading = f"{OBJECTIVE_WORDS[self.objective]} by the exact chain (exact − first order)"
        yield f"  {heading}: {', '.join(exact)}"

    def _bounds(self) -> Iterator[str]:
        if len(set(self.adjustable.values())) == 1:
            bounds = f"each by at most ±{next(iter(self.adjustable.values())):g} µm or µrad"
        else:
            each = (f"{key} ±{limit:g}" for key, limit in self.adjustable.items())
            bounds = f"by at most {', '.join(each)}"
        if not self.analysis.unconstrained:
            has_tolerances = any(map(self.scene.tolerances.get, self.adjustable))
            tolerance = ", within tolerance" if has_tolerances else ""
            bounds += f"{tolerance}, without a larger mean"
        yield f"  adjusted: {', '.join(self.adjustable)}; {bounds}"

    def _act_remarks(self) -> Iterator[str]:
        name = f"{self.objective}_um"
        before = spell_fixed(getattr(self.before, name))
        for adjusted in self.adjustments:
            after = spell_fixed(getattr(adjusted, name))
            if f"u95_{name}" in adjusted.expanded_uncertainty:
                u95 = adjusted.expanded_uncertainty[f"u95_{name}"]
                after += f" {propagation.plus_minus(u95)}"
            changes = ", ".join(
                f"{key} {spell_fixed(self.present[key])} → {spell_fixed(new)} {parameter(key).unit}"
                for key, new in adjusted.adjust.items()
            )
            objective = OBJECTIVE_WORDS[self.objective]
            yield f"  set {adjusted.size}: {objective} {before} → {after} µm; {changes}"
        for learnt in self.stiffness or ():
            yield (
                f"  {learnt.adjuster}: effect {learnt.factor:.2f} ± {learnt.u95:.2f} (U95) of the"
                " geometric one"
            )
        if self.idle:
            yield (
                f"  no effect in this loop: {', '.join(self.idle)} (each moves tool and workpiece"
                " together, or only the placement of the workpiece)"
            )

    def _adjustments(self, adjusted: AdjustedSet) -> str:
        return ", ".join(
            f"{key} {self.present[key]:.4g} → {round(value, 6) + 0.0:.4g} {parameter(key).unit}"
            for key, value in adjusted.adjust.items()
        )

    def bars(self) -> Bars:
        errors, sets = self.errors[:MOST_BARS], self.adjustments
        none = [None] * len(sets), [None] * len(errors)
        panels = tuple(
            Panel(
                f"{name.partition('_')[0].replace('rms', 'RMS')} |E|, before {before:.1f} µm",
                (
                    Series([*(getattr(e.left_out, name) for e in errors), *none[0]], form=".1f"),
                    Series(
                        [*(getattr(e.best, name) for e in errors), *none[0]], role="key", form=".1f"
                    ),
                    Series([*none[1], *(getattr(s, name) for s in sets)], role="set", form=".1f"),
                ),
                unit="µm",
                before=before,
            )
            for name, before in zip(("mean_um", "rms_um", "max_um"), self.before.three, strict=True)
        )
        rows = [
            f"{effect.parameter.name}  {effect.key}  {spell_short(effect.present)} →"
            f" {spell(effect.best.value)} {effect.unit}"
            for effect in errors
        ]
        where = (self.scene.machine.title, *self._where, f"{self.analysis.grid} nodes per axis")
        return Bars(
            f"Adjustment · {self.scene.title}",
            " · ".join(where),
            [*rows, *(adjusted.label for adjusted in sets)],
            panels,
            legend=(
                ("before", "before"),
                ("this error omitted", "plain"),
                ("this error at its best value", "key"),
                ("best set of adjustments", "set"),
            ),
        )


def apply_adjustments(scene: Scene, adjust: Mapping[str, float]) -> Scene:
    errors = scene.errors
    for key, value in adjust.items():
        errors = errors.with_amplitude(key, value, scene.axis_span(parameter(key).axis))
    return replace(scene, title=f"{scene.title}, adjusted"[:MAX_TEXT], errors=errors)


def _with_uncertainty(
    result: AdjustResult, before: propagation.FieldUncertainty, basis: ErrorBasis
) -> AdjustResult:
    def u95_after(
        adjust: Mapping[str, float], adjusted: AdjustedSet | None = None
    ) -> description.ExpandedUncertainty[float | None]:
        if isinstance(adjusted, ActSet):
            error_um = adjusted.error_um
        else:
            values = amplitudes_of(apply_adjustments(result.scene, adjust).errors, basis.keys)
            error_um = basis.evaluate(values, orientation=False).error_um
        after = replace(before, error_um=error_um)
        u95 = after.with_expanded_uncertainty(result.before).expanded_uncertainty
        if adjust:
            objective = f"{result.objective}_um"
            u95["probability"] = before.probability_of_improvement(after, objective)
        return u95

    def effect_with_u95(effect: Effect) -> Effect:
        best = replace(effect.best, expanded_uncertainty=u95_after({effect.key: effect.best.value}))
        present = description.ExpandedUncertainty(u95_present=before.errors.u95_of(effect.key))
        return replace(effect, best=best, expanded_uncertainty=present)

    return replace(
        result,
        before=replace(result.before, expanded_uncertainty=u95_after({})),
        errors=tuple(map(effect_with_u95, result.errors)),
        adjustments=tuple(
            replace(step, expanded_uncertainty=u95_after(step.adjust, step))
            for step in result.adjustments
        ),
    )


def _candidates(scene: Scene, volume: Volume, analysis: Adjust) -> tuple[int, ...]:
    keys = volume.basis.keys
    active = [keys[index] for index in volume.active_indices]
    if ALL in analysis.adjustable:
        places = volume.active_indices
    elif not analysis.adjustable:
        constants = [i for i in volume.active_indices if parameter(keys[i]).is_constant]
        replaced = is_placement(scene, volume.grid, volume.basis.position[constants])
        places = tuple(i for i, is_placed in zip(constants, replaced, strict=True) if not is_placed)
    else:
        for key in analysis.adjustable:
            if key not in active:
                parameter(key)
                raise OptionError(
                    f"{{adjustable}} {key}: it moves no point in this loop; expected some of"
                    f" {', '.join(active) or 'none'}"
                )
        places = tuple(sorted({keys.index(key) for key in analysis.adjustable}))
    tried = [keys[index] for index in places]
    for key, limit in analysis.limit:
        if key not in (ALL, *tried):
            raise OptionError(
                f"{{limit}} of {key}: it is not among the errors that are adjusted"
                f" ({', '.join(tried) or 'none'})"
            )
        if not MIN_HALF_WIDTH <= limit <= MAX_ERROR:
            raise OptionError(
                f"{{limit}} of {'all errors' if key == ALL else key}: ±{limit:g}; expected"
                f" {MIN_HALF_WIDTH:g} to {MAX_ERROR:g} µm or µrad"
            )
    return places


def _effect(search: Search, index: int) -> Effect:
    volume = search.volume
    indices, present = (index,), float(volume.amplitudes[index])
    optimum = search.least(indices)
    best = np.array([present]) + (np.zeros(1) if optimum is None else optimum.change)
    out, improved = (
        volume.statistics(volume.changed(indices, values)).four for values in (np.zeros(1), best)
    )
    return Effect(
        key=volume.basis.keys[index],
        present=present,
        left_out=Summary(*out),
        best=Best(*improved, value=float(best[0])),
    )
