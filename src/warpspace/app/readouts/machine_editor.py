"""HTML of the machine editor: its boxes, and the machines to start from."""

import base64
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from markupsafe import Markup
from PIL import Image

from warpspace.app.evaluation.machine_edits import MachineType
from warpspace.app.evaluation.scene_edits import own_bodies
from warpspace.app.readouts.html import render
from warpspace.app.state.typed_numbers import spell_typed
from warpspace.machine.description import FIXED_FRAMES, ORIGIN, Axis, BodySource, Gantry, Machine
from warpspace.machine.limits import MAX_TYPED_NUMBER
from warpspace.scene.machines import machine_picture
from warpspace.scene.model import Scene

# --- The boxes of the machine editor as HTML: chain, and per frame all that describes it ----------

Attributes = Callable[[str], Markup]
Guides = tuple[float, float] | None
FIXED = {
    "w": "workpiece, on the last frame of its side",
    "S": "spindle, on the last frame of its side",
    "t": "tool, in the spindle",
}
"""What the frames are that do not move."""
FRAME = "F"


@dataclass(frozen=True, slots=True)
class Numbers:
    """A line of number boxes."""

    label: str
    unit: str
    what: str  # the word that they send, without the number of the box
    values: tuple[str, ...]
    names: tuple[str, ...]  # what each is called for a screen reader


@dataclass(frozen=True, slots=True)
class Row:
    """A frame of the machine."""

    name: str
    about: str
    axis: Axis | None  # none for one that does not move
    carries: str  # "workpiece" or "tool"
    numbers: tuple[Numbers, ...]


def editor_html(
    scene: Scene,
    button: Attributes,
    text_box: Attributes,
    typed: str = "",
    problem: str = "",
    guides: Mapping[str, Guides] | None = None,
) -> str:
    """Spell the editor."""
    chain = scene.machine.chain
    return render(
        "machine_editor",
        chain=typed or str(chain),
        problem=problem,
        links=["w", *reversed(chain.workpiece), FRAME, *chain.tool, "t"],
        axes=scene.machine.axes,
        rows=editor_rows(scene, guides or {}),
        gantries=scene.machine.gantries,
        bodies=[_body(frame, source) for frame, source in own_bodies(scene.machine).items()],
        notes=scene.notes,
        button=button,
        text_box=text_box,
        longest=MAX_TYPED_NUMBER,
    )


def editor_rows(scene: Scene, guides: Mapping[str, Guides] | None = None) -> list[Row]:
    """List the frames in the order of the written chain, the workpiece first."""
    machine, known = scene.machine, guides or {}
    return [
        _fixed(machine, "w", "workpiece"),
        *(_moving(scene, name, "workpiece", known) for name in reversed(machine.chain.workpiece)),
        *(_moving(scene, name, "tool", known) for name in machine.chain.tool),
        *(_fixed(machine, name, "tool") for name in FIXED_FRAMES if name != "w"),
    ]


def _fixed(machine: Machine, name: str, carries: str) -> Row:
    """Describe a frame that does not move."""
    offset = machine.fixed_mm.get(name, ORIGIN)
    turn = machine.fixed_deg.get(name, ORIGIN)
    return Row(name, FIXED[name], None, carries, _placing(name, offset, turn))


def _moving(scene: Scene, name: str, carries: str, guides: Mapping[str, Guides]) -> Row:
    axis, volume = scene.machine.axes[name], scene.workspace.ranges[name]
    way = "moves along" if axis.is_linear else "turns about"
    numbers = (
        *_placing(name, axis.offset_mm, axis.rotation_deg),
        _ends("Travel", "travel", name, axis.travel, axis.unit),
        _ends("Volume", "volume", name, volume, axis.unit),
        *_guides(scene.machine.gantries.get(name), guides.get(name)),
    )
    return Row(name, f"{way} {'xyz'[axis.index]}, carries the {carries}", axis, carries, numbers)


def _guides(gantry: Gantry | None, errors: Guides) -> tuple[Numbers, ...]:
    if gantry is None:
        return ()
    axis = gantry.axis
    names = (f"Distance between the guides of {axis}",)
    span = Numbers("Guides apart", "mm", f"span {axis}", (spell_typed(gantry.span_mm),), names)
    if errors is None:
        return (span,)
    told = tuple(f"Positioning error of the {one} guide of {axis}" for one in ("first", "second"))
    typed = tuple(spell_typed(round(value, 9)) for value in errors)
    return span, Numbers("Each off by", "µm", f"guide {axis}", typed, told)


def _body(frame: str, source: BodySource) -> tuple[str, str]:
    """Say where the body of a frame comes from; of a file its name alone, never its folder."""
    if source.shape:
        return frame, f"shape {source.shape}"
    words = [source.file, source.unit or "unit of its format"]
    for label, values, unit in (
        ("offset", source.offset_mm, "mm"),
        ("turned", source.rotation_deg, "°"),
    ):
        if any(values):
            words.append(f"{label} {', '.join(map(spell_typed, values))} {unit}")
    return frame, " · ".join(words)


def _placing(name: str, offset: tuple[float, ...], turn: tuple[float, ...]) -> tuple[Numbers, ...]:
    return (
        Numbers(
            "Offset",
            "mm",
            f"offset {name}",
            tuple(map(spell_typed, offset)),
            tuple(f"{direction} of the offset of {name}" for direction in "xyz"),
        ),
        Numbers(
            "Rotation",
            "°",
            f"rotation {name}",
            tuple(map(spell_typed, turn)),
            tuple(f"Rotation of {name} about {direction}" for direction in "xyz"),
        ),
    )


def _ends(label: str, what: str, name: str, ends: tuple[float, float], unit: str) -> Numbers:
    words = {"travel": f"the travel of {name}", "volume": f"{name} in the working volume"}
    names = tuple(f"{end} end of {words[what]}" for end in ("Lower", "Upper"))
    return Numbers(label, unit, f"{what} {name}", tuple(map(spell_typed, ends)), names)


# --- The machines to start from as HTML: a small picture, a title and a chain each ----------------

WIDTH_PX = 240  # of a small picture: it is shown smaller, sharp on fine screens too
QUALITY = 80
DRAWING = (0.02, 0.16, 0.6, 0.875)
"""Part of a picture in which the machine is: left, upper, right and lower end."""


def types_html(types: Sequence[MachineType], present: str, button: Callable[[str], Markup]) -> str:
    """Spell the machines to start from."""
    return render(
        "machine_types",
        types=[(entry, small_picture(entry.name)) for entry in types],
        present=present,
        button=button,
    )


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
