"""Quantities of tests as linear functionals of their readings: ranges, zones and projections."""

from dataclasses import dataclass

import numpy as np

from warpspace.units import Array


@dataclass(frozen=True, slots=True)
class LinearForm:
    """A quantity that is the least largest value of linear functionals.

    Its size is ``factor · min over u of max |rows − free @ u|``: the absolute value of a number has
    one row and no unknown, a range one unknown and the factor 2, the minimum zone about a line two
    unknowns. Sizes within a limit are linear constraints on the readings and u.
    """

    rows: Array  # [n, ...]; functionals of the readings, whose further axes are kept
    free: Array  # [n, f]; change of the rows per unit of each unknown u
    factor: float = 1.0  # 2 for widths


def absolute(*parts: Array) -> LinearForm:
    """Return the form of the largest absolute value of rows, parts of [n, ...] each."""
    rows = np.concatenate(parts)
    return LinearForm(rows, np.zeros((len(rows), 0)))


def zone(rows: Array, *columns: Array) -> LinearForm:
    """Return the form of the width of the narrowest zone about a sum of columns, [n] each."""
    return LinearForm(rows, np.stack([np.ones(len(rows)), *columns], axis=-1), 2.0)


def largest_range(rows: Array, group: Array) -> LinearForm:
    """Return the form of the largest of the ranges of groups of rows; labels of groups, [n]."""
    free = group[:, None] == np.unique(group)
    return LinearForm(rows, free.astype(float), 2.0)


def project_out(rows: Array, *columns: Array) -> Array:
    """Return the least-squares residuals of rows, [n, ...], about a sum of columns, [n] each."""
    design = np.stack(columns, axis=-1)
    return rows - np.tensordot(design, np.tensordot(np.linalg.pinv(design), rows, 1), 1)
