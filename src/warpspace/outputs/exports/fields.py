"""Error fields of any size as files: Parquet, CSV, NPZ and VTS, written block by block."""

import json
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from dataclasses import field as attribute
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.evaluate import ErrorField
from warpspace.field.grid import DIMENSIONS, cut, pieces
from warpspace.machine.axes import is_linear
from warpspace.outputs.file_output import check_target, write_atomically, write_content
from warpspace.picture.model import ScenePicture
from warpspace.resources import __version__
from warpspace.scene.text_files import guard_cell, spell_row
from warpspace.units import MICROMETRE, MICRORADIAN, MM_PER_UM, Array

if TYPE_CHECKING:
    import pyvista as pv

ABOUT = "about_json"  # name of the description in NPZ and VTS files
DECIMALS = 9  # of numbers in text: a billionth of a micrometre
_UNITS = {"mm": "mm", "deg": "°", "um": MICROMETRE, "urad": MICRORADIAN}


@dataclass(frozen=True)
class FieldRecord:
    """An error field with its axis positions and provenance."""

    axes: Mapping[str, Array]  # mm or degrees; axis positions, shaped to broadcast to the points
    field: ErrorField  # of points in a batch of any shape; of a grid for a VTS file
    # scene, loop, reference, convention, program
    about: Mapping[str, str] = attribute(default_factory=dict[str, str])
    # U95 of each point, by name; empty if unknown
    u95: Mapping[str, Array] = attribute(default_factory=dict[str, Array])

    @property
    def shape(self) -> tuple[int, ...]:
        return self.field.error_um.shape[:-1]

    @property
    def columns(self) -> dict[str, Array]:
        """Columns of the table by name, each broadcastable to the points; names end in units."""
        frame = "w" if self.about.get("frame") == "workpiece" else "R"
        error = f"error_{self.about.get('loop', 'tool')}"
        error += "_placed" if "placement" in self.about else ""
        error += "_referenced" if self.about.get("reference", "absolute") != "absolute" else ""
        error += f"_{frame}"
        axes = {
            f"axis_{name}_{'mm' if is_linear(name) else 'deg'}": values
            for name, values in self.axes.items()
        }
        vectors = {"R_{}_mm": self.field.nominal_mm, error + "_{}_um": self.field.error_um}
        tilts = {f"orientation_{frame}_" + "{}_urad": self.field.orientation_urad}
        norm = {"norm_um": self.field.norm_um}
        table = {**axes, **_by_component(vectors), **norm, **_by_component(tilts)}
        for name, values in self.u95.items():
            of, _, unit = name.rpartition("_")
            u95_columns = {name: values}
            if values.ndim > len(self.shape):
                u95_columns = _by_component({f"{of}_{frame}_{{}}_{unit}": values})
            table |= u95_columns
        return table

    def blocks(self) -> Iterator[dict[str, Array]]:
        """Yield the table some ten thousand rows at a time, the last direction running fastest."""
        columns = self.columns
        for piece in pieces(self.shape):
            nodes = cut(self.field.norm_um, piece).shape
            yield {
                name: np.broadcast_to(cut(values, piece), nodes).reshape(-1)
                for name, values in columns.items()
            }


def _by_component(vectors: Mapping[str, Array]) -> dict[str, Array]:
    return {
        name.format(letter): values[..., index]
        for name, values in vectors.items()
        for index, letter in enumerate("xyz")
    }


def column_unit(name: str) -> str:
    """Return the unit at the end of a column's name."""
    return _UNITS[name.rpartition("_")[2]]


def write_field(record: FieldRecord, path: str | Path, *, overwrite: bool = True) -> None:
    """Write a field in the format of the ending of a path."""
    target = check_target(path, FIELD_ENDINGS, overwrite=overwrite)
    ending = target.suffix.lower()
    if ending in GRID_ENDINGS and len(record.shape) != DIMENSIONS:
        raise OptionError(f"{target}: a {ending} file holds a grid, these are points")
    write = _WRITERS[ending]
    with write_atomically(target, overwrite=overwrite) as temporary:
        write(record, temporary)


