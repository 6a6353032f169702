"""Machines: bundled by name, or built from the table of a scene."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from warpspace.exceptions import ChainError, SceneError, UnknownNameError
from warpspace.machine import definition
from warpspace.machine.axes import direction_index, is_linear
from warpspace.machine.limits import MAX_SCENE_BYTES
from warpspace.resources import assets_dir
from warpspace.scene import schema
from warpspace.scene.schema import Problems
from warpspace.scene.text_files import one_line, parse_toml, read_text


def read_bodies(
    raw: object, machine: definition.Machine, folder: Path | None, problems: Problems
) -> dict[str, definition.BodySource]:
    bodies: dict[str, definition.BodySource] = {}
    frames = (*machine.axes, *definition.BODY_FRAMES)
    for frame, value in problems.table("bodies", raw).items():
        if frame not in frames:
            problems.only("bodies", [frame], frames, "frame of this machine")
            continue
        where = f"bodies.{frame}"
        body: definition.BodySource | None = problems.read(
            schema.BODY, where, {"file": value} if isinstance(value, str) else value
        )
        if body is None:
            continue
        if bool(body.file) == bool(body.shape):
            problems.add(where, "expected a file, or the shape of a tool", value)
        elif body.shape and frame != "t":
            problems.add(f"{where}.shape", "only the tool t has one; expected a file", body.shape)
        elif body.shape:
            bodies[frame] = definition.BodySource(shape=body.shape)
        elif Path(body.file).suffix.lower() not in definition.MESH_ENDINGS:
            endings = ", ".join(definition.MESH_ENDINGS)
            expected = f"unknown ending; expected a mesh that ends in {endings}"
            problems.add(where, expected, body.file)
        else:
            bodies[frame] = replace(body, path=path_beside(body.file, where, folder, problems))
    return bodies


def path_beside(file: str, where: str, folder: Path | None, problems: Problems) -> str:
    """Return the path of a file within a folder; note a problem if there is none."""
    if folder is None:
        return ""
    try:
        home = folder.resolve()
        path = (home / file).resolve()
        is_inside, is_file = path.is_relative_to(home), path.is_file()
    except (OSError, ValueError, RuntimeError):  # the last for circular links
        path, is_inside, is_file = folder, True, False
    if not is_inside:
        problems.add(where, "leads out of the folder of this file; expected one in it", file)
    elif not is_file:
        problems.add(where, "there is no such file beside this one", file)
    else:
        return str(path)
    return ""


def body_notes(machine: definition.Machine) -> tuple[str, ...]:
    """List meshes that cannot be read, since an upload has no folder."""
    return tuple(
        f"bodies.{frame}: {source.file} cannot be read from here (the text came without its"
        " folder); a schematic body is drawn instead"
        for frame, source in machine.bodies.items()
        if source.file and not source.path
    )


def machine_names() -> tuple[str, ...]:
    return tuple(sorted(path.parent.name for path in assets_dir().glob("machines/*/machine.toml")))


def machine_picture(name: str) -> Path | None:
    """Return the picture of a bundled machine; None where it has none."""
    path = assets_dir() / "machines" / name / "picture.png"
    return path if path.is_file() else None


@lru_cache(maxsize=64)
def load_machine(name: str) -> definition.Machine:
    if name not in machine_names():
        raise UnknownNameError("machine", name, machine_names())
    folder = assets_dir() / "machines" / name
    path = folder / "machine.toml"
    raw = parse_toml(read_text(path, MAX_SCENE_BYTES), str(path))
    problems = Problems()
    machine = read_machine(raw, "", name, problems, body_dir=str(folder), folder=folder)
    if machine is None or problems.lines:
        raise SceneError(str(path), problems.lines)
    return machine


def read_machine(
    raw: object,
    key: str,
    name: str,
    problems: Problems,
    body_dir: str = "",
    folder: Path | None = None,
) -> definition.Machine | None:
    expected = 'expected a machine name or a [machine] table with "chain"'
    if raw is None:
        problems.add(key, f"is missing; {expected}")
        return None
    if not isinstance(raw, dict):
        problems.add(key, expected, raw)
        return None
    section = problems.read(schema.MACHINE, key, raw)
    if section is None:
        return None
    prefix = f"{key}." if key else ""
    try:
        chain = definition.parse_chain(section["chain"])
    except ChainError as error:
        problems.add(f"{prefix}chain", str(error))
        return None
    tables = {part: section[part] for part in ("offset_mm", "rotation_deg", "travel", "direction")}
    for part in (*tables, "gantry", "columns"):
        fixed = definition.FIXED_FRAMES if part in ("offset_mm", "rotation_deg") else ()
        frames = (*chain.axes, *fixed)
        problems.only(f"{prefix}{part}", section[part], frames, "frame of this machine")
    machine = definition.build_machine(
        chain,
        **tables,
        gantries=_gantries(section["gantry"], chain.axes, f"{prefix}gantry", problems),
        name=name,
        title=section["title"] or one_line(name),
        body_dir=body_dir,
        source=section["source"],
    )
    _check_columns(section["columns"], chain.axes, f"{prefix}columns", problems)
    bodies = read_bodies(section["bodies"], machine, folder, problems)
    return replace(machine, columns=section["columns"], bodies=bodies)


def _check_columns(
    section: Mapping[str, str], axes: Sequence[str], key: str, problems: Problems
) -> None:
    named = {axis: section.get(axis, axis).lower() for axis in axes}
    for axis, name in section.items():
        duplicates = [other for other in axes if other != axis and named[other] == name.lower()]
        if duplicates:
            expected = f"is the name of {duplicates[0]} as well; expected a name for each axis"
            problems.add(f"{key}.{axis}", expected, name)


def _gantries(
    section: Mapping[str, Mapping[str, Any]], axes: Sequence[str], key: str, problems: Problems
) -> dict[str, definition.Gantry]:
    gantries: dict[str, definition.Gantry] = {}
    for axis, entries in section.items():
        if axis not in axes:  # noted already
            continue
        direction = "xyz"[direction_index(axis)]
        if not is_linear(axis):
            problems.add(f"{key}.{axis}", "expected a linear axis: a rotary one has no guides")
        elif entries["across"] == direction:
            directions = " or ".join(f'"{name}"' for name in "xyz" if name != direction)
            expected = f"is the direction of the axis itself; expected {directions}"
            problems.add(f"{key}.{axis}.across", expected, entries["across"])
        else:
            across = entries["across"] or definition.default_across(axis)
            gantries[axis] = definition.Gantry(axis, entries["span_mm"], across)
    return gantries
