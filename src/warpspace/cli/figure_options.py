"""Options of the commands that draw maps."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from warpspace.cli.file_options import force_option
from warpspace.cli.options import (
    Decorator,
    component_option,
    direction_option,
    exaggeration_option,
    grid_option,
    loop_option,
    parse_exaggeration,
)
from warpspace.cli.progress import progress
from warpspace.exceptions import OptionError

if TYPE_CHECKING:
    from pathlib import Path

    from warpspace.outputs.drawing.settings import FigureSettings
    from warpspace.scene.model import Scene

VIEWS = ("iso", "front", "right", "top")


def figure_options(size: str = "1600x1200") -> Decorator:
    """Add the options of a map, of a size in px unless a user says otherwise."""
    options = (
        component_option,
        exaggeration_option,
        click.option(
            "--view",
            type=click.Choice(VIEWS),
            default="iso",
            show_default=True,
            help="Where the camera stands.",
        ),
        click.option(
            "--size",
            default=size,
            show_default=True,
            metavar="WxH",
            help="Width and height of the picture in px.",
        ),
        loop_option,
        direction_option,
        grid_option(),
        click.option("--dark", is_flag=True, help="Light ink on a dark ground."),
        force_option,
    )

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


def parse_size(text: str) -> tuple[int, int]:
    """Read a size as a user types it, for instance ``1600x1200``.

    Raises
    ------
    OptionError
        If it cannot be read.
    """
    width, _, height = text.lower().replace("×", "x").partition("x")
    try:
        return int(width), int(height)
    except ValueError:
        raise OptionError(
            f"--size {text!r} cannot be read; expected WIDTHxHEIGHT in px, for instance 1600x1200"
        ) from None


def parse_settings(
    *,
    component: str,
    exaggeration: str | None,
    view: str,
    size: str,
    loop: str,
    grid: int,
    dark: bool,
) -> "FigureSettings":
    """Check the options of a map.

    Raises
    ------
    OptionError
        If one of them cannot be drawn with.
    """
    from warpspace.field.grid import node_counts
    from warpspace.outputs.drawing.settings import FigureSettings

    node_counts(grid)
    factor = parse_exaggeration(exaggeration)
    return FigureSettings(component, factor, view, parse_size(size), dark, loop, grid)


def draw_figure_file(
    name: str,
    scenes: "Sequence[Scene]",
    settings: "FigureSettings",
    target: "Path",
    *,
    force: bool,
    silent: bool = False,
) -> None:
    """Draw a figure in a process of its own and write it; the ending chooses the format."""
    from warpspace.outputs.files import write_atomically
    from warpspace.outputs.worker import FigureWorker

    with progress("drawing", silent=silent), FigureWorker() as worker:
        content = worker.render(name, scenes, settings, target.suffix.lower()[1:])
    with write_atomically(target, overwrite=force) as temporary:
        temporary.write_bytes(content)
