"""The machine editor: chain, frames, travels and working volume; and the machines to start from."""

import base64
import io
from dataclasses import replace
from functools import cache

import numpy as np
from markupsafe import Markup
from PIL import Image

from warpspace.app.browser.html import (
    EMPTY,
    button,
    field,
    fill,
    ident,
    join,
    tag,
    text_box,
)
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine_edits import (
    UNCHANGED,
    guide_errors,
    library_scene,
    machine_types,
    with_library_scene,
    with_word,
)
from warpspace.app.evaluation.scene_edits import own_bodies
from warpspace.app.state.app_state import AppState
from warpspace.app.state.typed_numbers import spell_typed
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.parts import Section
from warpspace.app.tasks.window import Window
from warpspace.machine.description import FIXED_FRAMES, ORIGIN, Axis, BodySource, Machine
from warpspace.scene.machines import machine_picture

FIXED = {
    "w": "workpiece, on the last axis of its side",
    "S": "spindle, on the last axis of its side",
    "t": "tool, in the spindle",
}
"""What the frames are that do not move."""
CHAIN = "chain"
CHAIN_HINT = (
    "w, axes, F, axes, t: from the workpiece over the frame F to the tool. An axis is a letter of"
    " X Y Z U V W A B C and an optional digit."
)
BODIES = (
    "A mesh of your own (STL, OBJ, PLY, GLB) lies beside the scene file, which names it:"
    ' [bodies] X = "column.stl".'
)
ENDS = ("from", "to")


class EditorSection(Section):
    """Chain, order, sides, offsets, rotations, travels, directions and working volume."""

    name, task, title = "editor", "machine", "Edit the machine"
    sentence = "Change axes, their order, places and travels, or start from another machine"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._refused: tuple[str, str] | None = None  # chain that was typed, and what is wrong

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow machine, working volume, and the errors of guides."""
        state = picture.state
        return (Identity(state.scene.machine), Identity(state.scene.workspace), self._refused,
                *_guides(state).items())  # fmt: skip

    def body(self, picture: LivePicture) -> Markup:
        """Write the chain, a part to unfold a frame, and what concerns the whole machine."""
        state = picture.state
        machine, name = state.scene.machine, f"editor:set.{CHAIN}"
        typed, problem = self._refused or (str(machine.chain), "")
        box = text_box(name, typed, aria_invalid=str(bool(problem)).lower())
        whole = (
            button("Another machine …", "page:open", MachinesWindow.name,
                   hint="Machines of the library, each with its own errors"),
            button("Default dimensions", "editor:do", "sizes",
                   hint="Offsets, travels, directions and working volume that fit the chain"),
            button("Back to the scene's", "editor:do", "own",
                   hint="The machine as it was opened, with the errors of its axes"),
        )  # fmt: skip
        frames = (
            _fixed(machine, "w"),
            *(_axis(state, axis, "workpiece") for axis in reversed(machine.chain.workpiece)),
            *(_axis(state, axis, "tool") for axis in machine.chain.tool),
            *(_fixed(machine, frame) for frame in FIXED_FRAMES if frame != "w"),
        )
        return join((
            field("Chain", box, name, hint=CHAIN_HINT),
            tag("p", problem, class_="ws-problem", role="alert") if problem else EMPTY,
            *frames, _bodies(machine),
            *(tag("p", note, class_="ws-tiny") for note in state.scene.notes),
            tag("div", join(whole), class_="ws-actions"),
        ))  # fmt: skip

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Change the machine; what cannot be is refused with a note."""
        self._refused = None
        if word == "do":
            return with_word(state, value if " " in value else f"{value} ")
        if not word.startswith("set."):
            return state
        what = word.removeprefix("set.")
        changed = with_word(state, f"{what} {value}")
        notes = changed.notes[len(state.notes) :]
        if what == CHAIN and notes and changed.scene is state.scene:
            problem = "\n".join(notes).removesuffix(f"; {UNCHANGED}")
            self._refused = (value[:200], problem)
            self.context.act(lambda: self.context.renew(self))
            return state
        return changed


def _guides(state: AppState) -> dict[str, tuple[float, float] | None]:
    """Give the errors of the guides of each gantry, µm."""
    return {axis: guide_errors(state, axis) for axis in state.scene.machine.gantries}


def _numbers(
    label: str,
    unit: str,
    what: str,
    values: tuple[float, ...],
    letters: tuple[str, ...],
    about: str,
) -> Markup:
    """Give a line of number boxes, each with its letter; `what` is the word that they send."""
    boxes = join(
        fill('<label for="{id}">{letter}</label>{box}', id=ident(name), letter=letter,
             box=text_box(name, spell_typed(value), label=f"{label} of {about}, {letter} in {unit}",
                          inputmode="decimal"))
        for index, (value, letter) in enumerate(zip(values, letters, strict=True))
        if (name := f"editor:set.{what} {index}")
    )  # fmt: skip
    head = fill("<span>{} <small>{}</small></span>", label, unit)
    return tag("div", head + boxes, class_="ws-numbers-line")


def _placing(name: str, offset: tuple[float, ...], turn: tuple[float, ...]) -> Markup:
    letters = ("x", "y", "z")
    return _numbers("Offset", "mm", f"offset {name}", offset, letters, name) + _numbers(
        "Rotation", "°", f"rotation {name}", turn, letters, name
    )


def _frame(name: str, about: str, body: Markup) -> Markup:
    summary = fill("<summary><b>{}</b> {}</summary>", name, about)
    return tag("details", summary + body, class_="ws-frame", data_key=f"frame-{name}")


def _fixed(machine: Machine, name: str) -> Markup:
    offset, turn = machine.fixed_mm.get(name, ORIGIN), machine.fixed_deg.get(name, ORIGIN)
    return _frame(name, FIXED[name], _placing(name, offset, turn))


