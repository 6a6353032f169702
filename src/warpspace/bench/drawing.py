"""Small helpers that lay out figures of tests."""

import math


def round_factor(most: float) -> float:
    """Give the largest of 1, 2, 5 × 10ⁿ that is not above a number."""
    if not most > 0.0 or not math.isfinite(most):
        return 1.0
    decade = 10.0 ** math.floor(math.log10(most))
    return decade * next(step for step in (5.0, 2.0, 1.0) if step * decade <= most * (1.0 + 1e-9))
