"""Command `draw`: a figure of a scene, or a moving picture, into a file."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from warpspace.cli.options import (
    FIGURES,
    SIZE,
    draw_figure_file,
    figure_options,
    output_option,
    parse_settings,
    say_first_order,
    scene_argument,
)
from warpspace.cli.tables import echo, progress
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.outputs.figures.catalogue import figure_command, figure_names

if TYPE_CHECKING:
    from warpspace.scene.model import Scene

MOVING = (".gif", ".webp", ".mp4")
MOVING_SIZE = "960x720"
FRAMES, FPS = 48, 15.0


@click.command()
@scene_argument()
@output_option("File to write: .png, .svg or .pdf; .gif, .webp or .mp4 move.", *FIGURES, *MOVING)
@click.option(
    "--figure",
    metavar="NAME",
    help=f"What to draw: {', '.join(figure_names())}.  [error-map]",
)
@click.option(
    "--motion",
    type=click.Choice(("exaggeration", "rotation")),
    help="What moves: from true scale to the display factor and back, or one turn of the rotary"
    " table.  [exaggeration]",
)
@click.option("--frames", type=int, help=f"Pictures of one round of what moves.  [{FRAMES}]")
@click.option("--fps", type=float, help=f"Pictures a second.  [{FPS:g}]")
@figure_options(size=None, sizes=f"  [{SIZE}; {MOVING_SIZE} of what moves]")
def draw(
    scene: str,
    output: str,
    figure: str | None,
    motion: str | None,
    frames: int | None,
    fps: float | None,
    direction: str | None,
    *,
    placed: bool,
    force: bool,
    size: str | None,
    **options: Any,
) -> None:
    """Draw a still or moving picture of SCENE.

    The picture carries its exaggeration, scale bars, statistics and provenance. It is the same,
    byte for byte, whenever it is repeated. Charts keep their own height to the width given. Camera
    and colour scale of a moving picture stay the same.
    """
    from warpspace.scene.library import load_scene
    from warpspace.scene.model import in_direction, placed_in

    moves = Path(output).suffix.lower() in MOVING
    given = {"--motion": motion, "--frames": frames, "--fps": fps}
    if moves and figure not in (None, "error-map"):
        raise OptionError(f"figure {figure!r} does not move; expected a .png, .svg or .pdf file")
    for option, value in given.items():
        if value is not None and not moves:
            raise OptionError(f"{option} belongs to a .gif, .webp or .mp4 file; given {output}")
    _check_figure(figure or "error-map")
    settings = parse_settings(size=size or (MOVING_SIZE if moves else SIZE), **options)

    def load() -> "Scene":
        found = in_direction(load_scene(scene), direction)
        found = placed_in(found, settings.loop, placed=placed)
        say_first_order(settings.loop, found)
        return found

    if not moves:
        draw_figure_file(figure or "error-map", [load()], settings, output, force=force)
        echo(f"wrote {output}")
        return
    from warpspace.outputs.animation import AnimationSettings, write_animation

    moving = AnimationSettings(
        motion or "exaggeration",
        FRAMES if frames is None else frames,
        FPS if fps is None else fps,
        settings,
    )
    loaded = load()
    with progress("drawing", moving.frames, "pictures") as bar:
        write_animation(loaded, output, moving, overwrite=force, progress=bar.advance)
    echo(f"{output}: {moving.frames} pictures, {moving.frames / moving.fps:.1f} s")


def _check_figure(figure: str) -> None:
    if figure in figure_names(scenes=2):
        command = figure_command(figure) or "compare A B -o FILE"
        raise OptionError(f"figure {figure!r} takes two scenes or more: warpspace {command}")
    if figure not in figure_names():
        raise UnknownNameError("figure", figure, figure_names())
