"""What a map shows, and what a finished figure holds."""

from collections.abc import Mapping
from dataclasses import dataclass

from matplotlib.figure import Figure

from warpspace.geometry.colour import ColourScale
from warpspace.geometry.deform import deform
from warpspace.geometry.surfaces import Shape
from warpspace.outputs.drawing.projection import Projection, Rect
from warpspace.outputs.drawing.render import Raster
from warpspace.units import Array


@dataclass(frozen=True, slots=True)
class MapContent:
    """What a map shows.

    Attributes
    ----------
    nominal_mm : ndarray, [nx, ny, nz, 3], mm
    error_um : ndarray, [nx, ny, nz, 3], µm
        Displaces the nodes.
    values : ndarray, [nx, ny, nz]
        Becomes colour.
    scale : ColourScale
    exaggeration : float
    """

    nominal_mm: Array
    error_um: Array
    values: Array
    scale: ColourScale
    exaggeration: float

    @property
    def shape(self) -> Shape:
        """Nodes along the axes."""
        nx, ny, nz = self.values.shape
        return nx, ny, nz

    @property
    def drawn_mm(self) -> Array:
        """Where the nodes are drawn, [nx, ny, nz, 3], mm."""
        return deform(self.nominal_mm, self.error_um, self.exaggeration)


@dataclass(frozen=True, slots=True)
class DrawnMap:
    """A map as it stands in a figure: enough to read it back.

    Attributes
    ----------
    projection : Projection
    scale : ColourScale
    values : ndarray, [nx, ny, nz]
        What the colour shows at the nodes.
    drawn_mm : ndarray, [nx, ny, nz, 3], mm
        Where the nodes are drawn.
    exaggeration : float
    raster : Raster or None
        The drawn body; None where there is no surface.
    rects : tuple of tuple of float, (n, 4), px
        Boxes of its labels.
    """

    projection: Projection
    scale: ColourScale
    values: Array
    drawn_mm: Array
    exaggeration: float
    raster: Raster | None
    rects: tuple[Rect, ...] = ()


@dataclass(frozen=True, slots=True)
class Drawing:
    """A finished figure.

    Attributes
    ----------
    figure : matplotlib Figure
    title : str
    facts : mapping of str to str
        Scene, version, settings: what the file carries as metadata.
    maps : tuple of DrawnMap
    rects : tuple of tuple of float, (n, 4), px
        Boxes of all text.
    """

    figure: Figure
    title: str
    facts: Mapping[str, str]
    maps: tuple[DrawnMap, ...] = ()
    rects: tuple[Rect, ...] = ()
