"""Reading the files of a scene: TOML and CSV, with limits and messages that say what is wrong."""

import csv
import math
import tomllib
from pathlib import Path

from warpspace.exceptions import SceneError, near_miss

MAX_SCENE_BYTES = 4 * 1024 * 1024
MAX_CSV_BYTES = 64 * 1024 * 1024


def read_text(path: Path, limit_bytes: int, source: str | None = None) -> str:
    """Read a text file that a user named.

    Parameters
    ----------
    path : Path
    limit_bytes : int
        Largest size accepted.
    source : str, optional
        How the file is called in messages; its path by default.

    Returns
    -------
    str

    Raises
    ------
    SceneError
        If it is missing, no regular file, too large, unreadable or not UTF-8.
    """
    source = source or str(path)
    try:
        if path.is_dir():
            raise SceneError(source, ["is a folder; expected a file"])
        if not path.exists():
            raise SceneError(source, ["no such file"])
        if not path.is_file():
            raise SceneError(source, ["is no regular file"])
        size = path.stat().st_size
        if size > limit_bytes:
            raise SceneError(
                source, [f"is {size:,} bytes long; expected at most {limit_bytes:,} bytes"]
            )
        return path.read_bytes().decode("utf-8")
    except UnicodeDecodeError as error:
        text = f"is not UTF-8 text (byte {error.start}); expected a UTF-8 file"
        raise SceneError(source, [text]) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SceneError(source, [f"cannot be read: {reason}"]) from None


def parse_toml(text: str, source: str) -> dict[str, object]:
    """Parse TOML text.

    Raises
    ------
    SceneError
        If it is not TOML; the message has line and column.
    """
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        reason = str(error) or "nested too deeply"
        raise SceneError(source, [f"is not valid TOML: {reason}"]) from None


def read_csv_column(path: Path, column: str, limit: float) -> list[tuple[float, float]]:
    """Read axis positions (first column) and one named column of a CSV file with a header.

    Parameters
    ----------
    path : Path
    column : str
        Name of the column in the header.
    limit : float
        Largest magnitude accepted, µm or µrad.

    Returns
    -------
    list of tuple of float, (n, 2)
        Position in mm or degrees, value in µm or µrad.

    Raises
    ------
    SceneError
        If the file cannot be read, has no such column, is ragged, holds something that is no
        finite number, or its positions do not ascend.
    """
    source = str(path)
    text = read_text(path, MAX_CSV_BYTES)
    try:
        rows = [row for row in csv.reader(text.splitlines(), strict=True) if row]
    except csv.Error as error:
        raise SceneError(source, [f"is not valid CSV: {error}"]) from None
    if len(rows) < 2:
        raise SceneError(source, ["expected a header and at least one row"])
    header = [name.strip() for name in rows[0]]
    if column not in header[1:]:
        raise SceneError(source, [f"column {column!r} not found{near_miss(column, header[1:])}"])
    index = header.index(column, 1)
    points: list[tuple[float, float]] = []
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            raise SceneError(
                source,
                [f"row {number} has {len(row)} fields; expected {len(header)} as the header"],
            )
        position, value = (_number(source, number, row[at]) for at in (0, index))
        if points and position <= points[-1][0]:
            raise SceneError(
                source,
                [
                    f"row {number}: position {position:g} after {points[-1][0]:g}; expected ascending"
                ],
            )
        if abs(value) > limit:
            raise SceneError(source, [f"row {number}: {value:g}; expected at most ±{limit:g}"])
        points.append((position, value))
    return points


def _number(source: str, row: int, text: str) -> float:
    """Read one finite number of a CSV file."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise SceneError(source, [f"row {row}: {text.strip()!r}; expected a finite number"])
    return value
