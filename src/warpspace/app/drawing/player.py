"""The player: moves one thing of a drawing at a time, by hand or with time."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine_bodies import rotary_axes
from warpspace.app.state.app_state import AppState
from warpspace.geometry.surfaces import auto_exaggeration

PROGRAM, EXAGGERATION, STORY = "program", "exaggeration", "story"
NO_AXES = (PROGRAM, EXAGGERATION, STORY)
"""Tracks that are no rotary axes."""
SPEEDS = (1.0 / 3.0, 1.0, 3.0)
AXIS_DEG_S, PROGRAM_S, EXAGGERATION_S, NOTE_S = 30.0, 20.0, 2.0, 6.0
"""Speed of an axis; times of a whole program, from true scale to the factor, of a step."""
STEP_S, SMOOTH_STEP_S = 0.125, 0.05  # between two pictures; of the exaggeration
STILL_STEP_S = 1.0  # between two pictures for readers who want no animations
LONGEST_STEP_S = 0.5  # longer delays are skipped
TURN_DEG = 360.0
TRUE_SCALE, SLIDER_STEPS = 1.0, 100


@dataclass(frozen=True, slots=True)
class Track:
    """A motion that can be played, between the ends of its range."""

    low: float
    high: float
    start: float  # while it has not been moved
    rate: float  # per second at the middle speed
    ends: str = "stop"  # what it does there: "stop", "turn" (full rotation) or "swing"
    is_logarithmic: bool = False  # its slider
    step: float = 1.0  # of its slider

    def to_slider(self, at: float) -> float:
        return math.log10(at) if self.is_logarithmic else at

    def from_slider(self, value: float) -> float:
        low, high = self.to_slider(self.low), self.to_slider(self.high)
        value = min(max(value, low), high)
        return min(max(10.0**value, self.low), self.high) if self.is_logarithmic else value


def find_tracks(picture: LivePicture, n_steps: int) -> dict[str, Track]:
    """List what can be played in a picture, and in a story of so many steps, by name."""
    state, path, tracks = picture.state, picture.path, dict[str, Track]()
    for axis in rotary_axes(state):
        low, high = state.scene.machine.axes[axis].travel
        ends = "turn" if high - low >= TURN_DEG else "swing"
        if high > low:
            tracks[axis] = Track(low, high, state.positions.get(axis, low), AXIS_DEG_S, ends)
    if path is not None and len(path.of.line) and not picture.is_rotary:
        last = len(path.of.line) - 1.0
        tracks[PROGRAM] = Track(0.0, last, 0.0, (last + 1.0) / PROGRAM_S)
    top = whole_factor(picture)
    if top > TRUE_SCALE:
        rate, step = (top - TRUE_SCALE) / EXAGGERATION_S, math.log10(top) / SLIDER_STEPS
        tracks[EXAGGERATION] = Track(TRUE_SCALE, top, top, rate, "swing", True, step)
    if n_steps:
        tracks[STORY] = Track(0.0, n_steps - 1.0, 0.0, 1.0 / NOTE_S)
    return tracks


def whole_factor(picture: LivePicture) -> float:
    """Return the exaggeration that is played up to: that of the state, automatic at true scale."""
    state, compared = picture.state, picture.compared
    if state.exaggeration is not None and state.exaggeration > TRUE_SCALE:
        return state.exaggeration
    largest = picture.largest_um
    if compared is not None and not picture.is_rotary:
        largest = max(compared.a.max_um, compared.b.max_um)
    return auto_exaggeration(largest, picture.size_mm) if largest else TRUE_SCALE


class Player:
    """Positions of the tracks that have been moved, and the track that plays."""

    def __init__(
        self,
        find: Callable[[], Mapping[str, Track]],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._find, self._clock = find, clock
        self.at: dict[str, float] = {}
        self.chosen = ""  # track of the bar; empty for the first of the drawing
        self.speed = SPEEDS[1]
        self.is_still = False  # whether the page wants no animations
        self.followers: dict[str, Callable[[], None]] = {}  # called after each move
        self._played_at: float | None = None  # None while nothing plays
        self._direction = 1.0

    @property
    def playing(self) -> str:
        """Name of the track that plays; empty while none does."""
        return "" if self._played_at is None else self.chosen

    @property
    def angles_deg(self) -> dict[str, float]:
        """Positions of the rotary axes that have been moved."""
        return {k: at for k, at in self.at.items() if k not in NO_AXES}

    def step_of(self, name: str) -> int | None:
        """Return the sample of the program or the step of the story; None while not shown."""
        return int(self.at[name]) if name in self.at else None

    def play(self, name: str) -> None:
        """Play a track from its position; from its low end where it is at the high one."""
        track = self._find().get(name)
        if track is None:
            return
        at = self.at.get(name, track.start)
        if at >= track.high and (track.ends == "stop" or track.is_logarithmic):
            at = track.low
        self._played_at, self._direction = self._clock(), 1.0
        self._put(name, at)

    def pause(self) -> None:
        self._played_at = None
        self._moved()

    def move(self, name: str, at: float) -> None:
        """Move a track by hand, within its range, which ends playing."""
        track = self._find().get(name)
        if track is not None:
            self._played_at = None
            self._put(name, min(max(at, track.low), track.high))

    def stop(self, *names: str) -> None:
        """Return tracks, by default all, to their state, and play nothing."""
        self._played_at, self.chosen = None, ""
        self.at = {k: at for k, at in self.at.items() if names and k not in names}
        self._moved()

    def follow(self, before: AppState, after: AppState) -> None:
        """Drop track and positions that do not belong to a changed state; a story goes on."""
        is_same = before.origin is after.origin and before.scene.machine is after.scene.machine
        is_same &= before.part.program is after.part.program
        is_same &= before.shows_rotary == after.shows_rotary
        if not is_same and self.chosen != STORY:
            self.chosen, self._played_at = "", None
        is_same &= before.positions == after.positions
        dropped = [] if is_same else [*self.angles_deg, PROGRAM]
        fields = ("scene", "amplitudes", "exaggeration", "exclusions", "look", "comparison")
        if any(getattr(before, name) is not getattr(after, name) for name in fields):
            dropped.append(EXAGGERATION)
        for name in dropped:
            if self.at.pop(name, None) is not None and name == self.playing:
                self._played_at = None

    @property
    def wait_s(self) -> float | None:
        """Time until the next picture; None while nothing plays."""
        if self._played_at is None:
            return None
        smooth = SMOOTH_STEP_S if self.chosen == EXAGGERATION else STEP_S
        step = STILL_STEP_S if self.is_still else smooth
        return max(0.0, self._played_at + step - self._clock())

    def turn(self) -> None:
        """Move what plays on to the present time."""
        name, now = self.playing, self._clock()
        track = self._find().get(name)
        if track is None or self._played_at is None:
            self._played_at = None
            return
        longest = STILL_STEP_S if self.is_still else LONGEST_STEP_S
        by = track.rate * self.speed * min(now - self._played_at, longest)
        at, span = self.at.get(name, track.start) + self._direction * by, track.high - track.low
        self._played_at = now
        if track.ends == "turn":
            at = track.low + (at - track.low) % TURN_DEG
        elif track.ends == "swing":
            if not track.low <= at <= track.high:
                self._direction = -self._direction
            away = (at - track.low) % (2.0 * span)
            at = track.low + min(away, 2.0 * span - away)
        elif at >= track.high:
            at, self._played_at = track.high, None
        self._put(name, at)

    def _put(self, name: str, at: float) -> None:
        if name not in (EXAGGERATION, STORY):  # the machine follows its program or its axes
            for other in (*self.angles_deg, PROGRAM):
                if (other == PROGRAM) != (name == PROGRAM):
                    self.at.pop(other, None)
        self.at[name], self.chosen = at, name
        self._moved()

    def _moved(self) -> None:
        for follower in tuple(self.followers.values()):
            follower()
