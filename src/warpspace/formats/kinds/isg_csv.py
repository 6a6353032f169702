"""ISG CSV of volumetric compensation: a header of arguments and parameters, blocks parted by #.

ISG kernel documentation, FCT-C26, page 296429067 (TwinCAT 3 CNC, TF5280): columns part by blanks,
rows of comments begin with //; two arguments make an error of two axes.
"""

import re
from collections.abc import Sequence
from itertools import pairwise

from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.kind import Files, Format, ReadOptions
from warpspace.formats.measured import BOTH, Imported, Plane, Run, Series, merge
from warpspace.formats.numbers import check_error, check_position, read_number, spell
from warpspace.formats.parts import volumetric
from warpspace.formats.parts.parametric import in_one_direction, sampled, table_of, zero_key
from warpspace.formats.parts.planes import plane_of
from warpspace.formats.source import Source
from warpspace.machine.limits import MAX_POINTS
from warpspace.machine.parameters import parameter

NAME = "isg-csv"
DIGITS = 12
_SPLIT = re.compile(r"[\s;,]+")
Block = list[tuple[int, list[str]]]


def recognise(head: str, name: str) -> bool:
    """Tell it by its first header: arguments and parameters, nothing else."""
    del name
    for text in head.splitlines():
        bare = text.split("//")[0].strip()
        if not bare or bare == "#":
            continue
        names = [part for part in _SPLIT.split(bare) if part]
        known = [part for part in names if volumetric.error_name(part)]
        return bool(known) and len(known) + sum(
            part in volumetric.ARGUMENTS for part in names
        ) == len(names)
    return False


def read(sources: Sequence[Source], options: ReadOptions) -> Imported:
    """Read the errors of files."""
    parts = [part for source in sources for part in _read_one(source)]
    return volumetric.finished(merge(parts), options)


def _blocks(source: Source) -> list[Block]:
    """Split a file into blocks of rows."""
    blocks: list[Block] = [[]]
    for number, text in enumerate(source.lines, start=1):
        bare = text.split("//")[0].strip()
        if bare.startswith("#"):
            blocks.append([])
            bare = bare[1:].strip()
        if bare:
            blocks[-1].append((number, [part for part in _SPLIT.split(bare) if part]))
            if len(blocks[-1]) > MAX_POINTS:
                source.refuse(
                    f"a block has more than {MAX_POINTS:,} rows; expected at most so many", number
                )
    return [block for block in blocks if block]


def _read_one(source: Source) -> list[Imported]:
    """Read the blocks of a file."""
    found: list[Imported] = []
    known: set[str] = set()
    for block in _blocks(source):
        part = _read_block(source, block)
        for key in part.keys:
            if key in known:
                source.refuse(
                    f"{volumetric.file_name(key)} stands in two blocks; expected it in one",
                    block[0][0],
                )
            known.add(key)
        found.append(part)
    if not known:
        source.refuse("has no errors; expected a header such as X EXX EYX")
    return found


def _read_block(source: Source, block: Block) -> Imported:
    """Read a header and its records."""
    line, names = block[0]
    arguments = [name for name in names if name in volumetric.ARGUMENTS]
    left = [name for name in names if volumetric.OTHER.fullmatch(name)]
    for name in names:
        if (
            name not in volumetric.ARGUMENTS
            and name not in left
            and not volumetric.error_name(name)
        ):
            expected = "expected arguments X Y Z A B C and parameters such as EXX or C0B"
            source.refuse(f"column {name!r}; {expected}", line)
    if twice := next((name for name in names if names.count(name) > 1), ""):
        source.refuse(f"column {twice} stands there twice; expected it once", line)
    if len(arguments) > 2:
        expected = "expected one or two: no error here depends on more"
        source.refuse(f"{len(arguments)} arguments {' '.join(arguments)}; {expected}", line)
    if len(block) < 2:
        source.refuse("a header without records; expected at least one", line)
    rows: list[tuple[int, dict[str, float]]] = []
    for number, parts in block[1:]:
        if len(parts) != len(names):
            source.refuse(f"{len(parts)} fields; expected {len(names)} as in the header", number)
        row: dict[str, float] = {}
        for name, part in zip(names, parts, strict=True):
            value = read_number(part, source, number, name)
            if name in arguments:
                row[name] = check_position(value, source, number, name)
            elif key := volumetric.error_name(name):
                row[key] = check_error(value * volumetric.factor_of(key), source, number, name)
        rows.append((number, row))
    notes = volumetric.left_out(left)
    notes = (*source.notes, *notes)
    keys = [key for name in names if (key := volumetric.error_name(name))]
    if not arguments:
        return _constants(source, rows, keys, notes, line)
    _check_arguments(source, keys, arguments, line)
    if len(arguments) == 2:
        planes = tuple(_plane(source, key, arguments, rows) for key in keys)
        return Imported(NAME, planes=planes, notes=notes)
    return Imported(
        NAME, tuple(_series(source, key, arguments[0], rows) for key in keys), notes=notes
    )


