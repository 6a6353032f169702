"""A design review in numbers, and the words of its first page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpspace.analysis.blocks import Column, Mark, Table, number_columns
from warpspace.analysis.commands.adjust import ActSet, Adjust, AdjustResult
from warpspace.analysis.commands.contributions import Contributions, Explanation, explain
from warpspace.analysis.commands.gains import Gains
from warpspace.analysis.commands.montecarlo import MonteCarlo
from warpspace.analysis.description import Analysis, Result, ignore_progress
from warpspace.analysis.sampling.cases import LIMIT_REDUCTION, Reduction, SamplingPlan
from warpspace.analysis.sampling.distribution import choose_distribution
from warpspace.analysis.statistics import Statistics, share_below
from warpspace.analysis.uncertainty.propagation import FieldUncertainty, volume_uncertainty
from warpspace.analysis.uncertainty.verdict import Verdict
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.machine.limits import REPAIR_NODES
from warpspace.outputs.report.templating import Block, Cards, Items, Text
from warpspace.picture.comparison import scene_change, share_exaggeration
from warpspace.picture.formatting import TIMES, list_axes, point_axes, spell_in_r, u95_behind
from warpspace.picture.model import Exaggeration, ScenePicture, evaluate_picture, same_nodes
from warpspace.scene.model import Scene, common_loop, second_order
from warpspace.units import spell_fixed, spell_short, spell_signed

UM, PERCENT = "\N{NO-BREAK SPACE}µm", "\N{NO-BREAK SPACE}%"


@dataclass(frozen=True, slots=True)
class ReportSettings:
    """Choices of a report."""

    loop: str | None = None  # "tool", "workpiece" or "relative"; None for that of the scenes
    grid: int = 21  # nodes per axis of the working volume
    # "auto" or None; display factor; None takes the first scene's
    exaggeration: Exaggeration = None
    spec_um: float | None = None  # limit of |E|, µm; None takes that of each scene
    samples: int = 100_000  # of the Monte Carlo
    seed: int = 0
    distribution: str = "uniform"  # "uniform" or "normal"
    author: str = ""
    questions: tuple[str, ...] = ()  # open questions, on the first page

    def analyses(self, limit_um: float | None) -> dict[str, Analysis]:
        loop, seed = Loop(self.loop) if self.loop else None, self.seed
        drawn = choose_distribution(self.distribution)

        def machines(statistic: Reduction) -> MonteCarlo:
            return MonteCarlo(
                loop=loop, distribution=drawn, seed=seed, samples=self.samples, over=statistic,
                limit_um=limit_um,
            )  # fmt: skip

        return {
            "adjust": Adjust(loop=loop, grid=min(self.grid, REPAIR_NODES[1])),
            "gains": Gains(loop=loop, over_travel=True),
            "worst": machines(LIMIT_REDUCTION),
            "sampled": machines(Reduction.SAMPLED),
            "shares": Contributions(loop=loop, distribution=drawn, seed=seed),
        }


@dataclass(frozen=True, slots=True)
class Reviewed:
    """One scene of a review, with the results of its analyses."""

    letter: str  # A or B in headings; empty for a single scene
    picture: ScenePicture  # evaluated scene with the display factor all scenes of the report share
    explanation: Explanation  # of the worst node
    linearisation_um: float  # largest difference between the exact chain and the first order
    results: Mapping[str, Result | str]  # of each analysis, or the reason for its failure
    share_within: float  # of the volume within the limit; 0 without a limit
    advice: str  # recommended adjustment
    uncertainty: FieldUncertainty | None  # None where the scene states none

    @property
    def scene(self) -> Scene:
        return self.picture.scene

    @property
    def statistics(self) -> Statistics:
        summary = self.picture.statistics
        return self.uncertainty.with_expanded_uncertainty(summary) if self.uncertainty else summary

    @property
    def largest(self) -> str:
        summary = self.statistics
        return f"{_with_u95(summary, 'max_um')} at {self.worst_axes}"

    @property
    def verdict(self) -> Verdict:
        """Verdict on the limit; of the model alone where the uncertainty is unknown."""
        u95 = self.statistics.expanded_uncertainty.get("u95_max_um")
        limit, largest = self.scene.limit_um, self.statistics.max_um
        if self.uncertainty is None or u95 is None or limit is None:
            return Verdict.FAIL if limit is not None and largest > limit else Verdict.PASS
        probability = self.uncertainty.errors.probability_within(largest, u95, -np.inf, limit)
        return Verdict.from_probability(float(probability))

    @property
    def worst_axes(self) -> str:
        """Axis positions of the worst point, formatted."""
        summary = self.picture.statistics
        axes = list_axes(point_axes(self.scene, summary.max_at_axes))
        return axes or spell_in_r(summary.max_at_mm)

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
        [
            evaluate_picture(scene, grid=settings.grid, loop=common_loop(scenes, settings.loop))
            for scene in scenes
        ],
        settings.exaggeration,
    )


def build_review(
    scenes: Sequence[Scene],
    settings: ReportSettings,
    pictures: Sequence[ScenePicture] | None = None,
) -> Review:
    """Evaluate the content of a report; `pictures` are the volumes where evaluated already."""
    pictures = pictures or share_pictures(scenes, settings)
    letters = ("",) if len(pictures) == 1 else ("A", "B")
    reviewed = [
        _review_scene(letter, picture, settings)
        for letter, picture in zip(letters, pictures, strict=True)
    ]
    return Review(settings, tuple(reviewed), _difference(*pictures))


def _review_scene(letter: str, picture: ScenePicture, settings: ReportSettings) -> Reviewed:
    scene, summary = picture.scene, picture.statistics
    results: dict[str, Result | str] = {}
    for name, analysis in settings.analyses(scene.limit_um).items():
        try:
            results[name] = analysis.run(scene, ignore_progress)
        except WarpspaceError as error:
            results[name] = str(error)
    at = {name: np.asarray(value) for name, value in summary.max_at_axes.items()}
    point = np.asarray(summary.max_at_mm)
    return Reviewed(
        letter,
        picture,
        explain(scene.model, scene.errors, at, picture.view, point),
        second_order(scene, picture.view.loop).um,
        results,
        0.0 if scene.limit_um is None else share_below(picture.field, scene.limit_um),
        _advice(picture, results["adjust"], settings),
        volume_uncertainty(scene, picture.view, settings.grid),
    )


def _with_u95(summary: Statistics, name: str) -> str:
    u95 = summary.expanded_uncertainty
    behind = u95_behind(u95[f"u95_{name}"]) if u95 else ""
    return spell_fixed(getattr(summary, name)) + behind + UM


def _difference(first: ScenePicture, second: ScenePicture | None = None) -> Statistics | None:
    if second is None or not same_nodes(first.field.nominal_mm, second.field.nominal_mm):
        return None
    return scene_change(first, second).statistics


def spell_setting(value: float) -> str:
    """Format a set value with its sign and without trailing zeros."""
    return ("+" if value > 0.0 else "") + spell_short(value)


def volume_share(share: float) -> str:
    """Format a share of the volume; 100 % only for the whole volume."""
    percent = 100.0 * share
    return f"{percent if share == 1.0 else min(percent, 99.9):.3g}{PERCENT}"


def verdict(review: Review) -> str:
    """Format the verdict on the limit; of two scenes also the change of the mean error."""
    if len(review.scenes) == 1:
        return _verdict_on(review.scenes[0])
    verdicts = [
        f"{one.letter}: {one.verdict}, limit {spell_short(one.scene.limit_um)}{UM}. "
        for one in review.scenes
        if one.scene.limit_um is not None
    ]
    a, b = (reviewed.statistics.mean_um for reviewed in review.scenes)
    change = (b - a) / a if a else 0.0
    comparison = f"{abs(100.0 * change):.0f}{PERCENT} {'less' if change < 0.0 else 'more'} than"
    if abs(change) < 0.005:
        comparison = "the same as"
    comment = f"{comparison} A's {spell_fixed(a)}{UM}" if a else "that of A is zero"
    return f"{''.join(verdicts)}The mean error of B is {spell_fixed(b)}{UM}: {comment}."


def _verdict_on(reviewed: Reviewed) -> str:
    limit, largest, worst = reviewed.scene.limit_um, reviewed.statistics.max_um, reviewed.largest
    volume = f"the working volume of {reviewed.volume}"
    if largest == 0.0:
        return f"The error is zero in {volume}."
    if limit is None:
        return f"No limit is set. The largest error in {volume} is {worst}."
    finding = f"the largest error in {volume} is {worst}"
    limit_text = f"the limit of {spell_short(limit)}{UM}"
    if reviewed.verdict is Verdict.UNDECIDED:
        return f"Undecided: {finding}; {limit_text} is in the uncertainty zone."
    if reviewed.verdict is Verdict.PASS:
        return f"Pass: {finding}, within {limit_text}."
    share = volume_share(reviewed.share_within)
    return f"Fail: {share} of {volume} is within {limit_text}; the largest error is {worst}."


def _advice(picture: ScenePicture, adjustment: Result | str, settings: ReportSettings) -> str:
    limit, before = picture.scene.limit_um, picture.statistics.max_um
    if before == 0.0:
        return "No adjustment required: the error is zero."
    if limit is not None and before <= limit:
        return "No adjustment required: the error is within the limit."
    if not isinstance(adjustment, AdjustResult) or not adjustment.adjustments:
        if isinstance(adjustment, AdjustResult) and adjustment.is_acts:
            return "No act on an adjuster reduces the error within its range and the tolerances."
        return "No adjustment possible: no squareness or alignment error acts in this loop."
    if not adjustment.worthwhile:
        return "No adjustment within tolerance reduces the RMS by 1 % or more."
    proposed = adjustment.worthwhile[0]
    scene, adjusted = adjustment.changes()[proposed].scene, adjustment.adjustments[proposed]
    after = evaluate_picture(scene, grid=settings.grid, loop=settings.loop)
    largest, rms = after.statistics.max_um, adjusted.rms_um
    numbers = map(spell_fixed, (adjustment.before.rms_um, rms, before, largest))
    effect = "the RMS changes from {} to {}{um}, the largest error from {} to {}{um}"
    effect = effect.format(*numbers, um=UM)
    if limit is not None and largest <= limit:
        effect += ", within the limit"
    elif limit is not None:
        share = volume_share(share_below(after.field, limit))
        effect += f"; {share} of the volume is within the limit"
    changes = ", ".join(
        f"{key} ({parameter(key).name}) from {spell_setting(adjustment.present[key])} to"
        f" {spell_signed(value)} {parameter(key).unit}"
        for key, value in adjusted.adjust.items()
    )
    if isinstance(adjusted, ActSet):
        return f"Adjust {adjusted.label}, which changes {changes}: {effect}."
    return f"Adjust {changes}: {effect}."


def first_page(review: Review, picture: Block) -> list[Block]:
    names = ["mean |E|", "P95", "max"]
    limits = [reviewed.scene.limit_um for reviewed in review.scenes]
    limited = any(limit is not None for limit in limits)
    rows: list[list[str]] = []
    for reviewed, limit in zip(review.scenes, limits, strict=True):
        summary = reviewed.statistics
        numbers = ("mean_um", "p95_um", "max_um", "rms_um")
        rows.append([_with_u95(summary, of) for of in numbers])
        if limited:
            rows[-1][-1] = "–" if limit is None else volume_share(reviewed.share_within)
    names.append("within the limit" if limited else "RMS")
    if len(rows) == 1:
        remarks = ("", "not exceeded in 95 % of the volume", f"at {review.scenes[0].worst_axes}")
        cards = zip(names, rows[0], (*remarks, "of the volume" if limited else ""), strict=True)
        numbers_block: Block = Cards(tuple(cards))
    else:
        columns = (Column("scene"), *number_columns(names, "s"))
        pairs = list(zip(review.scenes, limits, strict=True))
        exceeded = [limit is not None and one.statistics.max_um > limit for one, limit in pairs]
        marks: list[Mark] = ["worse" if beyond else "" for beyond in exceeded]
        titles = [one.titled(one.scene.title) for one in review.scenes]
        numbered = [(title, *row) for title, row in zip(titles, rows, strict=True)]
        numbers_block = Table(columns, numbered, marks=marks)
    noted = (
        one.titled(f"{note.text} (note {number}{note.author and f', {note.author}'})")
        for one in review.scenes
        for number, note in enumerate(one.scene.review, 1)
        if (note.kind, note.status) == ("question", "open")
    )
    questions = (*review.settings.questions, *noted)
    return [
        Text(verdict(review), "lead"),
        numbers_block,
        Text("Recommended adjustment", "heading"),
        *(Text(one.titled(one.advice)) for one in review.scenes),
        picture,
        *([Text("Open questions", "heading"), Items(questions)] if questions else []),
    ]
