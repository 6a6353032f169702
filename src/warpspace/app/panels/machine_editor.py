"""The task Machine: where axes stand, how points run while one turns; the editor; the library."""

import base64
import io
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import starmap

from markupsafe import Markup
from PIL import Image

from warpspace.analysis.axis_motion import AxisMotion, assemble_motion
from warpspace.app.browser.html import (
    EMPTY,
    button,
    choice,
    field,
    fill,
    ident,
    join,
    tag,
    text_box,
)
from warpspace.app.evaluation import machine_edits
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine_bodies import (
    NO_POSITIONS,
    chosen_trace,
    played_axis,
    standing,
)
from warpspace.app.panels.block_html import block_html
from warpspace.app.panels.form_controls import setting
from warpspace.app.panels.panel import Context, Section, Window
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import linear_spans
from warpspace.app.state.tree import leaves
from warpspace.app.state.typed_numbers import spell_typed
from warpspace.bodies.own_meshes import check_meshes
from warpspace.machine.definition import BodySource, Gantry
from warpspace.picture.formatting import spell_at, spell_point
from warpspace.picture.traces import TraceLine, evaluate_axis_motion, motion_lines
from warpspace.scene.machine_library import machine_picture
from warpspace.units import MICROMETRE, MINUS

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
        axis, playing, position = played_axis(state), False, NO_POSITIONS
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


# --- The editor: chain, frames, travels and working volume ----------------------------------------

FIXED = {
    "w": "workpiece, on the last axis of its side",
    "S": "spindle, on the last axis of its side",
    "t": "tool, in the spindle",
}
"""What the frames are that do not move."""
ROWS = {
    "offset": ("Offset", "xyz"),
    "rotation": ("Rotation", "xyz"),
    "travel": ("Travel", ("from", "to")),
    "volume": ("Volume", ("from", "to")),
    "span": ("Guides", ("apart",)),
}
"""Numbers of a frame: label and what each is."""
CHAIN_HINT = (
    "w, axes, F, axes, t: from the workpiece over the frame F to the tool. An axis is a letter of"
    " X Y Z U V W A B C and an optional digit."
)
BODIES = (
    "A mesh of your own (STL, OBJ, PLY, GLB) lies beside the scene file, which names it:"
    ' [bodies] X = "column.stl".'
)
WHOLE = (
    ("Another machine …", "page:open", "machines",
     "Machines of the library, each with its own errors"),
    ("Default dimensions", "editor:do", "sizes",
     "Offsets, travels, directions and working volume that fit the chain"),
    ("Back to the scene's", "editor:do", "own",
     "The machine as it was opened, with the errors of its axes"),
)  # fmt: skip


class EditorSection(Section):
    name, task, title = "editor", "machine", "Edit the machine"
    sentence = "Change axes, their order, places and travels, or start from another machine"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._refused = ("", "")  # chain that was typed, and what is wrong

    def body(self, picture: LivePicture) -> Markup:
        state, name = picture.state, "editor:set.chain"
        chain, tables = state.scene.machine.chain, machine_edits.tables_of(state.scene)
        typed, problem = self._refused if self._refused[1] else (str(chain), "")
        box = text_box(name, typed, aria_invalid=str(bool(problem)).lower())
        whole = (button(*words, hint=hint) for *words, hint in WHOLE)
        return join((
            field("Chain", box, name, hint=CHAIN_HINT),
            tag("p", problem, class_="ws-problem", role="alert") if problem else EMPTY,
            *(_frame(state, tables, frame)
              for frame in ("w", *reversed(chain.workpiece), *chain.tool, "S", "t")),
            _bodies(tables["mesh"]),
            *(tag("p", note, class_="ws-tiny") for note in state.scene.notes),
            tag("div", join(whole), class_="ws-actions"),
        ))  # fmt: skip

    def take(self, state: AppState, word: str, value: str) -> AppState:
        self._refused = ("", "")
        if word == "do":
            return machine_edits.with_word(state, value)
        what = word.removeprefix("set.")
        changed = machine_edits.with_word(state, f"{what} {value}")
        notes = changed.notes[len(state.notes) :]
        if what == "chain" and notes and changed.scene is state.scene:
            self._refused = (
                value[:200],
                "\n".join(notes).removesuffix(f"; {machine_edits.UNCHANGED}"),
            )
            self.context.act(self.renew)
            return state
        return changed


def _frame(state: AppState, tables: machine_edits.Tables, name: str) -> Markup:
    machine = state.scene.machine
    axis, gantry = machine.axes.get(name), machine.gantries.get(name)
    lines = [
        _boxes(
            f"{what} {name}", label, machine_edits.UNITS[what] or unit, tables[what][name], letters
        )
        for what, (label, letters) in ROWS.items()
        if name in tables[what] and (unit := axis.unit if axis else "mm")
    ]
    about = FIXED.get(name, "")
    if axis is not None:
        side, other = "workpiece", "tool"
        if name in machine.chain.tool:
            side, other = other, side
        way = "moves along" if axis.is_linear else "turns about"
        sense = "" if axis.direction == 1 else " against its name"
        about = f"{way} {'xyz'[axis.index]}{sense}, carries the {side}"
        words = {
            "left": "Nearer to the workpiece",
            "right": "Nearer to the tool",
            "side": f"Carry the {other}",
            "turn": "Reverse direction",
            "remove": f"Remove {name}",
        }
        found = [button(said, "editor:do", f"{do} {name}") for do, said in words.items()]
        if axis.is_linear:
            hint, pressed = "A gantry: two guides, each with an error", gantry is not None
            guides = button("Two guides", "editor:do", f"gantry {name}", hint=hint, pressed=pressed)
            found.insert(-1, guides)
        lines += [*_guides(state, gantry), tag("div", join(found), class_="ws-actions")]
    summary = fill("<summary><b>{}</b> {}</summary>", name, about)
    return tag("details", summary + join(lines), class_="ws-frame", data_key=f"frame-{name}")


