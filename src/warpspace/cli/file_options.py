"""Options of the commands that write files, and the checks before the work begins."""

from typing import TYPE_CHECKING

import click

from warpspace.cli.options import Decorator

if TYPE_CHECKING:
    from pathlib import Path

force_option = click.option("--force", is_flag=True, help="Replace FILE where it exists.")
csv_option = click.option(
    "--csv", "csv_path", type=click.Path(), help="Write the numbers to this CSV file."
)


def output_option(help_text: str, *, required: bool = True) -> Decorator:
    """Add the option --output."""
    return click.option(
        "-o", "--output", metavar="FILE", required=required, type=click.Path(), help=help_text
    )


def plot_option(what: str) -> Decorator:
    """Add the option --plot: a chart beside the numbers."""
    return click.option(
        "--plot", type=click.Path(), help=f"Draw the {what} into this file: .png, .svg or .pdf."
    )


def check_targets(*, plot: str | None = None, csv_path: str | None = None) -> None:
    """Check where a chart and a table are to be written.

    Raises
    ------
    OptionError
        If one of them cannot be written.
    """
    from warpspace.outputs.files import check_target

    if plot is not None:
        from warpspace.outputs.charts.paper import CHART_ENDINGS

        check_target(plot, CHART_ENDINGS)
    if csv_path is not None:
        check_target(csv_path, (".csv",))


def size_text(path: "Path") -> str:
    """Spell the size of a file."""
    return f"{path.stat().st_size / 1e6:.2f} MB"
