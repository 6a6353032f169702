"""Reading the files of a scene: TOML and CSV, with limits and messages that say what is wrong."""

import csv
import io
import math
import tomllib
from pathlib import Path

from warpspace.exceptions import SceneError, near_miss
from warpspace.scene.words import spell_value

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
        return path.read_bytes().decode("utf-8-sig")
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
    except RecursionError:
        raise SceneError(source, ["is not valid TOML: nested too deeply"]) from None
    except ValueError as error:  # a syntax error, or a whole number Python refuses to read
        reason = str(error).partition(";")[0]
        raise SceneError(source, [f"is not valid TOML: {reason}"]) from None


def read_csv_column(
    path: Path, column: str, limit: float, max_rows: int
) -> list[tuple[float, float]]:
    """Read axis positions (first column) and one named column of a CSV file with a header.

    Parameters
    ----------
    path : Path
    column : str
        Name of the column in the header.
    limit : float
        Largest magnitude accepted: of a value in µm or µrad, and of a position in mm or degrees.
    max_rows : int
        Largest number of rows accepted.

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
        reader = csv.reader(io.StringIO(text, newline=""), strict=True)
        rows = [(reader.line_num, row) for row in reader if row]
    except csv.Error as error:
        raise SceneError(source, [f"is not valid CSV: {error}"]) from None
    if not 2 <= len(rows) <= max_rows + 1:
        found = f"has {max(len(rows) - 1, 0)} rows below the header"
        raise SceneError(source, [f"{found}; expected a header and 1 to {max_rows} rows"])
    header = [name.strip() for name in rows[0][1]]
    if header[1:].count(column) != 1:
        found = "stands there twice" if column in header[1:] else "not found"
        hint = "" if column in header[1:] else near_miss(column, header[1:])
        raise SceneError(source, [f"column {column!r} {found}{hint}"])
    index = header.index(column, 1)
    points: list[tuple[float, float]] = []
    for line, row in rows[1:]:
        if len(row) != len(header):
            problem = f"has {len(row)} fields; expected {len(header)} as in the header"
            raise SceneError(source, [f"line {line} {problem}"])
        position, value = (_number(source, line, row[at]) for at in (0, index))
        if points and position <= points[-1][0]:
            problem = f"position {position:g} after {points[-1][0]:g}; expected ascending positions"
            raise SceneError(source, [f"line {line}: {problem}"])
        if max(abs(value), abs(position)) > limit:
            found = value if abs(value) > limit else position
            raise SceneError(source, [f"line {line}: {found:g}; expected at most ±{limit:g}"])
        points.append((position, value))
    return points


def _number(source: str, line: int, text: str) -> float:
    """Read one finite number of a CSV file."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise SceneError(
            source, [f"line {line}: {spell_value(text.strip())}; expected a finite number"]
        )
    return value
