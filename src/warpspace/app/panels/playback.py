"""The playback bar of the drawing of the rotary axes: scrub, play, speed."""

from collections.abc import Mapping

import numpy as np
from markupsafe import Markup

from warpspace.app.browser import actions as do
from warpspace.app.browser import html
from warpspace.app.browser.html import EMPTY, button, fill, join, number, tag
from warpspace.app.browser.incoming import index_of
from warpspace.app.drawing.moving import PROGRAM, SPEEDS_DEG_S, MovingLayer
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine_bodies import rotary_axes
from warpspace.app.panels.panel import Panel, Refresh, on
from warpspace.app.state.app_state import AppState
from warpspace.machine.axes import parameter
from warpspace.units import MINUS

MOST_LETTERS = 60  # of a line of the program
MOSTLY = 0.5  # share of an error above which its largest contribution is most of it


def share_words(share: float) -> str:
    return "mostly" if share > MOSTLY else "partly"


class PlaybackPanel(Panel):
    """A slider and a play button for each rotary axis that is drawn."""

    name = "playback"
    refresh = Refresh.IMMEDIATE

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        state, stage = picture.state, self.context.stage
        if not picture.is_rotary and picture.path is None:
            return {"playback": EMPTY}
        if stage is not None:
            stage.followers[self.name] = self.rerender
        speed = SPEEDS_DEG_S[1] if stage is None else stage.speed_deg_s
        middle, rotary = SPEEDS_DEG_S[1], picture.is_rotary
        speeds = {f"{s:g}": f"{s:g} °/s" if rotary else f"{s / middle:.1g} ×" for s in SPEEDS_DEG_S}
        bar = (
            *((_row(state, stage, axis) for axis in rotary_axes(state)) if picture.is_rotary
              else (_program(picture, stage),)),
            html.choice(do.Input.SET_SPEED(), f"{speed:g}", speeds, label="Speed"),
            button("Reset", do.Signal.STOP_PLAYBACK, kind="quiet",
                   hint="Return to the axis positions of the scene"),
        )  # fmt: skip
        return {"playback": tag("div", join(bar))}

    @on(do.Input.PLAY)
    def play(self, state: AppState, axis: str) -> None:
        stage, axes = self.context.stage, _played(state)
        if stage is not None:
            axis = next((a for a in (axis, stage.axis) if a in axes), axes[-1])
            plays = not (stage.playing and stage.axis == axis)
            self.context.call_soon(lambda: stage.play(plays, axis))

    @on(do.Signal.STOP_PLAYBACK)
    def stop(self, state: AppState) -> None:
        if (stage := self.context.stage) is not None:
            self.context.call_soon(lambda: stage.play(None))

    @on(do.Input.SET_SPEED)
    def set_speed(self, state: AppState, speed: str) -> None:
        speeds = {f"{at:g}": at for at in SPEEDS_DEG_S}
        if self.context.stage is not None and speed in speeds:
            self.context.stage.speed_deg_s = speeds[speed]

    @on(do.Scrub)
    def scrub(self, state: AppState, action: do.Scrub) -> None:
        stage, axis = self.context.stage, action.axis
        if stage is None or axis not in _played(state):
            return
        if axis == PROGRAM:
            path = self.context.picture and self.context.picture.path
            sample = index_of(action.value, len(path.error_um)) if path else None
            if sample is not None:
                self.context.call_soon(lambda: stage.scrub_program(sample))
        elif (at := _clamped(state, axis, action.value)) is not None:
            self.context.call_soon(lambda: stage.scrub(axis, at))

    @on(do.Signal.SHOW_WORST_BLOCK)
    def show_worst(self, state: AppState) -> None:
        stage, path = self.context.stage, self.context.picture and self.context.picture.path
        if stage is not None and path and PROGRAM in _played(state):
            worst = int(np.argmax(np.linalg.norm(path.error_um, axis=1)))
            self.context.call_soon(lambda: stage.play(False))
            self.context.call_soon(lambda: stage.scrub_program(worst))


def _played(state: AppState) -> tuple[str, ...]:
    return rotary_axes(state) if state.shows_rotary else (PROGRAM,)


def _program(picture: LivePicture, stage: MovingLayer | None) -> Markup:
    """Render the slider of the program, with line, error and its main cause."""
    path = picture.path
    assert path is not None  # noqa: S101 - checked by the panel
    sample = 0 if stage is None or stage.sample is None else int(stage.sample)
    sample = min(sample, len(path.error_um) - 1)
    plays = stage is not None and stage.playing and stage.axis == PROGRAM
    line, text = int(path.of.line[sample]), (picture.state.part.program or "").splitlines()
    code = text[line - 1][:MOST_LETTERS] if 0 < line <= len(text) else ""
    words = f"line {line}"
    return fill(
        '<div class="ws-turn">{play}<b>Program</b>{slider}<span>{words}</span>{worst}</div>'
        '<div class="ws-line"><code>{code}</code> {error}</div>',
        play=button("Pause" if plays else "Play", do.Input.PLAY(PROGRAM), kind="quiet",
                    aria_label=f"{'Pause' if plays else 'Play'} the program",
                    data_key="play-program", hint="Move the machine along the path (P)"),
        slider=html.slider(do.Scrub(PROGRAM), sample, 0, len(path.error_um) - 1, 1.0,
                           label="Position in the program", text=words),
        words=words, code=code, error=_error_words(picture, sample),
        worst=button("Worst", do.Signal.SHOW_WORST_BLOCK, kind="quiet",
                     hint="Go to the largest error"),
    )  # fmt: skip


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
    cause = parameter([*state.amplitudes][first]).cause
    return f"{words}, {share_words(float(along[first]) / length)} because {cause}"


def _clamped(state: AppState, axis: str, value: str) -> float | None:
    """Read a position sent by the page, degrees, within the travel; None where it is no number."""
    low, high = state.scene.machine.axes[axis].travel
    try:
        at = float(value[:40])
    except ValueError:
        return None
    return min(max(at, low), high) if at == at else None  # noqa: PLR0124 - not a number


def _row(state: AppState, stage: MovingLayer | None, axis: str) -> str:
    low, high = state.scene.machine.axes[axis].travel
    at = state.positions.get(axis, 0.0)
    if stage is not None:
        at = stage.position.get(axis, at)
    plays = stage is not None and stage.playing and stage.axis == axis
    text = f"{at:.0f}°".replace("-", MINUS)
    return fill(
        '<div class="ws-turn">{play}<b>{axis}</b>{slider}<span>{text}</span></div>',
        play=button("Pause" if plays else "Play", do.Input.PLAY(axis), kind="quiet",
                    aria_label=f"{'Pause' if plays else 'Play'} {axis}", data_key=f"play-{axis}",
                    hint=f"{'Pause' if plays else 'Turn'} {axis} (P)"),
        axis=axis, text=text,
        slider=html.slider(do.Scrub(axis), at, low, high, 1.0, label=f"Position of {axis}",
                           text=text),
    )  # fmt: skip
