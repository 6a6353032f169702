"""Command `contributions`: which tolerances the volumetric error comes from."""

import click

from warpspace.cli.montecarlo import (
    clip_option,
    cylinder_option,
    distribution_option,
    parse_cylinder,
    seed_option,
)
from warpspace.cli.options import json_option, loop_option, print_json, scene_argument


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
@click.option("--plot", type=click.Path(), help="Draw the chart: .png, .svg or .pdf.")
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
    clip: bool,
    as_json: bool,
) -> None:
    """Share out the variance of the volumetric error over the tolerances of SCENE.

    The model is linear and the parameters independent: the shares of trace(J Σ Jᵀ), averaged over
    the points, are exact. Beside them stands what 20,000 sampled machines give. Sobol indices look
    at the length |E| instead, which is not linear: the total index counts interactions, so that
    their sum is above 1.
    """
    from dataclasses import asdict

    from warpspace.exceptions import OptionError
    from warpspace.outputs.charts.paper import CHART_ENDINGS
    from warpspace.outputs.files import check_target
    from warpspace.scene import verbs
    from warpspace.scene.library import load_scene

    if plot is not None:
        check_target(plot, CHART_ENDINGS)
    if sobol is not None and sobol < 2:
        raise OptionError(f"--sobol {sobol}; expected a power of two, 2 or above")
    loaded = load_scene(scene)
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
        write_chart(contributions_chart(found, title, where), plot)
    if as_json:
        rows = [asdict(row) for row in found.rows]
        totals = {"variance_um2": found.variance_um2, "rms_um": found.rms_um}
        print_json({"contributions": rows, **totals})
        return
    click.echo(f"{loaded.title} · {where}")
    head = f"  {'key':<5} {'half width':>11}  {'share':>7} {'sampled':>8}"
    click.echo(head + ("   Sobol first  total" if sobol else ""))
    for row in found.rows:
        line = (
            f"  {row.key:<5} {row.half_width:6g} {row.unit:<4}  {row.share:7.2%}"
            f" {row.sampled_share:8.2%}"
        )
        if row.sobol_first is not None and row.sobol_total is not None:
            line += f"   {row.sobol_first:11.3f}  {row.sobol_total:.3f}"
            line += f" ± {row.sobol_total_confidence:.3f}"
        click.echo(line)
