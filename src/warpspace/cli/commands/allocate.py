"""Command `allocate`: the widest tolerances that keep a limit of |E| with a probability."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from warpspace.cli.file_options import check_output, force_option, output_option
from warpspace.cli.options import json_option, loop_option, print_json, scene_argument
from warpspace.cli.progress import progress
from warpspace.cli.sampling_options import (
    clip_option,
    cylinder_option,
    distribution_option,
    parse_cylinder,
    samples_option,
    seed_option,
)
from warpspace.cli.tables import Column, number_columns, print_table, print_text
from warpspace.exceptions import OptionError

if TYPE_CHECKING:
    from warpspace.analysis.allocation import Allocation

OVER = ("sampled", "max")


@click.command()
@scene_argument()
@click.option("--limit-um", type=float, required=True, help="Largest |E| accepted, in µm.")
@click.option(
    "--probability",
    type=float,
    default=0.95,
    show_default=True,
    help="Share of the machines that has to keep the limit.",
)
@click.option(
    "--over",
    type=click.Choice(OVER),
    default="sampled",
    show_default=True,
    help="Evaluated at a random point of each machine (sampled) or everywhere (max).",
)
@click.option(
    "--cost",
    "costs",
    multiple=True,
    metavar="KEY=NUMBER,…",
    help="Cost of an error's tolerance, 1 if not given: a half width w costs NUMBER/w. Repeatable.",
)
@click.option(
    "--fixed",
    "fixed",
    multiple=True,
    metavar="KEY,…",
    help="Errors whose tolerance stays as it is. Repeatable.",
)
@distribution_option
@clip_option
@loop_option
@cylinder_option
@samples_option
@seed_option
@click.option(
    "--workers", type=int, help="Threads; the result does not depend on it.  [one per core]"
)
@output_option("Scene file to write with the new tolerances: .toml.", required=False)
@force_option
@json_option
def allocate(
    scene: str,
    limit_um: float,
    probability: float,
    over: str,
    costs: Sequence[str],
    fixed: Sequence[str],
    distribution: str,
    loop: str,
    cylinder: str | None,
    samples: int,
    seed: int,
    workers: int | None,
    output: str | None,
    *,
    clip: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Find the widest tolerances that keep a limit of |E|.

    Of the machines drawn from the new tolerances of SCENE the wanted share keeps |E| ≤ LIMIT, at
    the least cost: a half width w of an error costs 1/w, or what --cost says over w. A tolerance of
    0 holds its error and stays 0; centres stay; half widths are rounded down to three digits and at
    most 1000 µm or µrad. The probability printed is that of new machines, drawn after the
    tolerances were found; `warpspace montecarlo FILE --spec-um LIMIT` repeats it on others.
    """
    from dataclasses import replace

    from warpspace.analysis.allocation import Wish
    from warpspace.outputs.files import write_atomically
    from warpspace.scene import verbs
    from warpspace.scene.library import load_scene
    from warpspace.scene.save import scene_to_toml

    target = None
    if output is not None:
        target = check_output(output, [".toml"], force=force, scenes=[scene])
    loaded = load_scene(scene)
    wish = Wish(limit_um, probability, parse_costs(costs), parse_keys(fixed))
    with progress("allocating", 100.0, "%", silent=as_json) as bar:
        found = verbs.allocate(
            loaded,
            wish,
            samples=samples,
            seed=seed,
            distribution=distribution,
            clip=clip,
            loop=loop,
            over=over,
            cylinder=parse_cylinder(cylinder),
            workers=workers,
            progress=lambda share: bar.advance(100.0 * share),
        )
    if target is not None:
        tolerances = loaded.tolerances.with_half_widths(found.tolerances)
        with write_atomically(target, overwrite=force) as temporary:
            text = scene_to_toml(replace(loaded, tolerances=tolerances))
            temporary.write_text(text, encoding="utf-8")
    if as_json:
        print_json(result_json(found, loop, over))
        return
    where = "everywhere" if over == "max" else "at a random point"
    print_text(f"{loaded.title} · {loop} loop · {distribution} · evaluated {where}")
    _print(found)
    if output is not None:
        print_text(f"{output}: the scene with these tolerances")


def parse_keys(texts: Sequence[str]) -> frozenset[str]:
    """Read lists of parameter keys with commas between."""
    parts = (part.strip().upper() for text in texts for part in text.split(","))
    return frozenset(part for part in parts if part)


def parse_costs(texts: Sequence[str]) -> dict[str, float]:
    """Read costs as a user types them.

    Raises
    ------
    OptionError
        If one cannot be read, or an error has two.
    """
    found: dict[str, float] = {}
    for part in (part for text in texts for part in text.split(",") if part.strip()):
        name, equals, number = part.partition("=")
        key = name.strip().upper()
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not equals or not key or not math.isfinite(value):
            raise OptionError(
                f"--cost {part.strip()!r}; expected KEY=NUMBER pairs with commas between, for"
                " instance EA0Z=4,EXX=0.5"
            )
        if key in found:
            raise OptionError(f"--cost {part.strip()!r}: {key} is given twice")
        found[key] = value
    return found


def result_json(found: "Allocation", loop: str, over: str) -> dict[str, object]:
    """Spell a result as the JSON output has it."""
    widths = dict(zip(found.draws.keys, found.half_width.tolist(), strict=True))
    return {
        "limit_um": found.wish.limit_um,
        "wanted": found.wish.probability,
        "loop": loop,
        "over": over,
        "distribution": str(found.draws.distribution),
        "tolerances": widths,
        "allocated": list(found.tolerances),
        "probability": found.after.probability,
        "low": found.after.low,
        "high": found.after.high,
        "probability_before": found.before.probability,
        "cost": found.cost_after,
        "cost_before": found.cost_before,
        "samples": found.samples,
        "seed": found.seed,
    }


def _print(found: "Allocation") -> None:
    """Print tolerances before and after, and how sure the limit is kept."""
    from warpspace.machine.parameters import parameter

    columns = (
        Column("key", leads=True),
        Column("error", wraps=True),
        *number_columns(("before ±", "after ±")),
        Column("unit"),
        Column("note", wraps=True),
    )
    rows: list[tuple[str, ...]] = []
    widths = zip(
        found.draws.keys, found.draws.half_width, found.half_width, found.free, strict=True
    )
    for key, before, after, free in widths:
        row = parameter(key)
        note = "the widest there is" if key in found.at_widest else ""
        if not free:
            note = "fixed" if key in found.wish.fixed else "zero" if before == 0.0 else "no effect"
        cost = found.wish.costs.get(key)
        note = note or ("" if cost is None else f"cost {cost:g}")
        rows.append((key, row.name, f"{before:g}", f"{after:g}", row.unit, note))
    print_table(columns, rows)
    limit = found.wish.limit_um
    print_text(
        f"  |E| ≤ {limit:g} µm before: {100.0 * found.before.probability:.2f} % of the machines,"
        f" cost {found.cost_before:.3g}"
    )
    print_text(
        f"  |E| ≤ {limit:g} µm after: {100.0 * found.after.probability:.2f} % of the machines,"
        f" 95 % interval {100.0 * found.after.low:.2f} … {100.0 * found.after.high:.2f} %,"
        f" cost {found.cost_after:.3g} ({found.samples:,} new machines)"
    )
