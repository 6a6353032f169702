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
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.formats import measured
from warpspace.formats.compensation.corrections import RequiredCorrections
from warpspace.formats.registry import Files, Format, ReadOptions, describe
from warpspace.formats.source import Source, SourceLine, format_comment, format_number
from warpspace.machine.axes import (
    PARAMETERS,
    TravelDirection,
    direction_index,
    is_linear,
    parameter,
)
from warpspace.machine.limits import MAX_POINTS
from warpspace.scene.text_files import list_repeated
from warpspace.units import UM_PER_MM, URAD_PER_RAD

STANDARD, ALTERNATIVE = "standard", "alternative"
ARGUMENTS = ("X", "Y", "Z", "A", "B", "C")
VARIANTS = (STANDARD, ALTERNATIVE)
CONVENTION = {"linear": "after_motion", "rotary": "before_motion"}
DIGITS = 12
ASSUMED = (
    "a positive angle follows the right-hand rule, also of a squareness",
    "errors of a linear axis move with it, those of a rotary axis act in fixed directions",
    "beyond the points, the end values apply",
)
ROTATION = (
    "rotation about the nominal axis (alternative_model 0); the distorted axis is a variant",
    "rotation about the distorted axis (alternative_model 1)",
)
DESCRIBED = (
    "the control describes the machine that was measured: the same chain and workpiece_axes, negate"
    " empty"
)
IGNORED = re.compile(r"P0[XYZ]|N0[XYZ]|P[XYZ][ABC]|V[XYZ][XYZABC]|ID[XYZ]|LN[XYZABC]")
FINE_DEG = 1.0  # step of a table to which a harmonic is added


def error_name(name: str) -> str:
    """Return the key of a parameter of a file; empty if it is not an error."""
    upper = name.strip().upper()
    return next((key for key in (upper, f"E{upper}") if key in PARAMETERS), "")


def file_name(key: str) -> str:
    """Return the name of an error parameter in files: C0B for EC0B."""
    return key[1:] if parameter(key).is_constant else key


def factor_of(key: str) -> float:
    """Return the factor from mm or rad to µm or µrad."""
    return URAD_PER_RAD if parameter(key).is_rotation else UM_PER_MM


def ignored_notes(names: Sequence[str]) -> tuple[str, ...]:
    return (f"ignored {', '.join(names)}: not errors",) if names else ()


def _errors_to_write(corrections: RequiredCorrections, name: str) -> measured.ImportedErrors:
    """Compute the errors of a scene for its direction of travel."""
    imported = measured.sample_errors(corrections)
    other = next((axis for axis in imported.axes if axis not in ARGUMENTS), "")
    if other:
        raise OptionError(f"{name} cannot represent axis {other}; expected {', '.join(ARGUMENTS)}")
    travel = TravelDirection(corrections.scene.model.direction)
    direction = measured.RUN_DIRECTION.get(travel, measured.UNDIRECTED)
    series = [
        measured.ErrorSeries.undirected(error.key, error.positions, error.in_direction(direction))
        for error in imported.series
    ]
    surfaces = [
        replace(error, values=tuple(map(tuple, error.table(direction).tolist())), backward=())
        for error in imported.surfaces
    ]
    return replace(imported, series=tuple(series), surfaces=tuple(surfaces))


def _finished(imported: measured.ImportedErrors, options: ReadOptions) -> measured.ImportedErrors:
    is_alternative = options.variant == ALTERNATIVE
    chain = options.machine and options.machine.chain
    description = f"; here {chain}, workpiece_axes {len(chain.workpiece)}" if chain else ""
    imported = replace(
        imported,
        units=("mm", "rad", "degrees for rotary positions"),
        assumed=(*imported.assumed, *ASSUMED, ROTATION[is_alternative], DESCRIBED + description),
        convention=CONVENTION,
    )
    if not is_alternative:
        return imported
    for axis in dict.fromkeys(parameter(key).axis for key in imported.constants):
        if not is_linear(axis):
            imported = _about_distorted_axis(imported, axis, options)
    return imported


