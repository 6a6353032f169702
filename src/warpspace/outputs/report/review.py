"""A design review in numbers, and the words of its first page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.analysis.cases import LIMIT_OVER, Over, Plan
from warpspace.analysis.contributions import Explanation, Shares, explain
from warpspace.analysis.description import Analysis, Result, silent
from warpspace.analysis.distribution import choose_distribution
from warpspace.analysis.gains import Gains
from warpspace.analysis.machines import Machines, MachinesResult
from warpspace.analysis.montecarlo import MonteCarlo
from warpspace.analysis.repair import Repair, RepairResult
from warpspace.analysis.statistics import Statistics
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.machine.limits import REPAIR_NODES
from warpspace.outputs.report.render import Block, Cards, Text
from warpspace.picture.comparison import STATISTICS, scene_change, share_exaggeration
from warpspace.picture.model import (
    DIFFERENCE_LENGTH,
    Exaggeration,
    ScenePicture,
    evaluate_picture,
    same_nodes,
)
from warpspace.picture.words import TIMES, own_axes, spell_point
from warpspace.scene.model import Scene, second_order
from warpspace.units import MINUS, spell, spell_short

SUBJECTS = {
    "tool": "the tool point",
    "workpiece": "the workpiece point",
    "relative": "the tool, relative to the workpiece,",
}
UM = "\N{NO-BREAK SPACE}µm"
_WORTH = 0.01  # share of the RMS that an adjustment must gain to be named


@dataclass(frozen=True, slots=True)
class ReportSettings:
    """Choices of a report."""

    loop: str = "tool"  # "tool", "workpiece" or "relative"
    grid: int = 21  # nodes per axis of the working volume
    # "auto" or None; display factor; None takes the first scene's
    exaggeration: Exaggeration = None
    spec_um: float | None = None  # specification of the volumetric error, µm
    samples: int = 100_000  # of the Monte Carlo
    seed: int = 0
    distribution: str = "uniform"  # "uniform" or "normal"

    def analyses(self) -> dict[str, Analysis]:
        """Give what is asked of every scene."""
        loop, seed = Loop(self.loop), self.seed
        drawn = choose_distribution(self.distribution)

        def machines(over: Over) -> Machines:
            return Machines(
                loop=loop, distribution=drawn, seed=seed, samples=self.samples, over=over,
                limit_um=self.spec_um,
            )  # fmt: skip

        return {
            "repair": Repair(loop=loop, grid=min(self.grid, REPAIR_NODES[1])),
            "gains": Gains(loop=loop, over_travel=True),
            "worst": machines(LIMIT_OVER),
            "sampled": machines(Over.SAMPLED),
            "shares": Shares(loop=loop, distribution=drawn, seed=seed),
        }


@dataclass(frozen=True, slots=True)
class Reviewed:
    """One scene, reviewed."""

    letter: str  # A or B in headings; nothing where it is alone
    picture: ScenePicture  # evaluated scene with the display factor all scenes of the report share
    explanation: Explanation  # of the worst node
    linearisation_um: float  # largest difference between the exact chain and the first order
    results: Mapping[str, Result | str]  # of each analysis; why there is none

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.picture.scene

    @property
    def statistics(self) -> Statistics:
        """Statistics of its field."""
        return self.picture.statistics

    @property
    def worst_place(self) -> str:
        """Spell the worst point: axis positions, and the point of R."""
        found = self.statistics
        return f"{spell_point(own_axes(self.scene, found.max_at_axes), found.max_at_mm)} mm"

    @property
    def volume(self) -> str:
        """Spell the size of the working volume."""
        edges = (f"{edge:.6g}" for edge in self.picture.grid.extent_mm)
        return f" {TIMES} ".join(edges) + " mm"

    @property
    def worst_machines(self) -> MonteCarlo | None:
        """Give machines within tolerance at the worst point of each."""
        found = self.results["worst"]
        return found.points[0].sampled if isinstance(found, MachinesResult) else None

    def titled(self, text: str) -> str:
        """Put the letter of the scene before a heading."""
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
        """Display factor of all pictures."""
        return self.scenes[0].picture.exaggeration

    @property
    def largest_um(self) -> float:
        """Largest error of all scenes: the end of the colour scale they share."""
        return max(one.statistics.max_um for one in self.scenes)


def share_pictures(scenes: Sequence[Scene], settings: ReportSettings) -> tuple[ScenePicture, ...]:
    """Evaluate the volumes of one scene or two, drawn with the same factor."""
    if not 1 <= len(scenes) <= 2:
        raise OptionError(f"a report is about one scene or two; given {len(scenes)}")
    Plan(settings.samples, settings.seed, spec_um=settings.spec_um).check()
    return share_exaggeration(
        [evaluate_picture(scene, grid=settings.grid, loop=settings.loop) for scene in scenes],
        settings.exaggeration,
        scenes[0].exaggeration,
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
    at = {name: np.asarray(value) for name, value in found.max_at_axes.items()}
    point = np.asarray(found.max_at_mm)
    return Reviewed(
        letter,
        picture,
        explain(scene.model, scene.errors, at, picture.view, point),
        second_order(scene, settings.loop).um,
        {name: _ask(analysis, scene) for name, analysis in settings.analyses().items()},
    )


def _ask(analysis: Analysis, scene: Scene) -> Result | str:
    try:
        return analysis.run(scene, silent)
    except WarpspaceError as error:
        return str(error)


def _difference(first: ScenePicture, second: ScenePicture | None = None) -> Statistics | None:
    if second is None or not same_nodes(first.field.nominal_mm, second.field.nominal_mm):
        return None
    return scene_change(first, second).statistics


# --- The first page -------------------------------------------------------------------------------


def signed(value: float, digits: int = 3) -> str:
    """Spell a computed number with its sign."""
    return _signed(spell(value, digits))


def given(value: float) -> str:
    """Spell a number that somebody has chosen, with its sign and without trailing zeros."""
    return _signed(spell_short(value))


def _signed(text: str) -> str:
    return text if text == "0" or text.startswith(MINUS) else f"+{text}"


def percent(share: float, digits: int = 1) -> str:
    """Spell a share in per cent."""
    return f"{100.0 * share:.{digits}f}\N{NO-BREAK SPACE}%"


def verdict(review: Review) -> str:
    """Say in a few sentences what a reader must know."""
    sentences = [one.titled(" ".join(_said_of(one, review.settings))) for one in review.scenes]
    if len(review.scenes) == 2:
        a, b = (one.statistics.mean_um for one in review.scenes)
        change = (b - a) / a if a else 0.0
        word = f"{percent(abs(change), 0)} {'less' if change < 0.0 else 'more'} than"
        words = word if abs(change) >= 0.005 else "the same as"
        how = f"{words} A's {spell(a)}{UM}" if a else "where A has none"
        sentences.insert(0, f"The mean error of B is {spell(b)}{UM}: {how}.")
    return " ".join(sentences)


def _said_of(reviewed: Reviewed, settings: ReportSettings) -> list[str]:
    found, subject = reviewed.statistics, SUBJECTS[settings.loop]
    where = f"in the working volume of {reviewed.volume}"
    if found.max_um == 0.0:
        sentences = [f"The error set is zero: {subject} is where it should be {where}."]
    else:
        sentences = [
            (
                f"On average {subject} is {spell(found.mean_um)}{UM} away from where it should be,"
                f" and at most {spell(found.max_um)}{UM}, {where}."
            ),
            f"The worst point is at {reviewed.worst_place}.",
            *_best_repair(reviewed),
        ]
        if settings.spec_um is not None:
            kept = "kept everywhere" if found.max_um <= settings.spec_um else "not kept"
            sentences.append(f"The specification of {spell_short(settings.spec_um)}{UM} is {kept}.")
    return [*sentences, *_promise(reviewed)]


def _best_repair(reviewed: Reviewed) -> list[str]:
    """Say which one adjustment helps the whole volume most, where one does."""
    found = reviewed.results["repair"]
    if not isinstance(found, RepairResult) or not found.repairs:
        return []
    best = found.repairs[0]
    ((key, value),) = best.adjust.items()
    if not best.rms_um < (1.0 - _WORTH) * found.before.rms_um:
        return []
    row = parameter(key)
    return [
        (
            f"Of all squareness and alignment errors, {key} ({row.name}) helps most: set from"
            f" {given(found.present[key])} to {signed(value)} {row.unit}, it brings the mean to"
            f" {spell(best.mean_um)}{UM} and the largest error to {spell(best.max_um)}{UM}."
        )
    ]


def _promise(reviewed: Reviewed) -> list[str]:
    """Say what the tolerances promise, where there are any."""
    worst, sampled = reviewed.worst_machines, reviewed.results["sampled"]
    if worst is None or not isinstance(sampled, MachinesResult):
        return []
    start = "Of machines that its tolerances allow,"
    if (kept := worst.probability) is not None:
        return [
            (
                f"{start} {percent(kept.probability)} keep the specification of"
                f" {spell_short(kept.spec_um)}{UM} in the whole working volume (95 % interval"
                f" {percent(kept.low)} to {percent(kept.high)})."
            )
        ]
    mean = sampled.points[0].sampled.mean_um
    return [
        (
            f"{start} 95 % stay below {spell(worst.p95_um)}{UM} at their worst point, and"
            f" {spell(mean)}{UM} is the mean error."
        )
    ]


def first_page(review: Review) -> list[Block]:
    """Give the verdict and the numbers to remember."""
    scenes = review.scenes
    alone = f"at {scenes[0].worst_place}" if len(scenes) == 1 else ""
    cards = [
        (
            "mean |E|" if name == "mean" else name,
            " → ".join(spell(getattr(one.statistics, field)) for one in scenes) + UM,
            alone if name == "max" else " → ".join(one.letter for one in scenes),
        )
        for name, field in STATISTICS.items()
        if name != "RMS"
    ]
    if review.difference is not None:
        largest = f"{spell(review.difference.max_um)}{UM}"
        cards.append((f"max {DIFFERENCE_LENGTH}", largest, "largest change of a point"))
    worst = [one.worst_machines for one in scenes]
    if all(worst):
        kept = [one.probability for one in worst if one is not None and one.probability]
        if kept:
            shares = " → ".join(percent(one.probability) for one in kept)
            cards.append((f"keep {spell_short(kept[0].spec_um)}{UM}", shares, "of machines"))
        else:
            below = " → ".join(spell(one.p95_um) for one in worst if one is not None)
            cards.append(("P95 by tolerances", f"{below}{UM}", "worst point, machines"))
    return [Text(verdict(review), "lead"), Cards(tuple(cards))]
