"""Bodies drawn off screen: colours exact, background transparent, depth in millimetres."""

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import ListedColormap
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import maximum_filter

from warpspace.exceptions import RenderError
from warpspace.geometry.colour import LEVELS, ColourScale, colour_table
from warpspace.outputs.drawing.projection import Projection
from warpspace.units import Array

if TYPE_CHECKING:
    import pyvista as pv

Bytes = NDArray[np.uint8]
_LARGEST_SIDE_PX = 8192
_LARGEST_AREA_PX = 24_000_000
SUPERSAMPLING = 2


@dataclass(frozen=True, slots=True)
class Body:
    """Triangles to draw.

    Attributes
    ----------
    vertices_mm : ndarray, [M, 3], mm
        Where they are drawn.
    triangles : ndarray of int, [T, 3]
    values : ndarray, [M], optional
        What the colour shows; interpolated over each triangle before it becomes a colour.
    scale : ColourScale, optional
        Colours of the values.
    colour : tuple of float, (3,), optional
        One colour (sRGB, 0 to 1) for a body without values.
    shaded : bool
        Whether light falls on it: for machine bodies, never for coloured errors.
    opacity : float
    """

    vertices_mm: Array
    triangles: NDArray[np.intp]
    values: Array | None = None
    scale: ColourScale | None = None
    colour: tuple[float, float, float] = (0.7, 0.7, 0.7)
    shaded: bool = False
    opacity: float = 1.0


@dataclass(frozen=True, slots=True)
class Raster:
    """Drawn bodies.

    Attributes
    ----------
    rgba : ndarray of uint8, [h, w, 4]
        First row at the top.
    depth_mm : ndarray, [h, w], mm
        As `Projection.depth_mm`; infinite where nothing is.
    farthest_mm : ndarray, [h, w], mm
        The largest depth within a pixel of the figure around each.
    rect : tuple of float, (4,), px
        Box of the figure it covers.
    """

    rgba: Bytes
    depth_mm: NDArray[np.float32]
    farthest_mm: NDArray[np.float32]
    rect: tuple[float, float, float, float]

    @property
    def sampling(self) -> float:
        """Pixels of the raster per pixel of the figure."""
        return self.rgba.shape[1] / (self.rect[2] - self.rect[0])

    def reduced(self) -> Bytes:
        """Average to one pixel per pixel of the figure."""
        step = round(self.sampling)
        if step == 1:
            return self.rgba
        # the background is black and clear, so that colours are multiplied with alpha already
        size = (self.rgba.shape[1], self.rgba.shape[0])
        image = Image.frombuffer("RGBa", size, self.rgba).reduce(step)
        return np.asarray(image.convert("RGBA"))

    def depth_at(self, points_px: Array, *, spread: bool = False) -> Array:
        """Read the depth at pixels of the figure.

        Parameters
        ----------
        points_px : ndarray, [..., 2], px
        spread : bool
            Give the farthest depth close around each point.

        Returns
        -------
        ndarray, [...], mm
            Infinite outside the raster and where nothing is.
        """
        left, _, _, top = self.rect
        i = np.floor((top - points_px[..., 1]) * self.sampling).astype(np.intp)
        j = np.floor((points_px[..., 0] - left) * self.sampling).astype(np.intp)
        height, width = self.depth_mm.shape
        inside = (i >= 0) & (i < height) & (j >= 0) & (j < width)
        depth = self.farthest_mm if spread else self.depth_mm
        return np.where(inside, depth[np.where(inside, i, 0), np.where(inside, j, 0)], np.inf)