def _boxes(
    what: str, label: str, unit: str, values: Sequence[float], letters: Sequence[str]
) -> Markup:
    """Give a line of number boxes, each with its letter; `what` is the word that they send."""
    about = what.partition(" ")[2]
    boxes: list[Markup] = []
    for index, (value, letter) in enumerate(zip(values, letters, strict=True)):
        name, words = f"editor:set.{what} {index}", f"{label} of {about}, {letter} in {unit}"
        box = text_box(name, spell_typed(value), label=words, inputmode="decimal")
        boxes.append(fill('<label for="{}">{}</label>{}', ident(name), letter, box))
    head = fill("<span>{} <small>{}</small></span>", label, unit)
    return tag("div", head + join(boxes), class_="ws-numbers-line")


def _guides(state: AppState, gantry: Gantry | None) -> list[Markup]:
    if gantry is None:
        return []
    name, errors = gantry.axis, machine_edits.guide_errors(state, gantry)
    words = (
        f"{gantry.positioning_key} is the mean of the guides, {gantry.rotation_key} follows from"
        " their difference."
    )
    lines: list[Markup] = []
    if errors is None:
        words += " Their curves differ: set both errors in the column at the left."
    else:
        values = [round(value, 9) for value in errors]
        lines.append(_boxes(f"guide {name}", "Each off by", MICROMETRE, values, "12"))
    hint = "Click for the other direction"
    across = button(f"Apart along {gantry.across}", "editor:do", f"across {name}", kind="link",
                    hint=hint)  # fmt: skip
    return [*lines, across, tag("p", words, class_="ws-tiny")]


def _bodies(own: dict[str, BodySource]) -> Markup:
    lines: list[Markup] = []
    for frame, source in own.items():
        remove = button("Remove", "editor:do", f"mesh {frame}", kind="link",
                        aria_label=f"Remove the body of {frame}")  # fmt: skip
        lines.append(tag("p", join((tag("b", frame), " ", _source(source), " ", remove))))
    lines = lines or [tag("p", "All bodies are generated.")]
    summary = tag("summary", "Bodies given by the scene")
    return tag("details", join((summary, *lines, tag("p", BODIES, class_="ws-tiny"))),
               class_="ws-frame", data_key="frame-bodies")  # fmt: skip


def _source(source: BodySource) -> str:
    """Say where a body comes from; of a file its name alone, never its folder."""
    file = f"{source.file} · {source.unit or 'unit of its format'}"
    words = [f"shape {source.shape}" if source.shape else file]
    placed = {"offset {} mm": source.offset_mm, "turned {} °": source.rotation_deg}
    for said, values in placed.items():
        if any(values):
            words.append(said.format(", ".join(map(spell_typed, values))))
    return " · ".join(words)


# --- The machines to start from: a small picture, a title and a chain each ------------------------

WIDTH_PX = 240  # of a small picture: it is shown smaller, sharp on fine screens too


class MachinesDialog(Window):
    name, title = "machines", "Start from a machine"

    def body(self, picture: LivePicture) -> Markup:
        present = picture.state.scene.machine.name
        return tag("div", join(
            tag("button", join((
                fill('<img src="{}" alt="" width="150">', found)
                if (found := small_picture(name)) else tag("i", "no picture"),
                tag("b", scene.machine.title), tag("small", str(scene.machine.chain)),
            )), type="button", data_do="machines:choose", data_value=name,
                aria_current="true" if name == present else None)
            for name, scene in machine_edits.library().items()
        ), class_="ws-gallery", data_list=True)  # fmt: skip

    def take(self, state: AppState, word: str, value: str) -> AppState:
        scene = machine_edits.library().get(value)
        if word != "choose" or scene is None:
            return state
        found = machine_edits.with_library_scene(state, scene)
        self.context.act(lambda: self.context.scenes.add(found.origin) and None)
        return self.closed(replace(found, page=state.page))


@cache
def small_picture(name: str) -> str:
    """Give the picture of a machine of the library as a data address; empty where it has none."""
    path = machine_picture(name)
    if path is None:
        return ""
    with Image.open(path) as picture:
        wide, high = picture.size  # the machine stands at the left, below the title
        box = (wide // 50, high // 6, wide * 11 // 20, high * 7 // 8)
        small = picture.convert("RGB").crop(box)
    small.thumbnail((WIDTH_PX, WIDTH_PX))
    buffer = io.BytesIO()
    small.save(buffer, "JPEG", quality=80)
    return f"data:image/jpeg;base64,{base64.b64encode(buffer.getvalue()).decode()}"
