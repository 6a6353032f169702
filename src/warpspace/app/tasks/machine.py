"""The task Machine: where the axes stand, and how points run while a rotary axis turns."""

import math
from dataclasses import replace
from itertools import starmap

from markupsafe import Markup

from warpspace.analysis.axis_motion import AxisMotion, assemble_motion
from warpspace.app.browser.html import button, choice, field, fill, join, tag
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine import HERE, chosen_trace, played_axis, standing
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import linear_spans
from warpspace.app.state.tree import leaves
from warpspace.app.tasks.charts import block_html
from warpspace.app.tasks.forms import setting
from warpspace.app.tasks.parts import Section
from warpspace.bodies.own_meshes import check_meshes
from warpspace.picture.traces import TraceLine, evaluate_axis_motion, motion_lines
from warpspace.picture.words import spell_at, spell_point
from warpspace.units import MINUS

OPEN_MESH = "The surface of a mesh of this machine is not closed; it is drawn as it is."


class PositionsSection(Section):
    name, task, title = "positions", "machine", "Axis positions"
    sentence = "Move the axes: rotary axes carry the working volume, linear ones the tool point"

    def body(self, picture: LivePicture) -> Markup:
        state = picture.state
        axes, point_mm = standing(state)
        copied = button("Copy", "positions:none", kind="link", hint="Copy the positions",
                        data_copy=spell_at(axes))  # fmt: skip
        words = join(("Tool point: ", spell_point(axes, point_mm), " ", copied))
        is_open = state.machine.shown and check_meshes(state.scene.machine)
        linear = (f"machine.linear_mm.{axis}" for axis in linear_spans(state.scene))
        paths = (*(f"positions.{axis}" for axis in state.positions), *linear)
        bars = [setting(state, path, bar=True) for path in paths]
        said = (words, OPEN_MESH) if is_open else (words,)
        return join((*bars, *(tag("p", one, class_="ws-tiny") for one in said)))


# --- Rotary axes: play, one trace as polar plots, all of them in numbers --------------------------

NOTHING_MOVED = (
    "No error moves the traced points: all errors of the axes that carry them are zero or"
    " excluded. Set one, for instance a translation error of a rotary axis, and the traces appear."
)
ON_THE_AXIS = "The point lies on the axis: it has no direction that deviations could be taken in."
ABOUT = (
    "Error motion of the axis at the height of the point and in its direction, which turns with it:"
    " peak to valley, and about the axis average line. A tilt or run-out once per turn also results"
    " from a tilted or displaced axis average line."
)
KEY = (
    '<p class="ws-key ws-tiny"><span class="ws-s0">actual − nominal</span>'
    '<span class="ws-s1">dashed: about the axis average line</span></p>'
)
HEADS = {
    "radius": "mm",
    "displaced": "µm",
    "inclined": "µrad",
    "radial": "µm",
    "axial": "µm",
    "tilt": "µrad",
}
AVERAGE = (
    "By how much the axis average line is displaced at the height of the point and inclined; error"
    " motions peak to valley / about that line."
)
MOST_ROWS = 24  # traces in the table


class RotarySection(Section):
    name, task, title = "rotary", "machine", "Rotary axes"
    sentence = "See how traced points run while a rotary axis turns (ISO 230-7)"

    def body(self, picture: LivePicture) -> Markup:
        state, stage = picture.state, self.context.stage
        axis, playing, position = played_axis(state), False, HERE
        if axis is None:
            return tag("p", "This machine has no rotary axis.", class_="ws-quiet")
        if stage is not None:
            stage.moved = self._follow
            playing, position = stage.playing, stage.position
        buttons = [button("Pause" if playing else f"Turn {axis}", "rotary:play",
                          hint="The points run along their circles")]  # fmt: skip
        if playing or position:
            hint = "Stop and return to the position of the axis"
            buttons.append(button("Stop", "rotary:stop", hint=hint))
        if position and not playing:
            hint, path = "Move the axis to the paused position", f"state:set.positions.{axis}"
            buttons.append(button("Stand here", path, round(position[axis]), hint=hint))
        return join((
            tag("div", join(buttons), class_="ws-actions"),
            fill('<p data-piece="rotary.angle" class="ws-tiny"></p>'),
            _trace(picture), _points(state, axis),
        ))  # fmt: skip

    def _follow(self) -> None:
        state, stage = self.context.state, self.context.stage
        if stage is not None and self.is_seen(state) and self.is_open(state):
            text = ", ".join(f"{axis} = {at:.0f}°" for axis, at in stage.position.items())
            self.context.page.put({"rotary.angle": str(tag("span", text.replace("-", MINUS)))})

    def take(self, state: AppState, word: str, value: str) -> AppState:
        stage = self.context.stage
        if word in ("play", "stop") and stage is not None:
            on = None if word == "stop" else not stage.playing
            self.context.act(lambda: stage.play(on))
            self.context.act(self.renew)
        return state


