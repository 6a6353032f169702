"""Command `report`: the design review of one scene or two."""

import click

from warpspace.cli.file_options import check_output, force_option, output_option, size_text
from warpspace.cli.options import (
    exaggeration_option,
    grid_option,
    loop_option,
    parse_exaggeration,
    scene_argument,
)
from warpspace.cli.progress import progress
from warpspace.cli.sampling_options import (
    distribution_option,
    samples_option,
    seed_option,
    specification_option,
)
from warpspace.cli.terminal import echo


@click.command()
@scene_argument("scenes", nargs=-1, required=True)
@output_option("File to write: .html (with interactive 3-D views) or .pdf.")
@click.option(
    "--concepts",
    multiple=True,
    metavar="SCENE",
    help="Another machine to set beside those of the report, within the tolerances of the first;"
    " may be given several times.",
)
@specification_option
@samples_option
@distribution_option
@seed_option
@grid_option()
@exaggeration_option
@loop_option
@force_option
def report(
    scenes: tuple[str, ...],
    output: str,
    concepts: tuple[str, ...],
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
    --concepts also a table and pictures of machines side by side, as `warpspace concepts` has them.
    The file needs no network.
    """
    from warpspace.cli.exports import embed_view
    from warpspace.exceptions import OptionError
    from warpspace.outputs.report import ReportSettings, write_report
    from warpspace.outputs.report.build import ENDINGS
    from warpspace.scene.library import load_scene, scene_path

    target = check_output(output, ENDINGS, force=force, scenes=(*scenes, *concepts))
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
    others = [load_scene(scene) for scene in concepts]
    with progress("writing the review"):
        write_report(
            loaded,
            target,
            settings,
            embed=embed_view,
            concepts=others,
            files=[scene_path(scene) for scene in (*scenes, *concepts)],
            overwrite=force,
        )
    titles = " and ".join(scene.title for scene in loaded)
    echo(f"{output}: design review of {titles}, {size_text(target)}")
