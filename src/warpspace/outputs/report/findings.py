"""Review notes in a report: what was found and decided, and the story that they tell."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from warpspace.analysis.blocks import Column, Mark, Table
from warpspace.analysis.reviewing import (
    note_numbers,
    said_stale,
    spell_change,
    spell_numbers,
    spell_place,
)
from warpspace.exceptions import WarpspaceError
from warpspace.geometry.colour import COMPONENTS
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import is_linear, parameter
from warpspace.machine.limits import MAX_ERROR, MAX_LENGTH_MM
from warpspace.outputs.report.render import Block
from warpspace.picture.model import VIEW_WORDS, VIEWS
from warpspace.picture.words import LOOP_WORDS
from warpspace.scene.files import parse_number
from warpspace.scene.library import parse_scene
from warpspace.scene.links import CAMERA, PACKED, read_settings, settings_of, unpack_scene
from warpspace.scene.model import Scene
from warpspace.scene.notes import MEASURES, Note, Reply, story

HEADING = "Findings and decisions"
AS_NOW = "What was on the screen cannot be read: the scene is shown as it is now."
NO_COMPARISON = "What it was compared with is left out."
_LISTED = re.compile(r"[\s,]+")


@dataclass(frozen=True, slots=True)
class Shown:
    """What a step of the story shows, as far as a map of the errors can show it."""

    scene: Scene
    loop: str = str(Loop.TOOL)
    component: str = "norm"
    view: str = "iso"
    remarks: tuple[str, ...] = ()  # what a reader must know of it


def _flat(text: str) -> str:
    return " ".join(text.split())


# --- Tables of the notes --------------------------------------------------------------------------


def tables(scene: Scene) -> Iterator[Block]:
    """List notes, decisions and replies; a note whose numbers no longer hold is marked."""
    notes, found = scene.review, note_numbers(scene, scene.review)
    columns = (
        Column("no.", leads=True), Column("what"), Column("where", wraps=True),
        Column("text", wraps=True), Column("numbers", wraps=True), Column("by", wraps=True),
    )  # fmt: skip
    rows = [
        (
            str(number), f"{note.kind}, {note.status}", spell_place(note), _all_texts(note),
            "; ".join(filter(None, (spell_numbers(note), said_stale(note, now)))), _signature(note),
        )
        for number, (note, now) in enumerate(zip(notes, found, strict=True), 1)
    ]  # fmt: skip
    marks: list[Mark] = [
        "worse" if said_stale(note, now) else "" for note, now in zip(notes, found, strict=True)
    ]
    yield Table(columns, rows, "Notes; red where the numbers no longer hold.", marks=marks)
    decided = [
        (str(number), _flat(note.text), spell_change(note), _before_after(note))
        for number, note in enumerate(notes, 1)
        if note.kind == "decision"
    ]
    if decided:
        columns = (
            Column("no.", leads=True), Column("decision", wraps=True), Column("change", wraps=True),
            Column("effect, µm", wraps=True),
        )  # fmt: skip
        yield Table(columns, decided, "Decisions: from → to, and what it did.")
    replies = [
        (str(number), _flat(one.text), _signature(one))
        for number, note in enumerate(notes, 1)
        for one in note.replies
    ]
    if replies:
        columns = (Column("to no.", leads=True), Column("text", wraps=True), Column("by"))
        yield Table(columns, replies, "Replies.")


def open_questions(scene: Scene) -> tuple[str, ...]:
    """List what is asked and not answered for the first page, in the words of the notes."""
    return tuple(
        f"{_flat(note.text)} (note {number}{', ' + _flat(note.author) if note.author else ''})"
        for number, note in enumerate(scene.review, 1)
        if (note.kind, note.status) == ("question", "open")
    )


def _all_texts(note: Note) -> str:
    return " / ".join(_flat(one.text) for one in (note, *note.versions))


def _signature(note: Note | Reply) -> str:
    return f"{_flat(note.author)} {note.date:%Y-%m-%d}".strip()


def _before_after(note: Note) -> str:
    return ", ".join(
        f"{name.removesuffix('_um')} {note.before[name]:.2f} → {note.numbers[name]:.2f}"
        for name in MEASURES
        if name in note.before and name in note.numbers
    )


# --- The story ------------------------------------------------------------------------------------


def steps(scene: Scene) -> Iterator[tuple[str, Shown]]:
    """Give captions and what is drawn of the steps of the story, in their order."""
    told = story(scene.review)
    for number, (note, now) in enumerate(zip(told, note_numbers(scene, told), strict=True), 1):
        shown = shown_by(scene, note)
        how = f"{LOOP_WORDS[Loop(shown.loop)]}, {VIEW_WORDS.get(shown.view, 'oblique view')}"
        if shown.component != "norm":
            how = f"{shown.component} component, {how}"
        # those of the scene when it was noted; the figure may show other errors
        noted = f"noted: {spell_numbers(note)}" if note.numbers else ""
        said = noted, said_stale(note, now), spell_change(note), _signature(note)
        facts, remarks = (
            " · ".join(filter(None, said)),
            " ".join((f"Drawn: {how}.", *shown.remarks)),
        )
        yield f"Step {number} of {len(told)}: {_flat(note.text)} ({facts}) {remarks}", shown


def shown_by(scene: Scene, note: Note) -> Shown:
    """Restore what of a note's view a map can show; nothing that stands in it is trusted."""
    try:
        given = dict(read_settings(note.view))
        if not given:
            return Shown(scene, note.loop)
        if PACKED not in given:
            return _shown(scene, given, note.loop, at_rest=True)
        text = unpack_scene(given[PACKED])
        packed = parse_scene(text, scene.name, "the scene of a note", folder=None)
        return _shown(packed, dict(read_settings(settings_of(text))), note.loop, at_rest=False)
    except (WarpspaceError, ValueError):
        return Shown(scene, note.loop, remarks=(AS_NOW,))


