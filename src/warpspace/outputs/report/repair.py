"""What repairs the machines of a report: effects of single errors, and the best sets."""

from collections.abc import Mapping

from warpspace.analysis.repair import Outcome, Repairs
from warpspace.machine.parameters import parameter
from warpspace.outputs.report import sections as parts
from warpspace.outputs.report.blocks import Block, Column, Mark, Section, Text, table
from warpspace.outputs.report.figures import ReportFigures
from warpspace.outputs.report.review import Review, Reviewed
from warpspace.outputs.report.wording import given, signed
from warpspace.picture.words import spell
from warpspace.units import MICROMETRE


def repair_section(review: Review, painter: ReportFigures) -> Section:
    """Tell what adjusting errors gives for the whole volume, scene by scene.

    Parameters
    ----------
    review : Review
    painter : ReportFigures

    Returns
    -------
    Section
    """
    blocks: list[Block] = []
    for letter, reviewed in parts.letters(review):
        found = reviewed.repairs
        if not found.effects and not found.repairs:
            words = "No point is off: nothing to repair."
            blocks.append(Text(parts.prefixed(letter, words), "note"))
            continue
        blocks.append(_effects_table(letter, reviewed))
        if found.repairs:
            blocks.append(_sets_table(letter, reviewed))
            blocks.append(painter.repair(reviewed, f"{letter}: " if letter else ""))
        else:
            words = "No squareness or alignment error acts in this loop: no set is looked for."
            blocks.append(Text(parts.prefixed(letter, words), "note"))
    return parts.section("Repair", blocks)


def _three(outcome: Outcome) -> tuple[str, ...]:
    """Spell mean, RMS and max."""
    return tuple(spell(value) for value in (outcome.mean_um, outcome.rms_um, outcome.max_um))


def _effects_table(letter: str, reviewed: Reviewed) -> Block:
    """Each error left out, and at its best value."""
    found = reviewed.repairs
    mean, rms, largest = _three(found.before)
    rows: list[tuple[str, ...]] = [
        (
            *(effect.key, effect.parameter.name),
            f"{given(effect.present)} {effect.parameter.unit}",
            *_three(effect.left_out),
            signed(effect.best_value),
            *_three(effect.best),
        )
        for effect in found.effects[: parts.MOST_ROWS]
    ]
    rows.append(("before", "", "", mean, rms, largest, "", mean, rms, largest))
    marks: list[Mark] = ["" for _ in rows]
    marks[-1] = "strong"
    columns = [
        Column("key", width=0.85),
        Column("error", width=1.9),
        Column("now", "right", 1.2),
        *_columns("left out"),
        Column("best value", "right", 0.95),
        *_columns("best"),
    ]
    caption = parts.prefixed(
        letter,
        "Each error alone, all others as they are: what leaving it out, and what the value with the"
        f" smallest RMS, gives for the whole volume; {MICROMETRE}, each node weighing its share.",
    )
    return table(caption, columns, rows, marks)


def _columns(what: str) -> list[Column]:
    """Columns of mean, RMS and max."""
    return [Column(f"{what}: mean", "right", 0.85)] + [
        Column(name, "right", 0.7) for name in ("RMS", "max")
    ]


def _sets_table(letter: str, reviewed: Reviewed) -> Block:
    """List the best sets of one, two, three … adjustments."""
    found = reviewed.repairs
    rows = [
        (
            str(len(one.adjust)),
            _adjustments(found, one.adjust),
            *(spell(one.outcome.mean_um), spell(one.outcome.rms_um)),
            *(spell(one.outcome.p95_um), spell(one.outcome.max_um)),
        )
        for one in found.repairs
    ]
    columns = [
        Column("set", width=0.4),
        Column("adjust", width=4.2),
        *(Column(f"{name}, {MICROMETRE}", "right", 0.9) for name in ("mean", "RMS", "P95", "max")),
    ]
    caption = (
        "The best sets of adjustments of squareness and alignment for the smallest RMS, each error"
        f" changed by at most ±{found.plan.limit:g} µm or µrad."
    )
    return table(parts.prefixed(letter, caption), columns, rows)


def _adjustments(found: Repairs, adjust: Mapping[str, float]) -> str:
    """Spell the adjustments of a set."""
    return ", ".join(
        f"{key} {given(found.present[key])} → {signed(value)} {parameter(key).unit}"
        for key, value in adjust.items()
    )
