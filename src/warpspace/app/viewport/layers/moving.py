"""Map notes, machine and turning table as one layer, with the player that turns the table."""

from collections.abc import Callable, Mapping

from viser import ClientHandle, SceneApi

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.rotation import played_position
from warpspace.app.viewport.layers import Layer
from warpspace.app.viewport.layers.annotations import AnnotationsLayer, BenchLayer
from warpspace.app.viewport.layers.asked_point import AskedPointLayer
from warpspace.app.viewport.layers.axes import AxesLayer
from warpspace.app.viewport.layers.box import OtherSideLayer
from warpspace.app.viewport.layers.machine import GhostMachineLayer, MachineLayer
from warpspace.app.viewport.layers.traces import Player, RotationLayer, TracesLayer

Tell = Callable[[Mapping[str, float]], None]
"""Takes the position of the played axis, degrees; none where the play is over."""


def draw_around(scene: SceneApi, picture: LivePicture) -> list[Layer]:
    """Draw what lies on and around the map."""
    kinds = (TracesLayer, BenchLayer, AxesLayer, OtherSideLayer, AskedPointLayer, GhostMachineLayer)
    return [kind(scene, picture) for kind in kinds]


class MovingLayer:
    """Everything around the map that may also move by itself.

    The player only asks for a picture; the session's worker draws it, as it draws all else.
    """

    def __init__(
        self, client: ClientHandle, picture: LivePicture, act: Callable[[Callable[[], None]], None]
    ) -> None:
        self._client, self._act = client, act
        self._picture = picture
        self._annotations = AnnotationsLayer(client.scene, picture)
        self._machine = MachineLayer(client.scene, picture)
        self._rotation = RotationLayer(client.scene, picture)
        self._listeners: list[Tell] = []
        self._position: dict[str, float] = {}
        self._due = False
        self._player = Player(self._ask)

    def show(self, picture: LivePicture) -> None:
        """Draw a picture; where the axis itself has been moved, the rotation starts there anew."""
        before, self._picture = self._picture.state, picture
        now = picture.state
        same = before.origin is now.origin and before.scene.machine is now.scene.machine
        if not same or before.positions != now.positions:
            self._player.rewind()
            self._stand({})
        self._annotations.show(picture)
        self._rotation.show(picture)
        self._machine.show(picture)

    def listen(self, tell: Tell) -> None:
        """Have somebody told where the played axis is."""
        self._listeners.append(tell)

    def play(self, on: bool | None) -> None:
        """Play (True), pause (False), or go back to where the axis stands (None)."""
        if on:
            self._player.play()
        elif on is False:
            self._player.pause()
            for tell in self._listeners:
                tell(self._position)
        elif self._player.rewind():
            with self._client.atomic():
                self._stand({})
            self._client.flush()

    def _stand(self, position: Mapping[str, float]) -> None:
        """Draw table and points with the played axis at a position; none where it stands."""
        self._position = dict(position)
        self._rotation.turn(self._position or None)
        self._machine.turn(self._position)
        for tell in self._listeners:
            tell(self._position)

    @property
    def playing(self) -> bool:
        """Whether the table turns."""
        return self._player.playing

    def stop(self) -> None:
        """End the player for good."""
        self._player.pause()

    def _ask(self) -> None:
        """Ask for a picture, unless one is still to be drawn."""
        if not self._due:
            self._due = True
            self._act(self._turn)

    def _turn(self) -> None:
        self._due = False
        if not self._player.playing:
            return
        position = played_position(self._picture.state, self._player.angle_deg)
        with self._client.atomic():
            self._stand(position)
        self._client.flush()
