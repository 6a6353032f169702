"""The light of the scene: plain lamps, and no picture of a surrounding."""

from viser import SceneApi

AMBIENT = 1.2
LAMP = 3.2
LAMP_FROM = (-2.0, -5.0, 10.0)


def light_scene(scene: SceneApi) -> None:
    """Light what is not coloured by numbers: bodies of the machine, markers.

    viser's own lights are a photograph of a surrounding and lamps with shadows. A page stays nearly
    invisible until the photograph has been worked into the materials, which takes seconds where
    there is no graphics card, and shadows cost every picture. The map itself needs no light.

    Parameters
    ----------
    scene : viser.SceneApi
        Of the server, so that it is on its way before anything is drawn.
    """
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_ambient("/lights/all_round", intensity=AMBIENT)
    scene.add_light_directional("/lights/lamp", intensity=LAMP, position=LAMP_FROM)
