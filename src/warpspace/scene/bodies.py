"""Reading `[bodies]`: meshes of a user beside the file, one a frame, and the shape of the tool."""

from pathlib import Path
from typing import Any

from warpspace.machine.body_source import BODY_FRAMES, MESH_ENDINGS, BodySource
from warpspace.machine.description import Machine
from warpspace.scene.sections import Problems


def read_bodies(
    raw: object, machine: Machine, folder: Path | None, problems: Problems
) -> dict[str, BodySource]:
    """Read where the bodies of a machine come from.

    Parameters
    ----------
    raw : object
        The table of the scene or machine: a file or a table per frame.
    machine : Machine
    folder : Path or None
        Folder that names are relative to, and that no name may leave; None for an upload, whose
        meshes are kept in mind and not drawn.
    problems : Problems

    Returns
    -------
    dict of str to BodySource
        By frame.
    """
    found: dict[str, BodySource] = {}
    frames = (*machine.axes, *BODY_FRAMES)
    for frame, value in problems.table("bodies", raw).items():
        if frame not in frames:
            problems.unknown("bodies", frame, frames, "frame of this machine")
            continue
        where = f"bodies.{frame}"
        section = problems.validate(
            "body", where, {"file": value} if isinstance(value, str) else value
        )
        if section is None:
            continue
        if bool(section.file) == bool(section.shape):
            problems.add(where, "expected a file, or the shape of a tool", value)
        elif section.shape and frame != "t":
            problems.add(
                f"{where}.shape", "only the tool t has one; expected a file", section.shape
            )
        elif section.shape:
            found[frame] = BodySource(shape=section.shape)
        else:
            path = _path(section.file, where, folder, problems)
            found[frame] = _source(section, path)
    return found


def _source(section: Any, path: str) -> BodySource:
    """Take over a checked entry."""
    return BodySource(
        section.file,
        path,
        section.unit or "",
        tuple(section.offset_mm),
        tuple(section.rotation_deg),
    )


def _path(file: str, where: str, folder: Path | None, problems: Problems) -> str:
    """Find a mesh beside the file that names it; empty where there is no folder."""
    ending = Path(file).suffix.lower()
    if ending not in MESH_ENDINGS:
        known = ", ".join(MESH_ENDINGS)
        problems.add(where, f"unknown ending; expected a mesh that ends in {known}", file)
        return ""
    if folder is None:
        return ""
    try:
        home = folder.resolve()
        path = (home / file).resolve()
        inside, there = path.is_relative_to(home), path.is_file()
    except (OSError, ValueError):
        path, inside, there = folder, True, False
    if not inside:
        problems.add(where, "leads out of the folder of this file; expected a mesh in it", file)
    elif not there:
        problems.add(where, "there is no such file beside this one", file)
    else:
        return str(path)
    return ""


def body_notes(machine: Machine) -> tuple[str, ...]:
    """Remark on meshes that are named and cannot be drawn, since an upload has no folder."""
    return tuple(
        f"bodies.{frame}: {source.file} cannot be read from here (the text came without its"
        " folder); a schematic body is drawn instead"
        for frame, source in machine.bodies.items()
        if source.file and not source.path
    )
