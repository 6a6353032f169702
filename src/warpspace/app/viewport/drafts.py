"""What of a picture follows every move of a slider, worked out in one go and without viser.

A draft is what a busy server shows while a slider moves: the map of every second node, and the
numbers of all nodes. All else waits until the slider rests.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.readouts import summary as legend
from warpspace.app.state.app_state import AppState
from warpspace.app.viewport.tone_map import vertex_colours
from warpspace.bodies.gltf import Part, build_gltf
from warpspace.picture.mesh import (
    Pieces,
    edge_pieces,
    grid_pieces,
    isoline_pieces,
    line_mesh,
    map_mesh,
)

TEXTS: Mapping[str, Callable[[LivePicture], str]] = {
    "summary": legend.summary,
    "heading": legend.heading,
}
"""What is always in view beside the picture."""


@dataclass(frozen=True, slots=True)
class BoxPicture:
    """The bent box as it is sent; None where something is not drawn.

    Attributes
    ----------
    surface : bytes
        GLB, vertices in mm.
    grid, edges, isolines : ndarray of float32, [S, 2, 3], mm, or None
        Pieces of line.
    """

    surface: bytes
    grid: Pieces | None
    edges: Pieces | None
    isolines: Pieces | None


@dataclass(frozen=True, slots=True)
class Draft:
    """What a busy server shows while a slider moves.

    Attributes
    ----------
    box : BoxPicture
        Of every second node.
    texts : mapping of str to str
        HTML by the names in `TEXTS`, of all nodes.
    """

    box: BoxPicture
    texts: Mapping[str, str]


def surface_glb(picture: LivePicture) -> bytes:
    """Write the coloured map of a picture, or its lines alone, vertices in mm."""
    mesh = line_mesh(picture) if picture.state.look.surface == "grid" else map_mesh(picture)
    colours = vertex_colours(picture.scale, mesh.values)
    return build_gltf([Part("surface", mesh.vertices_mm, mesh.triangles, colours=colours)])


def box_picture(picture: LivePicture) -> BoxPicture:
    """Work out what is sent of the bent box."""
    look = picture.state.look
    on_map = look.surface != "grid"
    return BoxPicture(
        surface_glb(picture),
        grid_pieces(picture) if on_map and picture.state.shown.grid_lines else None,
        edge_pieces(picture) if on_map else None,
        isoline_pieces(picture) if on_map and look.isolines else None,
    )


def build_draft(picture: LivePicture) -> Draft:
    """Work out the draft of a picture."""
    texts = {name: spell(picture) for name, spell in TEXTS.items()}
    return Draft(box_picture(picture), texts)


def only_moved(old: AppState, new: AppState) -> bool:
    """Tell whether two states differ in nothing but amplitudes, and compare nothing."""
    return new.comparison.b is None and all(
        getattr(old, field.name) is getattr(new, field.name)
        for field in fields(AppState)
        if field.name != "amplitudes"
    )
