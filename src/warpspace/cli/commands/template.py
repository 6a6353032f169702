"""Command `template`: a table of measured errors to fill in."""

from itertools import pairwise

import click

from warpspace.cli.file_options import check_output, force_option, output_option
from warpspace.cli.terminal import echo
from warpspace.exceptions import OptionError

MOST_ROWS = 100_000


@click.command()
@click.argument("axis")
@output_option("CSV file to write.  [standard output]", required=False)
@click.option(
    "--positions",
    metavar="Q1,Q2,…",
    help="Positions of its rows, in mm or degrees.  [-250 … 250, a turn for a rotary axis]",
)
@click.option(
    "--over",
    metavar="AXIS|AXIS=Q1,Q2,…",
    help="Second axis that the errors depend on, with its positions.  [-250 … 250, or a turn]",
)
@force_option
def template(
    axis: str, output: str | None, positions: str | None, over: str | None, *, force: bool
) -> None:
    """Write a table to fill in with measured errors of AXIS.

    Its header names the six errors of the axis and their uncertainties with their units; columns
    that are not needed may be left out. With --over it has a row a point of a grid of two axes.
    """
    from warpspace.formats.parts.csv_writing import surface_template, usual_places
    from warpspace.formats.parts.csv_writing import template as spelled
    from warpspace.machine.axes import is_axis_name
    from warpspace.outputs.files import write_atomically

    name = axis.strip().upper()
    if not is_axis_name(name):
        raise OptionError(f"axis {axis!r}; expected a name such as X, C or C2")
    places = _positions(positions, "--positions")
    if over is None:
        text = spelled(name, places)
    else:
        second, equals, given = over.partition("=")
        other = second.strip().upper()
        if not is_axis_name(other) or other == name:
            raise OptionError(
                f"--over {over!r}; expected another axis than {name}, such as Z=0,100"
            )
        beside = _positions(given if equals else None, "--over")
        at = (places or usual_places(name), beside or usual_places(other))
        if len(at[0]) * len(at[1]) > MOST_ROWS:
            found = f"{len(at[0])} × {len(at[1])} points"
            raise OptionError(f"{found}; expected at most {MOST_ROWS:,} rows")
        text = surface_template((name, other), at)
    if output is None:
        click.echo(text, nl=False)
        return
    target = check_output(output, (".csv",), force=force)
    with write_atomically(target, overwrite=force) as temporary:
        temporary.write_text(text, encoding="utf-8")
    echo(f"wrote {output}")


def _positions(text: str | None, option: str) -> tuple[float, ...]:
    """Read positions as a user types them."""
    if text is None:
        return ()
    try:
        found = tuple(float(part) for part in text.split(","))
    except ValueError:
        found = ()
    if not 2 <= len(found) <= 1000 or not all(abs(q) <= 1e5 for q in found):
        raise OptionError(f"{option} {text!r}; expected 2 to 1000 numbers with commas between")
    if any(high <= low for low, high in pairwise(found)):
        raise OptionError(f"{option} {text!r}; expected ascending positions")
    return found
