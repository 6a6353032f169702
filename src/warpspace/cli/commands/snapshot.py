"""Command `snapshot`: a figure of a scene into a file."""

from typing import Any

import click

from warpspace.cli.figure_options import draw_figure_file, figure_options, parse_settings
from warpspace.cli.file_options import check_output, output_option
from warpspace.cli.options import scene_argument
from warpspace.cli.terminal import echo
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.outputs.figures.catalogue import figure_command, figure_names


@click.command()
@scene_argument()
@output_option("File to write: .png, .svg or .pdf.")
@click.option(
    "--figure",
    default="error-map",
    show_default=True,
    metavar="NAME",
    help=f"What to draw: {', '.join(figure_names())}.",
)
@figure_options()
def snapshot(
    scene: str, output: str, figure: str, direction: str | None, *, force: bool, **options: Any
) -> None:
    """Draw an error map, or another figure, of SCENE.

    The picture carries its exaggeration, scale bars, statistics and provenance. It is the same,
    byte for byte, whenever it is repeated. Charts keep their own height to the width given.
    """
    from warpspace.outputs.drawing.style import FIGURE_ENDINGS
    from warpspace.scene.library import load_scene
    from warpspace.scene.pipeline import in_direction

    if figure in figure_names(scenes=2):
        command = figure_command(figure) or "compare A B -o FILE"
        raise OptionError(f"figure {figure!r} takes two scenes or more: warpspace {command}")
    if figure not in figure_names():
        raise UnknownNameError("figure", figure, figure_names())
    target = check_output(output, FIGURE_ENDINGS, force=force, scenes=[scene])
    settings = parse_settings(**options)
    loaded = in_direction(load_scene(scene), direction)
    draw_figure_file(figure, [loaded], settings, target, force=force)
    echo(f"wrote {output}")
