"""LinuxCNC `matrixkins`: joints are a 3 × 3 matrix times the axes.

LinuxCNC, src/hal/components/matrixkins.comp: X_joint = C_xx·X + C_xy·Y + C_xz·Z and so on; of the
diagonals A (X+/Y+) and B (X+/Y−) of a square part C_xy = (B² − A²) / (2·A·B).
"""

import re
from collections.abc import Sequence

from warpspace.formats.compensation.linear_fit import AXES, fit_linear
from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.kind import Files, Format, ReadOptions, resolve_axis
from warpspace.formats.measured import Imported
from warpspace.formats.numbers import read_number, spell
from warpspace.formats.source import Source
from warpspace.formats.table_errors import errors_of
from warpspace.formats.terms import Affine, Tables

DIGITS = 9
MOST = 0.1
"""Of a coefficient's distance from the identity: 0.1 rad or 10 %."""
_SETP = re.compile(r"setp\s+matrixkins\.C_([xyz])([xyz])\s+(\S+)", re.IGNORECASE)


def squareness(first_diagonal_mm: float, second_diagonal_mm: float) -> float:
    """Give C_xy of a part from its diagonals.

    Parameters
    ----------
    first_diagonal_mm : float, mm
        In the direction X+/Y+ (A).
    second_diagonal_mm : float, mm
        In the direction X+/Y− (B).

    Returns
    -------
    float
        (B² − A²) / (2·A·B); the squareness error EC0Y in rad.
    """
    a, b = first_diagonal_mm, second_diagonal_mm
    return (b * b - a * a) / (2.0 * a * b)


def recognise(head: str, name: str) -> bool:
    """Tell it by its parameters."""
    del name
    return "matrixkins.C_" in head


def read_tables(sources: Sequence[Source], options: ReadOptions) -> Tables:
    """Read the matrix as the kinematics module holds it."""
    found: dict[tuple[str, str], float] = {}
    for source in sources:
        for number, line in enumerate(source.lines, start=1):
            bare = line.split("#")[0].strip()
            if "matrixkins.C_" not in bare:
                continue
            matched = _SETP.fullmatch(bare)
            if matched is None:
                expected = "expected setp matrixkins.C_xy NUMBER"
                source.refuse(f"{source.shown(number)}; {expected}", number)
            row, column = matched[1].upper(), matched[2].upper()
            value = read_number(matched[3], source, number, f"C_{matched[1]}{matched[2]}")
            value -= float(row == column)
            if abs(value) > MOST:
                expected = f"expected a matrix within ±{MOST:g} of the identity"
                source.refuse(f"{source.shown(number)}; {expected}", number)
            if (row, column) in found:
                source.refuse(
                    f"C_{row.lower()}{column.lower()} is set twice; expected it once", number
                )
            for axis in (row, column):
                resolve_axis(axis, source, number, options)
            found[row, column] = value
        if not found:
            source.refuse("sets no coefficient; expected setp matrixkins.C_xx … C_zz")
    matrix = tuple(tuple(found.get((row, axis), 0.0) for axis in AXES) for row in AXES)
    return Tables((Affine(AXES, matrix),), (), (), ("mm/mm",))


def read(sources: Sequence[Source], options: ReadOptions) -> Imported:
    """Read squareness and scale errors that the matrix corrects."""
    return errors_of(read_tables(sources, options), FORMAT.name, sources[0], options)


def write(wanted: Wanted) -> Files:
    """Write the matrix that leaves the smallest RMS."""
    allowed = [(row, column) for row in AXES for column in AXES]
    found = fit_linear(wanted, allowed)
    lines = [f"# {wanted.title}"]
    for row, column in allowed:
        value = float(row == column) + found.get((row, column), 0.0)
        text = spell(float(wanted.round(value)), DIGITS)
        lines.append(f"setp matrixkins.C_{row.lower()}{column.lower()} {text}")
    return {"": "\n".join(lines) + "\n"}


FORMAT = Format(
    name="linuxcnc-matrix",
    title="LinuxCNC matrixkins, 3 × 3 matrix of calibrated kinematics",
    source="LinuxCNC manual page matrixkins(9)",
    endings=(".hal",),
    holds="squareness between X, Y and Z, and their scales",
    units="mm/mm",
    grid="none: the same everywhere",
    limits="nine numbers, no constant part",
    recognise=recognise,
    read=read,
    tables=read_tables,
    write=write,
)
