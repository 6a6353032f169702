"""The playback bar: play, pause, scrub and speed of whatever the drawing can play."""

from collections.abc import Mapping
from functools import partial

import numpy as np

from warpspace.app.browser import actions as do
from warpspace.app.browser.html import EMPTY, number
from warpspace.app.browser.templates import Templates
from warpspace.app.drawing.player import (
    AXIS_DEG_S,
    EXAGGERATION,
    NO_AXES,
    PROGRAM,
    SPEEDS,
    STORY,
    Track,
)
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine_bodies import played_axis
from warpspace.app.panels.panel import Context, Panel, Refresh, on
from warpspace.app.state.app_state import AppState
from warpspace.app.state.typed_numbers import read_typed
from warpspace.picture.formatting import spell_cause, spell_factor
from warpspace.units import MINUS

HTML = Templates("playback")
MOST_LETTERS = 60  # of a line of the program


class PlaybackPanel(Panel):
    """The bar: one track, or all axes in the drawing of the rotary axes."""

    name = "playback"
    refresh = Refresh.IMMEDIATE

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        context.player.followers[self.name] = self.rerender

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        player, state = self.context.player, picture.state
        is_used = picture.is_rotary or picture.path is not None or player.chosen
        tracks = self.context.find_tracks(picture) if is_used else {}
        chosen = self._chosen(tracks, rotary=picture.is_rotary)
        if not chosen:
            return {"playback": EMPTY}
        axes = [name for name in tracks if name not in NO_AXES]
        names = axes if chosen in axes and picture.is_rotary else [chosen]
        speeds = {f"{s:.2g}": f"{AXIS_DEG_S * s:g} °/s" if chosen in axes else f"{s:.1g} ×"
                  for s in SPEEDS}  # fmt: skip
        motions: dict[str | None, do.Motion] = {
            played_axis(state): "rotation", PROGRAM: "program", STORY: "story"
        }  # fmt: skip
        if not state.shows_rotary:
            motions[EXAGGERATION] = "exaggeration"
        return {"playback": HTML.bar(
            [self._row(picture, name, tracks[name]) for name in names], chosen,
            {name: name for name in tracks if name != STORY}, f"{player.speed:.2g}", speeds,
            motions.get(chosen),
        )}  # fmt: skip

    def _chosen(self, tracks: Mapping[str, Track], *, rotary: bool) -> str:
        """Return the track of the bar: the selected one, or that of the drawing."""
        chosen, axes = self.context.player.chosen, [name for name in tracks if name not in NO_AXES]
        if chosen in tracks:
            return chosen
        if rotary and axes:
            return axes[-1]
        return next((name for name in (PROGRAM, EXAGGERATION) if name in tracks), "")

    def _row(self, picture: LivePicture, name: str, track: Track) -> tuple[object, ...]:
        player = self.context.player
        at, plays = min(player.at.get(name, track.start), track.high), player.playing == name
        text, move, code, error = f"{at:.0f}°".replace("-", MINUS), "", "", ""
        if name == EXAGGERATION:
            text = spell_factor(float(f"{at:.3g}"))
        elif name == STORY:
            text = f"{int(at) + 1} of {int(track.high) + 1}"
        elif name == PROGRAM:
            text, code, error = _program_words(picture, int(at))
        elif name in player.at and not player.playing:
            move = str(round(at))
        subject, word = f"the {name}" if name in NO_AXES else name, "Pause" if plays else "Play"
        position = (*map(track.to_slider, (at, track.low, track.high)), track.step)
        return name, subject, word, position, text, move, code, error

    @on(do.Input.PLAY)
    def play(self, state: AppState, name: str) -> None:
        player, tracks = self.context.player, self.context.find_tracks()
        name = name if name in tracks else self._chosen(tracks, rotary=state.shows_rotary)
        toggle = player.pause if name == player.playing else partial(player.play, name)
        self.context.call_soon(toggle)

    @on(do.Signal.STOP_PLAYBACK, later=True)
    def stop(self) -> None:
        self.context.player.stop()

    @on(do.Input.SET_SPEED, later=True)
    def set_speed(self, name: str) -> None:
        speeds, player = {f"{speed:.2g}": speed for speed in SPEEDS}, self.context.player
        player.speed = speeds.get(name, player.speed)
        self.rerender()

    @on(do.Signal.REDUCE_MOTION, later=True)
    def reduce_motion(self) -> None:
        self.context.player.is_still = True

    @on(do.Input.CHOOSE_TRACK, later=True)
    def choose_track(self, name: str) -> None:
        track = self.context.find_tracks().get(name)
        if track is not None and name != STORY:
            self.context.player.move(name, self.context.player.at.get(name, track.start))

    @on(do.Scrub, later=True)
    def scrub(self, action: do.Scrub) -> None:
        track, at = self.context.find_tracks().get(action.axis), read_typed(action.value)
        if track is not None and at is not None:
            self.context.player.move(action.axis, track.from_slider(at))

    @on(do.Signal.SHOW_WORST_BLOCK, later=True)
    def show_worst(self) -> None:
        path = self.context.picture and self.context.picture.path
        if path:
            lengths = np.linalg.norm(path.error_um, axis=1)
            self.context.player.move(PROGRAM, float(np.argmax(lengths)))


def _program_words(picture: LivePicture, sample: int) -> tuple[str, str, str]:
    """Format the line of the program; and its text, its error and the main cause of this."""
    path, state = picture.path, picture.drawn_state
    assert path is not None  # noqa: S101 - checked by `find_tracks`
    line, lines = int(path.of.line[sample]), (picture.state.part.program or "").splitlines()
    code = lines[line - 1][:MOST_LETTERS] if 0 < line <= len(lines) else ""
    error = path.error_um[sample]
    length = float(np.linalg.norm(error))
    words = f"{number(length)} µm"
    if length and not picture.is_difference and state.controller is None:
        amplitudes = np.fromiter(state.active.values(), float, len(state.amplitudes))
        along = amplitudes * (path.response[:, 3 * sample : 3 * sample + 3] @ error) / length
        first = int(np.argmax(np.abs(along)))
        cause = spell_cause([*state.amplitudes][first], float(along[first]) / length)
        words += f", {cause}"
    return f"line {line}", code, words
