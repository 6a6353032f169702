"""Options of the commands that write files, and the checks before the work begins."""

from collections.abc import Sequence
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


def check_output(
    path: str, endings: Sequence[str], *, force: bool, scenes: Sequence[str] = ()
) -> "Path":
    """Check where a command is to write; the same rule for every file it writes.

    Parameters
    ----------
    path : str
    endings : sequence of str
        Endings of the files it can write.
    force : bool
        Whether an existing file may be replaced.
    scenes : sequence of str, optional
        The scenes it reads, as the user named them; none of their files is replaced.

    Returns
    -------
    Path

    Raises
    ------
    OutputError
        If it cannot or must not be written.
    """
    from warpspace.cli.inputs import input_files
    from warpspace.outputs.files import check_target

    return check_target(path, endings, overwrite=force, inputs=input_files(*scenes))


def check_targets(
    *scenes: str, force: bool, plot: str | None = None, csv_path: str | None = None
) -> None:
    """Check where a chart and a table are to be written; see `check_output`."""
    if plot is not None:
        from warpspace.outputs.charts.paper import CHART_ENDINGS

        check_output(plot, CHART_ENDINGS, force=force, scenes=scenes)
    if csv_path is not None:
        check_output(csv_path, (".csv",), force=force, scenes=scenes)


def size_text(path: "Path") -> str:
    """Spell the size of a file."""
    return f"{path.stat().st_size / 1e6:.2f} MB"
