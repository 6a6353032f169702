"""One picture in numbers: an evaluated volume with its display factor and its colours."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from warpspace.analysis.statistics import Statistics, volume_statistics
from warpspace.exceptions import OptionError
from warpspace.field.basis import ErrorField
from warpspace.field.evaluate import View
from warpspace.field.grid import Grid
from warpspace.geometry.colour import SYMBOLS, ColourScale, build_scale, component_values
from warpspace.geometry.deform import deform
from warpspace.geometry.surfaces import Shape
from warpspace.picture.topology import Topology, topology
from warpspace.units import Array

SAME_PLACE_MM = 1e-6
"""Nodes nearer to each other than this are the same."""


@dataclass(frozen=True, kw_only=True)
class Picture:
    """What every renderer, export and page draws of a gridded volume, a slice included.

    Attributes
    ----------
    view : View
        Loop, frame and reference the errors are seen in.
    grid : Grid
    field : ErrorField
        Errors of all nodes of the grid.
    exaggeration : float
        Display factor of displacements; 1 is true scale.
    component : str
        What is coloured: "norm", "x", "y" or "z" ...
    quantity : str
        ... of the "position" error, µm, or of the "orientation" error of the tool axis, µrad.
    colours : ColourScale or None
        The colours where they are given, for instance shared with other pictures; None for round
        ends that hold all values.
    cut : bool
        Whether the octant towards the operator is cut away.
    slices : tuple of Picture
        Slices that are drawn in place of the surface, where there are any.
    conditions : tuple of str
        What a reader must know who takes the picture for all of its scene: which errors are
        excluded, and colours that end where somebody chose. Every output says them.
    """

    view: View
    grid: Grid
    field: ErrorField
    exaggeration: float
    component: str = "norm"
    quantity: str = "position"
    colours: ColourScale | None = None
    cut: bool = False
    slices: "tuple[Picture, ...]" = ()
    conditions: tuple[str, ...] = ()

    @property
    def tilts(self) -> bool:
        """Whether the orientation error of the tool axis is coloured, not the position error."""
        return self.quantity == "orientation"

    @property
    def shape(self) -> Shape:
        """Nodes along the axes of the grid."""
        return self.grid.shape

    @property
    def topology(self) -> Topology:
        """What is drawn of the grid, as indices into its nodes."""
        return topology(self.grid.shape, cut=self.cut)

    @cached_property
    def size_mm(self) -> float:
        """Length that marks are sized by, mm: the longest edge of the volume."""
        return self.grid.longest_edge_mm

    @cached_property
    def statistics(self) -> Statistics:
        """Statistics of the length of the position error over the volume."""
        return volume_statistics(self.field, self.grid)

    @cached_property
    def values(self) -> Array:
        """What is coloured at each node, [nx, ny, nz], in the unit of the scale."""
        return coloured_values(self.field, self.component, self.quantity)

    @cached_property
    def scale(self) -> ColourScale:
        """Colours of the values."""
        if self.colours is not None:
            return self.colours
        return choose_scale([self.values], self.component, self.quantity)

    @cached_property
    def drawn_mm(self) -> Array:
        """Where the nodes are drawn, [nx, ny, nz, 3], mm."""
        return deform(self.grid.nominal_mm, self.field.error_um, self.exaggeration)


P = TypeVar("P", bound=Picture)


def coloured_error(field: ErrorField, quantity: str) -> Array:
    """Give the vectors that are coloured, [..., 3], µm or µrad."""
    return field.orientation_urad if quantity == "orientation" else field.error_um


def coloured_values(field: ErrorField, component: str, quantity: str = "position") -> Array:
    """Give the values that are coloured, [...], µm or µrad."""
    if component == "norm" and quantity == "position":
        return field.norm_um
    return component_values(coloured_error(field, quantity), component)


def choose_scale(
    values: "list[Array]", component: str, quantity: str = "position", end: float | None = None
) -> ColourScale:
    """Choose the colours of pictures that share one bar.

    Parameters
    ----------
    values : list of ndarray, µm or µrad
        What each picture colours.
    component, quantity : str
    end : float, optional
        Where the scale ends, whatever the values.

    Returns
    -------
    ColourScale
        With round ends unless one is given.
    """
    symbol, unit = SYMBOLS[quantity]
    largest = max((float(np.abs(part).max(initial=0.0)) for part in values), default=0.0)
    return build_scale(largest, component, quantity=symbol, unit=unit, end=end)


def same_nodes(one_mm: Array, other_mm: Array) -> bool:
    """Tell whether two sets of nominal points, [..., 3], mm, coincide."""
    return one_mm.shape == other_mm.shape and bool(
        np.allclose(one_mm, other_mm, rtol=0.0, atol=SAME_PLACE_MM)
    )


def subtract_fields(one: ErrorField, other: ErrorField) -> ErrorField:
    """Subtract the errors of a field from those of another over the same points, one − other."""
    return ErrorField(
        one.nominal_mm,
        one.error_um - other.error_um,
        one.orientation_urad - other.orientation_urad,
    )


def subtract_pictures(one: P, other: Picture) -> P:
    """Subtract the errors of a picture from those of another, one − other, node by node.

    Parameters
    ----------
    one, other : Picture

    Returns
    -------
    Picture
        As `one` is drawn: its factor, component and given colours.

    Raises
    ------
    OptionError
        If their nodes do not coincide.
    """
    if not same_nodes(one.grid.nominal_mm, other.grid.nominal_mm):
        raise OptionError("the working volumes are not the same: there is no difference")
    return replace(one, field=subtract_fields(one.field, other.field))
