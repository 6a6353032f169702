"""Monte Carlo and variance shares of a report, in numbers."""

from warpspace.machine.parameters import parameter
from warpspace.outputs.report.blocks import Block, Column, Text, table
from warpspace.outputs.report.review import Reviewed
from warpspace.outputs.report.sections import MOST_ROWS, prefixed
from warpspace.outputs.report.wording import limit, percent
from warpspace.picture.words import spell, spell_short
from warpspace.units import MICROMETRE


def sampling_blocks(letter: str, reviewed: Reviewed) -> list[Block]:
    """Monte Carlo and variance shares in numbers."""
    sampling = reviewed.sampling
    if sampling is None:
        return [Text(prefixed(letter, reviewed.why_not_sampled), "note")]
    rows: list[tuple[str, ...]] = []
    for name, result in (
        ("at a random point", sampling.sampled),
        ("at the worst point", sampling.worst),
    ):
        share = result.probability
        rows.append(
            (
                name,
                f"{result.plan.samples:,}".replace(",", " "),
                *(spell(value) for value in (result.mean_um, result.mode_um, result.median_um)),
                spell(result.p95_um),
                spell(result.max_um),
                percent(share.probability, 2) if share else "–",
                f"{percent(share.low, 2)} … {percent(share.high, 2)}" if share else "–",
            )
        )
    spec = sampling.sampled.plan.spec_um
    columns = [
        Column("|E| of a machine", width=1.7),
        Column("machines", "right", 1.1),
        *(Column(name, "right", 0.85) for name in ("mean", "mode", "median", "P95", "max")),
        Column(f"≤ {limit(spec)}" if spec is not None else "in spec.", "right", 1.1),
        Column("95 % interval", "right", 1.9),
    ]
    caption = prefixed(
        letter,
        f"Machines drawn from the tolerances of {reviewed.scene.title}"
        f" ({sampling.sampled.draws.distribution}, seed {sampling.sampled.plan.seed}),"
        f" {MICROMETRE}.",
    )
    shares = [
        (
            row.key,
            parameter(row.key).name,
            f"± {spell_short(row.half_width)} {row.unit}",
            spell(row.variance_um2),
            percent(row.share),
        )
        for row in sampling.shares.rows[:MOST_ROWS]
        if row.share > 0.0
    ]
    share_columns = [
        Column("key"),
        Column("error", width=2.2),
        Column("half width", "right", 1.2),
        Column(f"variance, {MICROMETRE}²", "right", 1.2),
        Column("share", "right"),
    ]
    which = prefixed(letter, "Which tolerances matter: shares of the variance of E, exact.")
    return [table(caption, columns, rows), table(which, share_columns, shares)]
