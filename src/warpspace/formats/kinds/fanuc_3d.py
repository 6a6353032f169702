"""FANUC three-dimensional error compensation: corrections of X, Y and Z at the points of a grid.

FANUC Series 30i-MODEL A, Three-dimensional error compensation, additional manual A-79351E, page 3:
the correction at a position is the sum over the eight corners of its cell, trilinear. The file that
the control itself reads is not published: what is read and written here is a table of the numbers
that are entered into it, a row a point.
"""

import csv
from collections.abc import Sequence

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.kind import CORRECTION, Files, Format, ReadOptions, resolve_axis
from warpspace.formats.measured import Imported
from warpspace.formats.numbers import MM_PER, check_position, read_number, read_whole, unit_factor
from warpspace.formats.source import Source
from warpspace.formats.table_errors import errors_of
from warpspace.formats.terms import Grid3, Tables

MARK = "# three-dimensional error compensation"
DETECTION_MM = 1e-3
"""Detection unit where none is asked for: a micrometre (IS-B)."""
MOST_COUNT = 127
"""Of a correction in detection units, times the magnification."""
MOST_MAGNIFICATION = 100
MOST_POINTS = 25
STEP_SHARE = 1e-4
HEADINGS = ("point", "X [mm]", "Y [mm]", "Z [mm]", "CX", "CY", "CZ")
LIMITS = (
    f"counts within ±{MOST_COUNT} times a magnification of at most {MOST_MAGNIFICATION} and"
    f" {MOST_POINTS} points an axis are taken for the limits of the control: check its parameters"
)


def recognise(head: str, name: str) -> bool:
    """Tell it by its first line."""
    del name
    return head.lstrip().startswith(MARK)


def _settings(source: Source) -> tuple[float, int, list[tuple[int, str]]]:
    """Read detection unit in mm, magnification, and the lines of the table."""
    unit, magnification = DETECTION_MM, 1
    lines: list[tuple[int, str]] = []
    for number, text in enumerate(source.lines, start=1):
        bare = text.strip()
        if not bare.startswith("#"):
            if bare:
                lines.append((number, bare))
            continue
        key, _, value = (part.strip() for part in bare.lstrip("# ").partition("="))
        if key == "detection unit":
            size, _, name = value.partition(" ")
            unit = read_number(size, source, number, key)
            unit *= unit_factor(name.strip(), MM_PER, source, number, key)
            if not 1e-7 <= unit <= 1.0:
                source.refuse(f"{key} {value}; expected 0.0000001 … 1 mm", number)
        elif key == "magnification":
            magnification = read_whole(value, source, number, key, 1, MOST_MAGNIFICATION)
    return unit, magnification, lines


def _grid(source: Source, options: ReadOptions) -> Grid3:
    """Read the grid of a file."""
    unit, magnification, lines = _settings(source)
    if not lines:
        source.refuse(f"has no table; expected the columns {', '.join(HEADINGS)}")
    heading = tuple(part.strip() for part in lines[0][1].split(","))
    if heading != HEADINGS:
        expected = f"expected {', '.join(HEADINGS)}"
        source.refuse(f"columns {', '.join(heading)}; {expected}", lines[0][0])
    rows: list[list[float]] = []
    for count, (number, text) in enumerate(lines[1:], start=1):
        parts = next(csv.reader([text]))
        if len(parts) != len(HEADINGS):
            source.refuse(f"{len(parts)} columns; expected {len(HEADINGS)}", number)
        read_whole(parts[0], source, number, "point", count, count)
        place = [
            check_position(
                read_number(part, source, number, "position"), source, number, "position"
            )
            for part in parts[1:4]
        ]
        counts = [
            read_whole(part, source, number, "correction", -MOST_COUNT - 1, MOST_COUNT)
            for part in parts[4:]
        ]
        rows.append([*place, *(float(c) for c in counts)])
        if count > MOST_POINTS**3:
            source.refuse(f"more than {MOST_POINTS**3} points; expected at most so many", number)
    table = np.array(rows).reshape(-1, 6)
    along = [np.unique(table[:, index]) for index in range(3)]
    shape = tuple(len(places) for places in along)
    if len(table) != np.prod(shape) or min(shape) < 2:
        found = f"{len(table)} points for a grid of {' × '.join(map(str, shape))}"
        source.refuse(f"{found}; expected every point of a grid once (is the file cut off?)")
    if max(shape) > MOST_POINTS:
        found = f"{max(shape)} points along an axis"
        source.refuse(f"{found}; expected at most {MOST_POINTS}, as the control takes")
    for places, axis in zip(along, "XYZ", strict=True):
        steps = np.diff(places)
        if np.ptp(steps) > STEP_SHARE * steps.max():
            source.refuse(
                f"steps of {steps.min():g} to {steps.max():g} mm along {axis}; expected"
                " equal steps, as the control has"
            )
    order = np.lexsort(table[:, :3].T[::-1])
    ordered = table[order].reshape(*shape, 6)
    first, second, third = (resolve_axis(axis, source, None, options) for axis in "XYZ")
    values = options.factor(CORRECTION) * ordered[..., 3:] * unit * magnification
    x, y, z = (tuple(places.tolist()) for places in along)
    return Grid3((first, second, third), (x, y, z), values)


