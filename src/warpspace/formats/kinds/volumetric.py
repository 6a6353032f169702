"""Volumetric compensation of the ISG kernel and TwinCAT CNC: two files with one set of parameters.

ISG kernel documentation, FCT-C26: parameters in mm and rad, arguments in mm and degrees; position
errors `C0B`, component errors `EXY`; GRID interpolation is linear. A rotation takes place about the
nominal axis and is then subject to location and component errors in fixed directions (page
"Alternative model"); with alternative_model = 1 it takes place about the distorted axis.

ISG CSV (page 296429067, TwinCAT 3 CNC TF5280): a header of arguments and parameters, blocks parted
by #; columns part by blanks; two arguments make an error of two axes. Etalon exchange format (page
296430091): blocks named after ISO 230-1, `[C0B]` VALUE and `[EXY]` Gridpoints; of its two variants
"Vendor" is the one to use. Rows of comments begin with // in both.
"""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.formats import measured
from warpspace.formats.compensation.corrections import RequiredCorrections
from warpspace.formats.registry import Files, Format, ReadOptions, format_description
from warpspace.formats.source import Source, SourceLine, format_comment, format_number
from warpspace.machine.axes import PARAMETERS, direction_index, is_linear, parameter
from warpspace.machine.limits import MAX_POINTS
from warpspace.units import UM_PER_MM, URAD_PER_RAD

STANDARD, ALTERNATIVE = "standard", "alternative"
ARGUMENTS = ("X", "Y", "Z", "A", "B", "C")
VARIANTS = (STANDARD, ALTERNATIVE)
CONVENTION = {"linear": "after_motion", "rotary": "before_motion"}
DIGITS = 12
ASSUMED = (
    "a positive angle follows the right-hand rule, also of a squareness",
    "errors of a linear axis ride on it, those of a rotary axis act in fixed directions",
    "values beyond the points are held",
)
IGNORED = re.compile(r"P0[XYZ]|N0[XYZ]|P[XYZ][ABC]|V[XYZ][XYZABC]|ID[XYZ]|LN[XYZABC]")
FINE_DEG = 1.0  # steps of a table that a wave is added to


def error_name(name: str) -> str:
    """Give the key of a parameter of a file; empty where it is no error."""
    upper = name.strip().upper()
    for key in (upper, f"E{upper}"):
        if key in PARAMETERS:
            return key
    return ""


def file_name(key: str) -> str:
    """Give the name that a file has for a key: C0B for EC0B."""
    return key[1:] if parameter(key).is_constant else key


def factor_of(key: str) -> float:
    """Give the factor from mm or rad to µm or µrad."""
    return URAD_PER_RAD if parameter(key).is_rotation else UM_PER_MM


def ignored_notes(names: Sequence[str]) -> tuple[str, ...]:
    return (f"{', '.join(names)}: no errors, left out",) if names else ()


def check_axes(imported: measured.ImportedErrors, name: str) -> None:
    if other := next((axis for axis in imported.axes if axis not in ARGUMENTS), ""):
        raise OptionError(f"{name} knows the axes {', '.join(ARGUMENTS)}; the scene has {other}")


def _finished(imported: measured.ImportedErrors, options: ReadOptions) -> measured.ImportedErrors:
    imported = replace(
        imported,
        units=("mm", "rad", "degrees for rotary positions"),
        assumed=(*imported.assumed, *ASSUMED),
        convention=CONVENTION,
    )
    if options.variant != ALTERNATIVE:
        assumption = "rotation about the nominal axis (alternative_model 0); --variant says otherwise"
        return replace(imported, assumed=(*imported.assumed, assumption))
    assumption = "rotation about the distorted axis (alternative_model 1)"
    imported = replace(imported, assumed=(*imported.assumed, assumption))
    for axis in dict.fromkeys(parameter(key).axis for key in imported.constants):
        if not is_linear(axis):
            imported = _about_distorted_axis(imported, axis, options)
    return imported


