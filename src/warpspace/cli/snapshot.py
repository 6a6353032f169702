"""Command `snapshot`: a figure of a scene into a file."""

from typing import Any

import click

from warpspace.cli.figure_options import figure_options, parse_settings
from warpspace.cli.options import scene_argument
from warpspace.exceptions import OptionError, UnknownNameError

FIGURES = (
    *("error-map", "slices", "orientation-map", "machine", "traces", "error-curves"),
    *("gains", "montecarlo", "ballbar"),
)


@click.command()
@scene_argument()
@click.option("-o", "--output", required=True, type=click.Path(), help="A .png, .svg or .pdf file.")
@click.option(
    "--figure",
    default="error-map",
    show_default=True,
    metavar="NAME",
    help=f"What to draw: {', '.join(FIGURES)}.",
)
@figure_options
def snapshot(scene: str, output: str, figure: str, *, force: bool, **options: Any) -> None:
    """Draw an error-map picture (or another figure) of SCENE into a file.

    The picture carries its exaggeration, scale bars, statistics and provenance. It is the same,
    byte for byte, whenever it is repeated. Charts keep their own height to the width given.
    """
    from warpspace.outputs.drawing.style import FIGURE_ENDINGS
    from warpspace.outputs.files import check_target, write_atomically
    from warpspace.outputs.worker import FigureWorker
    from warpspace.scene.library import load_scene

    if figure == "comparison":
        raise OptionError("figure 'comparison' takes two scenes: warpspace compare A B -o FILE")
    if figure not in FIGURES:
        raise UnknownNameError("figure", figure, FIGURES)
    target = check_target(output, FIGURE_ENDINGS, overwrite=force)
    settings = parse_settings(**options)
    loaded = load_scene(scene)
    with FigureWorker() as worker:
        content = worker.render(figure, [loaded], settings, target.suffix.lower()[1:])
    with write_atomically(output, overwrite=force) as temporary:
        temporary.write_bytes(content)
    click.echo(f"wrote {output}")
