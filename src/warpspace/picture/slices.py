"""Slices through the working volume: pictures of one plane each."""

from collections.abc import Sequence
from dataclasses import dataclass

from warpspace.picture.model import P, Picture, same_nodes, subtract_pictures


@dataclass(frozen=True, kw_only=True)
class Slice(Picture):
    """A picture of one plane of the working volume.

    Attributes
    ----------
    axis : str
        The axis that stands still: the grid has one node along it.
    position_mm : float, mm
        Where it stands.
    """

    axis: str
    position_mm: float


def subtract_slices(one: Sequence[P], other: Sequence[P]) -> tuple[P, ...]:
    """Subtract the errors of slices, one − other, where both lie in one place."""
    return tuple(
        subtract_pictures(first, second)
        for first, second in zip(one, other, strict=False)
        if same_nodes(first.grid.nominal_mm, second.grid.nominal_mm)
    )
