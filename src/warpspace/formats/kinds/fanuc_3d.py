"""FANUC three-dimensional error compensation: corrections of X, Y and Z at the points of a grid.

FANUC Series 30i-MODEL A, Three-dimensional error compensation, additional manual A-79351E, page 3:
the correction at a position is the sum over the eight corners of its cell, trilinear. The file of
the control itself is not published: this module reads and writes a table of the numbers to be
entered into the control, one row per point.
"""

from collections.abc import Sequence

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.formats.compensation.corrections import RequiredCorrections
from warpspace.formats.registry import CORRECTION, Files, Format, ReadOptions, describe, has_pattern
from warpspace.formats.source import MM_PER, Source, format_comment
from warpspace.formats.terms import Grid3, Tables

MARK = "# three-dimensional error compensation"
DETECTION_MM = 1e-3  # default of the detection unit: a micrometre (IS-B)
MAX_COUNT = 127  # of a correction in detection units, times the magnification
MAX_MAGNIFICATION = 100
MAX_AXIS_POINTS = 25
STEP_SHARE = 1e-4
HEADINGS = ("point", "X [mm]", "Y [mm]", "Z [mm]", "CX", "CY", "CZ")
LIMITS = (
    f"assumed limits of the control: counts within ±{MAX_COUNT}, a magnification of at most"
    f" {MAX_MAGNIFICATION}, {MAX_AXIS_POINTS} points per axis; check its parameters"
)


def _settings(source: Source) -> tuple[float, int]:
    unit, magnification = DETECTION_MM, 1
    for at, text in source.scan():
        key, _, value = (part.strip() for part in text.lstrip("# ").partition("="))
        if key == "detection unit":
            size, _, name = value.partition(" ")
            unit = at.number(size, key) * at.unit(name.strip(), MM_PER, key)
            if not 1e-7 <= unit <= 1.0:
                at.refuse(f"{key} {value}", "0.0000001 … 1 mm")
        elif key == "magnification":
            magnification = at.integer(value, key, 1, MAX_MAGNIFICATION)
    return unit, magnification


def _grid(source: Source, options: ReadOptions) -> Grid3:
    unit, magnification = _settings(source)
    csv_rows = source.rows(MAX_AXIS_POINTS**3)
    if not csv_rows.header:
        source.refuse("has no table", f"the columns {', '.join(HEADINGS)}")
    if tuple(csv_rows.header) != HEADINGS:
        head = source.at(csv_rows.line)
        head.refuse(f"columns {', '.join(csv_rows.header)}", ", ".join(HEADINGS))
    rows: list[list[float]] = []
    for count, (number, parts) in enumerate(csv_rows, start=1):
        at = source.at(number)
        at.integer(parts[0], "point", count, count)
        numbers = (csv_rows.number(part, number, "position") for part in parts[1:4])
        place = [at.checked_position(q, "position") for q in numbers]
        counts = [at.integer(part, "correction", -MAX_COUNT - 1, MAX_COUNT) for part in parts[4:]]
        rows.append([*place, *counts])
    csv_rows.check()
    table = np.array(rows).reshape(-1, 6)
    along = [np.unique(table[:, index]) for index in range(3)]
    shape = tuple(len(places) for places in along)
    if len(table) != np.prod(shape) or min(shape) < 2:
        problem = f"{len(table)} points for a grid of {' × '.join(map(str, shape))}"
        source.refuse(problem, "every point of a grid once (is the file truncated?)")
    if max(shape) > MAX_AXIS_POINTS:
        expected = f"at most {MAX_AXIS_POINTS}, the limit of the control"
        source.refuse(f"{max(shape)} points along an axis", expected)
    for places, axis in zip(along, "XYZ", strict=True):
        steps = np.diff(places)
        if np.ptp(steps) > STEP_SHARE * steps.max():
            problem = f"steps of {steps.min():g} to {steps.max():g} mm along {axis}"
            source.refuse(problem, "equal steps, a requirement of the control")
    ordered = table[np.lexsort(table[:, :3].T[::-1])].reshape(*shape, 6)
    x, y, z = (options.axis_named(axis, source) for axis in "XYZ")
    values = options.factor(CORRECTION) * ordered[..., 3:] * unit * magnification
    return Grid3((x, y, z), tuple(tuple(places.tolist()) for places in along), values)


def read_tables(sources: Sequence[Source], options: ReadOptions) -> Tables:
    if len(sources) > 1:
        sources[1].refuse("is a second grid", "one")
    sign = options.sign or "values are added to the commanded position"
    assumed = (f"sign: {sign}", "beyond the grid, the values at its boundary apply", LIMITS)
    return Tables((_grid(sources[0], options),), assumed, (), ("mm", "detection units"))


def write(required: RequiredCorrections) -> Files:
    """Write the grid, with the smallest magnification that represents all corrections."""
    axes = ("X", "Y", "Z")
    if tuple(required.axes) != axes or not set(axes) <= set(required.corrector.moved):
        raise OptionError(
            "fanuc-3d corrects X, Y and Z; expected a working volume of X, Y and Z instead of"
            f" {', '.join(required.axes)}"
        )
    unit = required.resolution or DETECTION_MM
    places = {axis: required.positions(axis) for axis in axes}
    moves = required.corrections(places)
    values = required.factor(CORRECTION) * np.stack([moves[axis] for axis in axes], -1)
    largest = float(np.abs(values).max())
    magnification = max(1, int(np.ceil(largest / unit / MAX_COUNT - 1e-9)))
    if magnification > MAX_MAGNIFICATION:
        raise OptionError(
            f"fanuc-3d: corrections reach {largest:.3g} mm, more than {MAX_COUNT} ×"
            f" {MAX_MAGNIFICATION} × {unit:g} mm; expected a larger {{resolution}}"
        )
    counts = np.rint(values / (unit * magnification)).astype(int)
    counts = np.clip(counts, -MAX_COUNT - 1, MAX_COUNT)
    lines = [
        format_comment(f"{MARK}, ", required.scene.title),
        f"# detection unit = {unit:.9f}".rstrip("0") + " mm",
        f"# magnification = {magnification}",
        f"# {'values are ' + required.sign + 's' if required.sign else 'values are added'}",
        ",".join(HEADINGS),
    ]
    # compensation points are numbered with the first axis fastest
    shape = [len(places[axis]) for axis in reversed(axes)]
    for point, (k, j, i) in enumerate(np.ndindex(*shape), start=1):
        at = [places[axis][index] for axis, index in zip(axes, (i, j, k), strict=True)]
        coordinates = [f"{q:.6f}".rstrip("0").rstrip(".") for q in at]
        lines.append(",".join([str(point), *coordinates, *map(str, counts[i, j, k].tolist())]))
    return {"": "\n".join(lines) + "\n"}


LARGEST = f"{MAX_AXIS_POINTS} points per axis, ±{MAX_COUNT} detection units times the magnification"
FORMATS = (
    Format(
        **describe("fanuc-3d"), limits=LARGEST, recognise=has_pattern(rf"\A\s*{MARK}"),
        tables=read_tables, write=write, most_points=MAX_AXIS_POINTS,
    ),
)  # fmt: skip
