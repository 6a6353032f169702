"""Shapes of the drawing as data, and the nodes of viser's scene that follow them.

All points are in mm and all nodes have a scale of `SCENE_PER_MM`: one scene unit is 100 mm, since
viser clips beyond 1000 units.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi
from viser.transforms import SO3

from warpspace.app.browser.page import Page
from warpspace.app.drawing.colours import Rgb, line_colour
from warpspace.units import Array

SCENE_PER_MM = 0.01
UNLIT = {"scale": SCENE_PER_MM, "cast_shadow": False, "receive_shadow": False}
Pieces = NDArray[np.float32]  # [S, 2, 3], mm; ends of line segments


@dataclass(frozen=True, slots=True)
class SceneNode:
    add: str  # method of viser's scene that adds it
    constant: Mapping[str, Any]  # a change adds the node again
    assigned: Mapping[str, Any]  # assigned in place; arrays are not changed afterwards
    on_update: Callable[[Any], None] | None = None  # callback for user events


Shapes = Mapping[str, SceneNode | None]


class Nodes:
    """Nodes of viser's scene, by name: added once, then changed in place or hidden."""

    def __init__(self, scene: SceneApi, page: Page | None = None) -> None:
        self._scene, self._page = scene, page
        self._drawn: dict[str, tuple[Any, SceneNode]] = {}

    def draw(self, shapes: Shapes) -> None:
        """Draw shapes and hide all others; unchanged properties are not sent."""
        self.hide([name for name in self._drawn if shapes.get(name) is None])
        for name, shape in shapes.items():
            if shape is not None:
                self._drawn[name] = self._handle(name, shape), shape

    def hide(self, names: Sequence[str]) -> None:
        for name in names:
            if name in self._drawn and self._drawn[name][0].visible:
                self._drawn[name][0].visible = False

    def _handle(self, name: str, shape: SceneNode) -> Any:
        drawn = self._drawn.get(name)
        if drawn is None or not _same(drawn[1].constant, shape.constant):
            handle = getattr(self._scene, shape.add)(name, **shape.constant, **shape.assigned)
            if shape.on_update is not None:
                handle.on_update(shape.on_update)
            return handle
        handle, previous = drawn
        for word, value in shape.assigned.items():
            if word == "position" and self._page is not None:  # viser takes ten times as long
                self._page.run_script(f'warpspaceMesh.move("{name}",{value.tolist()});')
            elif value is not previous.assigned[word]:
                setattr(handle, word, value)
        if not handle.visible:
            handle.visible = True
        return handle


def _same(old: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
    return all(
        np.array_equal(value, old[word]) if isinstance(value, np.ndarray) else value == old[word]
        for word, value in new.items()
    )


def lines(
    pieces: Array | Pieces, rgb: Rgb | NDArray[np.uint8], width_px: float
) -> SceneNode | None:
    """Draw line segments, [S, 2, 3], in one colour or many, with a constant width on screen."""
    constant = {"thickness": width_px, "thickness_units": "screen", "scale": SCENE_PER_MM}
    colours = line_colour(rgb) if isinstance(rgb, tuple) else rgb
    assigned = {"points": pieces.astype(np.float32), "colors": colours}
    return SceneNode("add_line_segments", constant, assigned) if len(pieces) else None


def ball(at_mm: Array, radius_mm: float, rgb: Rgb) -> SceneNode:
    constant = {**UNLIT, "scale": radius_mm * SCENE_PER_MM}
    return SceneNode("add_icosphere", constant, {"position": at_mm * SCENE_PER_MM, "color": rgb})


def ellipsoid(at_mm: Array, square_mm2: Array, rgb: Rgb, opacity: float) -> SceneNode:
    """Draw an ellipsoid; its extent along a unit vector v is the root of v · square · v."""
    values, axes = np.linalg.eigh(square_mm2)
    axes[:, 0] *= np.linalg.det(axes)  # right-handed
    scale = SCENE_PER_MM * np.sqrt(np.maximum(values, 0.0))
    assigned = {"position": at_mm * SCENE_PER_MM, "wxyz": SO3.from_matrix(axes).wxyz, "color": rgb}
    constant = {"opacity": opacity, "cast_shadow": False, "receive_shadow": False}
    return SceneNode("add_icosphere", constant, {**assigned, "scale": tuple(scale.tolist())})


def dots(at_mm: Array, size_mm: float, rgb: Rgb) -> SceneNode | None:
    constant = {
        "point_size": size_mm, "point_shape": "circle", "point_shading": "flat",
        "precision": "float32", "scale": SCENE_PER_MM,
    }  # fmt: skip
    assigned = {"points": at_mm.astype(np.float32), "colors": np.array(rgb, dtype=np.uint8)}
    return SceneNode("add_point_cloud", constant, assigned) if len(at_mm) else None


# --- Line segments --------------------------------------------------------------------------------


def polylines(points: Sequence[Array]) -> Array:
    """Split polylines, [n, 3] each, into segments, [S, 2, 3]."""
    cut = [np.stack([line[:-1], line[1:]], axis=1) for line in points]
    return np.concatenate([np.zeros((0, 2, 3)), *cut])


def dashes(pieces: Array, dash: float, gap: float) -> Array:
    """Split line segments, [S, 2, 3], into dashes."""
    parts = [np.zeros((0, 2, 3))]
    for start, end in pieces:
        length = float(np.linalg.norm(end - start))
        if length == 0.0:
            continue
        count = max(1, round((length + gap) / (dash + gap)))
        period = (length + gap) / count
        begin = np.arange(count) * period / length
        ends = np.minimum(begin + (period - gap) / length, 1.0)
        at = np.stack([begin, ends], axis=1)[..., None]
        parts.append(start + at * (end - start))
    return np.concatenate(parts)


# --- Lights ---------------------------------------------------------------------------------------

AMBIENT = 1.2
LAMP = 3.2
LAMP_FROM = (-2.0, -5.0, 10.0)


def light_scene(scene: SceneApi) -> None:
    """Add lights for machine bodies and markers; the map is unlit.

    viser's default lights are an environment map and lamps with shadows. Without a graphics card,
    the environment map delays the first picture by seconds, and shadows slow down every picture.
    """
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_ambient("/lights/all_round", intensity=AMBIENT)
    scene.add_light_directional("/lights/lamp", intensity=LAMP, position=LAMP_FROM)