def _about_distorted_axis(
    imported: measured.ImportedErrors, axis: str, options: ReadOptions
) -> measured.ImportedErrors:
    """Take back, turned with the axis, what the constant errors of a rotary axis move at zero.

    A rotation R about an axis that is displaced by E₀ is E₀·R·E₀⁻¹: to first order the constant
    error minus the same error turned by R, which is one wave a turn of its component errors.
    """
    machine = options.machine
    sense = machine.axes[axis].direction if machine is not None and axis in machine.axes else 1
    axis_index = direction_index(axis)
    first, second = (axis_index + 1) % 3, (axis_index + 2) % 3
    for letters in ("XYZ", "ABC"):
        one, other = (
            imported.constants.get(f"E{letters[index]}0{axis}", 0.0) for index in (first, second)
        )
        along = imported.constants.get(f"E{letters[axis_index]}0{axis}", 0.0)
        imported = _plus(imported, f"E{letters[first]}{axis}", 0.0, -one, sense * other)
        imported = _plus(imported, f"E{letters[second]}{axis}", 0.0, -other, -sense * one)
        imported = _plus(imported, f"E{letters[axis_index]}{axis}", -along)
    return imported


def _plus(
    imported: measured.ImportedErrors,
    key: str,
    offset: float = 0.0,
    cosine: float = 0.0,
    sine: float = 0.0,
) -> measured.ImportedErrors:
    size = math.hypot(cosine, sine)
    if not size and not offset:
        return imported
    present = next((one for one in imported.series if one.key == key), None)
    if present is None:
        phase = math.degrees(math.atan2(sine, cosine))
        curve = {"harmonics": [[1, size, phase]]} if size else {"poly": [offset]}
        return replace(imported, curves={**imported.curves, key: curve})
    at = np.array(present.positions)
    if size:
        at = np.union1d(at, np.arange(at[0], at[-1], FINE_DEG))
    values = np.interp(at, present.positions, present.values) + offset
    values = values + cosine * np.cos(np.deg2rad(at)) + sine * np.sin(np.deg2rad(at))
    changed = measured.ErrorSeries(
        key,
        tuple(at.tolist()),
        (measured.MeasuredRun(1, measured.UNDIRECTED, tuple(values.tolist())),),
    )
    series = tuple(changed if one.key == key else one for one in imported.series)
    return replace(imported, series=series)


def _read_with(
    read_one: Callable[[Source], Sequence[measured.ImportedErrors]],
) -> Callable[[Sequence[Source], ReadOptions], measured.ImportedErrors]:
    return lambda sources, options: _finished(
        measured.merge([part for source in sources for part in read_one(source)]), options
    )


ISG = "isg-csv"
_SPLIT = re.compile(r"[\s;,]+")
Block = list[tuple[SourceLine, list[str]]]
Row = tuple[SourceLine, dict[str, float]]


def _is_isg(head: str, name: str) -> bool:
    del name
    for text in head.splitlines():
        bare = text.split("//")[0].strip()
        if not bare or bare == "#":
            continue
        names = [part for part in _SPLIT.split(bare) if part]
        parameters = [part for part in names if error_name(part)]
        return bool(parameters) and len(parameters) + sum(part in ARGUMENTS for part in names) == len(names)
    return False


def _blocks(source: Source) -> list[Block]:
    blocks: list[Block] = [[]]
    for at, text in source.scan("//"):
        bare = text
        if bare.startswith("#"):
            blocks.append([])
            bare = bare[1:].strip()
        if bare:
            blocks[-1].append((at, [part for part in _SPLIT.split(bare) if part]))
            if len(blocks[-1]) > MAX_POINTS:
                at.refuse(f"a block has more than {MAX_POINTS:,} rows", "at most so many")
    return [block for block in blocks if block]


def _read_isg(source: Source) -> list[measured.ImportedErrors]:
    imports: list[measured.ImportedErrors] = []
    keys: set[str] = set()
    for block in _blocks(source):
        part = _read_block(source, block)
        for key in part.keys:
            if key in keys:
                name = file_name(key)
                block[0][0].refuse(f"{name} stands in two blocks", "it in one")
            keys.add(key)
        imports.append(part)
    if not keys:
        source.refuse("has no errors", "a header such as X EXX EYX")
    return imports


