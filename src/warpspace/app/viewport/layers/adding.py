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


# --- The light of the scene: plain lamps, and no picture of a surrounding -------------------------

AMBIENT = 1.2
LAMP = 3.2
LAMP_FROM = (-2.0, -5.0, 10.0)


def light_scene(scene: SceneApi) -> None:
    """Light what is not coloured by numbers: bodies of the machine, markers.

    viser's own lights are a photograph of a surrounding and lamps with shadows. A page stays nearly
    invisible until the photograph has been worked into the materials, which takes seconds where
    there is no graphics card, and shadows cost every picture. The map itself needs no light.
    """
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_ambient("/lights/all_round", intensity=AMBIENT)
    scene.add_light_directional("/lights/lamp", intensity=LAMP, position=LAMP_FROM)
