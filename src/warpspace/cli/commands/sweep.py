"""Command `sweep`: Monte Carlo over tolerances in steps and fleets of scenes."""

import math
from collections.abc import Sequence
from contextlib import nullcontext

import click

from warpspace.cli.file_options import check_output, force_option, output_option
from warpspace.cli.fleets import (
    PRINTED,
    cells,
    columns,
    describe_run,
    find_scenes,
    load_each,
    row,
    row_kinds,
)
from warpspace.cli.options import (
    grid_option,
    json_option,
    loop_option,
    print_json,
    scene_argument,
)
from warpspace.cli.pools import find_workers, scheduler_option, workers_option
from warpspace.cli.progress import progress
from warpspace.cli.sampling_options import (
    clip_option,
    cylinder_option,
    distribution_option,
    parse_cylinder,
    samples_option,
    seed_option,
)
from warpspace.cli.tables import print_table, print_text
from warpspace.exceptions import OptionError
from warpspace.machine.limits import SWEEP_CASES

OVER = ("sampled", "max", "mean")


@click.command()
@scene_argument("scenes", metavar="SCENE…", nargs=-1, required=True)
@click.option(
    "--tolerance",
    "steps",
    multiple=True,
    metavar="KEY=FROM:TO:N",
    help="Half widths of a parameter, or of the class translation, rotation or squareness, in µm or"
    " µrad: N of them in equal steps, or a list as in EXX=5,10,20. Repeatable: every combination.",
)
@click.option("--limit-um", type=float, help="Of |E| in µm, to say how likely it is kept.")
@samples_option
@seed_option
@grid_option(11, "for --over max|mean")
@distribution_option
@clip_option
@loop_option
@click.option(
    "--over",
    type=click.Choice(OVER),
    default="sampled",
    show_default=True,
    help="|E| at one random point per machine, or its largest or mean over a machine's points.",
)
@cylinder_option
@workers_option
@scheduler_option
@output_option("Table to write, a row for each combination: .parquet or .csv.", required=False)
@force_option
@json_option
def sweep(
    scenes: Sequence[str],
    steps: Sequence[str],
    limit_um: float | None,
    samples: int,
    seed: int,
    grid: int,
    distribution: str,
    loop: str,
    over: str,
    cylinder: str | None,
    workers: int | None,
    scheduler: str | None,
    output: str | None,
    *,
    clip: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Show what tolerances in steps do to |E|.

    Machines of every SCENE (a folder stands for the scenes in it) are drawn with every combination
    of half widths, with the same seed throughout, so that rows differ by their tolerances only.
    Without --tolerance there is one row for each scene. The numbers of a seed are the same on any
    number of workers, processes or machines of a cluster.
    """
    from warpspace.analysis.plan import Plan
    from warpspace.outputs.exports.rows import ROW_ENDINGS, write_rows
    from warpspace.scene.sweeps import check_half_widths, count_points
    from warpspace.scene.sweeps import sweep as run

    half_widths = parse_steps(steps)
    check_half_widths(half_widths)
    names = find_scenes(scenes)
    count = len(names) * count_points(half_widths)
    if count > SWEEP_CASES:
        raise OptionError(f"{count:,} rows; expected at most {SWEEP_CASES:,}")
    if output is not None:
        check_output(output, ROW_ENDINGS, force=force, scenes=names)
    plan = Plan(samples, seed, over, grid, limit_um, parse_cylinder(cylinder), None)
    plan.check()
    total = samples * count
    loaded = load_each(names)
    printed: list[dict[str, object]] = []
    said, number = "", 0
    with (
        find_workers(scheduler, workers, total) as found,
        progress("sampling", total, "machines", silent=as_json) as bar,
        write_rows(output, row_kinds(list(half_widths)), overwrite=force)
        if output is not None
        else nullcontext() as append,
    ):
        points = run(
            loaded,
            half_widths,
            plan=plan,
            distribution=distribution,
            clip=clip,
            loop=loop,
            executor=found.executor,
            workers=found.number,
            progress=bar.advance,
        )
        for point in points:
            number += 1
            values = row(point)
            said = said or describe_run(point.sampled)
            if append is not None:
                append({name: [value] for name, value in values.items()})
            if as_json or len(printed) < PRINTED:
                printed.append(values)
    if as_json:
        print_json({"tolerances": half_widths, "rows": printed})
        return
    print_text(said)
    print_table(
        columns(list(half_widths), limit_um),
        [cells(values, list(half_widths)) for values in printed],
    )
    if number > len(printed):
        print_text(f"… and {number - len(printed):,} rows more; -o FILE writes all")
    if output is not None:
        print_text(f"wrote {output}")


def parse_steps(texts: Sequence[str]) -> dict[str, list[float]]:
    """Read half widths as a user types them.

    Raises
    ------
    OptionError
        If they cannot be read.
    """
    found: dict[str, list[float]] = {}
    for text in texts:
        key, equals, values = text.partition("=")
        key = key.strip()
        if not (key and equals):
            raise _unreadable(text)
        if key in found:
            raise OptionError(f"--tolerance {text!r}: {key} is given twice")
        found[key] = _steps(text, values) if ":" in values else _list(text, values)
    return found


def _steps(text: str, values: str) -> list[float]:
    """Read FROM:TO:N."""
    import numpy as np

    try:
        low, high, number = values.split(":")
        ends, count = (float(low), float(high)), int(number)
    except ValueError:
        raise _unreadable(text) from None
    if not (all(map(math.isfinite, ends)) and 1 <= count <= SWEEP_CASES):
        raise _unreadable(text)
    return np.linspace(*ends, count).tolist()


def _list(text: str, values: str) -> list[float]:
    """Read numbers with commas between."""
    try:
        return [float(value) for value in values.split(",")]
    except ValueError:
        raise _unreadable(text) from None


def _unreadable(text: str) -> OptionError:
    """Say what was expected."""
    return OptionError(
        f"--tolerance {text!r}; expected KEY=FROM:TO:N with N from 1 to {SWEEP_CASES:,}, or"
        " KEY=NUMBER,…, for instance EAX=5:20:4 or rotation=10,20"
    )
