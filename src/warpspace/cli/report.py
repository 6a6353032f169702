"""Command `report`: the design review of one scene or two."""

from typing import TYPE_CHECKING

import click

from warpspace.cli.options import loop_option, scene_argument
from warpspace.cli.targets import exaggeration_option, force_option, parse_exaggeration

if TYPE_CHECKING:
    from warpspace.scene.model import Scene


@click.command()
@scene_argument("scenes", nargs=-1, required=True)
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(),
    help="File to write: .html (with interactive 3-D views) or .pdf.",
)
@click.option("--spec-um", type=float, help="Specification of the volumetric error, in µm.")
@click.option(
    "--samples",
    type=int,
    default=100_000,
    show_default=True,
    help="Machines drawn from the tolerances.",
)
@click.option(
    "--distribution",
    type=click.Choice(("uniform", "normal")),
    default="uniform",
    show_default=True,
    help="How an error falls into its tolerance.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="Of the random numbers.")
@click.option(
    "--grid", type=int, default=21, show_default=True, help="Nodes per axis of the working volume."
)
@exaggeration_option
@loop_option
@force_option
def report(
    scenes: tuple[str, ...],
    output: str,
    spec_um: float | None,
    samples: int,
    distribution: str,
    seed: int,
    grid: int,
    exaggeration: str | None,
    loop: str,
    *,
    force: bool,
) -> None:
    """Write the design review of one SCENE, or of two side by side.

    First a page with the verdict, then the evidence: maps, contributions at the worst point, errors
    and tolerances, gains, Monte Carlo, conventions and provenance. The file needs no network.
    """
    from warpspace.exceptions import OptionError
    from warpspace.outputs.files import check_target
    from warpspace.outputs.report import ReportSettings, write_report
    from warpspace.outputs.report.build import ENDINGS
    from warpspace.scene.library import load_scene, scene_path

    target = check_target(output, ENDINGS, overwrite=force)
    if len(scenes) > 2:
        raise OptionError(f"report: {len(scenes)} scenes; expected one, or two to compare")
    settings = ReportSettings(
        loop=loop,
        grid=grid,
        exaggeration=parse_exaggeration(exaggeration),
        spec_um=spec_um,
        samples=samples,
        seed=seed,
        distribution=distribution,
    )
    loaded = [load_scene(scene) for scene in scenes]
    write_report(
        loaded,
        target,
        settings,
        embed=embed_view,
        files=[scene_path(scene) for scene in scenes],
        overwrite=force,
    )
    titles = " and ".join(scene.title for scene in loaded)
    click.echo(f"{output}: design review of {titles}, {target.stat().st_size / 1e6:.2f} MB")


def embed_view(
    scene: "Scene", *, exaggeration: float, nodes: int, loop: str, largest: float
) -> str:
    """Build the page with the interactive scene; outputs know nothing of the app."""
    from warpspace.app.documents.offline_page import build_offline_html, offline_picture
    from warpspace.kinematics.model import Loop

    frame = offline_picture(
        scene, exaggeration=exaggeration, nodes=nodes, loop=Loop(loop), largest=largest
    )
    return build_offline_html(frame)
