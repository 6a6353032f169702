"""The part of a report that sets other machines beside the reviewed ones, before one is built."""

from collections.abc import Sequence

from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.kinematics.model import Loop
from warpspace.machine.limits import MOST_CONCEPTS
from warpspace.machine.parameters import parameter
from warpspace.outputs.report import sections as parts
from warpspace.outputs.report.blocks import Block, Column, Section, Text, table
from warpspace.outputs.report.figures import ReportFigures
from warpspace.outputs.report.review import ReportSettings
from warpspace.picture.words import LOOP_WORDS, spell, spell_count, spell_short, tolerance_words
from warpspace.scene.concepts import LETTERS, Concept, ConceptPlan, compare_concepts
from warpspace.scene.model import Scene
from warpspace.units import MICROMETRE

LOOP = Loop.RELATIVE
"""Axes count on whichever side they are, whatever the loop of the report."""
CAPTION = "The machines in one scale; colours are the RMS of |E| within tolerance."


def concept_plan(settings: ReportSettings) -> ConceptPlan:
    """Say how machines are sampled: as the report samples those of its tolerances."""
    return ConceptPlan(
        settings.spec_um,
        samples=settings.samples,
        seed=settings.seed,
        distribution=settings.distribution,
    )


def compare_with(
    scenes: Sequence[Scene], others: Sequence[Scene], settings: ReportSettings
) -> tuple[Concept, ...]:
    """Compare the reviewed machines with others within the tolerances of the first.

    Parameters
    ----------
    scenes : sequence of Scene
        Those of the report.
    others : sequence of Scene
        None where nothing is to be compared.
    settings : ReportSettings

    Returns
    -------
    tuple of Concept
        Empty where there are no others.

    Raises
    ------
    SceneError, OptionError
        If tolerances are missing, or there are too many machines.
    """
    if not others:
        return ()
    every = (*scenes, *others)
    if len(every) > MOST_CONCEPTS:
        raise OptionError(
            f"{len(every)} machines side by side; expected at most {MOST_CONCEPTS}"
            f" with the {len(scenes)} of the report"
        )
    return compare_concepts(every, concept_plan(settings), loop=LOOP)


def concept_section(
    found: Sequence[Concept], painter: ReportFigures, settings: ReportSettings
) -> Section:
    """Tell how machines compare: numbers, what matters most in each, pictures in one scale.

    Parameters
    ----------
    found : sequence of Concept
    painter : ReportFigures
    settings : ReportSettings

    Returns
    -------
    Section
    """
    blocks: list[Block] = [Text(_said(found, settings), "body"), _table(found, settings)]
    plan = concept_plan(settings)
    try:
        blocks.append(painter.concepts([one.scene for one in found], plan, str(LOOP), CAPTION))
    except WarpspaceError as error:
        blocks.append(Text(f"{CAPTION} {error}", "note"))
    return parts.section("Concepts side by side", blocks)


def _said(found: Sequence[Concept], settings: ReportSettings) -> str:
    """Say what is compared."""
    tolerances = tolerance_words(found[0].scene.tolerances)
    best = min(zip(found, LETTERS, strict=False), key=lambda one: one[0].sampled.mean_um)
    return (
        f"Machines within the same tolerances, those of A by class: {tolerances}."
        f" {spell_count(settings.samples)} sampled machines of each, {settings.distribution},"
        f" |E| at a random point of each; {LOOP_WORDS[LOOP]}; errors are absolute."
        f" {best[1]} has the smallest mean, {spell(best[0].sampled.mean_um)} µm."
    )


def _table(found: Sequence[Concept], settings: ReportSettings) -> Block:
    """List the machines with their numbers."""
    limit = settings.spec_um
    columns = [
        Column("", width=0.25),
        Column("machine", width=2.2),
        Column("chain", width=1.2),
        *(Column(f"{name}, {MICROMETRE}", "right", 0.8) for name in ("mean", "P95", "max")),
        *([] if limit is None else [Column(f"≤ {spell_short(limit)} {MICROMETRE}", "right", 0.85)]),
        Column("matter most (share of the variance)", width=3.2),
    ]
    rows = [
        (
            letter,
            concept.scene.title,
            str(concept.scene.machine.chain),
            *(
                spell(value)
                for value in (
                    concept.sampled.mean_um,
                    concept.sampled.p95_um,
                    concept.sampled.max_um,
                )
            ),
            *(
                []
                if concept.sampled.probability is None
                else [f"{100.0 * concept.sampled.probability.probability:.1f} %"]
            ),
            ", ".join(
                f"{row.key} {100.0 * row.share:.0f} % ({parameter(row.key).name})"
                for row in concept.leading
            ),
        )
        for letter, concept in zip(LETTERS, found, strict=False)
    ]
    return table("Machines side by side within the same tolerances.", columns, rows)
