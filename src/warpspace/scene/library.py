"""Finding scenes and machines: bundled by name, or any file by path."""

from pathlib import Path

from warpspace.exceptions import SceneError, near_miss
from warpspace.machine.limits import MAX_SCENE_BYTES
from warpspace.resources import scenes_dir
from warpspace.scene.build import build_scene
from warpspace.scene.files import parse_toml, read_text
from warpspace.scene.machines import load_machine, machine_names, machine_of
from warpspace.scene.model import Scene
from warpspace.scene.sections import Problems


def scene_names() -> tuple[str, ...]:
    """List the bundled scenes, the reference machine's first."""
    return tuple(sorted((path.stem for path in scenes_dir().glob("*.toml")), key=_order))


def _order(name: str) -> tuple[bool, str]:
    """Sort the teaching scenes behind the machine's."""
    return (not name.startswith("dvf"), name)


def scene_path(name_or_path: str | Path) -> Path:
    """Find the file of a scene.

    Parameters
    ----------
    name_or_path : str or Path
        A bundled name, or the path of a file.

    Returns
    -------
    Path

    Raises
    ------
    SceneError
        If it is neither; the message names the near misses.
    """
    text = str(name_or_path)
    if text in scene_names():
        return scenes_dir() / f"{text}.toml"
    path = Path(name_or_path)
    try:
        exists = bool(text) and path.exists()
    except (OSError, ValueError):
        exists = False
    if not exists:
        names = scene_names()
        hint = near_miss(text, names) or f"; bundled scenes: {', '.join(names)}"
        raise SceneError(text or '""', [f"no such scene or file{hint}"])
    return path


def load_scene(name_or_path: str | Path) -> Scene:
    """Load a scene by its bundled name or its path.

    Parameters
    ----------
    name_or_path : str or Path

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        With every problem of the file: key, value and what was expected.

    Examples
    --------
    >>> scene = load_scene("dvf5000_first")
    >>> scene.title
    'DVF5000, first machine measured'
    >>> str(scene.machine.chain)
    'wCBFXYZt'
    """
    path = scene_path(name_or_path)
    name = path.stem.encode(errors="replace").decode()  # bytes that are no text become "?"
    return parse_scene(read_text(path, MAX_SCENE_BYTES), name, str(path), path.parent)


def parse_scene(
    text: str, name: str, source: str | None = None, folder: Path | None = None
) -> Scene:
    """Build a scene from TOML text, for instance an upload.

    Parameters
    ----------
    text : str
    name : str
        Name of the scene.
    source : str, optional
        What the text is called in messages.
    folder : Path, optional
        Folder that CSV names are relative to; without it CSV files are refused.

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        With every problem of the text.
    """
    source = source or name
    raw = parse_toml(text, source)
    problems = Problems()
    given = raw.get("machine")
    if not isinstance(given, str):
        machine = machine_of(given, "machine", name, problems, folder=folder)
    elif given in machine_names():
        machine = load_machine(given)
    else:
        machine = None
        problems.unknown_value("machine", given, machine_names(), "machine")
    return build_scene(raw, name, source, machine, folder, problems)
