"""Tables of review notes, with their numbers re-evaluated in the scene."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache

from warpspace.analysis.blocks import Column, Mark, Table
from warpspace.analysis.statistics import volume_statistics
from warpspace.exceptions import WarpspaceError
from warpspace.field.grid import DEFAULT_NODES, build_grid
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import PARAMETERS, parameter
from warpspace.scene.model import Scene, evaluate, evaluate_grid
from warpspace.scene.notes import TOLERANCES, Note, changed_number
from warpspace.units import spell_short

Numbers = Mapping[str, float]
_COLUMNS = (
    Column("no.", key="no", leads=True),
    *(Column(key=key, shows=False) for key in ("id", "kind", "status")),
    Column("what", wraps=True),  # kind and status
    Column("text", key="text", wraps=True),
    *(Column(key=key, shows=False) for key in ("author", "date")),
    Column("by", wraps=True),
    Column("where", key="where", wraps=True),
    Column("numbers", key="numbers", wraps=True),
)


def note_numbers(scene: Scene, notes: Iterable[Note]) -> list[Numbers]:
    """Evaluate the present numbers of notes, µm, by key; empty where there are none.

    They are those of the scene's own evaluation: mean and max over the working volume where the
    rotary axes stand as in the note, and the length of the error at its point.
    """

    @cache
    def of_volume(loop: str, still: tuple[tuple[str, float], ...]) -> Numbers:
        moved = replace(scene, workspace=scene.workspace.moved(dict(still))) if still else scene
        grid = build_grid(moved.model, moved.workspace, DEFAULT_NODES)
        statistics = volume_statistics(evaluate_grid(moved, grid, moved.view(Loop(loop))), grid)
        return {"mean_um": round(statistics.mean_um, 2), "max_um": round(statistics.max_um, 2)}

    numbers: list[Numbers] = []
    for note in notes:
        still = {q: at for q, at in note.at.items() if q not in scene.workspace.volume_axes}
        try:
            volume_numbers = of_volume(note.loop, tuple(sorted(still.items())))
            numbers.append({**volume_numbers, **_point_numbers(scene, note)})
        except WarpspaceError:  # its axes are no longer there
            numbers.append({})
    return numbers


def _point_numbers(scene: Scene, note: Note) -> Numbers:
    mark, loop = note.on, note.loop
    if not note.at or (mark and mark.body):
        return {}
    if mark and mark.loop and mark.point_mm:
        model = replace(scene.model, workpiece_point_mm=mark.point_mm)
        scene, loop = replace(scene, model=model), mark.loop
    return {"here_um": round(float(evaluate(scene, at=note.at, loop=loop).norm_um), 2)}


def stale_remark(note: Note, present: Numbers) -> str:
    """Format the changes of the numbers of a note: "changed: 51.7 → 46.1 µm"."""
    changes = changed_number(note.numbers, present)
    return f"changed: {changes}" if changes else ""


def spell_change(note: Note) -> str:
    """Format the changes made by a decision: "EA0Z 33.9 → 20.2 µrad"."""
    changes: list[str] = []
    for key, (old, new) in note.change.items():
        row = parameter(key.removeprefix(TOLERANCES))
        name = row.key if key in PARAMETERS else f"tolerance of {row.key}"
        changes.append(f"{name} {spell_short(old)} → {spell_short(new)} {row.unit}")
    return ", ".join(changes)


def spell_place(note: Note) -> str:
    """Format the place of a note: the whole, a body, or positions of axes."""
    if note.on and note.on.body:
        return f"body {note.on.body}"
    where = " ".join(f"{axis} {spell_short(at)}" for axis, at in note.at.items())
    return f"trace, {where}" if note.on else where or "the whole"


def spell_numbers(note: Note) -> str:
    """Format the numbers of a note: "mean 30.88, max 60.00 → 51.72, here 51.72 µm"."""
    numbers = [
        f"{name.removesuffix('_um')} "
        + (f"{note.before[name]:.2f} → {at:.2f}" if name in note.before else f"{at:.2f}")
        for name, at in note.numbers.items()
    ]
    return f"{', '.join(numbers)} µm" if numbers else ""


def notes_table(scene: Scene, title: str = "") -> Table:
    """Tabulate the notes of a scene with their versions, replies and present numbers."""
    rows: list[tuple[object, ...]] = []
    marks: list[Mark] = []
    heads = [(number, remark) for number, note in enumerate(scene.review, 1)
             for remark in (note, *note.versions)]  # fmt: skip
    numbers = note_numbers(scene, [note for _, note in heads])
    for (number, note), now in zip(heads, numbers, strict=True):
        stale = stale_remark(note, now)
        facts = "; ".join(filter(None, (spell_change(note), spell_numbers(note), stale)))
        kinds = (note.kind, note.status), *(("reply", "") for _ in note.replies)
        for remark, (kind, status) in zip((note, *note.replies), kinds, strict=True):
            text, author = (" ".join(string.split()) for string in (remark.text, remark.author))
            date, what = f"{remark.date:%Y-%m-%d}", f"{kind}{status and f', {status}'}"
            about = (spell_place(note), facts) if remark is note else ("", "")
            by = f"{author} {date}".strip()
            rows.append((number, note.id, kind, status, what, text, author, date, by, *about))
            marks.append("worse" if stale and remark is note else "")
    return Table(_COLUMNS, rows, title, empty="No notes.", marks=marks)
