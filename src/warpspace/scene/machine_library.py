"""Machines: bundled by name, or built from the table of a scene."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from warpspace.exceptions import ChainError, SceneError, UnknownNameError
from warpspace.machine import adjusters, definition
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
    read = read_adjusters(section["adjusters"], machine, f"{prefix}adjusters", problems)
    return replace(machine, columns=section["columns"], bodies=bodies, adjusters=read)


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


NOT_UNIT, ROUNDED = 1e-3, 1e-12  # deviations of the length of a direction from 1


def read_adjusters(
    tables: Sequence[Mapping[str, Any]], machine: definition.Machine, key: str, problems: Problems
) -> tuple[adjusters.Adjuster, ...]:
    """Build the adjusters of a machine; note those that are invalid or depend on each other."""
    built: list[adjusters.Adjuster] = []
    for index, table in enumerate(tables):
        entries: dict[str, Any] = {**table, "kind": adjusters.AdjusterKind(table["kind"])}
        direction = table["direction"]
        if direction:
            length = sum(part * part for part in direction) ** 0.5
            if abs(length - 1.0) > NOT_UNIT:
                problems.add(f"{key}[{index}].direction", "expected a unit vector", direction)
                continue
            if abs(length - 1.0) > ROUNDED:  # a written direction is read back as it is
                entries["direction"] = tuple(part / length for part in direction)
        adjuster = adjusters.Adjuster(**entries)
        before = len(problems.lines)
        for name, text, value in _adjuster_problems(adjuster, built, machine):
            shown = ... if value is None else value
            problems.add(f"{key}[{index}].{name}", f"{adjuster.name}: {text}", shown)
        built += [adjuster] * (len(problems.lines) == before)
    if len(built) == len(tables):
        for text in _joint_problems(built):
            problems.add(key, text)
    return tuple(built)


def _adjuster_problems(
    adjuster: adjusters.Adjuster, earlier: Sequence[adjusters.Adjuster], machine: definition.Machine
) -> Iterator[tuple[str, str, object]]:
    """List key, problem and value of what is wrong with one adjuster."""
    kind, body = adjuster.kind, adjuster.body
    linear = [axis for axis in machine.axes if is_linear(axis)]
    bodies = {
        adjusters.AdjusterKind.GIB: linear,
        adjusters.AdjusterKind.RAIL_BOLT: linear,
        adjusters.AdjusterKind.SCALE: linear,
        adjusters.AdjusterKind.OFFSET: [axis for axis in machine.axes if axis not in linear],
    }.get(kind, [adjusters.FRAME, *machine.axes])
    if body not in bodies:
        expected = f"expected one of {', '.join(bodies)}" if bodies else "no axis can have one"
        yield "body", f"{kind}; {expected}", body
    names = {name for other in earlier for name in (other.name, *other.groups)}
    own_groups = {name for other in earlier for name in other.groups} & {*adjuster.groups}
    twice = {adjuster.name, *adjuster.groups} & (names - own_groups)
    if twice or adjuster.name in adjuster.groups:
        yield "name", "expected names that no other adjuster or group has", adjuster.name
    for name in ("at_mm", "direction"):
        value = getattr(adjuster, name)
        if kind.is_parameter != (value is None):
            expected = "a parameter of the control has none" if kind.is_parameter else "is missing"
            yield name, f"{kind}; {expected}", value
    if bool(adjuster.pitch_mm) not in kind.pitches:
        expected = "expected the travel per turn" if kind.pitches[0] else "expected none"
        yield "pitch_mm", f"{kind}; {expected}", adjuster.pitch_mm
    low, high = adjuster.range
    if not low <= 0.0 <= high:
        yield "range", "expected a range around 0, the present position", list(adjuster.range)
    elif adjuster.steps_left() == (0, 0):
        yield "range", f"holds no step of {adjuster.step:g} {adjuster.unit}", list(adjuster.range)


def _joint_problems(built: Sequence[adjusters.Adjuster]) -> Iterator[str]:
    """List joints whose adjusters depend on each other, and groups of unlike adjusters."""
    kinds = adjusters.AdjusterKind
    for joint in dict.fromkeys(adjuster.joint for adjuster in built):
        members = [adjuster for adjuster in built if adjuster.joint == joint]
        names, kind = ", ".join(adjuster.name for adjuster in members), members[0].kind
        if kind.is_parameter:
            if len(members) > 1:
                yield f"{names}: dependent; expected one {kind} of {joint[0]}"
            continue
        least = 2 if kind in (kinds.GIB, kinds.RAIL_BOLT) else 3
        rows = adjusters.support_rows(members)
        bends = kind is kinds.RAIL_BOLT or (joint[0] == adjusters.FRAME and len(members) > least)
        if len(members) < least:
            yield f"{names}: expected at least {least} adjusters under {joint[0]}"
        elif adjusters.rank_of(members) < least:
            yield f"{names}: dependent; expected {least} that are not in one place or line"
        elif bends and rows is None:
            yield (
                f"{names}: expected one direction, and one or two rows of at least two supports"
                " along x, y or z"
            )
    for group in dict.fromkeys(name for adjuster in built for name in adjuster.groups):
        members = [adjuster for adjuster in built if group in adjuster.groups]
        if len({(a.joint, a.kind, a.step, a.pitch_mm) for a in members}) > 1:
            yield f"group {group}: expected adjusters of one body, kind, step and pitch_mm"
