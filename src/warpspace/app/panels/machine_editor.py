"""The task "Machine": axis positions, error motions of rotary axes, editor, library."""

import math
from dataclasses import replace
from functools import partial

from markupsafe import Markup

from warpspace.analysis.axis_motion import AxisMotion, assemble_motion
from warpspace.app.browser import actions as do
from warpspace.app.browser.html import EMPTY, join, tag
from warpspace.app.browser.templates import Templates
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
from warpspace.machine.definition import BodySource
from warpspace.picture.formatting import spell_at, spell_point
from warpspace.picture.traces import TraceLine, evaluate_axis_motion, motion_lines

HTML = Templates("machine_editor")


class PositionsSection(panel.Section):
    name, task, title = "positions", "machine", "Axis positions"
    sentence = "Rotary axes move the working volume, linear axes the tool point"

    def body(self, picture: LivePicture) -> Markup:
        state = picture.state
        axes, point_mm = standing(state)
        is_open = state.machine.shown and check_meshes(state.scene.machine)
        linear = (f"machine.linear_mm.{axis}" for axis in linear_spans(state.scene))
        paths = (*(f"positions.{axis}" for axis in state.positions), *linear)
        bars = join(panel.setting(state, path, bar=True) for path in paths)
        return HTML.positions(bars, spell_at(axes), spell_point(axes, point_mm), is_open)


# --- Rotary axes: animation, polar plots of one trace, table of all traces ------------------------

MOST_ROWS = 24  # traces in the table


class RotarySection(panel.Section):
    name, task, title = "rotary", "machine", "Rotary axes"
    sentence = "Error motion of traced points during rotation of an axis (ISO 230-7)"

    def body(self, picture: LivePicture) -> Markup:
        state, axis = picture.state, played_axis(picture.state)
        if axis is None:
            return tag("p", "This machine has no rotary axis.", class_="ws-quiet")
        low, high = state.scene.machine.axes[axis].travel
        high = min(high, low + 359.0)  # at most one revolution
        turns = range(math.ceil(low / 90.0), math.floor(high / 90.0) + 1)
        stops = ",".join(str(90 * turn) for turn in turns)
        traces = _traces(picture) if state.shown.traces else EMPTY
        points = leaves(state)["rotary.off"].choices
        return HTML.rotary(axis, state, traces, points, partial(panel.setting, state), stops)


def _traces(picture: LivePicture) -> Markup:
    moved, name = picture.moved_traces, chosen_trace(picture)
    motions = {trace: motion_of(picture, moved[trace]) for trace in [*moved][:MOST_ROWS]}
    chosen = moved.get(name)
    motion = motions[name] if name in motions else chosen and motion_of(picture, chosen)
    plots: list[tuple[str, Markup, str]] = []
    if motion is not None:
        for part in motion.motions:
            chart = motion_lines(part.name, motion, part)
            plot = block_html(replace(chart, title=part.name, note=""))
            plots.append((part.iso, plot, chart.note))
    names = {trace: trace for trace in moved}
    return HTML.traces(name, names, plots, picture.is_rotary, motions)


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


# --- The editor: chain, frames, travels and working volume ----------------------------------------


class EditorSection(panel.Section):
    name, task, title = "editor", "machine", "Edit the machine"
    sentence = "Axes, their order, offsets and travels; or another machine to start from"

    _problem = ""  # of a rejected chain

    def body(self, picture: LivePicture) -> Markup:
        scene = picture.state.scene
        tables = machine_edits.tables_of(scene)
        numbers = {
            quantity: {frame: list(map(spell_typed, row)) for frame, row in table.items()}
            for quantity, table in tables.items()
            if quantity != "mesh"
        }
        guides = {
            axis: machine_edits.guide_errors(picture.state, gantry)
            for axis, gantry in scene.machine.gantries.items()
        }
        bodies = {frame: _source(source) for frame, source in tables["mesh"].items()}
        return HTML.editor(scene, self._problem, numbers, machine_edits.UNITS, guides, bodies)

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
        return HTML.machines(machine_edits.library(), present)

    @panel.on(do.Input.CHOOSE_MACHINE)
    def choose(self, state: AppState, name: str) -> AppState | None:
        scene = machine_edits.library().get(name)
        if scene is None:
            return None
        opened = machine_edits.with_library_scene(state, scene)
        self.context.call_soon(lambda: self.context.scenes.add(opened.origin) and None)
        return self.closed(replace(opened, page=state.page))