def _read_block(source: Source, block: Block) -> measured.ImportedErrors:
    at, names = block[0]
    arguments = [name for name in names if name in ARGUMENTS]
    left = [name for name in names if IGNORED.fullmatch(name)]
    key_of = {name: error_name(name) for name in names}
    for name in names:
        if name not in (*arguments, *left) and not key_of[name]:
            expected = "arguments X Y Z A B C and parameters such as EXX or C0B"
            at.refuse(f"column {name!r}", expected)
    if twice := next((name for name in names if names.count(name) > 1), ""):
        at.refuse(f"column {twice} stands there twice", "it once")
    if len(arguments) > 2:
        expected = "one or two: no error here depends on more"
        at.refuse(f"{len(arguments)} arguments {' '.join(arguments)}", expected)
    if len(block) < 2:
        at.refuse("a header without records", "at least one")
    rows: list[Row] = []
    for place, parts in block[1:]:
        if len(parts) != len(names):
            place.refuse(f"{len(parts)} fields", f"{len(names)} as in the header")
        row: dict[str, float] = {}
        for name, part in zip(names, parts, strict=True):
            value = place.number(part, name)
            if name in arguments:
                row[name] = place.checked_position(value, name)
            elif key := key_of[name]:
                row[key] = place.checked_error(value * factor_of(key), name)
        rows.append((place, row))
    notes = (*source.notes, *ignored_notes(left))
    keys = [key for name in names if (key := key_of[name])]
    if not arguments and len(rows) > 1:
        rows[1][0].refuse(f"{len(rows)} records without arguments", "one")
    for key in keys:
        _check_arguments(at, key, arguments)
    if not arguments:
        return measured.ImportedErrors(
            ISG, constants={key: rows[0][1][key] for key in keys}, notes=notes
        )
    if len(arguments) == 2:
        planes = tuple(_isg_plane(source, key, arguments, rows) for key in keys)
        return measured.ImportedErrors(ISG, surfaces=planes, notes=notes)
    series = tuple(_isg_series(key, arguments[0], rows) for key in keys)
    return measured.ImportedErrors(ISG, series, notes=notes)


def _check_arguments(at: SourceLine, key: str, arguments: Sequence[str]) -> None:
    row = parameter(key)
    if not arguments:
        if not row.is_constant:
            at.refuse(f"{key} without an argument", f"the argument {row.axis} beside it")
    elif row.is_constant:
        expected = "it in a block without arguments"
        at.refuse(f"{file_name(key)} is constant", expected)
    elif row.axis not in arguments:
        at.refuse(f"{key} over {' and '.join(arguments)}", f"the argument {row.axis}")


def _isg_series(key: str, argument: str, rows: Sequence[Row]) -> measured.ErrorSeries:
    for (_, before), (at, row) in pairwise(rows):
        if row[argument] <= before[argument]:
            problem = f"{argument} {row[argument]:g} after {before[argument]:g}"
            at.refuse(problem, "ascending positions")
    run = measured.MeasuredRun(1, measured.UNDIRECTED, tuple(row[key] for _, row in rows))
    return measured.ErrorSeries(key, tuple(row[argument] for _, row in rows), (run,))


def _isg_plane(
    source: Source, key: str, arguments: Sequence[str], rows: Sequence[Row]
) -> measured.ErrorSurface:
    own = parameter(key).axis
    other = next(axis for axis in arguments if axis != own)
    points = [(at, row[own], row[other], row[key]) for at, row in rows]
    return measured.build_surface(key, (own, other), points, source)


def _write_isg(corrections: RequiredCorrections) -> Files:
    imported = measured.to_single_direction(measured.sample_errors(corrections), corrections)
    check_axes(imported, ISG)

    def format_value(value: float, key: str) -> str:
        return format_number(value / factor_of(key), DIGITS)

    blocks: list[list[list[str]]] = []
    for table in measured.build_error_tables(imported):
        names = [*reversed(table.axes), *map(file_name, table.keys)]
        ordered = sorted(table.rows, key=lambda row: row[0][::-1])  # the first axis runs fastest
        rows = [
            [*map(repr, reversed(at)), *map(format_value, values, table.keys)]
            for at, _, values in ordered
        ]
        blocks.append([names, *rows])
    if not blocks:
        key = measured.zero_key(corrections.scene)
        blocks = [[[parameter(key).axis, key], ["0.0", "0.0"]]]
    texts = ["\n".join("\t".join(row) for row in block) for block in blocks]
    return {
        "": f"{format_comment('// ', corrections.scene.title)}\n// mm, rad, degrees\n"
        + "\n#\n".join(texts)
        + "\n"
    }


ISO = "iso-text"
_SECTION = re.compile(r"\[\s*([A-Za-z0-9]+)\s*\]")
_VALUE = re.compile(r"VALUE\s*=\s*(\S+)", re.IGNORECASE)
_OPEN = re.compile(r"Gridpoints\s*=\s*\{?", re.IGNORECASE)


def _is_iso(head: str, name: str) -> bool:
    del name
    blocks = [error for error in _SECTION.findall(head) if error_name(error)]
    return bool(blocks) and bool(re.search(r"Gridpoints|VALUE\s*=", head, re.IGNORECASE))


