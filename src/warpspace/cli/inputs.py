"""Which files a scene is read from, so that no command writes over them."""

from collections.abc import Iterator
from pathlib import Path
from typing import cast

from warpspace.exceptions import SceneError


def input_files(*scenes: str) -> Iterator[Path]:
    """Find the files that scenes are read from: their own, and the CSV files and meshes these name.

    Parameters
    ----------
    scenes : str
        Bundled names or paths. One that cannot be read names no others; what is wrong with it
        is said when it is loaded.

    Yields
    ------
    Path
    """
    from warpspace.machine.limits import MAX_SCENE_BYTES
    from warpspace.scene.files import parse_toml, read_text
    from warpspace.scene.library import scene_path

    for scene in scenes:
        try:
            path = scene_path(scene)
            yield path
            if path.suffix.lower() == ".vts":
                continue
            raw = parse_toml(read_text(path, MAX_SCENE_BYTES), str(path))
        except SceneError:
            continue
        for name in (*_csv_names(raw), *_mesh_names(raw.get("bodies"))):
            yield path.parent / name


def _mesh_names(value: object) -> Iterator[str]:
    """Find the meshes that a table of bodies names."""
    if not isinstance(value, dict):
        return
    for part in cast("dict[str, object]", value).values():
        entry = cast("dict[str, object]", part).get("file") if isinstance(part, dict) else part
        if isinstance(entry, str):
            yield entry


def _csv_names(value: object) -> Iterator[str]:
    """Find what is named by a key "csv", anywhere."""
    if isinstance(value, dict):
        for key, part in cast("dict[str, object]", value).items():
            if key == "csv" and isinstance(part, str):
                yield part
            else:
                yield from _csv_names(part)
    elif isinstance(value, list):
        for part in cast("list[object]", value):
            yield from _csv_names(part)