def _constants(
    source: Source,
    rows: list[tuple[int, dict[str, float]]],
    keys: Sequence[str],
    notes: tuple[str, ...],
    line: int,
) -> Imported:
    """Read errors without arguments."""
    if len(rows) > 1:
        source.refuse(f"{len(rows)} records without arguments; expected one", rows[1][0])
    for key in keys:
        if not parameter(key).is_constant:
            expected = f"expected the argument {parameter(key).axis} beside it"
            source.refuse(f"{key} without an argument; {expected}", line)
    return Imported(NAME, constants={key: rows[0][1][key] for key in keys}, notes=notes)


def _check_arguments(
    source: Source, keys: Sequence[str], arguments: Sequence[str], line: int
) -> None:
    """Refuse errors that do not depend on their own axis."""
    for key in keys:
        row = parameter(key)
        if row.is_constant:
            expected = "expected it in a block without arguments"
            source.refuse(f"{volumetric.file_name(key)} is constant; {expected}", line)
        if row.axis not in arguments:
            expected = f"expected the argument {row.axis}"
            source.refuse(f"{key} over {' and '.join(arguments)}; {expected}", line)


def _series(
    source: Source, key: str, argument: str, rows: list[tuple[int, dict[str, float]]]
) -> Series:
    """Read an error over its axis."""
    for (_, before), (number, row) in pairwise(rows):
        if row[argument] <= before[argument]:
            found = f"{argument} {row[argument]:g} after {before[argument]:g}"
            source.refuse(f"{found}; expected ascending positions", number)
    run = Run(1, BOTH, tuple(row[key] for _, row in rows))
    return Series(key, tuple(row[argument] for _, row in rows), (run,))


def _plane(
    source: Source,
    key: str,
    arguments: Sequence[str],
    rows: list[tuple[int, dict[str, float]]],
) -> Plane:
    """Read an error over two axes, its own one first."""
    own = parameter(key).axis
    other = next(axis for axis in arguments if axis != own)
    points = [(number, row[own], row[other], row[key]) for number, row in rows]
    return plane_of(key, (own, other), points, source)


def write(wanted: Wanted) -> Files:
    """Write the errors of a scene, a block an axis."""
    held = in_one_direction(sampled(wanted), wanted)
    volumetric.check_axes(held, NAME)
    blocks: list[str] = []
    if held.constants:
        names = [volumetric.file_name(key) for key in held.constants]
        values = [spell(v / volumetric.factor_of(k), DIGITS) for k, v in held.constants.items()]
        blocks.append("\n".join(["\t".join(names), "\t".join(values)]))
    for axis in dict.fromkeys(parameter(one.key).axis for one in held.series):
        table = table_of([one for one in held.series if parameter(one.key).axis == axis])
        lines = ["\t".join([axis, *table.keys])]
        for position, _, values in table.rows:
            scaled = [
                spell(value / volumetric.factor_of(key), DIGITS)
                for key, value in zip(table.keys, values, strict=True)
            ]
            lines.append("\t".join([repr(position), *scaled]))
        blocks.append("\n".join(lines))
    for plane in held.planes:
        own, other = plane.axes
        lines = [f"{other}\t{own}\t{plane.key}"]
        for j, second in enumerate(plane.second):
            for i, first in enumerate(plane.first):
                value = spell(plane.values[i][j] / volumetric.factor_of(plane.key), DIGITS)
                lines.append("\t".join([repr(second), repr(first), value]))
        blocks.append("\n".join(lines))
    head = f"// {wanted.title}\n// mm, rad, degrees\n"
    return {"": head + "\n#\n".join(blocks or [_nothing(wanted)]) + "\n"}


def _nothing(wanted: Wanted) -> str:
    """Spell a block whose error is zero, for a scene without any."""
    key = zero_key(wanted.scene)
    return f"{parameter(key).axis}\t{key}\n0.0\t0.0"


FORMAT = Format(
    name=NAME,
    title="CSV of volumetric compensation (ISG kernel, TwinCAT CNC)",
    source="ISG kernel documentation, FCT-C26 Volumetric Compensation, ISG CSV format",
    endings=(".csv", ".txt"),
    holds="any component error along its axis or over two axes, and constants",
    units="mm, rad; arguments mm, degrees",
    grid="any ascending positions; a full grid of two axes",
    limits="as many records as max_records keeps; corrects the position only",
    recognise=recognise,
    read=read,
    write=write,
    points=41,
    most_points=2001,
    parametric=True,
    variants=volumetric.VARIANTS,
)
