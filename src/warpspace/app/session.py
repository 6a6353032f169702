"""One browser tab: its state, its widgets, its drawing, and the one thread that joins them.

Widget callbacks only mark that something changed. The worker thread wakes, reads every widget,
applies what buttons have posted, evaluates once and mutates handles in place: the last position of
a slider is always what is shown, however fast it was moved.
"""

import json
import logging
import threading
from collections import deque
from collections.abc import Mapping

import numpy as np
from viser import ClientHandle
from viser import _messages as messages

from warpspace.app.camera import fit_camera
from warpspace.app.layers import SCENE_PER_MM, Layer
from warpspace.app.layers.axes import AxesLayer, axes_room_mm
from warpspace.app.layers.box import BoxLayer
from warpspace.app.layers.traces import TracesLayer
from warpspace.app.live import Frame, LiveModel
from warpspace.app.panels import Desk, Panel, Update
from warpspace.app.panels.layout import HEADING_HEIGHT, apply_theme, lay_out_panels, side_widths
from warpspace.app.state import AppState
from warpspace.exceptions import WarpspaceError
from warpspace.scene.model import Scene

logger = logging.getLogger(__name__)
NOTE_SECONDS = 8.0
LEAST_WIDTH = 200


class Session:
    """The app of one browser tab.

    Parameters
    ----------
    client : viser.ClientHandle
    live : LiveModel
        Shared by all sessions.
    scenes : mapping of str to Scene
        Scenes to choose from, by the title shown.
    state : AppState
        What is shown first.
    """

    def __init__(
        self, client: ClientHandle, live: LiveModel, scenes: Mapping[str, Scene], state: AppState
    ) -> None:
        self._client, self._live, self._scenes = client, live, scenes
        self._state = state
        self._shown: Frame | None = None
        self._posted: deque[Update] = deque()
        self._wake = threading.Event()
        self._stopped = threading.Event()
        self._layers: list[Layer] = []
        self._panels: list[Panel] = []
        self._worker = threading.Thread(
            target=self._run, name=f"warpspace-session-{client.client_id}", daemon=True
        )

    @property
    def state(self) -> AppState:
        """What is shown, or about to be."""
        return self._state

    def start(self) -> None:
        """Build page and drawing, then follow the widgets."""
        self._worker.start()

    def stop(self) -> None:
        """End the worker; nothing is sent any more."""
        self._stopped.set()
        self._wake.set()

    def changed(self) -> None:
        """Take note that a widget has changed; returns at once."""
        self._wake.set()

    def post(self, update: Update) -> None:
        """Queue a pure update of the state; returns at once."""
        self._posted.append(update)
        self._wake.set()

    def _run(self) -> None:
        """Wait, take everything in, show once; until stopped."""
        self._guarded(self._build)
        while True:
            self._wake.wait()
            self._wake.clear()
            if self._stopped.is_set():
                return
            self._guarded(self._step)

    def _guarded(self, step: Update | object) -> None:
        """Run a step; what it raises is logged and shown to this user, and the session goes on."""
        try:
            step()  # type: ignore[operator]
        except Exception as error:
            if self._stopped.is_set():
                return
            logger.exception("session %d", self._client.client_id)
            known = isinstance(error, WarpspaceError)
            text = str(error) if known else f"{type(error).__name__}: {error}"
            self._notify("That did not work", text, "red")

    def _build(self) -> None:
        """Draw the first frame, then lay out the panels."""
        frame = self._live.frame(self._state)
        scene = self._client.scene
        with self._client.atomic():
            self._set_title(frame)
            self._place_camera(frame)
            self._layers = [
                BoxLayer(scene, frame),
                TracesLayer(scene, frame),
                AxesLayer(scene, frame),
            ]
            desk = Desk(self._client.gui, self.changed, self.post)
            self._panels = lay_out_panels(desk, self._state, self._scenes, self.fit_view)
            for panel in self._panels:
                panel.show(frame)
        self._client.flush()
        self._shown = frame

    def _step(self) -> None:
        """Take in what has changed and show the outcome."""
        state = self._state.without_notes()
        for panel in self._panels:
            state = panel.read(state)
        while self._posted:
            state = self._posted.popleft()(state)
        if state == self._state and self._shown is not None:
            return
        self._state = state
        self._show(self._live.frame(state))

    def _show(self, frame: Frame) -> None:
        """Make page and drawing show a frame, all at once."""
        before = self._shown
        with self._client.atomic():
            for layer in self._layers:
                layer.show(frame)
            for panel in self._panels:
                panel.show(frame)
            if before is not None and before.state.scene is not frame.state.scene:
                self._set_title(frame)
                self._place_camera(frame)
            if before is not None and before.state.shown.dark != frame.state.shown.dark:
                apply_theme(self._client.gui, dark=frame.state.shown.dark)
        self._client.flush()
        self._shown = frame
        if frame.state.notes:
            self._notify("Clamped", "\n".join(frame.state.notes), "yellow")

    def fit_view(self) -> None:
        """Put the camera back to the operator's side."""
        if self._shown is not None:
            self._place_camera(self._shown)
            self._client.flush()

    def _place_camera(self, frame: Frame) -> None:
        """Fill the room between the panels with the box, its traces and axes."""
        camera = self._client.camera
        taken = sum(side_widths()) if self._shown is None else 0  # not docked yet
        width = max(camera.image_width - taken, LEAST_WIDTH)
        points = np.concatenate([axes_room_mm(frame), frame.drawn_mm.reshape(-1, 3)])
        height = max(camera.image_height, LEAST_WIDTH)
        pose = fit_camera(points, width / height, top=min(HEADING_HEIGHT / height, 0.3))
        camera.up_direction = (0.0, 0.0, 1.0)
        camera.fov = pose.fov_rad
        camera.position = pose.position * SCENE_PER_MM
        camera.look_at = pose.look_at * SCENE_PER_MM

    def _set_title(self, frame: Frame) -> None:
        """Name the browser tab after the scene."""
        title = json.dumps(f"{frame.state.scene.title} · warpspace").replace("<", "\\u003c")
        # viser has a message for it and no method
        self._client._websock_connection.queue_message(  # noqa: SLF001 # pyright: ignore[reportPrivateUsage]
            messages.RunJavascriptMessage(source=f"document.title = {title};")
        )

    def _notify(self, title: str, text: str, colour: str) -> None:
        """Show a message in this tab."""
        self._client.add_notification(
            title,
            text,
            auto_close_seconds=NOTE_SECONDS,
            color=colour,  # type: ignore[arg-type]
        )
