"""From the raw value of an error in a scene file to its curve; each kind of curve reads its own."""

from collections.abc import Collection
from pathlib import Path
from typing import cast

from warpspace.machine.curves.constant import Constant
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.curves.reading import MISSING, CsvColumn, Points, ValueReader, is_number
from warpspace.machine.curves.registry import find_form, spell_forms
from warpspace.machine.limits import MAX_ERROR, MAX_POINTS
from warpspace.scene.csv_column import read_csv_column
from warpspace.scene.sections import Problems
from warpspace.scene.words import location


def read_curve(
    raw: object,
    span: tuple[float, float],
    where: str,
    folder: Path | None,
    problems: Problems,
    *,
    constant: bool = False,
    axis: str = "",
    axes: Collection[str] = (),
) -> ErrorFunction | None:
    """Read the curve of an error.

    Parameters
    ----------
    raw : object
        A number, or a table of one of the registered kinds of curve.
    span : tuple of float, (2,), mm or degrees
        Range of the axis.
    where : str
        Place of the value in the file.
    folder : Path or None
        Folder that CSV names are relative to; None where CSV files are not allowed.
    problems : Problems
        What was found so far.
    constant : bool, optional
        Whether only a number is allowed.
    axis : str, optional
        The axis of the error, for curves that name axes.
    axes : collection of str, optional
        All axes of the machine.

    Returns
    -------
    ErrorFunction or None
        None where problems were noted.
    """
    before = len(problems.lines)
    # A constant must be a number: the file that a table names need not be read.
    columns = _no_points if constant else _csv_columns(folder)

    def read(value: object, place: str) -> ErrorFunction | None:
        """Read a curve, and the curves within it."""
        reader = ValueReader(
            columns,
            axis=axis,
            axes=axes,
            curve=lambda inner, path: read(inner, location(place, path)),
        )
        return _read(value, span, place, problems, reader)

    curve = read(raw, where)
    if constant and not is_number(raw) and len(problems.lines) == before:
        problems.add(where, "is constant along its axis; expected a number", raw)
    return curve if len(problems.lines) == before else None


def _read(
    raw: object, span: tuple[float, float], where: str, problems: Problems, reader: ValueReader
) -> ErrorFunction | None:
    """Read a number or a table and note what is wrong with it."""
    if is_number(raw):
        curve, table, form = Constant.read(raw, span, reader), {}, ()
    elif raw is MISSING:
        problems.add(where, "is missing")
        return None
    else:
        table = cast("dict[str, object]", raw) if isinstance(raw, dict) else {}
        found = find_form(table)
        if found is None:
            problems.add(where, f"expected {spell_forms()}", raw)
            return None
        kind, form = found
        curve = kind.read({**dict.fromkeys(form, MISSING), **table}, span, reader)
    for finding in reader.findings:
        problems.add(location(where, finding.path), finding.text, finding.value)
    for key in table:
        if key not in form:
            problems.unknown(where, key, form, "key")
    return curve


def _no_points(file: str, column: str) -> Points:
    """Read no file."""
    del file, column
    return ()


def _csv_columns(folder: Path | None) -> CsvColumn | None:
    """Give the reader of CSV columns in a folder."""
    if folder is None:
        return None
    return lambda file, column: read_csv_column(folder / file, column, MAX_ERROR, MAX_POINTS)
