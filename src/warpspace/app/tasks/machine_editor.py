"""The machine editor: chain, frames, travels and working volume; and the machines to start from."""

import base64
import io
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

from markupsafe import Markup
from PIL import Image

from warpspace.app.browser.html import EMPTY, button, field, fill, ident, join, tag, text_box
from warpspace.app.evaluation import machine_edits
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.state.typed_numbers import spell_typed
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.parts import Section, Window
from warpspace.machine.description import BodySource, Gantry
from warpspace.scene.machines import machine_picture
from warpspace.units import MICROMETRE

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
        _numbers(
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


def _numbers(
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
        lines.append(_numbers(f"guide {name}", "Each off by", MICROMETRE, values, "12"))
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


class MachinesWindow(Window):
    """The machines of the library."""

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
