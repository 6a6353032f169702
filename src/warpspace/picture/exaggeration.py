"""Which display factor a picture is drawn with: what is asked for, the scene's, or a round one."""

from typing import Literal

from warpspace.exceptions import OptionError
from warpspace.geometry.deform import auto_exaggeration
from warpspace.machine.limits import EXAGGERATION

Exaggeration = float | Literal["auto"] | None
"""A display factor, "auto" for a round one that suits the errors, None for what the scene says."""


def given_exaggeration(wanted: Exaggeration, own: float | None) -> float | None:
    """Give the factor that is asked for, else the scene's own; None where one is to be chosen.

    Raises
    ------
    OptionError
        If it is no number from a thousandth to a million.
    """
    factor = own if wanted is None else wanted
    if factor is None or factor == "auto":
        return None
    low, high = EXAGGERATION
    if not low <= factor <= high:  # nor is NaN
        found = f"exaggeration {factor:g}; expected auto or a number above 0"
        raise OptionError(f"{found}, from {low:g} to {high:,.0f}")
    return float(factor)


def choose_exaggeration(
    wanted: Exaggeration, own: float | None, largest_um: float, size_mm: float
) -> float:
    """Choose the display factor of a picture, or of several that share one.

    Parameters
    ----------
    wanted : float, "auto" or None
        What is asked for.
    own : float or None
        What the scene says; None for a round one.
    largest_um : float, µm
        Largest displacement of all pictures.
    size_mm : float, mm
        Length that the largest of them is sized by.

    Returns
    -------
    float
    """
    given = given_exaggeration(wanted, own)
    return auto_exaggeration(largest_um, size_mm) if given is None else given
