"""What lies outside the panels of a tab: its camera, its page, its files."""

from collections.abc import Callable
from dataclasses import dataclass

from viser import ClientHandle

from warpspace.app.documents.scene_list import SceneList
from warpspace.app.documents.services import Services
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.server.tab_memory import CameraMemory


@dataclass(frozen=True, slots=True)
class TabContext:
    """What some panels need beside the desk.

    Attributes
    ----------
    client : viser.ClientHandle
    scenes : SceneList
        Scenes this tab can choose from.
    camera : callable
        Gives where the camera stands.
    look_from : callable
        Puts the camera somewhere with the next picture.
    run_script : callable
        Runs JavaScript of our own in the page.
    services : Services
    shown : callable
        Gives the picture that is drawn; None before the first.
    """

    client: ClientHandle
    scenes: SceneList
    camera: Callable[[], CameraMemory]
    look_from: Callable[[CameraMemory], None]
    run_script: Callable[[str], None]
    services: Services
    shown: Callable[[], LivePicture | None]
