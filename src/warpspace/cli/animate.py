"""Command `animate`: a moving picture of a scene."""

from collections.abc import Callable
from typing import Any

import click

from warpspace.cli.figure_options import figure_options, parse_settings
from warpspace.cli.options import scene_argument

SIZE = "960x720"


def _smaller(command: Callable[..., Any]) -> Callable[..., Any]:
    """Let the pictures of an animation be smaller than a figure, unless a user says otherwise."""
    options: list[click.Parameter] = command.__click_params__  # type: ignore[attr-defined]
    for option in options:
        if option.name == "size":
            option.default = SIZE
    return command


@click.command()
@scene_argument()
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(),
    help="File to write: .gif, .webp or .mp4.",
)
@click.option(
    "--motion",
    type=click.Choice(("exaggeration", "rotation")),
    default="exaggeration",
    show_default=True,
    help="From true scale to the display factor and back, or one turn of the rotary table.",
)
@click.option("--frames", type=int, default=48, show_default=True, help="Pictures of one round.")
@click.option("--fps", type=float, default=15.0, show_default=True, help="Pictures a second.")
@_smaller
@figure_options
def animate(
    scene: str,
    output: str,
    motion: str,
    frames: int,
    fps: float,
    *,
    force: bool,
    **options: Any,
) -> None:
    """Draw a moving picture of SCENE into a file.

    Every picture carries its display factor; camera and colour scale stay the same.
    """
    import sys

    from tqdm import tqdm

    from warpspace.outputs.animation.pictures import AnimationSettings
    from warpspace.outputs.animation.write import ENDINGS, write_animation
    from warpspace.outputs.files import check_target
    from warpspace.scene.library import load_scene

    check_target(output, ENDINGS, overwrite=force)
    settings = AnimationSettings(motion, frames, fps, parse_settings(**options))
    loaded = load_scene(scene)
    with tqdm(total=frames, unit="picture", delay=1.0, disable=not sys.stderr.isatty()) as bar:
        write_animation(loaded, output, settings, overwrite=force, progress=bar.update)
    click.echo(f"{output}: {frames} pictures, {frames / fps:.1f} s")