def _about_distorted_axis(
    imported: measured.ImportedErrors, axis: str, options: ReadOptions
) -> measured.ImportedErrors:
    """Subtract the constant errors of a rotary axis, rotated with the axis.

    A rotation R about an axis that is displaced by E₀ is E₀·R·E₀⁻¹: to first order the constant
    error minus the same error rotated by R, which is a first harmonic of its component errors.
    """
    machine = options.machine
    sense = machine.axes[axis].direction if machine is not None and axis in machine.axes else 1
    axis_index = direction_index(axis)
    first, second = (axis_index + 1) % 3, (axis_index + 2) % 3
    for letters in ("XYZ", "ABC"):
        u, v, along = (
            imported.constants.get(f"E{letters[index]}0{axis}", 0.0)
            for index in (first, second, axis_index)
        )
        imported = _plus(imported, f"E{letters[first]}{axis}", 0.0, -u, sense * v)
        imported = _plus(imported, f"E{letters[second]}{axis}", 0.0, -v, -sense * u)
        imported = _plus(imported, f"E{letters[axis_index]}{axis}", -along)
    return imported


def _plus(
    imported: measured.ImportedErrors,
    key: str,
    offset: float = 0.0,
    cosine: float = 0.0,
    sine: float = 0.0,
) -> measured.ImportedErrors:
    """Add an offset and a first harmonic to an error."""
    size = math.hypot(cosine, sine)
    if not size and not offset:
        return imported
    present = next((error for error in imported.series if error.key == key), None)
    if present is None:
        phase = math.degrees(math.atan2(sine, cosine))
        curve = {"harmonics": [[1, size, phase]]} if size else {"poly": [offset]}
        return replace(imported, curves={**imported.curves, key: curve})
    at = np.array(present.positions)
    if size:
        at = np.union1d(at, np.arange(at[0], at[-1], FINE_DEG))
    values = np.interp(at, present.positions, present.values) + offset
    values = values + cosine * np.cos(np.deg2rad(at)) + sine * np.sin(np.deg2rad(at))
    changed = measured.ErrorSeries.undirected(key, at, values)
    series = tuple(changed if error is present else error for error in imported.series)
    return replace(imported, series=series)


def _read_with(
    read_one: Callable[[Source], Sequence[measured.ImportedErrors]],
) -> Callable[[Sequence[Source], ReadOptions], measured.ImportedErrors]:
    return lambda sources, options: _finished(
        measured.merge([part for source in sources for part in read_one(source)]), options
    )


ISG = "isg-csv"
_FIELD = re.compile(r"[^\s;,]+")
Block = list[tuple[SourceLine, list[str]]]


def _is_isg(head: str, _name: str) -> bool:
    rows = (text.split("//")[0].strip() for text in head.splitlines())
    names = _FIELD.findall(next((row for row in rows if row not in ("", "#")), ""))
    return any(map(error_name, names)) and all(
        name in ARGUMENTS or error_name(name) for name in names
    )


def _blocks(source: Source) -> list[Block]:
    blocks: list[Block] = [[]]
    for at, text in source.scan("//"):
        if text.startswith("#"):
            blocks.append([])
        fields = _FIELD.findall(text.removeprefix("#"))
        if fields:
            blocks[-1].append((at, fields))
            if len(blocks[-1]) > MAX_POINTS:
                at.refuse(f"a block has more than {MAX_POINTS:,} rows", "shorter blocks")
    return [block for block in blocks if block]


def _read_isg(source: Source) -> list[measured.ImportedErrors]:
    imports: list[measured.ImportedErrors] = []
    keys: set[str] = set()
    for block in _blocks(source):
        part = _read_block(source, block)
        repeated = next((key for key in part.keys if key in keys), "")
        if repeated:
            block[0][0].refuse(f"{file_name(repeated)} occurs in two blocks", "it in one")
        keys.update(part.keys)
        imports.append(part)
    if not keys:
        source.refuse("has no errors", "a header such as X EXX EYX")
    return imports


