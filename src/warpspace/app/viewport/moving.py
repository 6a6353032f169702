"""Everything around the box as one layer, and the player that turns a table."""

import threading
import time
from collections.abc import Callable

from viser import ClientHandle

from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.rotation import played_position
from warpspace.app.viewport.around import around, turned_points
from warpspace.app.viewport.machine import ghost_machine, machine
from warpspace.app.viewport.shapes import Nodes

RATE_HZ = 8.0  # pictures a second: modest, since each is sent to the page
SPEED_DEG_S = 30.0
FULL_TURN_DEG = 360.0


class Player:
    """Turns an angle on while it plays; the session's thread starts it."""

    def __init__(self, ask: Callable[[], None]) -> None:
        self._ask = ask
        self._over = threading.Event()
        self._over.set()
        self.angle_deg = 0.0  # how far it has turned, 0 … 360

    @property
    def playing(self) -> bool:
        """Whether it turns."""
        return not self._over.is_set()

    def play(self) -> None:
        """Turn on from where it was paused; one thread at a time."""
        if not self.playing:
            self._over = threading.Event()
            threading.Thread(
                target=self._run, args=(self._over,), name="warpspace-rotation", daemon=True
            ).start()

    def pause(self) -> None:
        """Stand still."""
        self._over.set()

    def rewind(self) -> bool:
        """Stand still where the play began; tell whether there was anything to take back."""
        moved = self.playing or self.angle_deg != 0.0
        self.pause()
        self.angle_deg = 0.0
        return moved

    def _run(self, over: threading.Event) -> None:
        """Turn at a steady rate until it is over; time lost is skipped, not made up for."""
        before = time.monotonic()
        while not over.wait(1.0 / RATE_HZ):
            now = time.monotonic()
            self.angle_deg = (self.angle_deg + SPEED_DEG_S * min(now - before, 0.5)) % FULL_TURN_DEG
            before = now
            self._ask()


class MovingLayer:
    """Everything around the box, which may also move by itself.

    The player only asks for a picture; the session's worker draws it, as it draws all else.
    """

    def __init__(
        self, client: ClientHandle, picture: LivePicture, act: Callable[[Callable[[], None]], None]
    ) -> None:
        self._client, self._act = client, act
        self._picture = picture
        self._around, self._ghost, self._turning = (Nodes(client.scene) for _ in range(3))
        self._ghost_of: object = None
        self.position: dict[str, float] = {}  # of the played axis, degrees; none where it stands
        self.moved: Callable[[], None] = lambda: None
        self._due = False
        self._player = Player(self._ask)
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Draw a picture; where the axis itself has been moved, the rotation starts there anew."""
        before, self._picture = self._picture.state, picture
        now = picture.state
        same = before.origin is now.origin and before.scene.machine is now.scene.machine
        if not same or before.positions != now.positions:
            self._player.rewind()
            self._stand({})
        self._around.draw(around(picture))
        self._draw_ghost(picture)
        self._draw_turning()

    def _draw_ghost(self, picture: LivePicture) -> None:
        """Errors do not move the ghost; it is not drawn beside the machine itself."""
        state = picture.state
        on = state.machine.ghost and not state.machine.shown
        of = on and (
            Identity(state.scene), state.seen, state.shown.dark,
            Identity(state.machine.linear_mm), Identity(state.positions),
        )  # fmt: skip
        if of != self._ghost_of:
            self._ghost_of = of
            self._ghost.draw(ghost_machine(picture) if on else {})

    def _draw_turning(self) -> None:
        picture, position = self._picture, self.position
        self._turning.draw({**turned_points(picture, position), **machine(picture, position)})

    def play(self, on: bool | None) -> None:
        """Play (True), pause (False), or go back to where the axis stands (None)."""
        if on:
            self._player.play()
        elif on is False:
            self._player.pause()
            self.moved()
        elif self._player.rewind():
            self._stand({}, drawn=True)

    def _stand(self, position: dict[str, float], *, drawn: bool = False) -> None:
        """Have the played axis at a position; none where it stands."""
        self.position = position
        if drawn:
            with self._client.atomic():
                self._draw_turning()
            self._client.flush()
        self.moved()

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
        if self._player.playing:
            angle = self._player.angle_deg
            self._stand(played_position(self._picture.state, angle), drawn=True)
