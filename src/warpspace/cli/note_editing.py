"""Run the commands `notes` and `merge`: review notes of a scene."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from warpspace.analysis.blocks import table_markdown
from warpspace.analysis.note_tables import note_numbers, notes_table
from warpspace.cli.analyses import print_blocks
from warpspace.cli.shared_options import parse_point, print_json, warn_outside_travel, write_text
from warpspace.cli.tables import echo, print_text, warn
from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_SCENE_BYTES
from warpspace.scene.library import load_scene, parse_scene, scene_path
from warpspace.scene.model import Scene
from warpspace.scene.notes import Note, changed_number, merge_notes, note_to_toml
from warpspace.scene.scene_writer import scene_to_toml, spell_note
from warpspace.scene.text_files import lock_file, read_bytes, read_text, spell_row


def notes_json(scene: Scene) -> list[dict[str, Any]]:
    """List the notes of a scene as in its file, with their present numbers."""
    return [
        {
            **note_to_toml(note),
            "stale": changed_number(note.numbers, now) != "",
            "numbers": note.numbers,
            "now": {name: now[name] for name in note.numbers if name in now},
        }
        for note, now in zip(scene.review, note_numbers(scene, scene.review), strict=True)
    ]


def edit_notes(
    scene: str,
    text: str | None,
    point: str | None,
    output: str | None,
    *,
    force: bool,
    as_json: bool,
    **about: Any,
) -> None:
    if text is not None:
        loaded = _add_note(scene, output or scene, point, force=force, text=text, **about)
        output = None
    else:
        loaded = load_scene(scene)
    if text is None and (point is not None or (output or "").endswith(".toml")):
        raise OptionError("--at and a .toml file need --add with the text of the note")
    title = f"{loaded.name}: {loaded.title}"
    if output is not None:
        table = notes_table(loaded, title)
        rows = table.csv_rows()
        text = table_markdown(table) if output.endswith(".md") else "".join(map(spell_row, rows))
        write_text(output, text, force=force)
    if as_json:
        print_json({"notes": notes_json(loaded)})
    elif output is None:
        print_blocks([notes_table(loaded, title)])


def _add_note(name: str, path: str, point: str | None, *, force: bool, **about: Any) -> Scene:
    file = scene_path(name)
    with lock_file(file):
        original, scene = read_bytes(file, MAX_SCENE_BYTES), load_scene(file)
        at = {} if point is None else parse_point(point, scene.machine.axes)
        if not path.endswith(".toml"):
            expected = "expected a .toml file (-o FILE.toml); bundled scenes are not changed"
            raise OptionError(f"{path}: {expected}")
        about["loop"] = about["loop"] or scene.default_loop
        note = Note(at=at, **about)
        warn_outside_travel(scene.machine, note.at)
        note = replace(note, numbers=note_numbers(scene, [note])[0])
        text = f"{read_text(file, MAX_SCENE_BYTES).rstrip()}\n\n{spell_note(note)}"
        scene_with_note = parse_scene(text, scene.name, path, Path(path).parent)
        same = file == Path(path)
        write_text(path, text, force=force or same, original=original if same else None)
    echo(f"{path}: {note.kind} {note.id} added", err=True)
    return scene_with_note


def merge_scenes(first: str, second: str, output: str, *, force: bool) -> None:
    a, b = load_scene(first), load_scene(second)
    merged = merge_notes(a.review, b.review)
    text = scene_to_toml(replace(a, review=merged))
    parse_scene(text, a.name, output, None)  # a note of SECOND may name an axis FIRST has not
    write_text(output, text, force=force)
    print_text(f"{output}: {len(merged)} notes of {len(a.review)} and {len(b.review)}")
    for note in merged:
        if note.versions:
            print_text(f"  {note.id}: {1 + len(note.versions)} versions, both retained")
    if replace(b, name=a.name, review=a.review) != a:
        functions, other_functions = a.errors.functions, b.errors.functions
        keys = [
            key
            for key in {**functions, **other_functions}
            if functions.get(key) != other_functions.get(key)
        ]
        differences = f", among them the errors {', '.join(keys)}" if keys else ""
        warn(f"the scenes differ in more than their notes{differences}; {first} is used")
