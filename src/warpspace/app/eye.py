"""The camera of one tab: put where all of the box is seen, remembered, put back."""

import numpy as np
from viser import ClientHandle

from warpspace.app.camera import fit_camera
from warpspace.app.layers import SCENE_PER_MM
from warpspace.app.layers.axes import axes_room_mm
from warpspace.app.live import Frame
from warpspace.app.panels.layout import HEADING_HEIGHT, side_widths
from warpspace.app.tabs import CameraMemory

LEAST_SIZE = 200
"""CSS pixels of a picture that is taken to be one."""


class Eye:
    """The camera of a tab.

    Parameters
    ----------
    client : viser.ClientHandle
    """

    def __init__(self, client: ClientHandle) -> None:
        self._camera = client.camera

    def fit(self, frame: Frame, *, docked: bool) -> None:
        """Fill the room between the panels with the box, its traces and axes.

        Parameters
        ----------
        frame : Frame
        docked : bool
            Whether the panels have taken their room already.
        """
        camera = self._camera
        taken = 0 if docked else sum(side_widths())
        width = max(camera.image_width - taken, LEAST_SIZE)
        height = max(camera.image_height, LEAST_SIZE)
        points = np.concatenate([axes_room_mm(frame), frame.drawn_mm.reshape(-1, 3)])
        pose = fit_camera(points, width / height, top=min(HEADING_HEIGHT / height, 0.3))
        camera.up_direction = (0.0, 0.0, 1.0)
        camera.fov = pose.fov_rad
        camera.position = pose.position * SCENE_PER_MM
        camera.look_at = pose.look_at * SCENE_PER_MM

    def remember(self) -> CameraMemory:
        """Give where it stands."""
        camera = self._camera
        return CameraMemory(
            tuple(camera.position.tolist()),
            tuple(camera.look_at.tolist()),
            tuple(camera.up_direction.tolist()),
            camera.fov,
        )

    def restore(self, memory: CameraMemory) -> None:
        """Put it where it stood."""
        camera = self._camera
        camera.up_direction = memory.up
        camera.fov = memory.fov_rad
        camera.position = memory.position
        camera.look_at = memory.look_at
