"""The error field as a VTK structured grid: for ParaView, and to be shown again later."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from warpspace.exceptions import SceneError, WarpspaceError
from warpspace.field.basis import ErrorField
from warpspace.field.grid import MIN_NODES
from warpspace.outputs.exports.vts_header import check_header
from warpspace.outputs.files import write_atomically
from warpspace.picture.scene_picture import ScenePicture, evaluate_picture
from warpspace.scene.library import parse_scene
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, Array

PROVENANCE = "warpspace_json"
MAX_VTS_BYTES = 1024**3
_AGREES_UM = 1e-6
"""Stored and recomputed errors may differ by this and by as much relative."""


@dataclass(frozen=True, slots=True)
class StoredField:
    """A field read back from a file.

    Attributes
    ----------
    scene : Scene
        The scene it was written from, to the last bit.
    picture : ScenePicture
        The scene evaluated as the file was: loop, grid, component, display factor.
    field : ErrorField
        Nominal points and errors as stored, [nx, ny, nz, 3].
    program : str
        Program and version that wrote the file.
    """

    scene: Scene
    picture: ScenePicture
    field: ErrorField
    program: str


def write_vts(picture: ScenePicture, path: str | Path, *, overwrite: bool = True) -> None:
    """Write the field as a VTK structured grid.

    Parameters
    ----------
    picture : ScenePicture
    path : str or Path
    overwrite : bool, optional
        Whether an existing file may be replaced.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    data = build_vts(picture)
    with write_atomically(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(data)


def build_vts(picture: ScenePicture) -> bytes:
    """Build the field as a VTK structured grid.

    Parameters
    ----------
    picture : ScenePicture

    Returns
    -------
    bytes
        The points are nominal, in mm. Point arrays: ``error_um``, ``norm_um``,
        ``orientation_urad``, ``deformed_mm`` (where the points are drawn) and ``displacement_mm``
        (nominal to deformed: ParaView's Warp By Vector with factor 1 bends the grid). Field
        arrays: ``exaggeration``, ``EAX_urad`` and so on for the parameters that are not zero, and
        ``warpspace_json``, UTF-8 text as bytes, with everything else: text arrays are what some
        readers stumble over.
    """
    from vtkmodules.vtkIOXML import vtkXMLStructuredGridWriter

    from warpspace.outputs.exports.multiblock import structured_grid

    grid, field = picture.grid, picture.field
    arrays = {
        "error_um": field.error_um,
        "norm_um": field.norm_um,
        "orientation_urad": field.orientation_urad,
        "deformed_mm": picture.drawn_mm,
        "displacement_mm": field.error_um * (picture.exaggeration * MM_PER_UM),
    }
    mesh = structured_grid(grid.nominal_mm, arrays)
    mesh.point_data.active_vectors_name = "displacement_mm"
    mesh.field_data["exaggeration"] = np.array([picture.exaggeration])
    for key, row in picture.provenance["parameters"].items():
        unit = "urad" if row["unit"].endswith("rad") else "um"
        mesh.field_data[f"{key}_{unit}"] = np.array([row["amplitude"]])
    text = json.dumps(picture.provenance, ensure_ascii=False, allow_nan=False)
    mesh.field_data[PROVENANCE] = np.frombuffer(text.encode(), dtype=np.uint8)
    writer = vtkXMLStructuredGridWriter()
    writer.SetInputData(mesh)
    writer.SetDataModeToBinary()
    writer.SetWriteToOutputString(True)
    writer.Write()
    return str(writer.GetOutputString()).encode()


def load_stored_field(path: str | Path) -> StoredField:
    """Read a field that `write_vts` wrote, or that ParaView saved again.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    StoredField

    Raises
    ------
    SceneError
        If the file cannot be read, is none of ours, or holds errors that its own scene does not
        give.
    """
    source = str(path)
    arrays, shape = _read_arrays(Path(path))
    try:
        head = json.loads(arrays[PROVENANCE].astype(np.uint8).tobytes().decode())
        settings = head["settings"]
        scene = parse_scene(head["scene_toml"], str(head["scene"]), source)
        picture = evaluate_picture(
            scene,
            exaggeration=float(settings["exaggeration"]),
            grid=max(MIN_NODES, *(int(count) for count in settings["nodes"])),
            loop=str(settings["loop"]),
            component=str(settings["component"]),
        )
        stored = ErrorField(
            *(
                np.swapaxes(arrays[name].reshape(*reversed(shape), 3), 0, 2)
                for name in ("points", "error_um", "orientation_urad")
            )
        )
        program = str(head["program"])
    except SceneError:
        raise
    except (KeyError, TypeError, ValueError, WarpspaceError) as error:
        what = f"holds no field of warpspace ({type(error).__name__}: {error})"
        raise SceneError(source, [what]) from None
    _check_agreement(source, stored, picture.field, program)
    return StoredField(scene, picture, stored, program)


def _read_arrays(path: Path) -> tuple[dict[str, Array], tuple[int, int, int]]:
    """Read points, point arrays and field arrays; VTK's own complaints are kept quiet."""
    source = str(path)
    try:
        if not path.is_file():
            raise SceneError(source, ["no such file"])
        if path.stat().st_size > MAX_VTS_BYTES:
            raise SceneError(source, [f"is larger than {MAX_VTS_BYTES:,} bytes"])
        with path.open("rb") as file:
            head = file.read(4096)
        if b"StructuredGrid" not in head:
            raise SceneError(source, ["is no VTK structured grid (.vts)"])
        check_header(path, source)
    except OSError as error:
        raise SceneError(source, [f"cannot be read: {error.strerror or error}"]) from None
    import pyvista as pv
    from vtkmodules.vtkCommonCore import vtkObject
    from vtkmodules.vtkIOXML import vtkXMLStructuredGridReader

    shown = vtkObject.GetGlobalWarningDisplay()
    vtkObject.GlobalWarningDisplayOff()
    try:
        reader = vtkXMLStructuredGridReader()
        reader.SetFileName(source)
        reader.Update()
        mesh = cast("Any", pv.wrap(reader.GetOutput()))
    except UnicodeEncodeError:
        raise SceneError(source, ["cannot be read: VTK wants a file name in UTF-8"]) from None
    finally:
        vtkObject.SetGlobalWarningDisplay(shown)
    arrays = {name: np.asarray(mesh.field_data[name]) for name in mesh.field_data}
    arrays |= {name: np.asarray(mesh.point_data[name]) for name in mesh.point_data}
    if PROVENANCE not in arrays:
        raise SceneError(source, ["holds no field of warpspace, or is damaged"])
    return {**arrays, "points": np.asarray(mesh.points)}, tuple(mesh.dimensions)


def _check_agreement(source: str, stored: ErrorField, computed: ErrorField, program: str) -> None:
    """Refuse a file whose numbers are not those of its scene."""
    if stored.error_um.shape != computed.error_um.shape:
        raise SceneError(
            source, [f"has a grid of {stored.error_um.shape[:3]}; its scene gives another"]
        )
    largest = float(np.abs(computed.error_um).max())
    difference = float(np.abs(stored.error_um - computed.error_um).max())
    if not difference <= _AGREES_UM * (1.0 + largest):
        what = f"stores errors that differ by up to {difference:.3g} µm from what its scene gives"
        raise SceneError(source, [f"{what} (written by {program})"])