def _axis(state: AppState, name: str, carries: str) -> Markup:
    scene = state.scene
    axis, volume = scene.machine.axes[name], scene.workspace.ranges[name]
    way = "moves along" if axis.is_linear else "turns about"
    lines = join((
        _placing(name, axis.offset_mm, axis.rotation_deg),
        _numbers("Travel", axis.unit, f"travel {name}", axis.travel, ENDS, name),
        _numbers("Volume", axis.unit, f"volume {name}", volume, ENDS, name),
        _gantry(state, name),
    ))  # fmt: skip
    return _frame(name, f"{way} {'xyz'[axis.index]}, carries the {carries}",
                  lines + _buttons(axis, carries, name in scene.machine.gantries))  # fmt: skip


def _buttons(axis: Axis, carries: str, has_guides: bool) -> Markup:
    name, other = axis.name, "tool" if carries == "workpiece" else "workpiece"
    sense = "with" if axis.direction == 1 else "against"
    found = [
        button("Nearer to the workpiece", "editor:do", f"left {name}"),
        button("Nearer to the tool", "editor:do", f"right {name}"),
        button(f"Carry the {other}", "editor:do", f"side {name}"),
        button(
            "Reverse direction", "editor:do", f"turn {name}", hint=f"Moves {sense} its name now"
        ),
    ]
    if axis.is_linear:
        found.append(button("Two guides", "editor:do", f"gantry {name}", pressed=has_guides,
                            hint="A gantry: two guides, each with an error"))  # fmt: skip
    found.append(button(f"Remove {name}", "editor:do", f"remove {name}"))
    return tag("div", join(found), class_="ws-actions")


def _gantry(state: AppState, name: str) -> Markup:
    gantry = state.scene.machine.gantries.get(name)
    if gantry is None:
        return EMPTY
    errors = guide_errors(state, name)
    words = (
        f"{gantry.positioning_key} is the mean of the guides, {gantry.rotation_key} follows from"
        " their difference."
    )
    if errors is None:
        words += " Their curves differ: set both errors in the column at the left."
    lines = [_numbers("Guides", "mm", f"span {name}", (gantry.span_mm,), ("apart",), name)]
    if errors is not None:
        rounded = tuple(round(value, 9) for value in errors)
        lines.append(_numbers("Each off by", "µm", f"guide {name}", rounded, ("1", "2"), name))
    lines.append(button(f"Apart along {gantry.across}", "editor:do", f"across {name}", kind="link",
                        hint="Click for the other direction"))  # fmt: skip
    return join((*lines, tag("p", words, class_="ws-tiny")))


def _bodies(machine: Machine) -> Markup:
    lines = [
        tag("p", join((tag("b", frame), " ", _source(source), " ",
                       button("Remove", "editor:do", f"mesh {frame}", kind="link",
                              aria_label=f"Remove the body of {frame}"))))
        for frame, source in own_bodies(machine).items()
    ]  # fmt: skip
    if not lines:
        lines = [tag("p", "All bodies are generated.")]
    summary = tag("summary", "Bodies given by the scene")
    return tag("details", summary + join((*lines, tag("p", BODIES, class_="ws-tiny"))),
               class_="ws-frame", data_key="frame-bodies")  # fmt: skip


def _source(source: BodySource) -> str:
    """Say where a body comes from; of a file its name alone, never its folder."""
    if source.shape:
        return f"shape {source.shape}"
    words = [source.file, source.unit or "unit of its format"]
    placed = (("offset", source.offset_mm, "mm"), ("turned", source.rotation_deg, "°"))
    words += [
        f"{label} {', '.join(map(spell_typed, values))} {unit}"
        for label, values, unit in placed
        if any(values)
    ]
    return " · ".join(words)


# --- The machines to start from: a small picture, a title and a chain each ------------------------

WIDTH_PX = 240  # of a small picture: it is shown smaller, sharp on fine screens too
QUALITY = 80
DRAWING = (0.02, 0.16, 0.55, 0.875)
"""Part of a picture in which the machine is: left, upper, right and lower end."""


class MachinesWindow(Window):
    """The machines of the library."""

    name, title = "machines", "Start from a machine"

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow which machine is shown."""
        return (picture.state.scene.machine.name,)

    def body(self, picture: LivePicture) -> Markup:
        """List them."""
        present = picture.state.scene.machine.name
        return tag("div", join(
            tag("button", join((
                fill('<img src="{}" alt="" width="150">', found)
                if (found := small_picture(entry.name)) else tag("i", "no picture"),
                tag("b", entry.title), tag("small", str(entry.scene.machine.chain)),
            )), type="button", data_do="machines:choose", data_value=entry.name,
                aria_current="true" if entry.name == present else None)
            for entry in machine_types()
        ), class_="ws-gallery", data_list=True)  # fmt: skip

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Start anew with a machine and its own errors."""
        library = library_scene(value) if word == "choose" else None
        if library is None:
            return state
        found = with_library_scene(state, library)
        self.context.act(lambda: self.context.scenes.add(found.origin) and None)
        return self.closed(replace(found, page=state.page))


@cache
def small_picture(name: str) -> str:
    """Give the picture of a machine of the library as a data address; empty where it has none."""
    path = machine_picture(name)
    if path is None:
        return ""
    with Image.open(path) as picture:
        ends = np.array(DRAWING) * np.tile(picture.size, 2)
        small = picture.convert("RGB").crop(tuple(ends.round().astype(int).tolist()))
    small.thumbnail((WIDTH_PX, WIDTH_PX))
    buffer = io.BytesIO()
    small.save(buffer, "JPEG", quality=QUALITY)
    return f"data:image/jpeg;base64,{base64.b64encode(buffer.getvalue()).decode()}"
