"""The picture of `concepts`, drawn in a process of its own."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from warpspace.cli.options import draw_figure_file, parse_size, plot_option
from warpspace.exceptions import OptionError

if TYPE_CHECKING:
    from warpspace.analysis.concepts import Concepts, ConceptsResult
    from warpspace.analysis.description import Watch
    from warpspace.scene.model import Scene

OPTIONS = (
    plot_option("machines side by side"),
    click.option(
        "--size", default="1600x1200", show_default=True, metavar="WxH", help="Of the picture, px."
    ),
)


def run(
    asked: "Concepts",
    scenes: "Sequence[Scene]",
    watch: "Watch",
    *,
    size: str,
    plot: str | None,
    force: bool,
    **_others: object,
) -> "ConceptsResult":
    """Compare the machines, and draw them where that is asked for."""
    from warpspace.outputs.drawing.settings import FigureSettings

    settings = FigureSettings(size=parse_size(size), loop=str(asked.loop), concepts=asked)
    if plot is not None and len(scenes) < 2:
        raise OptionError("--plot sets machines side by side; expected two scenes or more")
    found = asked.run_all(scenes, watch)
    if plot is not None:
        draw_figure_file("concepts", scenes, settings, plot, force=force, silent=True)
    return found
