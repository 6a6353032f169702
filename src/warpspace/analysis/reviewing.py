"""Review notes held against their scene: what their numbers are now, and a table of them."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from warpspace.analysis.blocks import Column, Table
from warpspace.analysis.statistics import volume_statistics
from warpspace.exceptions import WarpspaceError
from warpspace.field.grid import DEFAULT_NODES, build_grid
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import PARAMETERS, parameter
from warpspace.scene.model import Scene, evaluate, evaluate_grid
from warpspace.scene.notes import TOLERANCES, Note, told
from warpspace.units import spell_short

Numbers = Mapping[str, float]


def note_numbers(scene: Scene, notes: Iterable[Note]) -> list[Numbers]:
    """Give what the numbers of notes are now, µm, by their keys; empty where there are none.

    They are those of the scene's own evaluation: mean and max over the working volume where the
    rotary axes stand as in the note, and the length of the error at its point.
    """
    volumes: dict[object, Numbers] = {}
    found: list[Numbers] = []
    for note in notes:
        still = {q: at for q, at in note.at.items() if q not in scene.workspace.volume_axes}
        key = note.loop, tuple(sorted(still.items()))
        try:
            if key not in volumes:
                volumes[key] = _of_volume(scene, note.loop, still)
            found.append({**volumes[key], **_here(scene, note)})
        except WarpspaceError:  # its axes are no longer there
            found.append({})
    return found


def _of_volume(scene: Scene, loop: str, still: Mapping[str, float]) -> Numbers:
    moved = replace(scene, workspace=scene.workspace.moved(still)) if still else scene
    grid = build_grid(moved.model, moved.workspace, DEFAULT_NODES)
    found = volume_statistics(evaluate_grid(moved, grid, moved.view(Loop(loop))), grid)
    return {"mean_um": _printed(found.mean_um), "max_um": _printed(found.max_um)}


def _here(scene: Scene, note: Note) -> Numbers:
    mark = note.on
    if not note.at or (mark and mark.body):
        return {}
    loop = note.loop
    if mark and mark.loop and mark.point_mm:
        model = replace(scene.model, workpiece_point_mm=mark.point_mm)
        scene, loop = replace(scene, model=model), mark.loop
    return {"here_um": _printed(float(evaluate(scene, at=note.at, loop=loop).norm_um))}


def _printed(value: float) -> float:
    return round(value, 2)


def said_stale(note: Note, found: Numbers) -> str:
    """Say that the numbers of a note no longer hold: "changed: 51.7 → 46.1 µm"."""
    said = told(note.numbers, found)
    return f"changed: {said}" if said else ""


def spell_change(note: Note) -> str:
    """Spell what a decision changed: "EA0Z 33.9 → 20.2 µrad"."""
    said: list[str] = []
    for key, (old, new) in note.change.items():
        row = parameter(key.removeprefix(TOLERANCES))
        name = row.key if key in PARAMETERS else f"tolerance of {row.key}"
        said.append(f"{name} {spell_short(old)} → {spell_short(new)} {row.unit}")
    return ", ".join(said)


def spell_place(note: Note) -> str:
    """Spell what a note is pinned to: the whole, a body, or positions of axes."""
    if note.on and note.on.body:
        return f"body {note.on.body}"
    where = " ".join(f"{axis} {spell_short(at)}" for axis, at in note.at.items())
    return f"trace, {where}" if note.on else where or "the whole"


def spell_numbers(note: Note) -> str:
    """Spell the numbers of a note: "mean 30.88, max 51.72, here 51.72 µm"."""
    said = [f"{name.removesuffix('_um')} {at:.2f}" for name, at in note.numbers.items()]
    return f"{', '.join(said)} µm" if said else ""


def notes_table(notes: Sequence[Note], found: Sequence[Numbers], title: str = "") -> Table:
    """Set notes in a table, with what their numbers are now."""
    columns = (
        Column("id", key="id", leads=True),
        Column("kind", key="kind"),
        Column("status", key="status"),
        Column("where", key="where", wraps=True),
        Column("text", key="text", wraps=True),
        Column("numbers", key="numbers", wraps=True),
        Column("now", key="now", wraps=True),
        Column("by", key="author", wraps=True),
        Column("date", key="date"),
        Column(key="change", shows=False),
        Column(key="replies", shows=False),
    )
    rows: list[tuple[str, ...]] = []
    for note, now in zip(notes, found, strict=True):
        replies = "; ".join(f"{one.author}: {one.text}" for one in note.replies)
        versions = "".join(f" / {one.text}" for one in note.versions)
        cells = (
            note.id, note.kind, note.status, spell_place(note), note.text + versions,
            spell_numbers(note), said_stale(note, now) or "holds", note.author,
            f"{note.date:%Y-%m-%d}", spell_change(note), replies,
        )  # fmt: skip
        rows.append(tuple(" ".join(cell.split()) for cell in cells))
    return Table(columns, rows, title, empty="No notes.")


def notes_markdown(scene: Scene, notes: Sequence[Note], found: Sequence[Numbers]) -> str:
    """Write notes as Markdown; nothing that somebody has written acts as a mark of it."""
    lines = [f"# {_escaped(scene.title)}: findings and decisions", ""]
    for note, now in zip(notes, found, strict=True):
        lines.append(f"## {note.kind.capitalize()} {note.id}, {note.status}")
        facts = (
            spell_place(note), spell_numbers(note), said_stale(note, now), spell_change(note),
            note.author, f"{note.date:%Y-%m-%d}",
        )  # fmt: skip
        lines += ["", " · ".join(_escaped(one) for one in facts if one), ""]
        texts = [note.text, *(f"Also: {one.text}" for one in note.versions)]
        lines += [_escaped(line) for text in texts for line in (*text.splitlines(), "")]
        lines += [f"- {_escaped(f'{one.author}: {one.text}')}" for one in note.replies]
        lines.append("")
    return "\n".join(lines)


def _escaped(text: str) -> str:
    flat = re.sub(r"([\\`*_{}\[\]<>#|~&!])", r"\\\1", " ".join(text.split()))
    return re.sub(r"^(\d*)([-+.)=])", r"\1\\\2", flat)  # no list and no heading begins there