def render_bodies(bodies: Sequence[Body], projection: Projection, margin_px: int = 4) -> Raster:
    """Draw bodies.

    Parameters
    ----------
    bodies : sequence of Body
        At least one with triangles.
    projection : Projection
    margin_px : int, optional
        Room around them.

    Returns
    -------
    Raster

    Raises
    ------
    RenderError
        If VTK gives no picture.
    """
    points = np.concatenate([body.vertices_mm for body in bodies])
    spots = projection.project(points)
    left, bottom = (np.floor(spots.min(axis=0)) - margin_px).astype(int)
    right, top = (np.ceil(spots.max(axis=0)) + margin_px).astype(int)
    width, height = int(right - left), int(top - bottom)
    small = max(width, height) * SUPERSAMPLING <= _LARGEST_SIDE_PX
    small = small and width * height * SUPERSAMPLING**2 <= _LARGEST_AREA_PX
    step = SUPERSAMPLING if small else 1
    middle = np.array([(left + right) / 2.0, (bottom + top) / 2.0])
    rgba, depth = _draw(bodies, projection, middle, (width * step, height * step), step)
    farthest = np.asarray(maximum_filter(depth, size=2 * step + 1, mode="nearest"), np.float32)
    return Raster(rgba, depth, farthest, (float(left), float(bottom), float(right), float(top)))


def _draw(
    bodies: Sequence[Body],
    projection: Projection,
    middle_px: Array,
    size: tuple[int, int],
    step: int,
) -> tuple[Bytes, NDArray[np.float32]]:
    """Let PyVista draw; colours and depth, first row at the top."""
    if sys.platform == "linux":
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    import pyvista as pv

    offset = (middle_px - projection.centre_px) / projection.px_per_mm
    focus = projection.centre_mm + offset[0] * projection.right + offset[1] * projection.up
    depths = np.concatenate([projection.depth_mm(body.vertices_mm) for body in bodies])
    room = 1.0 + 0.02 * float(np.ptp(depths))
    near, far = float(depths.min()) - room, float(depths.max()) + room

    # a theme of its own: what users set for their plotters does not reach the figures
    theme = pv.themes.Theme()
    theme.background = "black"
    plotter = pv.Plotter(off_screen=True, window_size=list(size), lighting="none", theme=theme)
    try:
        plotter.disable_anti_aliasing()
        for body in bodies:
            _add_body(plotter, body)
        if any(body.shaded for body in bodies):
            _add_light(plotter, projection)
        camera = plotter.camera
        camera.parallel_projection = True
        camera.position = focus + (1.0 - near) * projection.towards
        camera.focal_point = focus - near * projection.towards
        camera.up = projection.up
        camera.parallel_scale = size[1] / step / 2.0 / projection.px_per_mm
        camera.clipping_range = (1.0, 1.0 + far - near)
        rgba = plotter.screenshot(transparent_background=True, return_img=True)
        behind = plotter.get_image_depth(fill_value=-np.inf, reset_camera_clipping_range=False)
    except (ValueError, AttributeError, RuntimeError) as error:
        raise RenderError(
            f"the picture could not be drawn: VTK gave no pixels ({error})"
        ) from error
    finally:
        plotter.close()
    depth = (near - 1.0) - np.asarray(behind)
    return np.array(rgba), depth.astype(np.float32)


def _add_body(plotter: "pv.Plotter", body: Body) -> None:
    """Put a body on the stage."""
    import pyvista as pv

    mesh = pv.PolyData.from_regular_faces(
        np.ascontiguousarray(body.vertices_mm, dtype=float), body.triangles
    )
    look: dict[str, Any] = {"color": body.colour, "opacity": body.opacity, "lighting": body.shaded}
    if body.shaded:
        look |= {"interpolation": "flat", "ambient": 0.45, "diffuse": 0.6}
    if body.values is not None and body.scale is not None:
        # VTK lays the first and the last colour half a colour inside the ends of its range
        half = 0.5 * (body.scale.high - body.scale.low) / (LEVELS - 1)
        look |= {
            "scalars": body.values,
            "cmap": ListedColormap(colour_table(diverging=body.scale.diverging) / 255.0),
            "n_colors": LEVELS,
            "clim": (body.scale.low - half, body.scale.high + half),
            "interpolate_before_map": True,
            "show_scalar_bar": False,
        }
    plotter.add_mesh(mesh, copy_mesh=False, reset_camera=False, render=False, **look)


def _add_light(plotter: "pv.Plotter", projection: Projection) -> None:
    """Light machine bodies from above on the left of the viewer."""
    import pyvista as pv

    direction = projection.towards + 1.1 * projection.up - 0.7 * projection.right
    plotter.add_light(
        pv.Light(position=tuple(direction), focal_point=(0.0, 0.0, 0.0), light_type="scene light")
    )
