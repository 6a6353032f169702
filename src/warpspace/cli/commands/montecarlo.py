"""Command `montecarlo`: the volumetric error of machines drawn from a scene's tolerances."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from warpspace.cli.file_options import (
    check_targets,
    force_option,
    output_option,
    plot_option,
)
from warpspace.cli.fleets import (
    PRINTED,
    cells,
    columns,
    find_scenes,
    load_each,
    row,
)
from warpspace.cli.machine_table import check_machine_table, machine_table
from warpspace.cli.options import (
    grid_option,
    json_option,
    loop_option,
    print_json,
    scene_argument,
)
from warpspace.cli.pools import find_workers, scheduler_option, workers_option
from warpspace.cli.progress import progress
from warpspace.cli.results.montecarlo import (
    describe,
    plot_samples,
    print_samples,
    result_json,
)
from warpspace.cli.sampling_options import (
    clip_option,
    cylinder_option,
    distribution_option,
    parse_cylinder,
    samples_option,
    seed_option,
    specification_option,
)
from warpspace.cli.tables import print_table, print_text
from warpspace.exceptions import OptionError

if TYPE_CHECKING:
    from warpspace.analysis.montecarlo import Plan, Progress, Take
    from warpspace.cli.pools import Workers
    from warpspace.scene.model import Scene
    from warpspace.scene.sweeps import SweepPoint

SOURCES = ("tolerances", "uncertainty")
OVER = ("sampled", "max", "mean")


@click.command()
@scene_argument("scenes", metavar="SCENE…", nargs=-1, required=True)
@samples_option
@seed_option
@grid_option(11, "for --over max|mean")
@specification_option
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
@click.option(
    "--from",
    "source",
    type=click.Choice(SOURCES),
    default="tolerances",
    show_default=True,
    help="Machines within the tolerances; or what the measured machine may be: the errors of SCENE,"
    " each off by its standard uncertainty.",
)
@workers_option
@scheduler_option
@plot_option("histogram")
@output_option("|E| of every machine as a table: .parquet or .csv.", required=False)
@force_option
@json_option
def montecarlo(
    scenes: Sequence[str],
    samples: int,
    seed: int,
    grid: int,
    spec_um: float | None,
    distribution: str,
    loop: str,
    over: str,
    cylinder: str | None,
    source: str,
    workers: int | None,
    scheduler: str | None,
    plot: str | None,
    output: str | None,
    *,
    force: bool,
    clip: bool,
    as_json: bool,
) -> None:
    """Show how large |E| gets on machines within tolerance.

    Machines are sampled from the tolerances of each SCENE (a folder stands for the scenes in it;
    several are printed as a table); |E| is the length of the error in µm.
    Each parameter is drawn once per machine and holds everywhere; a component error is the value it
    has at the point looked at. Tool and relative loop: points uniform in the working volume, rotary
    axes at their place in the scene. Workpiece loop: points uniform in the volume of the largest
    workpiece, its rotary axes uniform over their travel.

    With --from uncertainty the errors of SCENE keep their curves, and each is off by one number
    times its standard uncertainty along the axis: normal, or uniform with the same standard
    uncertainty where --distribution says so.

    Quantiles are exact up to a million samples; beyond, from a histogram with steps of 0.002 %.
    """
    from warpspace.analysis.plan import Plan

    names = find_scenes(scenes)
    check_targets(*names, force=force, plot=plot)
    if source == "uncertainty" and clip:
        raise OptionError("--clip is for tolerances: an uncertainty has no limits; leave it out")
    if plot is not None and len(names) > 1:
        raise OptionError("--plot draws one machine; expected one scene")
    plan = Plan(samples, seed, over, grid, spec_um, parse_cylinder(cylinder), None)
    plan.check()
    check_machine_table(output, names, samples, force=force)
    total = samples * len(names)
    loaded = load_each(names)
    with (
        find_workers(scheduler, workers, total) as found,
        progress("sampling", total, "machines", silent=as_json) as bar,
        machine_table(output, names, force=force) as take,
    ):
        if source == "uncertainty":
            chosen = _chosen(distribution) or "normal"
            points = [
                _uncertain(scene, index, plan, loop, chosen, found, bar.advance, take)
                for index, scene in enumerate(loaded)
            ]
        else:
            points = _sampled(loaded, plan, loop, distribution, clip, found, bar.advance, take)
    first = points[0]
    if plot is not None:
        plot_samples(plot, first.scene, first.sampled, source, force=force)
    if as_json and len(points) == 1:
        kind = {} if source == "tolerances" else {"from": source}
        print_json({**result_json(first.sampled), **kind})
    elif as_json:
        print_json({"scenes": [_named_json(point) for point in points], "from": source})
    elif len(points) == 1:
        print_samples(first.scene, first.sampled, source)
    else:
        _print_fleet(points, spec_um, source)
    if output is not None and not as_json:
        print_text(f"wrote {output}")


def _sampled(
    scenes: "Iterable[Scene]",
    plan: "Plan",
    loop: str,
    distribution: str,
    clip: bool,
    found: "Workers",
    advance: "Progress",
    take: "Take | None",
) -> "list[SweepPoint]":
    """Sample machines within the tolerances of each scene."""
    from warpspace.scene.sweeps import sweep

    return list(
        sweep(
            scenes,
            plan=plan,
            distribution=distribution,
            clip=clip,
            loop=loop,
            executor=found.executor,
            workers=found.number,
            progress=advance,
            take=take,
        )
    )


def _uncertain(
    scene: "Scene",
    index: int,
    plan: "Plan",
    loop: str,
    distribution: str,
    found: "Workers",
    advance: "Progress",
    take: "Take | None",
) -> "SweepPoint":
    """Sample what the measured machine of a scene may be."""
    from warpspace.scene.sweeps import SweepPoint
    from warpspace.scene.uncertainty import uncertain_montecarlo

    sampled = uncertain_montecarlo(
        scene,
        plan,
        loop=loop,
        distribution=distribution,
        progress=advance,
        workers=found.number,
        executor=found.executor,
        take=None if take is None else lambda _, values: take(index, values),
    )
    return SweepPoint(scene, {}, sampled)


def _named_json(point: "SweepPoint") -> dict[str, object]:
    """Spell the result of one scene among others."""
    return {
        "scene": point.scene.name,
        "title": point.scene.title,
        **result_json(point.sampled),
    }


def _print_fleet(points: "Sequence[SweepPoint]", spec_um: float | None, source: str) -> None:
    """Print a line for each scene."""
    print_text(describe(points[0].sampled, source))
    print_table(columns((), spec_um), [cells(row(point), ()) for point in points[:PRINTED]])
    if len(points) > PRINTED:
        print_text(f"… and {len(points) - PRINTED:,} scenes more; --json prints all")


def _chosen(distribution: str) -> str:
    """Give the distribution that a user has named; empty where it is the one unless said."""
    said = click.get_current_context().get_parameter_source("distribution")
    return "" if said is ParameterSource.DEFAULT else distribution
