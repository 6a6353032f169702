"""Error fields of any size as files: Parquet, CSV, NPZ and VTS, written block by block."""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from dataclasses import field as attribute
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.basis import ErrorField
from warpspace.field.grid import DIMENSIONS
from warpspace.field.pieces import cut, pieces
from warpspace.machine.axes import is_linear
from warpspace.outputs.files import check_target, write_atomically
from warpspace.units import MICROMETRE, MICRORADIAN, Array

if TYPE_CHECKING:
    from warpspace.analysis.uncertain import FieldUncertainty

ABOUT = "about_json"
"""Name under which NPZ and VTS files say what they hold."""
DECIMALS = 9
"""Of numbers in text: a billionth of a micrometre."""
_UNITS = {"mm": "mm", "deg": "°", "um": MICROMETRE, "urad": MICRORADIAN}


@dataclass(frozen=True)
class FieldRecord:
    """An error field and what it belongs to.

    Attributes
    ----------
    axes : mapping of str to ndarray, mm or degrees
        Axis positions, shaped to broadcast to the points.
    field : ErrorField
        Of points in a batch of any shape; of a grid for a VTS file.
    about : mapping of str to str
        Scene, loop, reference, convention, program.
    uncertainty : FieldUncertainty or None
        Standard uncertainty (k = 1) of each point, in columns of its own.
    """

    axes: Mapping[str, Array]
    field: ErrorField
    about: Mapping[str, str] = attribute(default_factory=dict[str, str])
    uncertainty: "FieldUncertainty | None" = None

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the batch of points."""
        return self.field.error_um.shape[:-1]

    @property
    def columns(self) -> dict[str, Array]:
        """Columns of the table by name, each broadcastable to the points; names end in units."""
        found = {
            f"axis_{name}_{'mm' if is_linear(name) else 'deg'}": values
            for name, values in self.axes.items()
        }
        vectors = {"R_{}_mm": self.field.nominal_mm, "error_{}_um": self.field.error_um}
        tilts = {"orientation_{}_urad": self.field.orientation_urad}
        found |= _by_component(vectors) | {"norm_um": self.field.norm_um} | _by_component(tilts)
        if self.uncertainty is not None:
            found |= _by_component({"uncertainty_{}_um": self.uncertainty.error_um})
            found["uncertainty_norm_um"] = self.uncertainty.norm_um
            tilts = {"uncertainty_orientation_{}_urad": self.uncertainty.orientation_urad}
            found |= _by_component(tilts)
        return found

    def blocks(self) -> Iterator[dict[str, Array]]:
        """Give the table some ten thousand rows at a time, the last direction running fastest."""
        columns = self.columns
        for piece in pieces(self.shape):
            nodes = cut(self.field.norm_um, piece).shape
            yield {
                name: np.broadcast_to(cut(values, piece), nodes).reshape(-1)
                for name, values in columns.items()
            }


def _by_component(vectors: Mapping[str, Array]) -> dict[str, Array]:
    """Name the components of vectors."""
    return {
        name.format(letter): values[..., index]
        for name, values in vectors.items()
        for index, letter in enumerate("xyz")
    }


def column_unit(name: str) -> str:
    """Give the unit that the name of a column ends in."""
    return _UNITS[name.rpartition("_")[2]]


def write_field(record: FieldRecord, path: str | Path, *, overwrite: bool = True) -> None:
    """Write a field in the format that the ending of a path names.

    Parameters
    ----------
    record : FieldRecord
    path : str or Path
    overwrite : bool, optional
        Whether an existing file may be replaced.

    Raises
    ------
    OptionError
        If the format cannot hold the field.
    OutputError
        If the file cannot be written.

    Notes
    -----
    Parquet: a row a point and row groups of some ten thousand, the unit of each column in its
    metadata. CSV: the same table, numbers with nine decimals. NPZ: ``nominal_mm``, ``error_um``,
    ``norm_um``, ``orientation_urad`` with the shape of the grid, and ``axis_X_mm`` and so on, which
    broadcast to it. VTS: a structured grid of the nominal points with the same arrays. All but CSV
    say what they belong to: the metadata ``warpspace``, ``about_json``.
    """
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
    """Write the table into a file of its own; remarks are texts that stand in every row."""
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
    """Write a Parquet file, a row group for each block."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    names = list(record.columns)
    schema = pa.schema(
        [pa.field(name, pa.float64(), metadata={"unit": column_unit(name)}) for name in names],
        metadata={"warpspace": json.dumps(dict(record.about), ensure_ascii=False)},
    )
    # positions repeat; pyarrow's stubs know a flag only
    repeated: Any = [name for name in names if name.startswith("axis_")]
    with pq.ParquetWriter(path, schema, use_dictionary=repeated, compression="zstd") as writer:
        for block in record.blocks():
            arrays = [pa.array(values) for values in block.values()]
            writer.write_batch(pa.RecordBatch.from_arrays(arrays, schema=schema))


def _arrays(record: FieldRecord) -> dict[str, Array]:
    """Arrays of a field by name, units in the names."""
    found, spread = record.field, record.uncertainty
    arrays = {
        "nominal_mm": found.nominal_mm,
        "error_um": found.error_um,
        "norm_um": found.norm_um,
        "orientation_urad": found.orientation_urad,
    }
    if spread is not None:
        arrays["uncertainty_um"] = spread.error_um
        arrays["uncertainty_norm_um"] = spread.norm_um
        arrays["uncertainty_orientation_urad"] = spread.orientation_urad
    return arrays


def _write_npz(record: FieldRecord, path: Path) -> None:
    """Write a NumPy archive, an array at a time."""
    axes = {name: values for name, values in record.columns.items() if name.startswith("axis_")}
    about = np.array(json.dumps(dict(record.about), ensure_ascii=False))
    with path.open("wb") as file:
        np.savez(file, allow_pickle=False, **_arrays(record), **axes, **{ABOUT: about})


def _write_vts(record: FieldRecord, path: Path) -> None:
    """Write a VTK structured grid, arrays behind the XML as they are in memory."""
    from vtkmodules.vtkIOXML import vtkXMLStructuredGridWriter

    from warpspace.outputs.exports.multiblock import structured_grid

    arrays = _arrays(record)
    mesh = structured_grid(arrays.pop("nominal_mm"), arrays)
    text = json.dumps(dict(record.about), ensure_ascii=False)
    mesh.field_data[ABOUT] = np.frombuffer(text.encode(), dtype=np.uint8)
    writer = vtkXMLStructuredGridWriter()
    writer.SetInputData(mesh)
    writer.SetDataModeToAppended()
    writer.EncodeAppendedDataOff()
    writer.SetCompressorTypeToNone()
    writer.SetHeaderTypeToUInt64()
    writer.SetFileName(str(path))
    if not writer.Write():
        raise OSError(f"VTK could not write {path}")


_WRITERS: dict[str, Callable[[FieldRecord, Path], None]] = {
    ".parquet": _write_parquet,
    ".npz": _write_npz,
    ".csv": write_numbers_csv,
    ".vts": _write_vts,
}
FIELD_ENDINGS = tuple(_WRITERS)
GRID_ENDINGS = (".vts",)
"""Formats that hold grids only."""
