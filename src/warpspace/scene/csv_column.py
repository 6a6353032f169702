"""Reading one column of a CSV file, line by line: memory does not grow with what is refused."""

import csv
import math
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TextIO, TypeVar

from warpspace.exceptions import SceneError, near_miss
from warpspace.machine.limits import MAX_CSV_BYTES, MAX_CSV_COLUMNS, MAX_CSV_LINE, MAX_CSV_LINES
from warpspace.scene.files import check_file, read_text
from warpspace.scene.words import spell_value

_MAX_LINES_OF_ROW = 20
"""Lines that one row may take, where its texts hold line breaks."""
T = TypeVar("T")
Row = tuple[int, list[str]]
"""Number of the line that a row ends on, and its fields."""


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
        If the file cannot be read, has no such column, has too many rows or columns, is ragged,
        holds something that is no finite number, or its positions do not ascend.
    """
    source = str(path)
    return read_csv_rows(
        path, max_rows, lambda rows: _points(rows, column, limit, source, max_rows)
    )


def read_csv_rows(path: Path, max_rows: int, read: Callable[[Iterator[Row]], T]) -> T:
    """Open a CSV file and have its rows read.

    Parameters
    ----------
    path : Path
    max_rows : int
        Largest number of rows accepted below the header.
    read : callable
        Takes the rows that are not empty, the header first.

    Returns
    -------
    object
        What `read` gives.

    Raises
    ------
    SceneError
        If the file cannot be read or is no CSV, or what `read` raises.
    """
    source = str(path)
    check_file(path, MAX_CSV_BYTES, source)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            return read(_rows(file, source, max_rows))
    except UnicodeDecodeError:
        read_text(path, MAX_CSV_BYTES)  # names the byte
        raise
    except csv.Error as error:
        raise SceneError(source, [f"is not valid CSV: {error}"]) from None
    except OSError as error:
        raise SceneError(source, [f"cannot be read: {error.strerror or error}"]) from None


class _Lines:
    """The lines of a file, of bounded length, and no more than a few for one row."""

    def __init__(self, file: TextIO, source: str) -> None:
        self._file, self._source = file, source
        self.number = 0
        self.since_row = 0

    def __iter__(self) -> Iterator[str]:
        """Give line after line."""
        while line := self._file.readline(MAX_CSV_LINE + 1):
            self.number += 1
            self.since_row += 1
            if len(line) > MAX_CSV_LINE:
                found = f"is longer than {MAX_CSV_LINE:,} characters; expected at most so many"
                raise SceneError(self._source, [f"line {self.number} {found}"])
            if self.number > MAX_CSV_LINES:
                found = f"has more than {MAX_CSV_LINES:,} lines; expected at most so many"
                raise SceneError(self._source, [found])
            if self.since_row > _MAX_LINES_OF_ROW:
                raise csv.Error(f"line {self.number}: a quoted text does not end")
            yield line


def _rows(file: TextIO, source: str, max_rows: int) -> Iterator[Row]:
    """Give the rows that are not empty, the header first."""
    lines = _Lines(file, source)
    count = 0
    for row in csv.reader(lines, strict=True):
        lines.since_row = 0
        if not row:
            continue
        count += 1
        if count > max_rows + 1:
            found = f"has more than {max_rows} rows below the header"
            raise SceneError(source, [f"{found}; expected a header and 1 to {max_rows} rows"])
        if len(row) > MAX_CSV_COLUMNS:
            found = f"has {len(row)} fields; expected at most {MAX_CSV_COLUMNS}"
            raise SceneError(source, [f"line {lines.number} {found}"])
        yield lines.number, row


def _points(
    rows: Iterator[Row], column: str, limit: float, source: str, max_rows: int
) -> list[tuple[float, float]]:
    """Read the points row by row; of problems in rows the first is reported."""
    points: list[tuple[float, float]] = []
    _, first = next(rows, (0, []))
    header = [name.strip() for name in first]
    index = find_column(header, column, source) if header else 0
    for line, row in rows:
        try:
            points.append(_point(line, row, len(header), index, limit, points, source))
        except SceneError:
            deque(rows, maxlen=0)  # that the rows are too many, or no CSV, is said before
            raise
    if not points:
        found = "has 0 rows below the header"
        raise SceneError(source, [f"{found}; expected a header and 1 to {max_rows} rows"])
    return points


def find_column(header: list[str], column: str, source: str) -> int:
    """Find the column, behind the first one."""
    if header[1:].count(column) == 1:
        return header.index(column, 1)
    found = "stands there twice" if column in header[1:] else "not found"
    hint = "" if column in header[1:] else near_miss(column, header[1:])
    raise SceneError(source, [f"column {column!r} {found}{hint}"])


def _point(
    line: int,
    row: list[str],
    columns: int,
    index: int,
    limit: float,
    before: list[tuple[float, float]],
    source: str,
) -> tuple[float, float]:
    """Read the position and the value of a row."""
    if len(row) != columns:
        problem = f"has {len(row)} fields; expected {columns} as in the header"
        raise SceneError(source, [f"line {line} {problem}"])
    position, value = (csv_number(source, line, row[at]) for at in (0, index))
    if before and position <= before[-1][0]:
        problem = f"position {position:g} after {before[-1][0]:g}; expected ascending positions"
        raise SceneError(source, [f"line {line}: {problem}"])
    if max(abs(value), abs(position)) > limit:
        found = value if abs(value) > limit else position
        raise SceneError(source, [f"line {line}: {found:g}; expected at most ±{limit:g}"])
    return position, value


def csv_number(source: str, line: int, text: str) -> float:
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
