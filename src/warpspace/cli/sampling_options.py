"""Options of the commands that draw machines from tolerances."""

import math
from typing import TYPE_CHECKING

import click

from warpspace.exceptions import OptionError

if TYPE_CHECKING:
    from warpspace.analysis.points import Cylinder

DISTRIBUTIONS = ("uniform", "normal")

samples_option = click.option(
    "--samples",
    type=int,
    default=100_000,
    show_default=True,
    help="How many machines are drawn from the tolerances.",
)
specification_option = click.option(
    "--spec-um",
    type=float,
    help="Specification of |E| in µm, to say how likely a machine keeps it.",
)
seed_option = click.option(
    "--seed",
    type=int,
    default=0,
    show_default=True,
    help="Of the random numbers; the same seed gives the same numbers.",
)
distribution_option = click.option(
    "--distribution",
    type=click.Choice(DISTRIBUTIONS),
    default="uniform",
    show_default=True,
    help="uniform over the tolerance, or normal with 3σ = half width.",
)
clip_option = click.option(
    "--clip/--no-clip",
    default=False,
    show_default=True,
    help="Whether the normal distribution ends at the tolerance limits.",
)
cylinder_option = click.option(
    "--cylinder",
    metavar="DIAMETERxHEIGHT",
    help="Workpiece loop: largest workpiece in mm, over whose volume the points are spread.  [the"
    " one whose top rim the scene's workpiece point lies on: 550x450 on the DVF5000]",
)


def parse_cylinder(text: str | None) -> "Cylinder | None":
    """Read the size of a workpiece as a user types it.

    Raises
    ------
    OptionError
        If it cannot be read.
    """
    from warpspace.analysis.points import Cylinder

    if text is None:
        return None
    first, _, second = text.lower().replace("×", "x").partition("x")
    try:
        size = float(first), float(second)
    except ValueError:
        size = math.nan, math.nan
    if not (math.isfinite(size[0]) and math.isfinite(size[1])):
        raise OptionError(f"--cylinder {text!r}; expected diameter x height in mm, as in 550x450")
    return Cylinder(*size)
