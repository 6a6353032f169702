"""Reading the runs of a measured error from a CSV file: a position, a reading, a run each row."""

from collections.abc import Iterator
from pathlib import Path

from warpspace.exceptions import SceneError
from warpspace.machine.limits import MAX_ERROR, MAX_LENGTH_MM, MAX_POINTS, MAX_RUNS
from warpspace.machine.measurement import RUN_DIRECTIONS, UNKNOWN, Run
from warpspace.scene.csv_column import Row, csv_number, find_column, read_csv_rows
from warpspace.scene.words import spell_value

RUN, DIRECTION = "run", "direction"
"""Columns that a file may have."""


def read_csv_runs(path: Path, column: str) -> tuple[Run, ...]:
    """Read the runs of one error.

    Parameters
    ----------
    path : Path
        With a header; the first column is the position in mm or degrees. Rows of one run and one
        direction make a run; ``run`` (any text) and ``direction`` (``+``, ``-`` or nothing) may be
        left out.
    column : str
        Column of the readings, µm or µrad.

    Returns
    -------
    tuple of Run
        In the order in which they begin.

    Raises
    ------
    SceneError
        If the file cannot be read, has no such column, is ragged, or holds something that is no
        finite number; the message has the line.
    """
    source = str(path)
    return read_csv_rows(path, MAX_POINTS, lambda rows: _read(rows, column, source))


def _read(rows: Iterator[Row], column: str, source: str) -> tuple[Run, ...]:
    """Sort rows into runs."""
    _, first = next(rows, (0, []))
    header = [name.strip() for name in first]
    value_at = find_column(header, column, source)
    run_at, way_at = (header.index(name) if name in header else None for name in (RUN, DIRECTION))
    found: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for line, row in rows:
        if len(row) != len(header):
            problem = f"line {line} has {len(row)} fields; expected {len(header)} as in the header"
            raise SceneError(source, [problem])
        way = UNKNOWN if way_at is None else row[way_at].strip()
        if way not in RUN_DIRECTIONS:
            problem = f"line {line}: direction {spell_value(way)}; expected +, - or nothing"
            raise SceneError(source, [problem])
        position, value = (csv_number(source, line, row[at]) for at in (0, value_at))
        for number, limit in ((position, MAX_LENGTH_MM), (value, MAX_ERROR)):
            if abs(number) > limit:
                problem = f"line {line}: {number:g}; expected at most ±{limit:g}"
                raise SceneError(source, [problem])
        run = "" if run_at is None else row[run_at].strip()
        found.setdefault((run, way), []).append((position, value))
        if len(found) > MAX_RUNS:
            raise SceneError(source, [f"has more than {MAX_RUNS} runs; expected at most so many"])
    if not found:
        raise SceneError(source, ["has 0 rows below the header; expected at least one"])
    return tuple(Run(way, tuple(points)) for (_, way), points in found.items())
