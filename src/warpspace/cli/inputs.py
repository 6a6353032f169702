"""Which files a scene is read from, so that no command writes over them."""

from collections.abc import Iterator
from pathlib import Path
from typing import cast

from warpspace.exceptions import SceneError


def input_files(*scenes: str) -> Iterator[Path]:
    """Find the files that scenes are read from: their own and the CSV files these name.

    Parameters
    ----------
    scenes : str
        Bundled names or paths. One that cannot be read names no CSV files; what is wrong with it
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
        for name in _csv_names(raw):
            yield path.parent / name


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