def _trace(picture: LivePicture) -> Markup:
    if not picture.state.shown.traces:
        turn_on = button("Draw the traces", "state:set.shown.traces", "1", kind="main")
        return tag("div", turn_on, class_="ws-actions")
    moved = picture.moved_traces
    if not moved:
        return tag("p", NOTHING_MOVED, class_="ws-quiet")
    name, path = chosen_trace(picture), "state:set.rotary.chosen"
    chosen = field("Trace", choice(path, name, {one: one for one in moved}), path)
    motions = {one: motion_of(picture, moved[one]) for one in [*moved][:MOST_ROWS]}
    motion = motions[name] if name in motions else motion_of(picture, moved[name])
    shown = _motion(motion, name) if motion else tag("p", ON_THE_AXIS, class_="ws-quiet")
    head = join(fill("<th>{} <small>{}</small></th>", *one) for one in HEADS.items())
    table = tag("table", tag("tr", head) + join(starmap(_numbers, motions.items())))
    parts = tag("summary", "All traces in numbers") + tag("p", AVERAGE, class_="ws-tiny") + table
    return chosen + shown + tag("details", parts, class_="ws-options")


def _numbers(name: str, motion: AxisMotion | None) -> Markup:
    cells = ["on the axis"]
    if motion is not None:
        axis = (f"{one.once_a_turn:.2f}" for one in (motion.radial, motion.tilt))
        pairs = (
            f"{one.peak_to_valley:.2f} /\u00a0{one.motion_value:.2f}" for one in motion.motions
        )
        cells = [f"{motion.radius_mm:.1f}", *axis, *pairs]
    line = f'<tr><td colspan="{len(HEADS)}" class="ws-quiet">{{}}</td></tr>'
    return fill(line, name) + tag("tr", join(tag("td", cell) for cell in cells))


def motion_of(picture: LivePicture, line: TraceLine) -> AxisMotion | None:
    """Evaluate how the axis of a trace runs, with the errors that take part."""
    if picture.compared is None or not picture.is_difference:
        return _of_state(picture.drawn_state, line)
    one, other = (_of_state(side, line) for side in picture.compared.sides)
    if one is None or other is None:
        return None
    radial, axial, tilt = (
        b.values - a.values for a, b in zip(one.motions, other.motions, strict=True)
    )
    turn = other.angle_deg, other.radius_mm
    return assemble_motion(*turn, (radial, axial, tilt), closed=other.closed)


def _of_state(state: AppState, line: TraceLine) -> AxisMotion | None:
    points = (line.trace.point_mm,)
    return evaluate_axis_motion(replace(state.active_scene(), trace_points_mm=points), line)


def _motion(motion: AxisMotion, name: str) -> Markup:
    plots, said = list[Markup](), list[Markup]()
    for part in motion.motions:
        chart = motion_lines(part.name, motion, part)
        plots.append(block_html(replace(chart, title=part.name, note="")))
        said.append(tag("p", f"{part.iso}: {chart.note}.", class_="ws-tiny"))
    label = f"Error motion of {name}"
    drawn = tag("div", join(plots), class_="ws-plots", role="group", aria_label=label)
    return join((drawn, fill(KEY), *said, tag("p", ABOUT, class_="ws-tiny")))


def _points(state: AppState, played: str) -> Markup:
    traced: list[Markup] = []
    for index, words in leaves(state)["rotary.off"].choices.items():
        on = index not in state.rotary.off
        change = f"{'+' if on else '-'}{index}"
        traced.append(button(f"Trace {words}", "state:set.rotary.off", change, pressed=on))
    parts = [tag("div", join(traced), class_="ws-actions"), setting(state, "rotary.own_mm")]
    if len(state.positions) > 1:
        parts += [setting(state, f"rotary.held.{axis}") for axis in state.position_spans]
        low, high = state.scene.machine.axes[played].travel
        high = min(high, low + 359.0)  # a full turn once
        turns = range(math.ceil(low / 90.0), math.floor(high / 90.0) + 1)
        every, hint = ",".join(str(90 * turn) for turn in turns), "While the other axis turns"
        path = f"state:set.rotary.held.{played}"
        parts.append(button(f"Hold {played} at every 90°", path, every, hint=hint))
    summary = tag("summary", "Traced points and positions")
    return tag("details", summary + join(parts), class_="ws-options")
