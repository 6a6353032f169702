"""Command `contributions`: which tolerances the volumetric error comes from."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from warpspace.cli.file_options import check_targets, force_option, plot_option
from warpspace.cli.options import json_option, loop_option, print_json, scene_argument
from warpspace.cli.progress import progress
from warpspace.cli.sampling_options import (
    clip_option,
    cylinder_option,
    distribution_option,
    parse_cylinder,
    seed_option,
)
from warpspace.cli.tables import Column, number_columns, print_table, print_text

if TYPE_CHECKING:
    from warpspace.analysis.contributions import Contribution


@click.command()
@scene_argument()
@loop_option
@distribution_option
@clip_option
@cylinder_option
@seed_option
@click.option(
    "--sobol",
    type=int,
    help="Sobol indices of a machine's mean |E| beside the exact shares, from this many base"
    " samples, a power of two such as 1024.",
)
@plot_option("chart")
@force_option
@json_option
def contributions(
    scene: str,
    loop: str,
    distribution: str,
    cylinder: str | None,
    seed: int,
    sobol: int | None,
    plot: str | None,
    *,
    force: bool,
    clip: bool,
    as_json: bool,
) -> None:
    """Show which tolerances the volumetric error comes from.

    The variance of the volumetric error is shared out over the tolerances of SCENE, in percent.
    The model is linear and the parameters independent: the shares of trace(J Σ Jᵀ), averaged over
    the points, are exact. Beside them stands what 20,000 sampled machines give. Sobol indices look
    at the length |E| instead, which is not linear: the total index counts interactions, so that
    their sum is above 1.
    """
    from dataclasses import asdict

    from warpspace.exceptions import OptionError
    from warpspace.scene import verbs
    from warpspace.scene.library import load_scene

    check_targets(scene, force=force, plot=plot)
    if sobol is not None and sobol < 2:
        raise OptionError(f"--sobol {sobol}; expected a power of two, 2 or above")
    loaded = load_scene(scene)
    with progress("sampling", silent=as_json):
        found = verbs.contributions(
            loaded,
            loop=loop,
            distribution=distribution,
            clip=clip,
            seed=seed,
            cylinder=parse_cylinder(cylinder),
            sobol=sobol,
        )
    where = f"{loop} loop · {distribution} · RMS |E| {found.rms_um:.1f} µm"
    if plot is not None:
        from warpspace.outputs.charts import contributions_chart, write_chart

        title = f"Which tolerances matter · {loaded.title}"
        write_chart(contributions_chart(found, title, where), plot, overwrite=force)
    if as_json:
        rows = [asdict(row) for row in found.rows]
        totals = {"variance_um2": found.variance_um2, "rms_um": found.rms_um}
        print_json({"contributions": rows, **totals})
        return
    print_text(f"{loaded.title} · {where}")
    _print(found.rows)


def _print(rows: "Sequence[Contribution]") -> None:
    """Print the shares, and the Sobol indices where they were asked for."""
    with_sobol = any(row.sobol_total is not None for row in rows)
    sobol = number_columns(("Sobol first", "total", "± (95 %)")) if with_sobol else ()
    columns = (
        Column("key", leads=True),
        Column("half width", is_number=True),
        Column("unit"),
        *number_columns(("share", "sampled"), "%"),
        *sobol,
    )
    print_table(
        columns,
        [
            (
                *(row.key, f"{row.half_width:g}", row.unit),
                *(f"{100.0 * share:.2f}" for share in (row.share, row.sampled_share)),
                *(
                    "" if index is None else f"{index:.3f}"
                    for index in (row.sobol_first, row.sobol_total, row.sobol_total_confidence)
                    if with_sobol
                ),
            )
            for row in rows
        ],
    )