def read_tables(sources: Sequence[Source], options: ReadOptions) -> Tables:
    """Read the grid as the control holds it."""
    if len(sources) > 1:
        sources[1].refuse("is a second grid; expected one")
    said = options.sign or "values are added to the commanded position"
    assumed = (f"sign: {said}", "beyond the grid its border is held", LIMITS)
    return Tables((_grid(sources[0], options),), assumed, (), ("mm", "detection units"))


def read(sources: Sequence[Source], options: ReadOptions) -> Imported:
    """Read the errors, of two axes each, that the grid corrects."""
    return errors_of(read_tables(sources, options), FORMAT.name, sources[0], options)


def write(wanted: Wanted) -> Files:
    """Write the grid; the magnification grows until every correction fits."""
    axes = ("X", "Y", "Z")
    if tuple(wanted.axes) != axes or not set(axes) <= set(wanted.corrector.moved):
        raise OptionError(
            f"fanuc-3d corrects X, Y and Z over a volume of X, Y and Z; that of the scene is of"
            f" {', '.join(wanted.axes)}"
        )
    unit = wanted.resolution or DETECTION_MM
    places = {axis: wanted.places(axis) for axis in axes}
    needed = wanted.corrections(places)
    values = wanted.factor(CORRECTION) * np.stack([needed[axis] for axis in axes], -1)
    largest = float(np.abs(values).max())
    magnification = max(1, int(np.ceil(largest / unit / MOST_COUNT - 1e-9)))
    if magnification > MOST_MAGNIFICATION:
        raise OptionError(
            f"fanuc-3d: corrections reach {largest:.3g} mm, more than {MOST_COUNT} ×"
            f" {MOST_MAGNIFICATION} × {unit:g} mm; expected a larger --resolution"
        )
    counts = np.rint(values / (unit * magnification)).astype(int)
    counts = np.clip(counts, -MOST_COUNT - 1, MOST_COUNT)
    lines = [
        f"{MARK}, {wanted.title}",
        f"# detection unit = {unit:.9f}".rstrip("0") + " mm",
        f"# magnification = {magnification}",
        f"# {'values are ' + wanted.sign + 's' if wanted.sign else 'values are added'}",
        ",".join(HEADINGS),
    ]
    # the first axis runs fastest, as compensation points are numbered
    shape = [len(places[axis]) for axis in reversed(axes)]
    for point, (k, j, i) in enumerate(np.ndindex(*shape), start=1):
        at = [places[axis][index] for axis, index in zip(axes, (i, j, k), strict=True)]
        spelled = [f"{q:.6f}".rstrip("0").rstrip(".") for q in at]
        lines.append(",".join([str(point), *spelled, *map(str, counts[i, j, k].tolist())]))
    return {"": "\n".join(lines) + "\n"}


FORMAT = Format(
    name="fanuc-3d",
    title="FANUC three-dimensional error compensation, a grid of corrections",
    source="FANUC Series 30i-MODEL A, Three-dimensional error compensation, A-79351E",
    endings=(".csv",),
    holds="corrections of X, Y and Z over X, Y and Z",
    units="mm, detection units",
    grid="equal steps along each of three axes",
    limits=f"{MOST_POINTS} points an axis, ±{MOST_COUNT} detection units times the magnification",
    recognise=recognise,
    read=read,
    tables=read_tables,
    write=write,
    points=9,
    most_points=MOST_POINTS,
)