def _shown(scene: Scene, given: Mapping[str, str], loop: str, *, at_rest: bool) -> Shown:
    """Apply a line of settings; `at_rest` where it spells all that is not zero."""
    errors, excluded = scene.errors, list[str]()
    off, only = (set(_LISTED.split(given.get(name, ""))) - {""} for name in ("excluded", "only"))
    for key in scene.machine.allowed_keys:
        present = scene.errors.amplitude(key)
        value = _number(given[key], MAX_ERROR) if key in given else 0.0 if at_rest else present
        if value and (key in off or (only and key not in only)):
            excluded.append(key)
            value = 0.0
        if value != present:
            errors = errors.with_amplitude(key, value, scene.axis_span(parameter(key).axis))
    stand = scene.workspace.positions
    turned = [a for a in stand if not is_linear(a) and a not in scene.workspace.volume_axes]
    moved = {name: _number(given[name], MAX_LENGTH_MM) for name in turned if name in given}
    if at_rest:
        moved = {**dict.fromkeys(turned, 0.0), **moved}
    moved = {name: at for name, at in moved.items() if at != stand[name]}
    placed = given.get("placed", "0" if at_rest else str(int(scene.placed))) == "1"
    compares = any(name.startswith("compare.") for name in given)
    component, loop = given.get("component", "norm"), given.get("loop", loop)
    return Shown(
        replace(scene, errors=errors, workspace=scene.workspace.moved(moved), placed=placed),
        loop if loop in [*Loop] else str(Loop.TOOL),
        component if component in COMPONENTS else "norm",
        _nearest_view(given.get(CAMERA, "")),
        (
            *([f"Excluded: {', '.join(excluded)}."] if excluded else []),
            *([NO_COMPARISON] if compares else []),
        ),
    )


def _number(text: str, largest: float) -> float:
    value = parse_number(text)
    if abs(value) > largest:
        raise ValueError(f"{text}; expected at most ±{largest:g}")
    return value


def _nearest_view(camera: str) -> str:
    """Choose the view of figures that looks most as a camera does: from its place to its aim."""
    try:
        numbers = [parse_number(word) for word in camera.split(",")]
    except ValueError:
        return "iso"
    towards = np.subtract(numbers[:3], numbers[3:6]) if len(numbers) > 5 else np.zeros(3)
    return max(
        VIEWS, key=lambda name: towards @ np.array(VIEWS[name]) / np.linalg.norm(VIEWS[name])
    )
