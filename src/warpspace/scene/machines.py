"""Machines: bundled by name, or built from the table of a scene."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from warpspace.exceptions import ChainError, SceneError, UnknownNameError
from warpspace.machine.axes import direction_index, is_linear
from warpspace.machine.description import FIXED_FRAMES, Machine, build_machine, parse_chain
from warpspace.machine.limits import MAX_SCENE_BYTES
from warpspace.resources import assets_dir
from warpspace.scene.bodies import read_bodies
from warpspace.scene.files import parse_toml, read_text
from warpspace.scene.schema import GantrySection
from warpspace.scene.sections import Problems


def machine_names() -> tuple[str, ...]:
    """List the bundled machines."""
    return tuple(sorted(path.parent.name for path in assets_dir().glob("machines/*/machine.toml")))


def machine_picture(name: str) -> Path | None:
    """Give the picture of a bundled machine; None where it has none."""
    path = assets_dir() / "machines" / name / "picture.png"
    return path if path.is_file() else None


@lru_cache(maxsize=64)
def load_machine(name: str) -> Machine:
    """Load a bundled machine; its file is read once.

    Parameters
    ----------
    name : str
        Name of a folder below ``assets/machines``.

    Returns
    -------
    Machine

    Raises
    ------
    UnknownNameError
        If there is no such machine.
    SceneError
        If its file has problems.
    """
    if name not in machine_names():
        raise UnknownNameError("machine", name, machine_names())
    folder = assets_dir() / "machines" / name
    path = folder / "machine.toml"
    raw = parse_toml(read_text(path, MAX_SCENE_BYTES), str(path))
    problems = Problems()
    machine = machine_of(raw, "", name, problems, body_dir=str(folder), folder=folder)
    if machine is None or problems.lines:
        raise SceneError(str(path), problems.lines)
    return machine


def machine_of(
    raw: object,
    key: str,
    name: str,
    problems: Problems,
    body_dir: str = "",
    folder: Path | None = None,
) -> Machine | None:
    """Build a machine from its table; note problems and give None where it cannot be.

    Parameters
    ----------
    raw : object
        The table.
    key : str
        Where it stands; empty for a file of its own.
    name : str
        Name of the machine.
    problems : Problems
    body_dir : str, optional
        Folder of the machine's schematic bodies.
    folder : Path, optional
        Folder that the names of its meshes are relative to.
    """
    expected = 'expected a machine name or a [machine] table with "chain"'
    if raw is None:
        problems.add(key, f"is missing; {expected}")
        return None
    if not isinstance(raw, dict):
        problems.add(key, expected, raw)
        return None
    section = problems.validate("machine", key, raw)
    if section is None:
        return None
    prefix = f"{key}." if key else ""
    try:
        chain = parse_chain(section.chain)
    except ChainError as error:
        problems.add(f"{prefix}chain", str(error))
        return None
    for part, known in (
        ("offset_mm", (*chain.axes, *FIXED_FRAMES)),
        ("rotation_deg", (*chain.axes, *FIXED_FRAMES)),
        ("travel", chain.axes),
        ("direction", chain.axes),
        ("gantry", chain.axes),
    ):
        for axis in getattr(section, part):
            if axis not in known:
                problems.unknown(f"{prefix}{part}", axis, known, "frame of this machine")
    gantry = _gantries(section.gantry, chain.axes, f"{prefix}gantry", problems)
    machine = build_machine(
        chain,
        offset_mm=section.offset_mm,
        rotation_deg=section.rotation_deg,
        travel=section.travel,
        direction=section.direction,
        gantry=gantry,
        name=name,
        title=section.title or name,
        body_dir=body_dir,
        source=section.source,
    )
    if not section.bodies:
        return machine
    return replace(machine, bodies=read_bodies(section.bodies, machine, folder, problems))


def _gantries(
    section: Mapping[str, GantrySection], axes: Sequence[str], key: str, problems: Problems
) -> dict[str, tuple[float, str | None]]:
    """Read which axes stand on two guides; those that cannot are noted and left out."""
    found: dict[str, tuple[float, str | None]] = {}
    for axis, given in section.items():
        if axis not in axes:  # noted already
            continue
        own = "xyz"[direction_index(axis)]
        if not is_linear(axis):
            problems.add(f"{key}.{axis}", "expected a linear axis: a rotary one has no guides")
        elif given.across == own:
            others = " or ".join(f'"{name}"' for name in "xyz" if name != own)
            expected = f"is the direction of the axis itself; expected {others}"
            problems.add(f"{key}.{axis}.across", expected, given.across)
        else:
            found[axis] = (given.span_mm, given.across)
    return found
