"""Error fields as CSV: a header with units in the names, one row a point."""

import csv
import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from warpspace.analysis.uncertain import FieldUncertainty
from warpspace.field.basis import ErrorField
from warpspace.machine.axes import is_linear
from warpspace.outputs.files import write_atomically
from warpspace.picture.scene_picture import ScenePicture
from warpspace.units import Array

COLUMNS = (
    *("R_x_mm", "R_y_mm", "R_z_mm", "error_x_um", "error_y_um", "error_z_um", "norm_um"),
    *("orientation_x_urad", "orientation_y_urad", "orientation_z_urad"),
)
UNCERTAIN_COLUMNS = tuple(
    f"uncertainty_{name.removeprefix('error_')}" for name in COLUMNS if not name.startswith("R_")
)
"""Of standard uncertainties (k = 1), behind those of the field."""
_NUMBER = "%.9g"


def write_csv(picture: ScenePicture, path: str | Path, *, overwrite: bool = True) -> None:
    """Write the field of a scene over its grid.

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

    Notes
    -----
    Behind the numbers every row says what it belongs to (scene, loop, reference, convention,
    program), so that tables of several scenes can be put under each other.
    """
    grid = picture.grid
    axes = {
        name: np.broadcast_to(value, grid.shape).reshape(-1)
        for name, value in grid.coordinates.items()
    }
    write_field_csv(path, axes, picture.field, remarks=picture.remarks, overwrite=overwrite)


def write_field_csv(
    path: str | Path,
    axes: Mapping[str, Array],
    field: ErrorField,
    *,
    remarks: Mapping[str, str] | None = None,
    uncertainty: FieldUncertainty | None = None,
    overwrite: bool = True,
) -> None:
    """Write axis positions, nominal points in R, errors and orientation, one row a point.

    Parameters
    ----------
    path : str or Path
    axes : mapping of str to ndarray, [n], mm or degrees
    field : ErrorField
        Of n points, whatever their shape.
    remarks : mapping of str to str, optional
        Columns that say the same in every row.
    uncertainty : FieldUncertainty, optional
        Standard uncertainty of each point, in columns of its own.
    overwrite : bool, optional
        Whether an existing file may be replaced.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    parts = [
        *axes.values(),
        field.nominal_mm.reshape(-1, 3),
        field.error_um.reshape(-1, 3),
        field.norm_um.reshape(-1),
        field.orientation_urad.reshape(-1, 3),
    ]
    if uncertainty is not None:
        parts += [uncertainty.error_um, uncertainty.norm_um, uncertainty.orientation_urad]
    table = np.column_stack(parts)
    columns = COLUMNS if uncertainty is None else (*COLUMNS, *UNCERTAIN_COLUMNS)
    names = [f"axis_{name}_{'mm' if is_linear(name) else 'deg'}" for name in axes]
    remarks = remarks or {}
    row = ",".join([_NUMBER] * table.shape[1])
    tail = "".join("," + _quoted(text) for text in remarks.values()) + "\n"
    with (
        write_atomically(path, overwrite=overwrite) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        file.write(",".join([*names, *columns, *remarks]) + "\n")
        file.writelines(row % tuple(values) + tail for values in table.tolist())


def _quoted(text: str) -> str:
    """Spell a text as one CSV field; no spreadsheet takes it for a formula."""
    line = io.StringIO()
    safe = f"'{text}" if text[:1] in ("=", "+", "-", "@") else text
    csv.writer(line, lineterminator="").writerow([safe])
    return line.getvalue()