def _read_block(source: Source, block: Block) -> measured.ImportedErrors:
    at, names = block[0]
    arguments = [name for name in names if name in ARGUMENTS]
    ignored = [name for name in names if IGNORED.fullmatch(name)]
    _check_header(at, names, arguments, ignored)
    if len(block) < 2:
        at.refuse("a header without records", "at least one")
    lines = [line for line, _ in block[1:]]
    rows = [_read_record(line, names, parts) for line, parts in block[1:]]
    notes = (*source.notes, *ignored_notes(ignored))
    keys = [key for key in map(error_name, names) if key]
    if not arguments and len(rows) > 1:
        lines[1].refuse(f"{len(rows)} records without arguments", "one")
    for key in keys:
        _check_arguments(at, key, arguments)
    if not arguments:
        constants = {key: rows[0][key] for key in keys}
        return measured.ImportedErrors(ISG, constants=constants, notes=notes)
    series: list[measured.ErrorSeries] = []
    surfaces: list[measured.ErrorSurface] = []
    for key in keys:
        axis = parameter(key).axis
        if len(arguments) == 2:
            (other,) = {*arguments} - {axis}
            points = [
                (line, row[axis], row[other], row[key])
                for line, row in zip(lines, rows, strict=True)
            ]
            surfaces.append(measured.build_surface(key, (axis, other), points, source))
            continue
        along = [row[axis] for row in rows]
        for line, before, position in zip(lines[1:], along[:-1], along[1:], strict=True):
            line.ascending(position, before, axis)
        series.append(measured.ErrorSeries.undirected(key, along, [row[key] for row in rows]))
    return measured.ImportedErrors(ISG, tuple(series), tuple(surfaces), notes=notes)


def _check_header(
    at: SourceLine, names: Sequence[str], arguments: Sequence[str], ignored: Sequence[str]
) -> None:
    accepted = {*arguments, *ignored}
    for name in names:
        if name not in accepted and not error_name(name):
            at.refuse(f"column {name!r}", "arguments X Y Z A B C and parameters such as EXX or C0B")
    repeated = list_repeated(names)
    if repeated:
        at.refuse(f"column {repeated[0]} occurs twice", "it once")
    if len(arguments) > 2:
        expected = "one or two: no error parameter depends on more"
        at.refuse(f"{len(arguments)} arguments {' '.join(arguments)}", expected)


def _read_record(at: SourceLine, names: Sequence[str], parts: Sequence[str]) -> dict[str, float]:
    if len(parts) != len(names):
        at.refuse(f"{len(parts)} fields", f"{len(names)} as in the header")
    row: dict[str, float] = {}
    for name, part in zip(names, parts, strict=True):
        number, key = at.number(part, name), error_name(name)
        if name in ARGUMENTS:
            row[name] = at.checked_position(number, name)
        elif key:
            row[key] = at.checked_error(number * factor_of(key), name)
    return row


def _check_arguments(at: SourceLine, key: str, arguments: Sequence[str]) -> None:
    row = parameter(key)
    if not arguments:
        if not row.is_constant:
            at.refuse(f"{key} without an argument", f"the argument {row.axis} with it")
    elif row.is_constant:
        at.refuse(f"{file_name(key)} is constant", "it in a block without arguments")
    elif row.axis not in arguments:
        at.refuse(f"{key} over {' and '.join(arguments)}", f"the argument {row.axis}")


def _write_isg(corrections: RequiredCorrections) -> Files:
    imported = _errors_to_write(corrections, ISG)

    def format_error(error: float, key: str) -> str:
        return format_number(error / factor_of(key), DIGITS)

    blocks: list[list[list[str]]] = []
    for table in measured.build_error_tables(imported):
        names = [*reversed(table.axes), *map(file_name, table.keys)]
        ordered = sorted(table.rows, key=lambda row: row[0][::-1])  # the first axis fastest
        rows = [
            [*map(repr, reversed(at)), *map(format_error, values, table.keys)]
            for at, _, values in ordered
        ]
        blocks.append([names, *rows])
    if not blocks:
        key = measured.zero_key(corrections.scene)
        blocks = [[[parameter(key).axis, key], ["0.0", "0.0"]]]
    texts = ["\n".join("\t".join(row) for row in block) for block in blocks]
    head = format_comment("// ", corrections.scene.title)
    return {"": f"{head}\n// mm, rad, degrees\n" + "\n#\n".join(texts) + "\n"}


ISO = "iso-text"
_SECTION = re.compile(r"\[\s*([A-Za-z0-9]+)\s*\]")
_VALUE = re.compile(r"VALUE\s*=\s*(\S+)", re.IGNORECASE)
_OPEN = re.compile(r"Gridpoints\s*=\s*\{?", re.IGNORECASE)


