"""Meshes beside a file: one STL file for each frame, none that is read is ever replaced."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from warpspace.outputs.files import check_target, write_atomically


def mesh_files(
    target: Path, frames: Iterable[str], *, overwrite: bool, inputs: Iterable[Path]
) -> dict[str, Path]:
    """Name the meshes beside a file.

    Parameters
    ----------
    target : Path
        The file that names them.
    frames : iterable of str
    overwrite : bool
        Whether existing files may be replaced.
    inputs : iterable of Path
        Files that are read for what is written: never replaced.

    Returns
    -------
    dict of str to Path
        By frame.

    Raises
    ------
    OutputError
        If one of them must not be written.
    """
    files = {frame: target.with_name(f"{target.stem}_{frame}.stl") for frame in frames}
    read = tuple(inputs)
    for file in files.values():
        check_target(file, overwrite=overwrite, inputs=read)
    return files


def write_meshes(files: Mapping[str, Path], meshes: Mapping[str, Any], *, overwrite: bool) -> None:
    """Write the meshes of frames.

    Parameters
    ----------
    files : mapping of str to Path
        As `mesh_files` gives them.
    meshes : mapping of str to trimesh.Trimesh
        By frame.
    overwrite : bool
        Whether existing files may be replaced.

    Raises
    ------
    OutputError
        If one of them cannot be written.
    """
    for frame, file in files.items():
        with write_atomically(file, overwrite=overwrite) as temporary:
            meshes[frame].export(temporary, file_type="stl")
