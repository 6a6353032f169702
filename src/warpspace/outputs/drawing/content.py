"""What a finished figure holds."""

from collections.abc import Mapping
from dataclasses import dataclass

from matplotlib.figure import Figure

from warpspace.geometry.colour import ColourScale
from warpspace.outputs.drawing.projection import Projection, Rect
from warpspace.outputs.drawing.render import Raster
from warpspace.units import Array


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
