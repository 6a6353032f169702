"""A design review in numbers, and the words of its first page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpspace.analysis.adjustment_search import Objective
from warpspace.analysis.blocks import Column, Mark, Table, number_columns
from warpspace.analysis.commands.adjust import Adjust, AdjustResult
from warpspace.analysis.commands.contributions import Contributions, Explanation, explain
from warpspace.analysis.commands.gains import Gains
from warpspace.analysis.commands.montecarlo import MonteCarlo
from warpspace.analysis.description import Analysis, Result, ignore_progress
from warpspace.analysis.sampling.cases import LIMIT_OVER, Over, SamplingPlan
from warpspace.analysis.sampling.distribution import choose_distribution
from warpspace.analysis.statistics import Statistics, share_below
from warpspace.analysis.uncertainty.propagation import (
    LEAST_PROBABILITY,
    FieldUncertainty,
    volume_uncertainty,
)
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.machine.limits import REPAIR_NODES
from warpspace.outputs.report.templating import Block, Cards, Items, Text
from warpspace.picture.comparison import scene_change, share_exaggeration
from warpspace.picture.formatting import TIMES, list_axes, own_axes, spell_in_r, u95_behind
from warpspace.picture.model import Exaggeration, ScenePicture, evaluate_picture, same_nodes
from warpspace.scene.model import Scene, second_order
from warpspace.units import spell, spell_short, spell_signed

UM, PERCENT = "\N{NO-BREAK SPACE}µm", "\N{NO-BREAK SPACE}%"
_WORTH = 0.01  # share of the largest error that an adjustment must gain to be named


@dataclass(frozen=True, slots=True)
class ReportSettings:
    """Choices of a report."""

    loop: str = "tool"  # "tool", "workpiece" or "relative"
    grid: int = 21  # nodes per axis of the working volume
    # "auto" or None; display factor; None takes the first scene's
    exaggeration: Exaggeration = None
    spec_um: float | None = None  # limit of |E|, µm; None takes that of each scene
    samples: int = 100_000  # of the Monte Carlo
    seed: int = 0
    distribution: str = "uniform"  # "uniform" or "normal"
    author: str = ""
    questions: tuple[str, ...] = ()  # what is still open, on the first page

    def analyses(self, limit_um: float | None) -> dict[str, Analysis]:
        loop, seed = Loop(self.loop), self.seed
        drawn = choose_distribution(self.distribution)

        def machines(over: Over) -> MonteCarlo:
            return MonteCarlo(
                loop=loop, distribution=drawn, seed=seed, samples=self.samples, over=over,
                limit_um=limit_um,
            )  # fmt: skip

        repair = Adjust(loop=loop, grid=min(self.grid, REPAIR_NODES[1]))
        return {
            "advice": replace(repair, objective=Objective.MAX, count=1),
            "adjust": repair,
            "gains": Gains(loop=loop, over_travel=True),
            "worst": machines(LIMIT_OVER),
            "sampled": machines(Over.SAMPLED),
            "shares": Contributions(loop=loop, distribution=drawn, seed=seed),
        }


@dataclass(frozen=True, slots=True)
class Reviewed:
    """One scene, reviewed."""

    letter: str  # A or B in headings; nothing where it is alone
    picture: ScenePicture  # evaluated scene with the display factor all scenes of the report share
    explanation: Explanation  # of the worst node
    linearisation_um: float  # largest difference between the exact chain and the first order
    results: Mapping[str, Result | str]  # of each analysis; why there is none
    within: float  # share of the volume within the limit; 0 where there is none
    advice: str  # the one thing to do
    uncertainty: FieldUncertainty | None  # how sure its errors are

    @property
    def keeps(self) -> bool:
        """Whether its largest error is within its limit, where it has one."""
        limit = self.scene.limit_um
        return limit is None or self.statistics.max_um <= limit

    @property
    def scene(self) -> Scene:
        return self.picture.scene

    @property
    def statistics(self) -> Statistics:
        found = self.picture.statistics
        return self.uncertainty.with_expanded_uncertainty(found) if self.uncertainty else found

    @property
    def largest(self) -> str:
        found = self.statistics
        return f"{spell(found.max_um)}{_behind(found, 'max_um')}{UM} at {self.worst_axes}"

    @property
    def is_told(self) -> bool:
        """Whether the limit is kept, or missed, with enough probability (ISO 14253-1)."""
        found, limit = self.statistics, self.scene.limit_um
        u95 = found.expanded_uncertainty.get("u95_max_um")
        if self.uncertainty is None or u95 is None or limit is None:
            return True
        kept = float(self.uncertainty.errors.probability_within(found.max_um, u95, -np.inf, limit))
        return not 1.0 - LEAST_PROBABILITY < kept < LEAST_PROBABILITY

    @property
    def worst_axes(self) -> str:
        """Spell where the axes stand at the worst point."""
        found = self.statistics
        return list_axes(own_axes(self.scene, found.max_at_axes)) or spell_in_r(found.max_at_mm)

    @property
    def volume(self) -> str:
        edges = (f"{edge:.6g}" for edge in self.picture.grid.extent_mm)
        return f" {TIMES} ".join(edges) + " mm"

    def titled(self, text: str) -> str:
        return f"{self.letter}: {text}" if self.letter else text


@dataclass(frozen=True, slots=True)
class Review:
    """One scene or two, with their difference where they share a working volume."""

    settings: ReportSettings
    scenes: tuple[Reviewed, ...]
    # of |E_B − E_A|: the length of second minus first, as vectors, node by node
    difference: Statistics | None

    @property
    def exaggeration(self) -> float:
        return self.scenes[0].picture.exaggeration


def share_pictures(scenes: Sequence[Scene], settings: ReportSettings) -> tuple[ScenePicture, ...]:
    if not 1 <= len(scenes) <= 2:
        raise OptionError(f"a report is about one scene or two; given {len(scenes)}")
    SamplingPlan(settings.samples, settings.seed, spec_um=settings.spec_um).check()
    if settings.spec_um is not None:
        scenes = [replace(scene, limit_um=settings.spec_um) for scene in scenes]
    return share_exaggeration(
        [evaluate_picture(scene, grid=settings.grid, loop=settings.loop) for scene in scenes],
        settings.exaggeration,
    )


def build_review(
    scenes: Sequence[Scene],
    settings: ReportSettings,
    pictures: Sequence[ScenePicture] | None = None,
) -> Review:
    """Evaluate everything a report tells, where the volumes are not evaluated yet also those."""
    pictures = pictures or share_pictures(scenes, settings)
    letters = ("",) if len(pictures) == 1 else ("A", "B")
    reviewed = [
        _review_scene(letter, picture, settings)
        for letter, picture in zip(letters, pictures, strict=True)
    ]
    return Review(settings, tuple(reviewed), _difference(*pictures))


def _review_scene(letter: str, picture: ScenePicture, settings: ReportSettings) -> Reviewed:
    scene, found = picture.scene, picture.statistics
    results = {
        name: _ask(analysis, scene) for name, analysis in settings.analyses(scene.limit_um).items()
    }
    at = {name: np.asarray(value) for name, value in found.max_at_axes.items()}
    point = np.asarray(found.max_at_mm)
    return Reviewed(
        letter,
        picture,
        explain(scene.model, scene.errors, at, picture.view, point),
        second_order(scene, settings.loop).um,
        results,
        _within(picture),
        _advice(picture, results["advice"], settings),
        volume_uncertainty(scene, picture.view, settings.grid),
    )


def _behind(found: Statistics, name: str) -> str:
    return (
        u95_behind(found.expanded_uncertainty[f"u95_{name}"]) if found.expanded_uncertainty else ""
    )


def _within(picture: ScenePicture) -> float:
    limit = picture.scene.limit_um
    return 0.0 if limit is None else share_below(picture.field, limit)


def _ask(analysis: Analysis, scene: Scene) -> Result | str:
    try:
        return analysis.run(scene, ignore_progress)
    except WarpspaceError as error:
        return str(error)


def _difference(first: ScenePicture, second: ScenePicture | None = None) -> Statistics | None:
    if second is None or not same_nodes(first.field.nominal_mm, second.field.nominal_mm):
        return None
    return scene_change(first, second).statistics


def given(value: float) -> str:
    """Spell a number that somebody has chosen, with its sign and without trailing zeros."""
    return ("+" if value > 0.0 else "") + spell_short(value)


def volume_share(share: float) -> str:
    """Spell a share of the volume, 100 % only where it is all of it."""
    percent = 100.0 * share
    return f"{percent if share == 1.0 else min(percent, 99.9):.3g}{PERCENT}"


def verdict(review: Review) -> str:
    """Say what a reader must know: of two scenes which keeps its limit, and how they differ."""
    if len(review.scenes) == 1:
        return _verdict_on(review.scenes[0])
    kept = [
        f"{one.letter} {'keeps' if one.keeps else 'misses'} the limit of {spell_short(limit)}{UM}"
        for one in review.scenes
        if (limit := one.scene.limit_um) is not None
    ]
    a, b = (one.statistics.mean_um for one in review.scenes)
    change = (b - a) / a if a else 0.0
    words = f"{abs(100.0 * change):.0f}{PERCENT} {'less' if change < 0.0 else 'more'} than"
    words = words if abs(change) >= 0.005 else "the same as"
    how = f"{words} A's {spell(a)}{UM}" if a else "where A has none"
    limits = f"{'; '.join(kept)}. " if kept else ""
    return f"{limits}The mean error of B is {spell(b)}{UM}: {how}."


def _verdict_on(one: Reviewed) -> str:
    limit, largest, worst = one.scene.limit_um, one.statistics.max_um, one.largest
    volume = f"the working volume of {one.volume}"
    if largest == 0.0:
        return f"The error is zero in {volume}."
    if limit is None:
        return f"No limit is set. The largest error in {volume} is {worst}."
    if not one.is_told:
        words = f"It cannot be told whether the limit of {spell_short(limit)}{UM} is kept"
        return f"{words} in {volume}: the largest error is {worst}."
    words = f"The limit of {spell_short(limit)}{UM} is"
    if one.keeps:
        return f"{words} kept in {volume}: the largest error is {worst}."
    share = volume_share(one.within)
    return f"{words} missed: {share} of {volume} is within it, and the worst is {worst}."


def _advice(picture: ScenePicture, found: Result | str, settings: ReportSettings) -> str:
    limit, before = picture.scene.limit_um, picture.statistics.max_um
    if before == 0.0:
        return "Nothing to adjust: the error is zero."
    if limit is not None and before <= limit:
        return "Nothing to adjust: the limit is kept."
    if not isinstance(found, AdjustResult) or not found.adjustments:
        return "Nothing to adjust: no squareness or alignment acts in this loop."
    after = evaluate_picture(found.changes()[0].scene, grid=settings.grid, loop=settings.loop)
    largest = after.statistics.max_um
    if not largest < (1.0 - _WORTH) * before:
        return "No single adjustment lowers the largest error; several together may: see Repair."
    ((key, value),) = found.adjustments[0].adjust.items()
    row = parameter(key)
    then = ""
    if limit is not None:
        share = volume_share(_within(after))
        then = (
            ", and the limit is kept"
            if largest <= limit
            else f", and {share} of the volume is within the limit"
        )
    return (
        f"Adjust {key} ({row.name}) from {given(found.present[key])} to {spell_signed(value)}"
        f" {row.unit}: the largest error falls from {spell(before)} to {spell(largest)}{UM}{then}."
    )


def first_page(review: Review, picture: Block) -> list[Block]:
    names = ["mean |E|", "P95", "max"]
    limited = any(one.scene.limit_um is not None for one in review.scenes)
    rows: list[list[str]] = []
    for one in review.scenes:
        found = one.statistics
        numbers = ("mean_um", "p95_um", "max_um", "rms_um")
        rows.append([spell(getattr(found, of)) + _behind(found, of) + UM for of in numbers])
        if limited:
            rows[-1][-1] = volume_share(one.within) if one.scene.limit_um is not None else "–"
    names.append("within the limit" if limited else "RMS")
    if len(rows) == 1:
        remarks = ("", "95 % of the volume is below it", f"at {review.scenes[0].worst_axes}")
        cards = zip(names, rows[0], (*remarks, "of the volume" if limited else ""), strict=True)
        said: Block = Cards(tuple(cards))
    else:
        columns = (Column("scene"), *number_columns(names, "s"))
        titles = [one.titled(one.scene.title) for one in review.scenes]
        marks: list[Mark] = ["" if one.keeps else "worse" for one in review.scenes]
        numbered = [(title, *row) for title, row in zip(titles, rows, strict=True)]
        said = Table(columns, numbered, marks=marks)
    noted = (
        one.titled(f"{note.text} (note {number}{note.author and f', {note.author}'})")
        for one in review.scenes
        for number, note in enumerate(one.scene.review, 1)
        if (note.kind, note.status) == ("question", "open")
    )
    asked = (*review.settings.questions, *noted)
    return [
        Text(verdict(review), "lead"),
        said,
        Text("What to do", "heading"),
        *(Text(one.titled(one.advice)) for one in review.scenes),
        picture,
        *([Text("Open questions", "heading"), Items(asked)] if asked else []),
    ]
