"""What several layers add to a scene: pieces of line, markers of points."""

from viser import SceneApi

from warpspace.app.browser.handles import Handle
from warpspace.app.viewport.layers import NOTHING, SCENE_PER_MM, colour_bytes
from warpspace.app.viewport.tone_map import Rgb


def add_lines(
    scene: SceneApi, name: str, rgb: Rgb, thickness: float, *, visible: bool = True
) -> Handle:
    """Add pieces of line in one colour, as thick on screen from near and far; none of them yet."""
    return Handle(
        scene.add_line_segments(
            name,
            NOTHING,
            colour_bytes(rgb),
            thickness=thickness,
            thickness_units="screen",
            scale=SCENE_PER_MM,
            visible=visible,
        )
    )


def add_ball(scene: SceneApi, name: str, radius_mm: float, rgb: Rgb) -> Handle:
    """Add the marker of a point."""
    return Handle(
        scene.add_icosphere(
            name,
            radius_mm * SCENE_PER_MM,
            color=rgb,
            cast_shadow=False,
            receive_shadow=False,
        )
    )
