"""Command `animate`: a moving picture of a scene."""

from typing import Any

import click

from warpspace.cli.figure_options import figure_options, parse_settings
from warpspace.cli.file_options import check_output, output_option
from warpspace.cli.options import scene_argument
from warpspace.cli.progress import progress
from warpspace.cli.terminal import echo


@click.command()
@scene_argument()
@output_option("File to write: .gif, .webp or .mp4.")
@click.option(
    "--motion",
    type=click.Choice(("exaggeration", "rotation")),
    default="exaggeration",
    show_default=True,
    help="From true scale to the display factor and back, or one turn of the rotary table.",
)
@click.option("--frames", type=int, default=48, show_default=True, help="Pictures of one round.")
@click.option("--fps", type=float, default=15.0, show_default=True, help="Pictures a second.")
@figure_options(size="960x720")
def animate(
    scene: str,
    output: str,
    motion: str,
    frames: int,
    fps: float,
    direction: str | None,
    *,
    force: bool,
    **options: Any,
) -> None:
    """Draw a moving picture of SCENE into a file.

    Every picture carries its display factor; camera and colour scale stay the same.
    """
    from warpspace.outputs.animation.pictures import AnimationSettings
    from warpspace.outputs.animation.write import ENDINGS, write_animation
    from warpspace.scene.library import load_scene
    from warpspace.scene.pipeline import in_direction

    check_output(output, ENDINGS, force=force, scenes=[scene])
    settings = AnimationSettings(motion, frames, fps, parse_settings(**options))
    loaded = in_direction(load_scene(scene), direction)
    with progress("drawing", frames, "pictures") as bar:
        write_animation(loaded, output, settings, overwrite=force, progress=bar.advance)
    echo(f"{output}: {frames} pictures, {frames / fps:.1f} s")
