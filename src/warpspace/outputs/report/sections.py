"""From the numbers of a review to the parts of its report."""

from collections.abc import Sequence

import numpy as np

from warpspace.analysis.gains import DEFAULT_SHARE, Gain
from warpspace.machine.parameters import parameter
from warpspace.outputs.report.blocks import (
    Block,
    Card,
    Cards,
    Column,
    Mark,
    Section,
    Text,
    table,
)
from warpspace.outputs.report.review import Review, Reviewed
from warpspace.outputs.report.wording import (
    given,
    limit,
    microns,
    percent,
    signed,
    spell_function,
    verdict,
    worst_place,
)
from warpspace.picture.comparison import (
    CHANGE,
    DIFFERENCE_LENGTH,
    STATISTICS,
    statistics_change,
)
from warpspace.picture.coordinates import own_axes, spell_at, spell_point
from warpspace.picture.words import spell, spell_short, spell_signed, spell_vector
from warpspace.units import MICROMETRE

MOST_ROWS = 15
LETTERS = ("A", "B")


def letters(review: Review) -> Sequence[tuple[str, Reviewed]]:
    """Scenes with what they are called in headings: nothing for one, A and B for two."""
    if len(review.scenes) == 1:
        return [("", review.scenes[0])]
    return list(zip(LETTERS, review.scenes, strict=True))


def prefixed(letter: str, text: str) -> str:
    """Put the letter of a scene before a heading."""
    return f"{letter}: {text}" if letter else text


def summary_blocks(review: Review) -> list[Block]:
    """Give the verdict and the numbers to remember."""
    return [Text(verdict(review), "lead"), Cards(tuple(_cards(review)))]


def _cards(review: Review) -> list[Card]:
    """Numbers to remember."""
    if len(review.scenes) == 2:
        a, b = (reviewed.statistics for reviewed in review.scenes)
        found = [
            Card(f"mean, A → B, {MICROMETRE}", f"{spell(a.mean_um)} → {spell(b.mean_um)}"),
            Card(f"P95, A → B, {MICROMETRE}", f"{spell(a.p95_um)} → {spell(b.p95_um)}"),
            Card(f"max, A → B, {MICROMETRE}", f"{spell(a.max_um)} → {spell(b.max_um)}"),
        ]
        if review.difference is not None:
            largest = microns(review.difference.max_um)
            found.append(Card(f"max {DIFFERENCE_LENGTH}", largest, "largest change of a point"))
        return found
    reviewed = review.scenes[0]
    stats = reviewed.statistics
    found = [
        Card("mean |E|", microns(stats.mean_um)),
        Card("P95", microns(stats.p95_um)),
        Card("max", microns(stats.max_um), f"at {worst_place(reviewed)}"),
    ]
    if reviewed.sampling is not None:
        worst = reviewed.sampling.worst
        if worst.probability is not None:
            kept = percent(worst.probability.probability)
            found.append(Card(f"keep {limit(worst.probability.spec_um)}", kept, "of machines"))
        else:
            found.append(Card("P95 by tolerances", microns(worst.p95_um), "worst point, machines"))
    return found


def statistics_table(review: Review) -> Block:
    """Statistics of the fields, side by side where there are two."""
    found = [reviewed.statistics for reviewed in review.scenes]
    names = [letter or "value" for letter, _ in letters(review)]
    change: dict[str, float] = {}
    if len(found) == 2:
        change = statistics_change(found[0], found[1])
        names.append(CHANGE)
    if review.difference is not None:
        found.append(review.difference)
        names.append(DIFFERENCE_LENGTH)
    rows: list[tuple[str, ...]] = []
    for label, field in STATISTICS.items():
        numbers = [spell(getattr(stats, field)) for stats in found]
        numbers[2:2] = [spell_signed(change[field])] if change else []
        rows.append((f"{label}, {MICROMETRE}", *numbers))
    columns = [Column("|E| over the volume", width=1.4)]
    columns += [Column(name, "right") for name in names]
    note = (
        f" {CHANGE} is the change of each statistic; {DIFFERENCE_LENGTH} the length of the change"
        " of the error vector, node by node."
        if change
        else ""
    )
    return table(
        "Statistics of the length of the position error, each node counting for its share of the"
        f" volume.{note}",
        columns,
        rows,
    )


def places_table(review: Review) -> Block | None:
    """Say where each field is largest: axis positions, point of R, argument of a command."""
    found = [
        (letter or "|E|", reviewed.scene, reviewed.statistics)
        for letter, reviewed in letters(review)
    ]
    if review.difference is not None:
        found.append((DIFFERENCE_LENGTH, review.scenes[0].scene, review.difference))
    rows: list[tuple[str, ...]] = []
    for name, scene, stats in found:
        if stats.max_um > 0.0:
            own = own_axes(scene, stats.max_at_axes)
            axes, _, point = f"{spell_point(own, stats.max_at_mm)} mm".rpartition(" · ")
            rows.append((name, axes, point, f"--at {spell_at(own)}"))
    if not rows:
        return None
    columns = [
        Column("max of", width=0.8),
        Column("axis positions, mm", width=1.7),
        Column("point in R", width=1.7),
        Column("as an argument", width=2.0),
    ]
    return table("Where the error is largest.", columns, rows)


