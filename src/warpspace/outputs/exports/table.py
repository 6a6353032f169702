"""The field of a picture as CSV: a header with units in the names, one row a point."""

from pathlib import Path

from warpspace.outputs.exports.fields import FieldRecord, write_numbers_csv
from warpspace.outputs.files import write_atomically
from warpspace.picture.scene_picture import ScenePicture

_FORMULA = ("=", "+", "-", "@")


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
    record = FieldRecord(picture.grid.coordinates, picture.field)
    # no spreadsheet takes a text for a formula
    remarks = {
        name: f"'{text}" if text.startswith(_FORMULA) else text
        for name, text in picture.remarks.items()
    }
    with write_atomically(path, overwrite=overwrite) as temporary:
        write_numbers_csv(record, temporary, remarks)
