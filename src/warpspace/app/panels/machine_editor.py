"""The task "Machine": axis positions, error motions of rotary axes, editor, library."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import starmap

from markupsafe import Markup

from warpspace.analysis.axis_motion import AxisMotion, assemble_motion
from warpspace.app.browser import actions as do
from warpspace.app.browser import html
from warpspace.app.browser.html import EMPTY, button, fill, join, tag, text_box
from warpspace.app.evaluation import machine_edits
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine_bodies import chosen_trace, played_axis, standing
from warpspace.app.panels import panel
from warpspace.app.panels.block_html import block_html
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import linear_spans
from warpspace.app.state.tree import leaves
from warpspace.app.state.typed_numbers import spell_typed
from warpspace.bodies.mesh_files import check_meshes
from warpspace.machine.definition import BodySource, Gantry
from warpspace.picture.formatting import spell_at, spell_point
from warpspace.picture.traces import TraceLine, evaluate_axis_motion, motion_lines
from warpspace.units import MICROMETRE

OPEN_MESH = "A mesh of this machine is not watertight; it is drawn unchanged."


class PositionsSection(panel.Section):
    name, task, title = "positions", "machine", "Axis positions"
    sentence = "Rotary axes move the working volume, linear axes the tool point"

    def body(self, picture: LivePicture) -> Markup:
        state = picture.state
        axes, point_mm = standing(state)
        copied = button("Copy", None, kind="link", hint="Copy the positions",
                        data_copy=spell_at(axes))  # fmt: skip
        position = join(("Tool point: ", spell_point(axes, point_mm), " ", copied))
        is_open = state.machine.shown and check_meshes(state.scene.machine)
        linear = (f"machine.linear_mm.{axis}" for axis in linear_spans(state.scene))
        paths = (*(f"positions.{axis}" for axis in state.positions), *linear)
        bars = [panel.setting(state, path, bar=True) for path in paths]
        lines = (position, OPEN_MESH) if is_open else (position,)
        return join((*bars, *(panel.tiny(line) for line in lines)))


# --- Rotary axes: animation, polar plots of one trace, table of all traces ------------------------

NOTHING_MOVED = (
    "No error moves the traced points: all errors of the axes that carry them are zero or"
    " excluded. Set one, for example a translation error of a rotary axis."
)
ON_THE_AXIS = "The point lies on the axis of rotation; its radial direction is undefined."
ABOUT = (
    "Error motion at the axial position of the point, in the radial direction of the point, which"
    " rotates with the axis: peak-to-valley value, and value about the axis average line. A"
    " once-per-revolution component also results from a displaced or inclined axis average line."
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
    "Displacement at the axial position of the point and inclination of the axis average line;"
    " error motions: peak to valley / about that line."
)
MOST_ROWS = 24  # traces in the table


class RotarySection(panel.Section):
    name, task, title = "rotary", "machine", "Rotary axes"
    sentence = "Error motion of traced points during rotation of an axis (ISO 230-7)"

    def body(self, picture: LivePicture) -> Markup:
        state, axis = picture.state, played_axis(picture.state)
        if axis is None:
            return panel.quiet("This machine has no rotary axis.")
        play = button(f"Play {axis}", do.Input.PLAY(axis), hint="Animate the traced points (P)")
        return join((panel.actions(play), _trace(picture), _points(state, axis)))


def _trace(picture: LivePicture) -> Markup:
    if not picture.state.shown.traces:
        return panel.actions(button("Show traces", do.SetLeaf("shown.traces", "1"), kind="main"))
    moved = picture.moved_traces
    if not moved:
        return panel.quiet(NOTHING_MOVED)
    name, path = chosen_trace(picture), do.SetLeaf("rotary.chosen")
    chosen = html.field("Trace", html.choice(path, name, {trace: trace for trace in moved}), path)
    motions = {trace: motion_of(picture, moved[trace]) for trace in [*moved][:MOST_ROWS]}
    motion = motions[name] if name in motions else motion_of(picture, moved[name])
    motion_plots = (
        _motion(motion, name, large=picture.is_rotary) if motion else panel.quiet(ON_THE_AXIS)
    )
    head = join(fill("<th>{} <small>{}</small></th>", *heading) for heading in HEADS.items())
    table = tag("table", tag("tr", head) + join(starmap(_numbers, motions.items())))
    return chosen + motion_plots + panel.details("Table of all traces", panel.tiny(AVERAGE), table)


def _numbers(name: str, motion: AxisMotion | None) -> Markup:
    cells = ["on the axis"]
    if motion is not None:
        axis = (f"{part.once_a_turn:.2f}" for part in (motion.radial, motion.tilt))
        pairs = (f"{part.peak_to_valley:.2f} /\u00a0{part.motion_value:.2f}"
                 for part in motion.motions)  # fmt: skip
        cells = [f"{motion.radius_mm:.1f}", *axis, *pairs]
    line = f'<tr><td colspan="{len(HEADS)}" class="ws-quiet">{{}}</td></tr>'
    return fill(line, name) + tag("tr", join(tag("td", cell) for cell in cells))


def motion_of(picture: LivePicture, line: TraceLine) -> AxisMotion | None:
    """Evaluate the error motion of the axis of a trace, with the active errors."""
    if picture.compared is None or not picture.is_difference:
        return _of_state(picture.drawn_state, line)
    motion_a, motion_b = (_of_state(side, line) for side in picture.compared.sides)
    if motion_a is None or motion_b is None:
        return None
    radial, axial, tilt = (
        b.values - a.values for a, b in zip(motion_a.motions, motion_b.motions, strict=True)
    )
    turn = motion_b.angle_deg, motion_b.radius_mm
    return assemble_motion(*turn, (radial, axial, tilt), closed=motion_b.closed)


def _of_state(state: AppState, line: TraceLine) -> AxisMotion | None:
    points = (line.trace.point_mm,)
    return evaluate_axis_motion(replace(state.active_scene(), trace_points_mm=points), line)


def _motion(motion: AxisMotion, name: str, *, large: bool) -> Markup:
    plots, notes = list[Markup](), list[Markup]()
    for part in motion.motions:
        chart = motion_lines(part.name, motion, part)
        plots.append(block_html(replace(chart, title=part.name, note="")))
        notes.append(panel.tiny(f"{part.iso}: {chart.note}."))
    label = f"Error motion of {name}"
    kind = "ws-plots large" if large else "ws-plots"
    drawn = tag("div", join(plots), class_=kind, role="group", aria_label=label)
    return join((drawn, fill(KEY), *notes, panel.tiny(ABOUT)))


def _points(state: AppState, played: str) -> Markup:
    traced: list[Markup] = []
    for index, name in leaves(state)["rotary.off"].choices.items():
        on = index not in state.rotary.off
        change = do.SetLeaf("rotary.off", f"{'+' if on else '-'}{index}")
        traced.append(button(f"Trace {name}", change, pressed=on))
    parts = [panel.actions(*traced), panel.setting(state, "rotary.own_mm")]
    if len(state.positions) > 1:
        parts += [panel.setting(state, f"rotary.held.{axis}") for axis in state.position_spans]
        low, high = state.scene.machine.axes[played].travel
        high = min(high, low + 359.0)  # at most one revolution
        turns = range(math.ceil(low / 90.0), math.floor(high / 90.0) + 1)
        positions, hint = ",".join(str(90 * turn) for turn in turns), "While the other axis rotates"
        hold = do.SetLeaf(f"rotary.held.{played}", positions)
        parts.append(button(f"Hold {played} at every 90°", hold, hint=hint))
    return panel.details("Traced points and positions", *parts)


# --- The editor: chain, frames, travels and working volume ----------------------------------------

FIXED = {
    "w": "workpiece, on the last axis of the workpiece branch",
    "S": "spindle, on the last axis of the tool branch",
    "t": "tool, in the spindle",
}
"""Descriptions of frames that are no axes."""
ROWS = {
    "offset": ("Offset", "xyz"),
    "rotation": ("Rotation", "xyz"),
    "travel": ("Travel", ("from", "to")),
    "volume": ("Volume", ("from", "to")),
    "span": ("Guides", ("distance",)),
}
"""Numbers of a frame: label, and label of each number."""
CHAIN_HINT = (
    "w, axes, F, axes, t: from the workpiece via the frame F to the tool. An axis is one of the"
    " letters X Y Z U V W A B C with an optional digit."
)
BODIES = (
    "To use a custom mesh (STL, OBJ, PLY, GLB), put it beside the scene file and refer to it there:"
    ' [bodies] X = "column.stl".'
)
MACHINE_BUTTONS = (
    ("Another machine …", do.Input.OPEN_DIALOG("machines"),
     "Library machines with their errors"),
    ("Default dimensions", do.EditMachine("sizes"),
     "Default offsets, travels, directions and working volume for this chain"),
    ("Reset to the scene", do.EditMachine("own"),
     "The machine as opened, with the errors of its axes"),
)  # fmt: skip


class EditorSection(panel.Section):
    name, task, title = "editor", "machine", "Edit the machine"
    sentence = "Axes, their order, offsets and travels; or another machine to start from"

    _problem = ""  # of a rejected chain

    def body(self, picture: LivePicture) -> Markup:
        state, name = picture.state, do.EditMachine("chain")
        chain, tables = state.scene.machine.chain, machine_edits.tables_of(state.scene)
        box = text_box(name, str(chain))
        machine_buttons = (
            button(label, action, hint=hint) for label, action, hint in MACHINE_BUTTONS
        )
        return join((
            html.field("Chain", box, name, hint=CHAIN_HINT),
            panel.alert(self._problem) if self._problem else EMPTY,
            *(_frame(state, tables, frame)
              for frame in ("w", *reversed(chain.workpiece), *chain.tool, "S", "t")),
            _bodies(tables["mesh"]),
            *(panel.tiny(note) for note in state.scene.notes),
            panel.actions(*machine_buttons),
        ))  # fmt: skip

    @panel.on(do.EditMachine)
    def edit(self, state: AppState, action: do.EditMachine) -> AppState:
        self._problem = ""
        word = action.edit if action.value is None else f"{action.edit} {action.value}"
        changed = machine_edits.with_word(state, word)
        notes = changed.notes[len(state.notes) :]
        if action.edit == "chain" and notes and changed.scene is state.scene:
            self._problem = "\n".join(notes)
            self.context.call_soon(self.rerender)
            return state
        return changed


def _frame(state: AppState, tables: machine_edits.Tables, name: str) -> Markup:
    machine = state.scene.machine
    axis, gantry = machine.axes.get(name), machine.gantries.get(name)
    lines: list[Markup] = []
    for quantity, (label, letters) in ROWS.items():
        if name in tables[quantity]:
            unit = machine_edits.UNITS[quantity] or (axis.unit if axis else "mm")
            lines.append(_boxes(f"{quantity} {name}", label, unit, tables[quantity][name], letters))
    about = FIXED.get(name, "")
    if axis is not None:
        side, other = "workpiece", "tool"
        if name in machine.chain.tool:
            side, other = other, side
        motion = "moves along" if axis.is_linear else "rotates about"
        sense = "" if axis.direction == 1 else " (reversed)"
        about = f"{motion} {'xyz'[axis.index]}{sense}, carries the {side}"
        labels = {
            "left": "Move towards workpiece",
            "right": "Move towards tool",
            "side": f"Move to {other} side",
            "turn": "Reverse direction",
            "remove": f"Remove {name}",
        }
        buttons = [button(text, do.EditMachine(f"{command} {name}"))
                   for command, text in labels.items()]  # fmt: skip
        if axis.is_linear:
            hint, pressed = "Gantry: two guides with independent errors", gantry is not None
            guides = button(
                "Two guides", do.EditMachine(f"gantry {name}"), hint=hint, pressed=pressed
            )
            buttons.insert(-1, guides)
        lines += [*_guides(state, gantry), panel.actions(*buttons)]
    heading = fill("<b>{}</b> {}", name, about)
    return panel.details(heading, *lines, kind="frame", data_key=f"frame-{name}")


def _boxes(
    command: str, label: str, unit: str, values: Sequence[float], letters: Sequence[str]
) -> Markup:
    frame = command.partition(" ")[2]
    boxes: list[Markup] = []
    for index, (value, letter) in enumerate(zip(values, letters, strict=True)):
        name = do.EditMachine(f"{command} {index}")
        description = f"{label} of {frame}, {letter} in {unit}"
        box = text_box(name, spell_typed(value), label=description, inputmode="decimal")
        boxes.append(fill('<label for="{}">{}</label>{}', html.ident(name), letter, box))
    head = fill("<span>{} <small>{}</small></span>", label, unit)
    return tag("div", head + join(boxes), class_="ws-numbers-line")


def _guides(state: AppState, gantry: Gantry | None) -> list[Markup]:
    if gantry is None:
        return []
    name, errors = gantry.axis, machine_edits.guide_errors(state, gantry)
    note = (
        f"{gantry.positioning_key} is the mean of the guide errors, {gantry.rotation_key} results"
        " from their difference."
    )
    lines: list[Markup] = []
    if errors is None:
        note += " Their curves differ: edit both errors in the error list."
    else:
        values = [round(value, 9) for value in errors]
        lines.append(_boxes(f"guide {name}", "Error of each guide", MICROMETRE, values, "12"))
    across = button(f"Spaced along {gantry.across}", do.EditMachine(f"across {name}"), kind="link",
                    hint="Click to change the direction")  # fmt: skip
    return [*lines, across, panel.tiny(note)]


def _bodies(bodies: dict[str, BodySource]) -> Markup:
    lines: list[Markup] = []
    for frame, source in bodies.items():
        remove = button("Remove", do.EditMachine(f"mesh {frame}"), kind="link",
                        aria_label=f"Remove the body of {frame}")  # fmt: skip
        lines.append(tag("p", join((tag("b", frame), " ", _source(source), " ", remove))))
    lines = [*(lines or [tag("p", "All bodies are generated automatically.")]), panel.tiny(BODIES)]
    return panel.details(
        "Bodies defined by the scene", *lines, kind="frame", data_key="frame-bodies"
    )


def _source(source: BodySource) -> str:
    """Format the source of a body; of a file only the name, never its folder."""
    file = f"{source.file} · {source.unit or 'unit of its format'}"
    parts = [f"shape {source.shape}" if source.shape else file]
    placed = {"offset {} mm": source.offset_mm, "rotated {} °": source.rotation_deg}
    for template, values in placed.items():
        if any(values):
            parts.append(template.format(", ".join(map(spell_typed, values))))
    return " · ".join(parts)


# --- The library: thumbnail, title and chain of each machine --------------------------------------


class MachinesDialog(panel.Dialog):
    name, title = "machines", "Start from a machine"

    def body(self, picture: LivePicture) -> Markup:
        present = picture.state.scene.machine.name
        return tag("div", join(
            tag("button", join((
                html.thumbnail(scene.name), tag("b", scene.machine.title),
                tag("small", str(scene.machine.chain)),
            )), type="button", data_do=do.Input.CHOOSE_MACHINE(name),
                aria_current="true" if name == present else None)
            for name, scene in machine_edits.library().items()
        ), class_="ws-gallery", data_list=True)  # fmt: skip

    @panel.on(do.Input.CHOOSE_MACHINE)
    def choose(self, state: AppState, name: str) -> AppState | None:
        scene = machine_edits.library().get(name)
        if scene is None:
            return None
        opened = machine_edits.with_library_scene(state, scene)
        self.context.call_soon(lambda: self.context.scenes.add(opened.origin) and None)
        return self.closed(replace(opened, page=state.page))
