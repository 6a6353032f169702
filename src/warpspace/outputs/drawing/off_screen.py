"""Bodies drawn off screen in a parallel projection, and which parts of lines they hide."""

import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, reduce
from importlib import import_module
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import ListedColormap
from numpy.typing import NDArray
from PIL import Image

from warpspace.exceptions import NoRendererError, RenderError
from warpspace.geometry.colour import LEVELS, ColourScale, colour_table
from warpspace.picture.model import UPWARDS, VIEWS
from warpspace.units import Array

if TYPE_CHECKING:
    import pyvista as pv


Rect = tuple[float, float, float, float]  # left, bottom, right, top, px


@dataclass(frozen=True, slots=True)
class Projection:
    """A parallel projection onto the pixels of a figure."""

    # [3]; unit vectors in R: to the right and upwards in the picture, and towards the viewer
    right: Array
    up: Array
    towards: Array
    px_per_mm: float
    centre_mm: Array  # [3]; point of R ..
    centre_px: Array  # [2], px; ... and where it is drawn, origin bottom left.

    def project(self, points_mm: Array) -> Array:
        relative = points_mm - self.centre_mm
        plane = np.stack([relative @ self.right, relative @ self.up], -1)
        return self.centre_px + self.px_per_mm * plane

    def depth_mm(self, points_mm: Array) -> Array:
        """Distance behind the plane through the centre, [...], mm; larger is farther away."""
        return -((points_mm - self.centre_mm) @ self.towards)

    def moved(self, shift_px: Array) -> "Projection":
        return replace(self, centre_px=self.centre_px + shift_px)


def view_axes(view: str) -> tuple[Array, Array, Array]:
    towards = np.array(VIEWS[view])
    upwards = np.array(UPWARDS.get(view, (0.0, 0.0, 1.0)))
    towards /= np.linalg.norm(towards)
    right = np.cross(upwards, towards)
    right /= np.linalg.norm(right)
    return right, np.cross(towards, right), towards


def fit_projection(
    view: str, points_mm: Array, rect: Rect, px_per_mm: float | None = None
) -> Projection:
    """Fit the projection in which points fill a box of the figure, or are centred in it."""
    right, up, towards = view_axes(view)
    flat = points_mm.reshape(-1, 3)
    centre = (flat.min(axis=0) + flat.max(axis=0)) / 2.0
    plane = np.stack([(flat - centre) @ right, (flat - centre) @ up], -1)
    low, high = plane.min(axis=0), plane.max(axis=0)
    start, end = np.reshape(rect, (2, 2))
    spans = np.maximum(high - low, 1e-9)
    if px_per_mm is None:
        px_per_mm = float(np.min((end - start) / spans)) if (high - low).max() > 1e-9 else 1.0
    centre_px = (start + end) / 2.0 - px_per_mm * (low + high) / 2.0
    return Projection(right, up, towards, px_per_mm, centre, centre_px)


Bytes = NDArray[np.uint8]
_LARGEST_SIDE_PX = 8192
_LARGEST_AREA_PX = 24_000_000
SUPERSAMPLING, MARGIN_PX = 2, 4
PACKAGES = "libegl1 libgl1-mesa-dri"
WINDOW_VARIABLE = "VTK_DEFAULT_OPENGL_WINDOW"
FALLBACK = "vtkOSOpenGLRenderWindow"
WINDOWS = (
    "vtkEGLRenderWindow",
    FALLBACK,
    "vtkXOpenGLRenderWindow",
    "vtkWin32OpenGLRenderWindow",
    "vtkCocoaRenderWindow",
)


@dataclass(frozen=True, slots=True)
class RenderedBody:
    """Triangles to draw."""

    vertices_mm: Array  # [M, 3]; where they are drawn
    triangles: NDArray[np.intp]  # [T, 3]
    # [M]; coloured values; interpolated over each triangle before they become colours
    values: Array | None = None
    scale: ColourScale | None = None  # colours of the values
    # [M, 3]; sRGB, 0 to 1, of a body that is lit: of a machine, never of errors
    colours: Array | None = None
    normals: Array | None = None  # [M, 3], of a lit body; None for flat triangles


