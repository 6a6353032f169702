"""The playback bar: play, pause, scrub and speed of whatever the drawing can play."""

import math
from collections.abc import Mapping
from functools import partial

import numpy as np
from markupsafe import Markup

from warpspace.app.browser import actions as do
from warpspace.app.browser import html
from warpspace.app.browser.html import EMPTY, button, fill, join, number, tag
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
from warpspace.picture.formatting import spell_cause, spell_factor
from warpspace.units import MINUS

MOST_LETTERS = 60  # of a line of the program


class PlaybackPanel(Panel):
    """The bar: one track, or all axes in the drawing of the rotary axes."""

    name = "playback"
    refresh = Refresh.IMMEDIATE

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        context.player.followers[self.name] = self.rerender

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        player = self.context.player
        if not (picture.is_rotary or picture.path is not None or player.chosen):
            return {"playback": EMPTY}
        tracks = self.context.find_tracks(picture)
        chosen = self._chosen(tracks, rotary=picture.is_rotary)
        if not chosen:
            return {"playback": EMPTY}
        axes = [name for name in tracks if name not in NO_AXES]
        row_names = axes if chosen in axes and picture.is_rotary else [chosen]
        rows = [self._row(picture, name, tracks[name]) for name in row_names]
        return {
            "playback": tag("div", join((*rows, *self._buttons(picture.state, tracks, chosen))))
        }

    def _chosen(self, tracks: Mapping[str, Track], *, rotary: bool) -> str:
        """Return the track of the bar: the selected one, or that of the drawing."""
        chosen, axes = self.context.player.chosen, [name for name in tracks if name not in NO_AXES]
        if chosen in tracks:
            return chosen
        if rotary and axes:
            return axes[-1]
        return next((name for name in (PROGRAM, EXAGGERATION) if name in tracks), "")

    def _row(self, picture: LivePicture, name: str, track: Track) -> Markup:
        player, subject = self.context.player, name if name not in NO_AXES else f"the {name}"
        at, plays = min(player.at.get(name, track.start), track.high), player.playing == name
        text, extra = self._words(picture, name, at, int(track.high) + 1)
        word = "Pause" if plays else "Play"
        ends = track.to_slider(track.low), track.to_slider(track.high)
        return fill(
            '<div class="ws-turn">{play}<b>{label}</b>{slider}<span>{text}</span></div>{extra}',
            play=button(word, do.Input.PLAY(name), kind="quiet", aria_label=f"{word} {subject}",
                        data_key=f"play-{name}", hint=f"{word} {subject} (P)"),
            label=name if name not in NO_AXES else name.capitalize(), text=text, extra=extra,
            slider=html.slider(do.Scrub(name), track.to_slider(at), *ends, track.step,
                               label=f"Position of {subject}", text=text),
        )  # fmt: skip

    def _words(self, picture: LivePicture, name: str, at: float, count: int) -> tuple[str, Markup]:
        """Format the position of a track, and what follows its slider."""
        if name == EXAGGERATION:
            return spell_factor(float(f"{at:.3g}")), EMPTY
        if name == STORY:
            return f"{int(at) + 1} of {count}", EMPTY
        if name == PROGRAM:
            return _program_words(picture, int(at))
        player, path = self.context.player, do.SetLeaf(f"positions.{name}", str(round(at)))
        text, stands = f"{at:.0f}°".replace("-", MINUS), name in player.at and not player.playing
        hint = "Move the axis to the paused position"
        move = button("Move axes here", path, kind="quiet", hint=hint)
        return text, move if stands else EMPTY

    def _buttons(self, state: AppState, tracks: Mapping[str, Track], chosen: str) -> list[Markup]:
        player, is_axis = self.context.player, chosen not in NO_AXES
        labels = {f"{s:.2g}": f"{AXIS_DEG_S * s:g} °/s" if is_axis else f"{s:.1g} ×"
                  for s in SPEEDS}  # fmt: skip
        buttons = [html.choice(do.Input.SET_SPEED(), f"{player.speed:.2g}", labels, label="Speed")]
        if player.chosen == STORY:
            return [
                button("←", do.Signal.PREVIOUS_STEP, kind="quiet", hint="Previous step (←)",
                       aria_label="Previous step"),
                button("→", do.Signal.NEXT_STEP, kind="quiet", hint="Next step (→)",
                       aria_label="Next step"),
                *buttons,
                _export("story"),
                button("End", do.Signal.END_STORY, kind="quiet",
                       hint="Return to the previous view (Esc)"),
            ]  # fmt: skip
        names = {name: name for name in tracks if name != STORY}
        if len(names) > 1:
            buttons.insert(0, html.choice(do.Input.CHOOSE_TRACK(), chosen, names, label="Play"))
        motions: dict[str | None, do.Motion] = {played_axis(state): "rotation", PROGRAM: "program"}
        if not state.shows_rotary:
            motions[EXAGGERATION] = "exaggeration"
        if chosen in motions:
            buttons.append(_export(motions[chosen]))
        hint = "Return to the state of the scene"
        return [*buttons, button("Reset", do.Signal.STOP_PLAYBACK, kind="quiet", hint=hint)]

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
        track, at = self.context.find_tracks().get(action.axis), _read_number(action.value)
        if track is not None and at is not None:
            self.context.player.move(action.axis, track.from_slider(at))

    @on(do.Signal.SHOW_WORST_BLOCK, later=True)
    def show_worst(self) -> None:
        path = self.context.picture and self.context.picture.path
        if path:
            lengths = np.linalg.norm(path.error_um, axis=1)
            self.context.player.move(PROGRAM, float(np.argmax(lengths)))


def _export(motion: do.Motion) -> Markup:
    kinds = (button("Animated WebP", do.SaveAnimation(motion), kind="quiet"),
             button("MP4 video", do.SaveAnimation(motion, ".mp4"), kind="quiet"))  # fmt: skip
    return html.menu("Export", join(kinds), key="animation", kind="up", hint="Save as a file")


def _program_words(picture: LivePicture, sample: int) -> tuple[str, Markup]:
    """Format the line of the program; and its text, its error and the main cause of this."""
    path = picture.path
    assert path is not None  # noqa: S101 - checked by `find_tracks`
    line, lines = int(path.of.line[sample]), (picture.state.part.program or "").splitlines()
    code = lines[line - 1][:MOST_LETTERS] if 0 < line <= len(lines) else ""
    worst = button(
        "Worst", do.Signal.SHOW_WORST_BLOCK, kind="quiet", hint="Go to the largest error"
    )
    error = _error_words(picture, sample)
    body = fill('{}<div class="ws-line"><code>{}</code> {}</div>', worst, code, error)
    return f"line {line}", body


def _error_words(picture: LivePicture, sample: int) -> str:
    """Format the error of a sample and the error parameter that contributes most to it."""
    path, state = picture.path, picture.drawn_state
    assert path is not None  # noqa: S101 - checked by the panel
    error = path.error_um[sample]
    length = float(np.linalg.norm(error))
    words = f"{number(length)} µm"
    if picture.is_difference or state.controller is not None or not length:
        return words
    amplitudes = np.fromiter(state.active.values(), float, len(state.amplitudes))
    along = amplitudes * (path.response[:, 3 * sample : 3 * sample + 3] @ error) / length
    first = int(np.argmax(np.abs(along)))
    return f"{words}, {spell_cause([*state.amplitudes][first], float(along[first]) / length)}"


def _read_number(text: str) -> float | None:
    """Parse a number sent by the page; None where it is none."""
    try:
        value = float(text[:40])
    except ValueError:
        return None
    return None if math.isnan(value) else value