def explanation_blocks(letter: str, reviewed: Reviewed) -> list[Block]:
    """Contributions at the worst point, adding up to its error."""
    found = reviewed.explanation
    rows: list[tuple[str, ...]] = []
    ranked = sorted(found.contributions, key=lambda part: -abs(part.along_um))
    for part in ranked[:MOST_ROWS]:
        row = parameter(part.key)
        rows.append(
            (
                part.key,
                row.name,
                f"{given(part.value)} {row.unit}",
                *(signed(value) for value in part.error_um),
                signed(part.along_um),
            )
        )
    rest = ranked[MOST_ROWS:]
    if rest:
        vector = np.sum([part.error_um for part in rest], axis=0)
        along = sum(part.along_um for part in rest)
        rows.append((f"{len(rest)} more", "", "", *(signed(v) for v in vector), signed(along)))
    rows.append(("remainder", "second order", "", *(signed(v, 2) for v in found.remainder_um), ""))
    rows.append(("total", "exact chain", "", *(signed(v) for v in found.error_um), ""))
    columns = [
        Column("key", width=1.15),
        Column("error", width=2.2),
        Column("value there", "right", 1.3),
        *(Column(f"{axis}, {MICROMETRE}", "right", 0.95) for axis in "xyz"),
        Column(f"along E, {MICROMETRE}", "right", 1.15),
    ]
    marks: list[Mark] = ["" for _ in rows]
    marks[-1] = "strong"
    caption = (
        f"What each error does to the worst point, {worst_place(reviewed)}. The parts along E"
        " add up to the length of the first-order error. This is no advice what to repair: what"
        " adds most here may make up for other errors elsewhere; see Repair."
    )
    return [
        Text(prefixed(letter, reviewed.scene.title), "heading"),
        table(caption, columns, rows, marks),
    ]


def parameters_table(letter: str, reviewed: Reviewed) -> Block:
    """Every error that is not zero or has a tolerance, and whether it keeps it."""
    scene = reviewed.scene
    rows: list[tuple[str, ...]] = []
    marks: list[Mark] = []
    for key in scene.parameter_keys:
        row, tolerance = parameter(key), scene.tolerances.get(key)
        value = scene.errors.amplitude(key)
        if value == 0.0 and tolerance is None:
            continue
        limits, kept = "", ""
        if tolerance is not None:
            centre = "" if tolerance.centre == 0.0 else f"{given(tolerance.centre)} "
            limits = f"{centre}± {spell_short(tolerance.half_width)}"
            kept = "yes" if abs(value - tolerance.centre) <= tolerance.half_width else "no"
        curve = spell_function(scene.errors.functions.get(key), row.unit) if value else ""
        number = given(value) if value else "0"
        rows.append((key, row.symbol, row.name, number, limits, row.unit, kept, curve))
        marks.append("bad" if kept == "no" else "strong" if value else "")
    columns = [
        Column("key", width=0.85),
        Column("symbol", width=0.9),
        Column("error", width=2.4),
        Column("value", "right", 0.9),
        Column("tolerance", "right", 1.15),
        Column("unit", width=0.75),
        Column("kept", width=0.65),
        Column("along the axis", width=2.4),
    ]
    caption = prefixed(letter, f"Errors and tolerances of {scene.title}.")
    if not rows:
        return Text(f"{caption} All errors are zero, and there are no tolerances.", "note")
    return table(
        f"{caption} Errors that are zero and have no tolerance are left out.", columns, rows, marks
    )


def difference_table(review: Review) -> Block:
    """Parameters in which two scenes differ."""
    first, second = (reviewed.scene for reviewed in review.scenes)
    rows: list[tuple[str, ...]] = []
    keys = dict.fromkeys([*first.parameter_keys, *second.parameter_keys])
    for key in keys:
        a, b = (scene.errors.amplitude(key) for scene in (first, second))
        shapes = [scene.errors.functions.get(key) for scene in (first, second)]
        if shapes[0] == shapes[1] or (a == 0.0 and b == 0.0):
            continue
        row = parameter(key)
        rows.append((key, row.name, given(a), given(b), given(b - a), row.unit))
    columns = [
        Column("key"),
        Column("error", width=2.2),
        Column("A", "right"),
        Column("B", "right"),
        Column("B − A", "right"),
        Column("unit", width=0.8),
    ]
    if not rows:
        return Text("The error sets of A and B are the same.", "note")
    return table("Errors in which A and B differ (largest values along the axis).", columns, rows)


def gains_table(letter: str, gains: Sequence[Gain]) -> Block:
    """List the largest gains and the levers that explain them."""
    rows = [
        (
            gain.key,
            gain.parameter.name,
            spell(gain.norm),
            *(spell(value) for value in (gain.x, gain.y, gain.z)),
            gain.unit,
            spell_vector(gain.lever_mm),
        )
        for gain in gains[:MOST_ROWS]
    ]
    marks: list[Mark] = ["strong" if gain.is_key else "" for gain in gains[:MOST_ROWS]]
    columns = [
        Column("key", width=0.9),
        Column("error", width=2.2),
        Column("|E|", "right", 0.8),
        *(Column(axis, "right", 0.8) for axis in "xyz"),
        Column("unit", width=1.1),
        Column("lever x, y, z, mm", "right", 2.0),
    ]
    caption = (
        "Largest gains over the travel: how much of a unit of error arrives at the point. Strong:"
        f" the key errors, which make {percent(DEFAULT_SHARE, 0)} of the sum of squares."
    )
    return table(prefixed(letter, caption), columns, rows, marks)


def section(heading: str, blocks: Sequence[Block | None]) -> Section:
    """Put a section together, leaving out what there is none of."""
    return Section(heading, tuple(block for block in blocks if block is not None))