@dataclass(frozen=True, slots=True)
class Raster:
    """Drawn bodies."""

    rgba: Bytes  # [h, w, 4]; first row at the top
    depth_mm: NDArray[np.float32]  # [h, w]; as `Projection.depth_mm`; infinite for the background
    # [h, w]; the largest depth within a pixel of the figure around each
    farthest_mm: NDArray[np.float32]
    rect: Rect  # px; box of the figure it covers

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
        x_left, _, _, top = self.rect
        i = np.floor((top - points_px[..., 1]) * self.sampling).astype(np.intp)
        j = np.floor((points_px[..., 0] - x_left) * self.sampling).astype(np.intp)
        height, width = self.depth_mm.shape
        inside = (i >= 0) & (i < height) & (j >= 0) & (j < width)
        depth = self.farthest_mm if spread else self.depth_mm
        return np.where(inside, depth[np.where(inside, i, 0), np.where(inside, j, 0)], np.inf)


def render_bodies(bodies: Sequence[RenderedBody], projection: Projection) -> Raster | None:
    """Draw bodies; None without bodies."""
    if not bodies:
        return None
    points = np.concatenate([body.vertices_mm for body in bodies])
    spots = projection.project(points)
    low = np.floor(spots.min(axis=0)) - MARGIN_PX
    high = np.ceil(spots.max(axis=0)) + MARGIN_PX
    width, height = (high - low).astype(int).tolist()
    small = max(width, height) * SUPERSAMPLING <= _LARGEST_SIDE_PX
    small = small and width * height * SUPERSAMPLING**2 <= _LARGEST_AREA_PX
    step = SUPERSAMPLING if small else 1
    rgba, depth = _draw(bodies, projection, (low + high) / 2.0, (width * step, height * step), step)
    shifts, padded = range(2 * step + 1), np.pad(depth, step, mode="edge")
    rows = reduce(np.maximum, (padded[shift : shift + len(depth)] for shift in shifts))
    farthest = reduce(np.maximum, (rows[:, shift : shift + width * step] for shift in shifts))
    return Raster(rgba, depth, farthest, (*low.tolist(), *high.tolist()))


def _draw(
    bodies: Sequence[RenderedBody],
    projection: Projection,
    middle_px: Array,
    size: tuple[int, int],
    step: int,
) -> tuple[Bytes, NDArray[np.float32]]:
    check_renderer()
    import pyvista as pv

    offset = (middle_px - projection.centre_px) / projection.px_per_mm
    focus = projection.centre_mm + offset[0] * projection.right + offset[1] * projection.up
    depths = np.concatenate([projection.depth_mm(body.vertices_mm) for body in bodies])
    margin = 1.0 + 0.02 * float(np.ptp(depths))
    near, far = float(depths.min()) - margin, float(depths.max()) + margin

    # a separate theme: settings of users for their plotters do not affect the figures
    theme = pv.themes.Theme()
    theme.background = "black"
    plotter = pv.Plotter(off_screen=True, window_size=list(size), lighting="none", theme=theme)
    try:
        plotter.disable_anti_aliasing()
        for body in bodies:
            _add_body(plotter, body)
        if any(body.colours is not None for body in bodies):
            light = projection.towards + 1.1 * projection.up - 0.7 * projection.right
            plotter.add_light(pv.Light(position=tuple(light), focal_point=(0.0, 0.0, 0.0)))
        camera = plotter.camera
        camera.parallel_projection = True
        camera.position = focus + (1.0 - near) * projection.towards
        camera.focal_point = focus - near * projection.towards
        camera.up = projection.up
        camera.parallel_scale = size[1] / step / 2.0 / projection.px_per_mm
        camera.clipping_range = (1.0, 1.0 + far - near)
        rgba = plotter.screenshot(transparent_background=True, return_img=True)
        depth_image = plotter.get_image_depth(fill_value=-np.inf, reset_camera_clipping_range=False)
    except (ValueError, AttributeError, RuntimeError) as error:
        raise RenderError(
            f"the picture could not be drawn: VTK returned no pixels ({error})"
        ) from error
    finally:
        plotter.close()
    depth = (near - 1.0) - np.asarray(depth_image)
    return np.array(rgba), depth.astype(np.float32)