def _read_iso(source: Source) -> measured.ImportedErrors:
    constants: dict[str, float] = {}
    series: list[measured.ErrorSeries] = []
    left: list[str] = []
    key, name = "", ""
    opened: SourceLine | None = None
    rows: list[tuple[float, float]] = []
    for at, bare in source.scan("//"):
        if opened:
            body, closed, _ = bare.partition("}")
            _iso_row(at, body.replace("{", " ").split(), rows, name, key)
            if closed:
                if not rows:
                    at.refuse(f"[{name}] has no points", "position and value")
                if key:
                    places, values = zip(*rows, strict=True)
                    series.append(
                        measured.ErrorSeries(
                            key, places, (measured.MeasuredRun(1, measured.UNDIRECTED, values),)
                        )
                    )
                opened, rows = None, []
        elif matched := _SECTION.fullmatch(bare):
            name = matched[1].upper()
            key = error_name(name)
            if not key and not IGNORED.fullmatch(name):
                at.refuse(f"[{name}]", "a parameter such as EXY or C0B")
            if not key:
                left.append(name)
            elif key in constants or any(one.key == key for one in series):
                at.refuse(f"[{name}] is given twice", "it once")
        elif not name:
            at.refuse(at.quoted, "a block such as [EXY]")
        elif matched := _VALUE.fullmatch(bare):
            value = at.number(matched[1], f"VALUE of {name}")
            if key and not parameter(key).is_constant:
                at.refuse(f"[{name}] has one VALUE", "Gridpoints = { position value … }")
            if key:
                constants[key] = at.checked_error(value * factor_of(key), name)
        elif _OPEN.fullmatch(bare):
            if key and parameter(key).is_constant:
                at.refuse(f"[{name}] has Gridpoints", "VALUE = number")
            opened = at
        elif bare != "{":
            at.refuse(at.quoted, "VALUE = number or Gridpoints = {")
    if opened:
        opened.refuse(f"Gridpoints of [{name}] do not end", "} (is the file cut off?)")
    notes = (*source.notes, *ignored_notes(left))
    return measured.ImportedErrors(ISO, tuple(series), constants=constants, notes=notes)


def _iso_row(
    at: SourceLine, parts: list[str], rows: list[tuple[float, float]], name: str, key: str
) -> None:
    if not parts:
        return
    if len(parts) != 2:
        at.refuse(f"{len(parts)} numbers in {at.quoted}", "position and value")
    position = at.position(parts[0], "position")
    if rows and position <= rows[-1][0]:
        problem = f"position {position:g} of {name} after {rows[-1][0]:g}"
        at.refuse(problem, "ascending positions")
    rows.append((position, at.error(parts[1], name, factor_of(key) if key else 1.0)))
    if len(rows) > MAX_POINTS:
        at.refuse(f"{name} has more points than {MAX_POINTS:,}", "at most so many")


def _write_iso(corrections: RequiredCorrections) -> Files:
    imported = measured.to_single_direction(measured.sample_errors(corrections), corrections)
    check_axes(imported, ISO)
    lines = [format_comment("// ", corrections.scene.title), "// mm, rad, degrees; variant Vendor"]
    for plane in imported.surfaces:
        axes = " and ".join(plane.axes)
        lines.append(f"// {plane.key} over {axes}: has no place here, left out")
    for key, value in imported.constants.items():
        scaled = value / factor_of(key)
        lines += [f"[{file_name(key)}]", f"VALUE = {scaled:.{DIGITS}f}"]
    for error_series in imported.series:
        lines += [f"[{error_series.key}]", "Gridpoints = {"]
        scale = factor_of(error_series.key)
        lines += [
            f"  {position!r} {value / scale:.{DIGITS}f}"
            for position, value in zip(error_series.positions, error_series.values.tolist(), strict=True)
        ]
        lines.append(f"}}  // end of {error_series.key}")
    return {"": "\n".join(lines) + "\n"}


ISO_FORMAT = Format(
    **format_description(ISO),
    recognise=_is_iso,
    read=_read_with(lambda source: [_read_iso(source)]),
    write=_write_iso,
    variants=VARIANTS,
)
ISG_FORMAT = Format(
    **format_description(ISG),
    recognise=_is_isg,
    read=_read_with(_read_isg),
    write=_write_isg,
    variants=VARIANTS,
)
FORMATS = (ISO_FORMAT, ISG_FORMAT)
