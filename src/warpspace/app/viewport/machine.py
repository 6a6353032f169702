"""The schematic machine: bodies in quiet greys, and the tool point in the deformed grid."""

from collections.abc import Mapping

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine import drawn_bodies, tool_point
from warpspace.app.viewport.colours import Rgb, palette
from warpspace.app.viewport.shapes import Shape, Shapes, ball, lines, mesh
from warpspace.bodies.placed import PlacedBody

EDGE: Rgb = (70, 78, 90)
DARK_EDGE: Rgb = (150, 158, 170)
BALL = 0.010  # marker of the tool point, as a part of the longest edge
OPACITY = 0.045
GHOST, DARK_GHOST = (120, 132, 150), (150, 160, 176)
GHOST_EDGE: Rgb = (226, 230, 235)
DARK_GHOST_EDGE: Rgb = (48, 54, 63)


def machine(picture: LivePicture, turned: Mapping[str, float]) -> Shapes:
    """Draw the bodies, moved by the positions of the machine and bent by its errors.

    Some axes may stand elsewhere, degrees, while one is turned; its table is then drawn also where
    the machine is not.
    """
    shown, shapes = picture.state.machine.shown, dict[str, Shape | None]()
    if shown or turned:
        edge = DARK_EDGE if picture.state.shown.dark else EDGE
        for part in drawn_bodies(picture, turned):
            shapes |= _body("/machine", part, part.body.colour, edge)
    if shown:
        at, size = tool_point(picture)[0], BALL * picture.size_mm
        shapes["/machine/tool_point"] = ball(at, size, palette(picture).edge)
    return shapes


def ghost_machine(picture: LivePicture) -> Shapes:
    """Draw the nominal machine, nearly transparent: it tells what the box is a part of."""
    dark = picture.state.shown.dark
    colour, edge = (DARK_GHOST, DARK_GHOST_EDGE) if dark else (GHOST, GHOST_EDGE)
    shapes: dict[str, Shape | None] = {}
    for part in drawn_bodies(picture, nominal=True):
        shapes |= _body("/ghost_machine", part, colour, edge, opacity=OPACITY)
    return shapes


def _body(root: str, part: PlacedBody, colour: Rgb, edge: Rgb, **more: object) -> Shapes:
    name, triangles = f"{root}/{part.body.name}", part.body.triangles
    return {
        name: mesh(part.vertices_mm, triangles, colour, flat_shading=True, **more),
        f"{name}_edges": lines(part.edges_mm, edge, 0.9),
    }
