"""Command `montecarlo`: the volumetric error of machines drawn from a scene's tolerances."""

import math
from typing import TYPE_CHECKING

import click

from warpspace.cli.options import json_option, loop_option, print_json, scene_argument
from warpspace.exceptions import OptionError

if TYPE_CHECKING:
    from warpspace.analysis.montecarlo import MonteCarlo
    from warpspace.analysis.points import Cylinder
    from warpspace.scene.model import Scene

DISTRIBUTIONS = ("uniform", "normal")
OVER = ("sampled", "max", "mean")

seed_option = click.option(
    "--seed", type=int, default=0, show_default=True, help="The same seed gives the same numbers."
)
distribution_option = click.option(
    "--distribution",
    type=click.Choice(DISTRIBUTIONS),
    default="uniform",
    show_default=True,
    help="uniform over the tolerance, or normal with 3σ = half width.",
)
clip_option = click.option(
    "--clip/--no-clip",
    default=False,
    show_default=True,
    help="Whether the normal distribution ends at the tolerance limits.",
)
cylinder_option = click.option(
    "--cylinder",
    metavar="DIAMETERxHEIGHT",
    help="Workpiece loop: largest workpiece in mm, over whose volume the points are spread.  [the"
    " one whose top rim the scene's workpiece point lies on: 550x450 on the DVF5000]",
)


def parse_cylinder(text: str | None) -> "Cylinder | None":
    """Read the size of a workpiece as a user types it.

    Raises
    ------
    OptionError
        If it cannot be read.
    """
    from warpspace.analysis.points import Cylinder

    if text is None:
        return None
    first, _, second = text.lower().replace("×", "x").partition("x")
    try:
        size = float(first), float(second)
    except ValueError:
        size = math.nan, math.nan
    if not (math.isfinite(size[0]) and math.isfinite(size[1])):
        raise OptionError(f"--cylinder {text!r}; expected diameter x height in mm, as in 550x450")
    return Cylinder(*size)


@click.command()
@scene_argument()
@click.option("--samples", type=int, default=100_000, show_default=True, help="Machines drawn.")
@seed_option
@click.option(
    "--grid", type=int, default=11, show_default=True, help="Nodes per axis for --over max|mean."
)
@click.option(
    "--spec-um", type=float, help="Specification in µm: how likely does a machine keep it?"
)
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
    "--workers", type=int, help="Threads; the result does not depend on it.  [one per core]"
)
@click.option("--plot", type=click.Path(), help="Draw the histogram: .png, .svg or .pdf.")
@json_option
def montecarlo(
    scene: str,
    samples: int,
    seed: int,
    grid: int,
    spec_um: float | None,
    distribution: str,
    loop: str,
    over: str,
    cylinder: str | None,
    workers: int | None,
    plot: str | None,
    *,
    clip: bool,
    as_json: bool,
) -> None:
    """Sample machines from the tolerances of SCENE and show how large |E| gets.

    Each parameter is drawn once per machine and holds everywhere; a component error is the value it
    has at the point looked at. Tool and relative loop: points uniform in the working volume, rotary
    axes at their place in the scene. Workpiece loop: points uniform in the volume of the largest
    workpiece, its rotary axes uniform over their travel.

    Quantiles are exact up to a million samples; beyond, from a histogram with steps of 0.002 %.
    """
    from warpspace.outputs.charts.paper import CHART_ENDINGS
    from warpspace.outputs.files import check_target
    from warpspace.scene import verbs
    from warpspace.scene.library import load_scene

    if plot is not None:
        check_target(plot, CHART_ENDINGS)
    loaded = load_scene(scene)
    size = parse_cylinder(cylinder)
    with _progress(samples) as bar:
        result = verbs.montecarlo(
            loaded,
            samples=samples,
            seed=seed,
            distribution=distribution,
            clip=clip,
            loop=loop,
            over=over,
            grid=grid,
            spec_um=spec_um,
            cylinder=size,
            workers=workers,
            progress=bar.update,
        )
    if plot is not None:
        _plot(plot, loaded, result)
    if as_json:
        print_json(result_json(result))
        return
    _print(loaded, result)


def _progress(samples: int):  # noqa: ANN202 - tqdm's own type
    """Build a progress bar on stderr that shows after a second, on a terminal only."""
    import sys

    from tqdm import tqdm

    return tqdm(
        total=max(samples, 0),
        unit=" machines",
        unit_scale=True,
        delay=1.0,
        disable=None,
        leave=False,
        file=sys.stderr,
    )


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


def _plot(path: str, scene: "Scene", result: "MonteCarlo") -> None:
    """Draw the histogram."""
    from warpspace.outputs.charts import montecarlo_chart, write_chart

    chart = montecarlo_chart(result, scene.title, describe(result), printed_value(scene, result))
    write_chart(chart, path)


def _print(scene: "Scene", result: "MonteCarlo") -> None:
    """Print the numbers."""
    from warpspace.analysis.contributions import expected_square

    click.echo(f"{scene.title} · {describe(result)}")
    click.echo(
        f"  mean {result.mean_um:.2f}, mode {result.mode_um:.1f}, median {result.median_um:.2f},"
        f" P95 {result.p95_um:.2f}, P99 {result.p99_um:.2f}, max {result.max_um:.2f} µm"
    )
    if str(result.plan.over) == "sampled":
        variance, offset = expected_square(
            scene.model, result.draws, scene.workspace, result.view, result.plan
        )
        click.echo(
            f"  RMS  {result.rms_um:.2f} µm sampled, {math.sqrt(variance.sum() + offset):.2f} µm"
            " from trace(J Σ Jᵀ) without sampling"
        )
    if (value := printed_value(scene, result)) is not None:
        click.echo(f"  the thesis prints {value:g} µm (table 4-8; see `warpspace thesis`)")
    if (chance := result.probability) is not None:
        click.echo(
            f"  |E| ≤ {chance.spec_um:g} µm: {100.0 * chance.probability:.2f} % of the machines,"
            f" 95 % interval {100.0 * chance.low:.2f} … {100.0 * chance.high:.2f} %"
        )
    held = [
        key
        for key, width in zip(result.draws.keys, result.draws.half_width, strict=True)
        if width == 0.0
    ]
    note = f"; held at their centre: {', '.join(held)}" if held else ""
    click.echo(f"  {len(result.draws.keys) - len(held)} parameters drawn{note}")
    if not result.exact_quantiles:
        click.echo("  quantiles to 0.002 % of their value")
