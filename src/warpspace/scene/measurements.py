"""Reading what belongs to measured errors: standard uncertainties, and the readings themselves."""

from collections.abc import Mapping
from pathlib import Path
from typing import cast

from warpspace.exceptions import SceneError
from warpspace.machine.curves.constant import Constant
from warpspace.machine.curves.curve import ErrorFunction, Span
from warpspace.machine.curves.reading import MISSING, ValueReader
from warpspace.machine.curves.table import MAX_COLUMN_NAME, MAX_FILE_NAME, Table
from warpspace.machine.limits import MAX_ERROR, MAX_LENGTH_MM, MAX_POINTS, MAX_RUNS
from warpspace.machine.measurement import RUN_DIRECTIONS, UNKNOWN, Measurement, Run
from warpspace.machine.parameters import PARAMETERS
from warpspace.scene.csv_runs import read_csv_runs
from warpspace.scene.curves import read_curve
from warpspace.scene.sections import Problems
from warpspace.scene.words import location

LIMITS = ((-MAX_LENGTH_MM, MAX_LENGTH_MM), (-MAX_ERROR, MAX_ERROR))
"""Of position and reading."""


def read_uncertainties(
    table: Mapping[str, object],
    spans: Mapping[str, Span],
    folder: Path | None,
    problems: Problems,
) -> dict[str, ErrorFunction]:
    """Read standard uncertainties.

    Parameters
    ----------
    table : mapping of str to object
        By key of the error: a number, or a table of positions and numbers.
    spans : mapping of str to tuple of float, (2,), mm or degrees
        Range of each axis.
    folder : Path or None
        Folder that CSV names are relative to; None where CSV files are not allowed.
    problems : Problems
        What was found so far.

    Returns
    -------
    dict of str to ErrorFunction
        Constants and tables, nowhere negative.
    """
    found: dict[str, ErrorFunction] = {}
    for key, raw in table.items():
        where, row = f"uncertainty.{key}", PARAMETERS[key]
        curve = read_curve(raw, spans[row.axis], where, folder, problems, constant=row.is_constant)
        if curve is None:
            continue
        if not isinstance(curve, Constant | Table):
            expected = "expected a number or { table = [[position, uncertainty], …] }"
            problems.add(where, expected, raw)
            continue
        values = [curve.value] if isinstance(curve, Constant) else [v for _, v in curve.points]
        if min(values) < 0.0:
            problems.add(where, "a standard uncertainty is not negative", min(values))
        found[key] = curve
    return found


def read_measurements(
    table: Mapping[str, object], folder: Path | None, problems: Problems
) -> dict[str, Measurement]:
    """Read the readings of errors.

    Parameters
    ----------
    table : mapping of str to object
        By key of the error: its runs, or the CSV file and column that they stand in.
    folder : Path or None
        Folder that CSV names are relative to; None where CSV files are not allowed.
    problems : Problems
        What was found so far.

    Returns
    -------
    dict of str to Measurement
    """
    found: dict[str, Measurement] = {}
    for key, raw in table.items():
        reader = ValueReader()
        if isinstance(raw, dict) and "csv" in raw:
            runs = _csv_runs(cast("dict[str, object]", raw), folder, reader)
        else:
            entries = reader.table(raw, (), ("runs",))
            runs = _runs(entries["runs"], reader) if entries else ()
        for finding in reader.findings:
            problems.add(location(f"measured.{key}", finding.path), finding.text, finding.value)
        if not reader.findings:
            found[key] = Measurement(runs)
    return found


def _runs(raw: object, reader: ValueReader) -> tuple[Run, ...]:
    """Read runs that stand in the scene file."""
    found: list[Run] = []
    count = 0
    for index, entry in enumerate(reader.entries(raw, ("runs",), MAX_RUNS)):
        place = ("runs", index)
        table = reader.table(entry, place, ("direction", "points"))
        if not table:
            continue
        way = UNKNOWN if table["direction"] is MISSING else table["direction"]
        if way not in RUN_DIRECTIONS:
            reader.note((*place, "direction"), 'expected "+", "-" or "" (not known)', way)
        points: list[tuple[float, float]] = []
        for at, point in enumerate(reader.entries(table["points"], (*place, "points"), MAX_POINTS)):
            where = (*place, "points", at)
            position, value = reader.row(point, where, "[position, value]", LIMITS)
            points.append((position, value))
        found.append(Run(str(way), tuple(points)))
        count += len(points)
    if count > MAX_POINTS:
        reader.note(("runs",), f"have {count:,} readings; expected at most {MAX_POINTS:,}")
    return tuple(found)


def _csv_runs(raw: dict[str, object], folder: Path | None, reader: ValueReader) -> tuple[Run, ...]:
    """Read runs that stand in a CSV file beside the scene file."""
    entries = reader.table(raw, (), ("csv", "column"))
    file = reader.text(entries["csv"], ("csv",), MAX_FILE_NAME)
    column = reader.text(entries["column"], ("column",), MAX_COLUMN_NAME)
    if reader.findings:
        return ()
    if folder is None:
        reader.note((), "CSV files are not read here; expected the readings as runs = [ … ]")
        return ()
    try:
        return read_csv_runs(folder / file, column)
    except SceneError as error:
        for problem in error.problems:
            reader.note((), f"{error.source}: {problem}")
        return ()