def write_numbers_csv(
    record: FieldRecord, path: Path, remarks: Mapping[str, str] | None = None
) -> None:
    """Write the table into a CSV file; remarks are columns with the same text in every row."""
    import pyarrow as pa
    from pyarrow import csv

    texts = dict(remarks or {})
    names = [*record.columns, *texts]
    schema = pa.schema([(name, pa.string() if name in texts else pa.float64()) for name in names])
    plain = csv.WriteOptions(include_header=False, batch_size=1 << 16)
    with path.open("wb") as file:
        file.write(",".join(names).encode() + b"\n")
        with csv.CSVWriter(file, schema, write_options=plain) as writer:
            for block in record.blocks():
                # + 0.0: no negative zeros
                arrays = [pa.array(np.round(values, DECIMALS) + 0.0) for values in block.values()]
                rows = len(arrays[0])
                arrays += [pa.array([text] * rows) for text in texts.values()]
                writer.write_batch(pa.RecordBatch.from_arrays(arrays, schema=schema))


def _write_parquet(record: FieldRecord, path: Path) -> None:
    about = json.dumps(dict(record.about), ensure_ascii=False)
    kinds = dict.fromkeys(record.columns, "number")
    with _parquet(path, kinds, about, of_points=True) as append:
        for block in record.blocks():
            append(block)


def field_arrays(field: ErrorField) -> dict[str, Array]:
    return {name: getattr(field, name) for name in ("error_um", "norm_um", "orientation_urad")}


def _write_npz(record: FieldRecord, path: Path) -> None:
    arrays = {"nominal_mm": record.field.nominal_mm, **field_arrays(record.field), **record.u95}
    arrays |= {name: values for name, values in record.columns.items() if name.startswith("axis_")}
    arrays[ABOUT] = np.array(json.dumps(dict(record.about), ensure_ascii=False))
    with path.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)


def _write_vts(record: FieldRecord, path: Path) -> None:
    arrays = {**field_arrays(record.field), **record.u95}
    writer = _vts_writer(structured_grid(record.field.nominal_mm, arrays), ABOUT, record.about)
    writer.SetDataModeToAppended()
    writer.EncodeAppendedDataOff()
    writer.SetCompressorTypeToNone()
    writer.SetHeaderTypeToUInt64()
    writer.SetFileName(str(path))
    if not writer.Write():
        raise OSError(f"VTK could not write {path}")


def structured_grid(points_mm: Array, arrays: Mapping[str, Array]) -> "pv.StructuredGrid":
    import pyvista as pv

    mesh = pv.StructuredGrid()
    mesh.points = _in_order_of_vtk(points_mm)
    mesh.dimensions = points_mm.shape[:3]
    for name, values in arrays.items():
        mesh.point_data[name] = _in_order_of_vtk(values)
    mesh.point_data.active_scalars_name = "norm_um"
    return mesh


def _in_order_of_vtk(values: Array) -> Array:
    tail = values.shape[3:]
    return np.ascontiguousarray(np.swapaxes(values, 0, 2)).reshape(-1, *tail)


def _vts_writer(mesh: Any, name: str, about: Mapping[str, Any]) -> Any:
    from vtkmodules.vtkIOXML import vtkXMLStructuredGridWriter

    text = json.dumps(dict(about), ensure_ascii=False, allow_nan=False)
    mesh.field_data[name] = np.frombuffer(text.encode(), dtype=np.uint8)
    writer = vtkXMLStructuredGridWriter()
    writer.SetInputData(mesh)
    return writer


_WRITERS: dict[str, Callable[[FieldRecord, Path], None]] = {
    ".parquet": _write_parquet,
    ".npz": _write_npz,
    ".csv": write_numbers_csv,
    ".vts": _write_vts,
}
FIELD_ENDINGS = tuple(_WRITERS)
GRID_ENDINGS = (".vts",)  # formats that hold grids only


