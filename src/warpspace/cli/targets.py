"""Options of the commands that write files."""

import math
from typing import Literal

import click

from warpspace.exceptions import OptionError

force_option = click.option("--force", is_flag=True, help="Replace FILE where it exists.")
exaggeration_option = click.option(
    "--exaggeration",
    metavar="auto|N",
    help="Display factor of displacements: a number, or auto for a round one that suits the scene."
    "  [what the scene says]",
)


def parse_exaggeration(text: str | None) -> float | Literal["auto"] | None:
    """Read a display factor as a user types it.

    Parameters
    ----------
    text : str or None
        A number or "auto"; None where the option is absent.

    Returns
    -------
    float, "auto" or None

    Raises
    ------
    OptionError
        If it is neither.
    """
    if text is None:
        return None
    if text.strip().lower() == "auto":
        return "auto"
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise OptionError(f"--exaggeration {text!r}; expected auto or a number above 0")
    return value
