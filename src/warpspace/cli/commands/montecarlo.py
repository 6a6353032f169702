"""Command `montecarlo`: the volumetric error of machines drawn from a scene's tolerances."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

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
    describe_run,
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
    from warpspace.analysis.montecarlo import MonteCarlo
    from warpspace.scene.model import Scene
    from warpspace.scene.sweeps import SweepPoint

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

    Quantiles are exact up to a million samples; beyond, from a histogram with steps of 0.002 %.
    """
    from warpspace.analysis.plan import Plan
    from warpspace.scene.sweeps import sweep

    names = find_scenes(scenes)
    check_targets(*names, force=force, plot=plot)
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
        points = list(
            sweep(
                loaded,
                plan=plan,
                distribution=distribution,
                clip=clip,
                loop=loop,
                executor=found.executor,
                workers=found.number,
                progress=bar.advance,
                take=take,
            )
        )
    first = points[0]
    if plot is not None:
        _plot(plot, first.scene, first.sampled, force=force)
    if as_json and len(points) == 1:
        print_json(result_json(first.sampled))
    elif as_json:
        print_json({"scenes": [_named_json(point) for point in points]})
    elif len(points) == 1:
        _print(first.scene, first.sampled)
    else:
        _print_fleet(points, spec_um)
    if output is not None and not as_json:
        print_text(f"wrote {output}")


def _named_json(point: "SweepPoint") -> dict[str, object]:
    """Spell the result of one scene among others."""
    return {
        "scene": point.scene.name,
        "title": point.scene.title,
        **result_json(point.sampled),
    }


def _print_fleet(points: "Sequence[SweepPoint]", spec_um: float | None) -> None:
    """Print a line for each scene."""
    print_text(describe_run(points[0].sampled))
    print_table(columns((), spec_um), [cells(row(point), ()) for point in points[:PRINTED]])
    if len(points) > PRINTED:
        print_text(f"… and {len(points) - PRINTED:,} scenes more; --json prints all")


def result_json(result: "MonteCarlo") -> dict[str, object]:
    """Spell a result as the JSON output has it."""
    found: dict[str, object] = {
        "samples": result.plan.samples,
        "seed": result.plan.seed,
        "distribution": str(result.draws.distribution),
        "loop": str(result.view.loop),
        "over": str(result.plan.over),
        "mean_um": result.mean_um,
        "mode_um": result.mode_um,
        "median_um": result.median_um,
        "p95_um": result.p95_um,
        "p99_um": result.p99_um,
        "max_um": result.max_um,
        "histogram": {
            "edges_um": result.histogram.edges_um.tolist(),
            "counts": result.histogram.counts.tolist(),
        },
    }
    if result.probability is not None:
        found["specification"] = {
            "spec_um": result.probability.spec_um,
            "probability": result.probability.probability,
            "low": result.probability.low,
            "high": result.probability.high,
        }
    return found


def describe(result: "MonteCarlo") -> str:
    """Say in one line what was sampled."""
    what = {
        "sampled": "|E| at one random point each",
        "max": "largest |E| of each",
        "mean": "mean |E| of each",
    }[str(result.plan.over)]
    drawn = str(result.draws.distribution)
    if drawn == "normal":
        drawn = "normal, 3σ = half width" + (", clipped" if result.draws.clip else "")
    return (
        f"{result.view.loop} loop · {result.plan.samples:,} machines, {what} · {drawn} ·"
        f" seed {result.plan.seed}"
    )


def printed_value(scene: "Scene", result: "MonteCarlo") -> float | None:
    """Give the value that the thesis prints for this distribution; None where it has none."""
    from warpspace.analysis.thesis.rows import printed_tables

    name = f"{result.view.loop}_{scene.name.removeprefix('dvf5000_')}"
    found = printed_tables()["table_4_8"]["predicted"].get(name)
    here = scene.machine.name == "dvf5000" and scene.name.startswith("dvf5000_")
    return float(found) if found and here and str(result.plan.over) == "sampled" else None


def _plot(path: str, scene: "Scene", result: "MonteCarlo", *, force: bool) -> None:
    """Draw the histogram."""
    from warpspace.outputs.charts import montecarlo_chart, write_chart

    chart = montecarlo_chart(result, scene.title, describe(result), printed_value(scene, result))
    write_chart(chart, path, overwrite=force)


def _print(scene: "Scene", result: "MonteCarlo") -> None:
    """Print the numbers."""
    from warpspace.analysis.contributions import expected_square

    print_text(f"{scene.title} · {describe(result)}")
    print_text(
        f"  mean {result.mean_um:.2f}, mode {result.mode_um:.1f}, median {result.median_um:.2f},"
        f" P95 {result.p95_um:.2f}, P99 {result.p99_um:.2f}, max {result.max_um:.2f} µm"
    )
    if str(result.plan.over) == "sampled":
        variance, offset = expected_square(
            scene.model, result.draws, scene.workspace, result.view, result.plan
        )
        print_text(
            f"  RMS  {result.rms_um:.2f} µm sampled, {math.sqrt(variance.sum() + offset):.2f} µm"
            " from trace(J Σ Jᵀ) without sampling"
        )
    if (value := printed_value(scene, result)) is not None:
        print_text(f"  the thesis prints {value:g} µm (table 4-8; see `warpspace thesis`)")
    if (kept := result.probability) is not None:
        print_text(
            f"  |E| ≤ {kept.spec_um:g} µm: {100.0 * kept.probability:.2f} % of the machines,"
            f" 95 % interval {100.0 * kept.low:.2f} … {100.0 * kept.high:.2f} %"
        )
    held = [
        key
        for key, width in zip(result.draws.keys, result.draws.half_width, strict=True)
        if width == 0.0
    ]
    note = f"; held at their centre: {', '.join(held)}" if held else ""
    print_text(f"  {len(result.draws.keys) - len(held)} parameters drawn{note}")
    if not result.exact_quantiles:
        print_text("  quantiles to 0.002 % of their value")