def write_csv(picture: ScenePicture, path: str | Path, *, overwrite: bool = True) -> None:
    record = FieldRecord(picture.grid.coordinates, picture.field, picture.remarks)
    remarks = {name: guard_cell(text) for name, text in picture.remarks.items()}
    with write_atomically(path, overwrite=overwrite) as temporary:
        write_numbers_csv(record, temporary, remarks)


PROVENANCE = "warpspace_json"


def write_vts(picture: ScenePicture, path: str | Path, *, overwrite: bool = True) -> None:
    write_content(build_vts(picture), path, overwrite=overwrite)


def build_vts(picture: ScenePicture) -> bytes:
    arrays = field_arrays(picture.field) | {
        "deformed_mm": picture.drawn_mm,
        "displacement_mm": picture.field.error_um * (picture.exaggeration * MM_PER_UM),
    }
    mesh = structured_grid(picture.grid.nominal_mm, arrays)
    mesh.point_data.active_vectors_name = "displacement_mm"
    mesh.field_data["exaggeration"] = np.array([picture.exaggeration])
    for key, row in picture.provenance["parameters"].items():
        unit = "urad" if row["unit"].endswith("rad") else "um"
        mesh.field_data[f"{key}_{unit}"] = np.array([row["amplitude"]])
    writer = _vts_writer(mesh, PROVENANCE, picture.provenance)
    writer.SetDataModeToBinary()
    writer.SetWriteToOutputString(True)
    writer.Write()
    return str(writer.GetOutputString()).encode()


Kind: TypeAlias = str  # of a column: "text", "integer" or "number"
Columns: TypeAlias = Mapping[str, Sequence[Any] | Any]
"""Values by column, all of one length; arrays are not copied."""
Append: TypeAlias = Callable[[Columns], None]


@contextmanager
def write_rows(
    path: str | Path, kinds: Mapping[str, Kind], *, overwrite: bool = True
) -> Generator[Append]:
    """Open a table; the file appears when the block has succeeded."""
    write = _parquet if Path(path).suffix.lower() == ".parquet" else _csv
    with (
        write_atomically(path, overwrite=overwrite) as temporary,
        write(temporary, kinds) as append,
    ):
        yield append


@contextmanager
def _parquet(
    path: Path, kinds: Mapping[str, Kind], about: str = __version__, *, of_points: bool = False
) -> Generator[Append]:
    """Open a table; columns of points have their unit as metadata, and only positions repeat."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    types = {
        "text": pa.dictionary(pa.int32(), pa.string()),
        "integer": pa.int64(),
        "number": pa.float64(),
    }
    fields = [
        pa.field(name, types[kind], metadata={"unit": column_unit(name)} if of_points else None)
        for name, kind in kinds.items()
    ]
    schema = pa.schema(fields, metadata={"warpspace": about})
    # pyarrow's stubs know a flag only
    repeated: Any = [name for name in kinds if name.startswith("axis_")] if of_points else True
    with pq.ParquetWriter(path, schema, use_dictionary=repeated, compression="zstd") as writer:

        def append(columns: Columns) -> None:
            arrays = [pa.array(columns[field.name], field.type) for field in fields]
            writer.write_batch(pa.RecordBatch.from_arrays(arrays, schema=schema))

        yield append


@contextmanager
def _csv(path: Path, kinds: Mapping[str, Kind]) -> Generator[Append]:
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(spell_row(kinds))

        def append(columns: Columns) -> None:
            spelt = [
                [_spell(value, kind) for value in columns[name]] for name, kind in kinds.items()
            ]
            file.writelines(map(spell_row, zip(*spelt, strict=True)))

        yield append


def _spell(value: object, kind: Kind) -> object:
    if value is None or kind == "integer":
        return value
    return str(value) if kind == "text" else float(value)  # pyright: ignore[reportArgumentType]
