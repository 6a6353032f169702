"""Rotary axes: play, one trace as polar plots, all of them in numbers."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import groupby

from markupsafe import Markup

from warpspace.analysis.axis_motion import AxisMotion
from warpspace.app.browser.html import (
    EMPTY,
    button,
    choice,
    field,
    fill,
    join,
    number,
    switch,
    tag,
    text_box,
)
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.rotation import (
    CircleRow,
    chosen_trace,
    circle_rows,
    motion_of,
    moved_traces,
    played_axis,
)
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import quarters
from warpspace.app.state.tree import leaves, spell, toggled
from warpspace.app.tasks.charts import block_html
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.parts import Section
from warpspace.geometry.traces import Trace
from warpspace.picture.traces import motion_lines, turn_words
from warpspace.units import MINUS, spell_short

NOTHING_MOVED = (
    "No error moves the traced points: all errors of the axes that carry them are zero or"
    " excluded. Set one, for instance a translation error of a rotary axis, and the traces appear."
)
ON_THE_AXIS = "The point lies on the axis: it has no direction that deviations could be taken in."
ABOUT = (
    "Error motion of the axis at the height of the point and in its direction, which turns with it."
    " A tilt or run-out once per turn also results from a tilted or displaced axis average line."
)
KEY = (
    '<p class="ws-key ws-tiny"><span class="ws-s0">actual − nominal</span>'
    '<span class="ws-s1">dashed: about the axis average line</span></p>'
)
HEADS = {
    "radius": ("mm", "Nominal radius of the circle"),
    "radial": ("µm", "Peak to valley of the radial error once centre and radius are fitted"),
    "axial": ("µm", "Peak to valley of the axial error once offset and tilt are fitted"),
    "tilt": ("µrad", "Tilt of the plane of the trace"),
    "centre": ("µm", "Displacement of the centre in the plane of the trace"),
}


class RotarySection(Section):
    """Play, the chosen trace, points and positions, and the table of deviations."""

    name, task, title = "rotary", "machine", "Rotary axes"
    sentence = "See how traced points run while a rotary axis turns (ISO 230-7)"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._listens, self._playing = False, False
        self._position: dict[str, float] = {}

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow all that moves a trace."""
        state = picture.state
        return id(picture.traces), Identity(state), self._playing, bool(self._position)

    def body(self, picture: LivePicture) -> Markup:
        """Write buttons, plots, points and the table."""
        if not self._listens and self.context.stage is not None:
            self._listens = True
            self.context.stage.listen(self._follow)
        state = picture.state
        axis = played_axis(state)
        if axis is None:
            return tag("p", "This machine has no rotary axis.", class_="ws-quiet")
        return join((
            self._buttons(axis), fill('<p data-piece="rotary.angle" class="ws-tiny"></p>'),
            _trace(picture), _points(state),
        ))  # fmt: skip

    def _buttons(self, axis: str) -> Markup:
        play = button("Pause" if self._playing else f"Turn {axis}", "rotary:play",
                      hint="The points run along their circles")  # fmt: skip
        paused = bool(self._position) and not self._playing
        stand = button("Stand here", "rotary:stand",
                       hint="Move the axis to the paused position")  # fmt: skip
        stop = button("Stop", "rotary:stop", hint="Stop and return to the position of the axis")
        moving = (stop, stand) if paused else (stop,) if self._playing else ()
        return tag("div", join((play, *moving)), class_="ws-actions")

    def _follow(self, position: Mapping[str, float]) -> None:
        before, self._position = bool(self._position), dict(position)
        text = ", ".join(f"{axis} = {at:.0f}°" for axis, at in position.items())
        state = self.context.state
        if not self.is_seen(state) or not self.is_open(state):
            return
        self.context.page.put({"rotary.angle": str(tag("span", text.replace("-", MINUS)))})
        if before != bool(position):
            self._playing = self._playing and bool(position)
            self.context.renew(self)

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Play, pause, stop, stand; trace a point, or hold an axis at quarter turns."""
        rotary, axis = state.rotary, played_axis(state)
        what, _, index = word.partition(".")
        if what == "point" and index.isdecimal() and int(index) < len(state.scene.trace_points_mm):
            return toggled(state, "rotary.off", str(int(index)))
        if word == "quarters" and axis is not None:
            return replace(state, rotary=rotary.with_held(axis, quarters(state.scene, axis)))
        if word == "stand":
            for turned, at in self._position.items():
                state = state.with_position(turned, float(round(at)))
        if word in ("play", "stop"):
            self.context.act(lambda: self._play(word))
        return state

    def _play(self, word: str) -> None:
        self._playing = word == "play" and not self._playing
        if self.context.stage is not None:
            self.context.stage.play(self._playing if word == "play" else None)
        self.context.renew(self)


def _trace(picture: LivePicture) -> Markup:
    if not picture.state.shown.traces:
        turn_on = button("Draw the traces", "state:set.shown.traces", "1", kind="main")
        return tag("div", turn_on, class_="ws-actions")
    moved = moved_traces(picture)
    if not moved:
        return tag("p", NOTHING_MOVED, class_="ws-quiet")
    name = chosen_trace(picture, moved)
    path = "state:set.rotary.chosen"
    chosen = field("Trace", choice(path, name, {one: one for one in moved}), path)
    motion = motion_of(picture, moved[name])
    shown = _motion(motion, name) if motion else tag("p", ON_THE_AXIS, class_="ws-quiet")
    table = tag("details", tag("summary", "All traces in numbers") + circles(circle_rows(picture)),
                class_="ws-options")  # fmt: skip
    return chosen + shown + table


def _motion(motion: AxisMotion, name: str) -> Markup:
    plots = join(
        block_html(replace(motion_lines(part.name, motion, part), title=part.name, note=""))
        for part in motion.motions
    )  # fmt: skip
    lines = join(
        fill('<tr><td title="{}">{}</td><td class="number">{}</td><td class="number">{}</td>'
             "<td>{}</td></tr>", part.iso, part.name, f"{part.peak_to_valley:.2f} {part.unit}",
             f"{part.motion_value:.2f} {part.unit}",
             turn_words(part.times_a_turn) if motion.closed else "an arc")
        for part in motion.motions
    )  # fmt: skip
    head = fill('<tr><th></th><th class="number" title="Largest minus smallest deviation">peak to'
                ' valley</th><th class="number" title="{}">about average line</th><th>mostly</th>'
                "</tr>", "Peak to valley once the axis average line is taken out")  # fmt: skip
    return join((
        tag("div", plots, class_="ws-plots", role="group", aria_label=f"Error motion of {name}"),
        fill(KEY),
        tag("table", head + lines), tag("p", ABOUT, class_="ws-tiny"),
    ))  # fmt: skip


def spell_trace(trace: Trace) -> str:
    """Spell what is turned and where the others stand: ``C at B −30°``."""
    held = ", ".join(f"{axis} {spell_short(at)}°" for axis, at in trace.at.items())
    return f"{trace.axis} at {held}" if held else trace.axis


def circles(found: list[CircleRow]) -> Markup:
    """Spell the deviations of circles as a table, one block a point."""
    heads = join(
        fill('<th class="number" title="{}">{}<br>{}</th>', hint, name, unit)
        for name, (unit, hint) in HEADS.items()
    )
    lines = [tag("tr", tag("th", "") + heads)]

    def place(row: CircleRow) -> tuple[str, str]:
        return ", ".join(map(spell_short, row.trace.point_mm)), row.place

    for (own, where), rows in groupby(found, place):
        words = join(("point (", own, ") mm", fill("<br>{}", where) if where else EMPTY))
        lines.append(tag("tr", tag("td", words, colspan=6, class_="ws-quiet")))
        for row in rows:
            one, cells = row.deviation, ["on the axis", *[""] * 4]
            if one is not None:
                cells = [number(one.radius_mm), number(one.radial_um, 2), number(one.axial_um, 2),
                         number(one.tilt_urad), number(one.centre_um, 2)]  # fmt: skip
            values = join(tag("td", cell, class_="number") for cell in cells)
            lines.append(tag("tr", tag("td", spell_trace(row.trace)) + values))
    return tag("table", join(lines))


def _points(state: AppState) -> Markup:
    known, parts = leaves(state), list[Markup]()
    for index, point in enumerate(state.scene.trace_points_mm):
        words = "Trace (" + ", ".join(map(spell_short, point)) + ") mm"
        parts.append(switch(f"rotary:point.{index}", words, on=index not in state.rotary.off))
    held = [f"rotary.held.{axis}" for axis in state.position_spans if len(state.positions) > 1]
    for path in ("rotary.own_mm", *held):
        leaf, name = known[path], f"state:set.{path}"
        box = text_box(name, spell(state, path), placeholder="150, 0, 100" if "own" in path else "")
        parts.append(field(leaf.label, box, name, leaf.unit, leaf.hint))
    if held:
        parts.append(button("Hold at every 90°", "rotary:quarters",
                            hint="Turn the axis at every quarter turn of the table"))  # fmt: skip
    summary = tag("summary", "Traced points and positions")
    return tag("details", summary + join(parts), class_="ws-options")
