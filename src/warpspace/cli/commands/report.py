"""Command `report`: the design review of one scene or two."""

from typing import TYPE_CHECKING

import click

from warpspace.cli.guard import SceneName
from warpspace.cli.options import (
    RenamedOption,
    exaggeration_option,
    force_option,
    grid_option,
    loop_option,
    output_option,
    parse_exaggeration,
    say_first_order,
    scene_argument,
    size_text,
)
from warpspace.cli.tables import echo, progress

if TYPE_CHECKING:
    from warpspace.analysis.description import Analysis


@click.command()
@scene_argument("scenes", nargs=-1, required=True)
@output_option("File to write: .html (with interactive 3-D views) or .pdf.", ".html", ".pdf")
@click.option(
    "--concepts",
    type=SceneName(),
    multiple=True,
    metavar="SCENE",
    help="Another machine to set beside those of the report, within the tolerances of the first;"
    " may be given several times.",
)
@click.option(
    "--with",
    "others",
    multiple=True,
    metavar="NAME",
    help="Also what another analysis says of SCENE without options of its own, for instance"
    " certify; may be given several times.",
)
@click.option(
    "--limit",
    "spec_um",
    cls=RenamedOption,
    former=("--spec-um",),
    type=float,
    help="Of |E| in µm, to say whether it is kept, and how likely a machine keeps it.",
)
@click.option(
    "--samples",
    type=int,
    default=100_000,
    show_default=True,
    help="How many machines are drawn from the tolerances.",
)
@click.option(
    "--distribution",
    type=click.Choice(("uniform", "normal")),
    default="uniform",
    show_default=True,
    help="uniform over the tolerance, or normal with 3σ = half width.",
)
@click.option(
    "--seed",
    type=int,
    default=0,
    show_default=True,
    help="Of the random numbers; the same seed gives the same numbers.",
)
@grid_option()
@exaggeration_option
@loop_option
@force_option
def report(
    scenes: tuple[str, ...],
    output: str,
    concepts: tuple[str, ...],
    others: tuple[str, ...],
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
    """Write the design review of one SCENE or two.

    Two stand side by side. First a page with the verdict, then the evidence: maps, contributions at
    the worst point, errors and tolerances, gains, Monte Carlo, conventions and provenance. With
    --concepts also a table and pictures of machines side by side, as `warpspace concepts` has them;
    --with adds a section of any other analysis. The file needs no network.
    """
    from warpspace.analysis.description import silent
    from warpspace.cli.exports import embed_view
    from warpspace.exceptions import OptionError, RenderError
    from warpspace.outputs.report import ReportSettings, write_report
    from warpspace.scene.library import load_scene, scene_path

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
    beside = [load_scene(scene) for scene in concepts]
    asked = {name: _asked(name) for name in others}
    say_first_order(loop, *loaded)
    with progress("writing the review"):
        written = write_report(
            loaded,
            output,
            settings,
            embed=embed_view,
            concepts=beside,
            results={
                f"{heading}: {scene.title}": analysis.run(scene, silent)
                for heading, analysis in asked.items()
                for scene in loaded
            },
            files=[scene_path(scene) for scene in (*scenes, *concepts)],
            overwrite=force,
        )
    titles = " and ".join(scene.title for scene in loaded)
    echo(f"{output}: design review of {titles}, {size_text(output)}")
    if written.missing:
        raise RenderError(f"{output} is written without figures: {'; '.join(written.missing)}")


def _asked(name: str) -> "Analysis":
    from warpspace.analysis.catalogue import find_analysis
    from warpspace.exceptions import OptionError

    try:
        return find_analysis(name)()
    except TypeError:
        raise OptionError(f"--with {name}: needs options of its own: warpspace {name}") from None
