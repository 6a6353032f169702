"""Options of the commands that draw maps."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from warpspace.cli.options import COMPONENTS, loop_option
from warpspace.cli.targets import exaggeration_option, force_option, parse_exaggeration
from warpspace.exceptions import OptionError

if TYPE_CHECKING:
    from warpspace.outputs.drawing.settings import FigureSettings

VIEWS = ("iso", "front", "right", "top")
_OPTIONS = (
    click.option(
        "--component",
        type=click.Choice(COMPONENTS),
        default="norm",
        show_default=True,
        help="Length of the error, or one signed component.",
    ),
    exaggeration_option,
    click.option("--view", type=click.Choice(VIEWS), default="iso", show_default=True),
    click.option("--size", default="1600x1200", show_default=True, metavar="WxH", help="In px."),
    loop_option,
    click.option(
        "--grid", type=int, default=21, show_default=True, help="Nodes per axis, 2 to 101."
    ),
    click.option("--dark", is_flag=True, help="Light ink on a dark ground."),
    force_option,
)


def figure_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of a map."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


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
