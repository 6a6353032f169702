"""Etalon exchange format: blocks named after ISO 230-1, `[C0B]` VALUE and `[EXY]` Gridpoints.

ISG kernel documentation, FCT-C26, page 296430091 (TwinCAT 3 CNC, TF5280): of its two variants
"Vendor" is the one to use. Rows of comments begin with //.
"""

import re
from collections.abc import Sequence

from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.kind import Files, Format, ReadOptions
from warpspace.formats.measured import BOTH, Imported, Run, Series, merge
from warpspace.formats.numbers import check_error, check_position, read_number
from warpspace.formats.parts import volumetric
from warpspace.formats.parts.parametric import in_one_direction, sampled
from warpspace.formats.source import Source
from warpspace.machine.limits import MAX_POINTS
from warpspace.machine.parameters import parameter

NAME = "iso-text"
DIGITS = 12
_SECTION = re.compile(r"\[\s*([A-Za-z0-9]+)\s*\]")
_VALUE = re.compile(r"VALUE\s*=\s*(\S+)", re.IGNORECASE)
_OPEN = re.compile(r"Gridpoints\s*=\s*\{?", re.IGNORECASE)


def recognise(head: str, name: str) -> bool:
    """Tell it by its blocks."""
    del name
    blocks = [error for error in _SECTION.findall(head) if volumetric.error_name(error)]
    return bool(blocks) and bool(re.search(r"Gridpoints|VALUE\s*=", head, re.IGNORECASE))


def read(sources: Sequence[Source], options: ReadOptions) -> Imported:
    """Read the errors of files."""
    return volumetric.finished(merge([_read_one(source) for source in sources]), options)


def _read_one(source: Source) -> Imported:
    """Read one file."""
    constants: dict[str, float] = {}
    series: list[Series] = []
    left: list[str] = []
    key, name, opened = "", "", 0
    rows: list[tuple[float, float]] = []
    for number, text in enumerate(source.lines, start=1):
        bare = text.split("//")[0].strip()
        if not bare:
            continue
        if opened:
            body, closed, _ = bare.partition("}")
            if body.strip():
                _row(source, number, body, rows, name, key)
            if closed:
                if not rows:
                    source.refuse(f"[{name}] has no points; expected position and value", number)
                if key:
                    at, values = zip(*rows, strict=True)
                    series.append(Series(key, at, (Run(1, BOTH, values),)))
                opened, rows = 0, []
        elif matched := _SECTION.fullmatch(bare):
            name = matched[1].upper()
            key = volumetric.error_name(name)
            if not key and not volumetric.OTHER.fullmatch(name):
                source.refuse(f"[{name}]; expected a parameter such as EXY or C0B", number)
            if not key:
                left.append(name)
            elif key in constants or any(one.key == key for one in series):
                source.refuse(f"[{name}] is given twice; expected it once", number)
        elif not name:
            source.refuse(f"{source.shown(number)}; expected a block such as [EXY]", number)
        elif matched := _VALUE.fullmatch(bare):
            value = read_number(matched[1], source, number, f"VALUE of {name}")
            if key and not parameter(key).is_constant:
                expected = "expected Gridpoints = { position value … }"
                source.refuse(f"[{name}] has one VALUE; {expected}", number)
            if key:
                scaled = value * volumetric.factor_of(key)
                constants[key] = check_error(scaled, source, number, name)
        elif _OPEN.fullmatch(bare):
            if key and parameter(key).is_constant:
                source.refuse(f"[{name}] has Gridpoints; expected VALUE = number", number)
            opened = number
        elif bare != "{":
            expected = "expected VALUE = number or Gridpoints = {"
            source.refuse(f"{source.shown(number)}; {expected}", number)
    if opened:
        source.refuse(
            f"Gridpoints of [{name}] do not end; expected }} (is the file cut off?)", opened
        )
    notes = volumetric.left_out(left)
    return Imported(NAME, tuple(series), constants=constants, notes=(*source.notes, *notes))


def _row(
    source: Source,
    number: int,
    text: str,
    rows: list[tuple[float, float]],
    name: str,
    key: str,
) -> None:
    """Read a row of position and value."""
    parts = text.replace("{", " ").split()
    if not parts:
        return
    if len(parts) != 2:
        found = f"{len(parts)} numbers in {source.shown(number)}"
        source.refuse(f"{found}; expected position and value", number)
    position = check_position(
        read_number(parts[0], source, number, "position"), source, number, "position"
    )
    if rows and position <= rows[-1][0]:
        found = f"position {position:g} of {name} after {rows[-1][0]:g}"
        source.refuse(f"{found}; expected ascending positions", number)
    value = read_number(parts[1], source, number, name)
    scale = volumetric.factor_of(key) if key else 1.0
    rows.append((position, check_error(value * scale, source, number, name)))
    if len(rows) > MAX_POINTS:
        source.refuse(
            f"{name} has more points than {MAX_POINTS:,}; expected at most so many", number
        )


def write(wanted: Wanted) -> Files:
    """Write the errors of a scene; those of two axes have no place and are left out."""
    held = in_one_direction(sampled(wanted), wanted)
    volumetric.check_axes(held, NAME)
    lines = [f"// {wanted.title}", "// mm, rad, degrees; variant Vendor"]
    lines += [
        f"// {plane.key} over {' and '.join(plane.axes)}: has no place here, left out"
        for plane in held.planes
    ]
    for key, value in held.constants.items():
        lines += [
            f"[{volumetric.file_name(key)}]",
            f"VALUE = {value / volumetric.factor_of(key):.{DIGITS}f}",
        ]
    for one in held.series:
        lines += [f"[{one.key}]", "Gridpoints = {"]
        scale = volumetric.factor_of(one.key)
        lines += [
            f"  {position!r} {value / scale:.{DIGITS}f}"
            for position, value in zip(one.positions, one.values.tolist(), strict=True)
        ]
        lines.append(f"}}  // end of {one.key}")
    return {"": "\n".join(lines) + "\n"}


FORMAT = Format(
    name=NAME,
    title="text of volumetric compensation with ISO names (Etalon exchange format)",
    source="ISG kernel documentation, FCT-C26 Volumetric Compensation, Etalon Exchange Format",
    endings=(".exc", ".txt", ".ini"),
    holds="any component error along its axis, and constants; not direction of travel",
    units="mm, rad; positions mm, degrees",
    grid="any ascending positions",
    limits="as many records as max_records keeps; corrects the position only",
    recognise=recognise,
    read=read,
    write=write,
    points=41,
    most_points=2001,
    parametric=True,
    variants=volumetric.VARIANTS,
)