def _is_iso(head: str, _name: str) -> bool:
    has_errors = any(map(error_name, _SECTION.findall(head)))
    return has_errors and bool(re.search(r"Gridpoints|VALUE\s*=", head, re.IGNORECASE))


def _read_iso(source: Source) -> measured.ImportedErrors:
    constants: dict[str, float] = {}
    series: dict[str, measured.ErrorSeries] = {}
    ignored: list[str] = []
    name = key = ""  # of the block; an ignored one has no key
    lines = source.scan("//")
    for at, bare in lines:
        section, constant = _SECTION.fullmatch(bare), _VALUE.fullmatch(bare)
        if section:
            name = section[1].upper()
            key = error_name(name)
            if key in constants or key in series:
                at.refuse(f"[{name}] occurs twice", "it once")
            if not key and not IGNORED.fullmatch(name):
                at.refuse(f"[{name}]", "a parameter such as EXY or C0B")
            if not key:
                ignored.append(name)
        elif not name:
            at.refuse(at.quoted, "a block such as [EXY]")
        elif constant:
            number = at.number(constant[1], f"VALUE of {name}")
            if key and not parameter(key).is_constant:
                at.refuse(f"[{name}] has one VALUE", "Gridpoints = { position value … }")
            if key:
                constants[key] = at.checked_error(number * factor_of(key), name)
        elif _OPEN.fullmatch(bare):
            if key and parameter(key).is_constant:
                at.refuse(f"[{name}] has Gridpoints", "VALUE = number")
            positions, values = _grid_points(at, lines, name, factor_of(key) if key else 1.0)
            if key:
                series[key] = measured.ErrorSeries.undirected(key, positions, values)
        elif bare != "{":
            at.refuse(at.quoted, "VALUE = number or Gridpoints = {")
    notes = (*source.notes, *ignored_notes(ignored))
    return measured.ImportedErrors(ISO, tuple(series.values()), constants=constants, notes=notes)


def _grid_points(
    begin: SourceLine, lines: Iterator[tuple[SourceLine, str]], name: str, factor: float
) -> tuple[list[float], list[float]]:
    positions: list[float] = []
    values: list[float] = []
    for at, bare in lines:
        body, closed, _ = bare.partition("}")
        parts = body.replace("{", " ").split()
        if parts:
            if len(parts) != 2:
                at.refuse(f"{len(parts)} numbers in {at.quoted}", "position and value")
            position = at.position(parts[0], "position")
            if positions:
                at.ascending(position, positions[-1], "position", f" of {name}")
            positions.append(position)
            values.append(at.error(parts[1], name, factor))
        if len(positions) > MAX_POINTS:
            at.refuse(f"{name} has more than {MAX_POINTS:,} points", "fewer points")
        if closed and not positions:
            at.refuse(f"[{name}] has no points", "position and value")
        if closed:
            break
    else:
        begin.refuse(f"Gridpoints of [{name}] do not end", "} (is the file truncated?)")
    return positions, values


def _write_iso(corrections: RequiredCorrections) -> Files:
    imported = _errors_to_write(corrections, ISO)
    lines = [format_comment("// ", corrections.scene.title), "// mm, rad, degrees; variant Vendor"]
    for surface in imported.surfaces:
        axes = " and ".join(surface.axes)
        lines.append(f"// {surface.key} over {axes}: omitted, not supported by the format")
    for key, constant in imported.constants.items():
        scaled = constant / factor_of(key)
        lines += [f"[{file_name(key)}]", f"VALUE = {scaled:.{DIGITS}f}"]
    for series in imported.series:
        lines += [f"[{series.key}]", "Gridpoints = {"]
        scaled_errors = series.values / factor_of(series.key)
        for position, error in zip(series.positions, scaled_errors.tolist(), strict=True):
            lines.append(f"  {position!r} {error:.{DIGITS}f}")
        lines.append(f"}}  // end of {series.key}")
    return {"": "\n".join(lines) + "\n"}


FORMATS = (
    Format(
        **describe(ISO), recognise=_is_iso, read=_read_with(lambda source: [_read_iso(source)]),
        write=_write_iso, variants=VARIANTS,
    ),
    Format(
        **describe(ISG), recognise=_is_isg, read=_read_with(_read_isg), write=_write_isg,
        variants=VARIANTS,
    ),
)  # fmt: skip
