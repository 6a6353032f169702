"""Round values along an axis."""

import math

from warpspace.geometry.colour import nice_step

NO_SPAN = 1e-12
"""A range below this part of its ends is rounding, mm a part of 1 mm."""


def tick_values(low: float, high: float, most: float) -> list[float]:
    """Choose round values within a range.

    Parameters
    ----------
    low, high : float
    most : float
        Steps the range is divided into at most, two at least.

    Returns
    -------
    list of float
        The low end alone where the range is empty.
    """
    span = high - low
    if not span > NO_SPAN * max(1.0, abs(low), abs(high)):
        return [low]
    step = nice_step(span)
    while span / step > max(most, 2.0):
        step = nice_step(10.0 * step * 1.01)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(step * number, 10) for number in range(first, last + 1)]
