"""The playback bar of the drawing of the rotary axes: scrub, play, speed."""

from collections.abc import Mapping

from warpspace.app.browser import html
from warpspace.app.browser.html import EMPTY, button, fill, join, tag
from warpspace.app.drawing.moving import SPEEDS_DEG_S, MovingLayer
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine_bodies import rotary_axes
from warpspace.app.panels.panel import Panel, Refresh
from warpspace.app.state.app_state import AppState
from warpspace.units import MINUS


class PlaybackPanel(Panel):
    """A slider and a play button for each rotary axis that is drawn."""

    name = "playback"
    refresh = Refresh.IMMEDIATE

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        if not picture.is_rotary:
            return {"playback": EMPTY}
        state, stage = picture.state, self.context.stage
        if stage is not None:
            stage.followers[self.name] = self.rerender
        speed = SPEEDS_DEG_S[1] if stage is None else stage.speed_deg_s
        speeds = {f"{at:g}": f"{at:g} °/s" for at in SPEEDS_DEG_S}
        bar = (
            *(_row(state, stage, axis) for axis in rotary_axes(state)),
            html.choice("playback:speed", f"{speed:g}", speeds, label="Speed of rotation"),
            button("Reset", "playback:stop", kind="quiet",
                   hint="Return to the axis positions of the scene"),
        )  # fmt: skip
        return {"playback": tag("div", join(bar))}

    def handle(self, state: AppState, action: str, value: str) -> AppState:
        context, stage = self.context, self.context.stage
        axes = rotary_axes(state)
        if stage is None or not axes:
            return state
        name = action.removeprefix("set.")
        if action == "play":
            axis = value if value in axes else stage.axis or axes[-1]
            on = not (stage.playing and stage.axis == axis)
            context.call_soon(lambda: stage.play(on, axis))
        elif action == "stop":
            context.call_soon(lambda: stage.play(None))
        elif action == "speed" and value in {f"{at:g}" for at in SPEEDS_DEG_S}:
            stage.speed_deg_s = float(value)
        elif action != name and name in axes:
            at = _clamped(state, name, value)
            if at is not None:
                context.call_soon(lambda: stage.scrub(name, at))
        return state


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
        play=button("Pause" if plays else "Play", "playback:play", axis, kind="quiet",
                    aria_label=f"{'Pause' if plays else 'Play'} {axis}", data_key=f"play-{axis}",
                    hint=f"{'Pause' if plays else 'Turn'} {axis} (P)"),
        axis=axis, text=text,
        slider=html.slider(f"playback:set.{axis}", at, low, high, 1.0, label=f"Position of {axis}",
                           text=text),
    )  # fmt: skip