@cache
def check_renderer() -> None:
    """Check that VTK has OpenGL: without it, drawing would end the program."""
    if sys.platform == "linux":
        os.environ.setdefault(WINDOW_VARIABLE, "vtkEGLRenderWindow")
    from vtkmodules.vtkCommonCore import vtkLogger
    from vtkmodules.vtkRenderingCore import vtkRenderWindow

    import_module("vtkmodules.vtkRenderingOpenGL2")  # registers the available windows
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    window = vtkRenderWindow().GetClassName()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_INFO)
    if window == FALLBACK != os.environ.get(WINDOW_VARIABLE):
        raise NoRendererError(f"VTK cannot draw off screen here. {_advice()}")


def _advice() -> str:
    window = os.environ.get(WINDOW_VARIABLE)
    if window is not None and window not in WINDOWS:
        return f"The variable {WINDOW_VARIABLE} is {window!r}, which VTK does not know; unset it."
    if sys.platform == "linux":
        return f"Install the Debian packages {PACKAGES} (apt-get install {PACKAGES})."
    return "Check the OpenGL driver."


def _add_body(plotter: "pv.Plotter", body: RenderedBody) -> None:
    import pyvista as pv

    mesh = pv.PolyData.from_regular_faces(
        np.ascontiguousarray(body.vertices_mm, dtype=float), body.triangles
    )
    look: dict[str, Any] = {"lighting": body.colours is not None}
    if body.colours is not None:
        look |= {"scalars": body.colours, "rgb": True, "ambient": 0.52, "diffuse": 0.6}
    if body.normals is not None:
        mesh.point_data.active_normals = body.normals
        look["interpolation"] = "phong"
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


STEP_PX = 1.5
SHORTEST_PX = 4.0


def split_visible(
    lines_mm: Iterable[Array], projection: Projection, raster: Raster | None
) -> tuple[list[Array], list[Array]]:
    """Split polylines into their visible and their hidden parts, px."""
    visible_parts: list[Array] = []
    hidden_parts: list[Array] = []
    for line_mm in lines_mm:
        spots = projection.project(line_mm)
        if raster is None:
            visible_parts.append(spots)
            continue
        deep = np.column_stack([spots, projection.depth_mm(line_mm)])
        fine_px, fine_depth = np.split(resample(deep, STEP_PX), [2], axis=1)
        surface = raster.depth_at(fine_px, spread=True) + 1.5 / projection.px_per_mm
        visible = _steady(fine_depth[:, 0] <= surface, round(SHORTEST_PX / STEP_PX))
        for start, end in pairwise(_bounds(visible)):
            part = fine_px[start : min(end + 1, len(visible))]
            if len(part) > 1:
                (visible_parts if visible[start] else hidden_parts).append(_thin(part))
    return visible_parts, hidden_parts


def resample(line: Array, step: float) -> Array:
    """Insert points into a polyline up to a maximum distance in its first two columns, [n, ≥ 2]."""
    lengths = np.hypot(*np.diff(line[:, :2], axis=0).T)
    pieces = np.maximum(1, np.ceil(lengths / step)).astype(int)
    # position along the polyline, in numbers of its points
    along = np.concatenate([[0.0], np.cumsum(np.repeat(1.0 / pieces, pieces))])
    numbers = np.arange(len(line))
    return np.stack([np.interp(along, numbers, values) for values in line.T], -1)


def _thin(spots: Array) -> Array:
    if len(spots) < 3:
        return spots
    before, after = spots[1:-1] - spots[:-2], spots[2:] - spots[1:-1]
    turn = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
    bent = turn > 1e-6 * np.hypot(*before.T) * np.hypot(*after.T)
    return spots[np.concatenate([[True], bent, [True]])]


def _steady(visible: np.ndarray, shortest: int) -> np.ndarray:
    steady = visible.copy()
    for start, end in pairwise(_bounds(visible)):
        inner = start > 0 and end < len(visible)
        if inner and end - start < shortest:
            steady[start:end] = not visible[start]
    return steady


def _bounds(visible: np.ndarray) -> list[int]:
    return [0, *(np.flatnonzero(np.diff(visible)) + 1).tolist(), len(visible)]
