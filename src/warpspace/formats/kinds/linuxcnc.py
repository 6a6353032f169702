"""LinuxCNC: screw compensation of a joint, `COMP_FILE`, and the matrix of `matrixkins`.

LinuxCNC documentation, INI configuration, [JOINT_<num>], and src/emc/motion/command.c: rows of
nominal, forward and reverse, ascending, at most 256; type 0 contains actual positions, type 1
corrections; linear between rows, end values held, by direction of travel. Its usrmotintf.cc reads
the first three numbers of a line and stops at the first line without them, even if it is blank or
a comment.

src/hal/components/matrixkins.comp: X_joint = C_xx·X + C_xy·Y + C_xz·Z and so on; of the diagonals
A (X+/Y+) and B (X+/Y−) of a square part C_xy = (B² − A²) / (2·A·B).
"""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpspace.formats.compensation.corrections import AXES, RequiredCorrections
from warpspace.formats.registry import Files, Format, ReadOptions, describe, has_pattern
from warpspace.formats.source import Source, format_comment, format_number, quote
from warpspace.formats.terms import Affine, AxisTable, Tables
from warpspace.machine.axes import TravelDirection, is_linear

MAX_ROWS = 256
DIGITS = 6
JOINTS = "XYZABCUVW"
"""Axes of the joints 0 to 8, if ``coordinates=`` of KINEMATICS does not name them (trivkins)."""
INCH_MM = 25.4
POSITIONS, OFFSETS = "type-0", "type-1"
NEAR = 0.1
"""Largest error, as a share of the range, of actual positions in a file without a type."""
_NUMBER = r"([-+]?(?:\d++\.?\d*+|\.\d++)(?:[eE][-+]?\d++)?)"
_ROW = re.compile(rf"\s*{_NUMBER}\s+{_NUMBER}\s+{_NUMBER}(.*)", re.ASCII)
_KINEMATICS = re.compile(r"(?mi)^[ \t]*+KINEMATICS\s*=.*\bcoordinates\s*=\s*([A-Z]+)")
_INCH = re.compile(r"(?mi)^[ \t]*+LINEAR_UNITS\s*=\s*(?:in|inch|imperial)\b")
_SECTION = re.compile(r"\[JOINT_([0-9])\]")
Joint = tuple[str, str, float]  # axis, type of the table, mm or degrees per machine unit


def _is_comp(head: str, name: str) -> bool:
    if name.lower().endswith(".comp") or re.search(r"^\s*COMP_FILE\s*=", head, re.MULTILINE):
        return True
    rows = [line for line in head.splitlines() if line.strip()]
    return len(rows) > 1 and all(map(_ROW.match, rows))


def _read_ini(source: Source) -> dict[str, Joint]:
    """Read the joints of an INI file by the name of their table."""
    joints: dict[str, Joint] = {}
    coordinates = _KINEMATICS.search(source.text)
    axes = coordinates[1].upper() if coordinates else JOINTS
    per_unit = INCH_MM if _INCH.search(source.text) else 1.0
    axis, file, kind = "", "", POSITIONS
    for at, bare in replace(source, lines=(*source.lines, "[END]")).scan("#", ";"):
        key, _, setting = (part.strip() for part in bare.partition("="))
        if bare.startswith("["):
            if axis and file:
                joints[file] = (axis, kind, per_unit if is_linear(axis) else 1.0)
            section, axis, file, kind = _SECTION.fullmatch(bare), "", "", POSITIONS
            if section is not None:
                if int(section[1]) >= len(axes):
                    at.refuse(f"section {bare}", f"a joint from 0 to {len(axes) - 1}, {axes}")
                axis = axes[int(section[1])]
        elif key == "COMP_FILE":
            file = setting.rsplit("/", 1)[-1]
        elif key == "COMP_FILE_TYPE":
            kind = f"type-{at.integer(setting, key, 0, 1)}"
    return joints


def _rows(source: Source, per_unit: float, notes: list[str]) -> np.ndarray:
    rows: list[list[float]] = []
    for number, line in enumerate(source.lines, start=1):
        at, match = source.at(number), _ROW.match(line)
        if match is None:
            if not rows:
                problem = f"LinuxCNC stops here, at {at.quoted}, without a table"
                at.refuse(problem, "three numbers: nominal forward reverse")
            unread = sum(map(bool, map(_ROW.match, source.lines[number:])))
            if unread:
                notes.append(
                    f"{source.name}: LinuxCNC stops at line {number}, {at.quoted}: ignored"
                    f" {unread} rows after it"
                )
            break
        if match[4].strip():
            notes.append(
                f"{source.name}: line {number}: ignored {quote(match[4])} after three numbers"
            )
        row = [per_unit * at.number(match[n], "value") for n in (1, 2, 3)]
        if rows and row[0] <= rows[-1][0]:
            expected = "ascending positions, a requirement of LinuxCNC"
            at.refuse(f"nominal {row[0]:g} after {rows[-1][0]:g}", expected)
        rows.append([at.checked_position(number, "value") for number in row])
        if len(rows) > MAX_ROWS:
            at.refuse(f"more than {MAX_ROWS} rows", f"at most {MAX_ROWS}, the limit of LinuxCNC")
    return np.array(rows)


def _kind(rows: np.ndarray, stated: str) -> tuple[str, tuple[str, ...]]:
    if stated:
        return stated, ()
    span = max(np.ptp(rows[:, 0]), abs(rows[:, 0]).max(), 1e-9)
    positions = np.abs(rows[:, 1:] - rows[:, :1]).max() < NEAR * span
    kind = POSITIONS if positions and np.abs(rows[:, 1]).max() > NEAR * span else OFFSETS
    description = "actual positions (type 0)" if kind == POSITIONS else "offsets (type 1)"
    return kind, (f"second and third column: {description}; --variant selects the other type",)


def _read_comp(sources: Sequence[Source], options: ReadOptions) -> Tables:
    joints: dict[str, Joint] = {}
    tables: list[Source] = []
    for source in sources:
        if re.search(r"^[ \t]*+COMP_FILE", source.text, re.MULTILINE):
            joints |= _read_ini(source)
        else:
            tables.append(source)
    terms: list[AxisTable] = []
    inches = any(size != 1.0 for _, _, size in joints.values())
    assumed: list[str] = [f"machine units {'inches' if inches else 'mm'} and degrees"]
    notes: list[str] = []
    for source in tables:
        axis, kind, per_unit = joints.get(source.base, ("", "", 1.0))
        axis = (
            options.axis_named(axis, source)
            if axis
            else options.axis_of_file(source, "--axis X, or its INI file")
        )
        if any(term.source == axis for term in terms):
            source.refuse(f"is a second table of {axis}", "one per joint, the limit of LinuxCNC")
        rows = _rows(source, per_unit, notes)
        kind, assumptions = _kind(rows, options.variant or kind)
        assumed += assumptions
        trims = rows[:, :1] - rows[:, 1:] if kind == POSITIONS else rows[:, 1:]
        nominal, forward, reverse = (tuple(column.tolist()) for column in (rows[:, 0], *trims.T))
        backward = () if forward == reverse else reverse
        terms.append(AxisTable(axis, axis, nominal, forward, backward=backward))
    if not terms:
        sources[0].refuse("names files", "the files of its COMP_FILE lines with it")
    return Tables(tuple(terms), tuple(dict.fromkeys(assumed)), tuple(notes))


def _write_comp(corrections: RequiredCorrections) -> Files:
    files: dict[str, str] = {}
    lines = [format_comment("# ", corrections.scene.title)]
    lines.append(f"# joints in the order {JOINTS}: trivkins without coordinates=")
    for axis in corrections.axes:
        if axis not in corrections.corrector.moved or axis not in JOINTS:
            continue
        columns = [corrections.positions(axis)]
        for direction in (TravelDirection.FORWARD, TravelDirection.BACKWARD):
            moves = corrections.for_direction(direction, axis).averaged([axis])[axis]
            columns.append(corrections.round(moves))
        files[f"_{axis}.comp"] = "".join(
            " ".join(format_number(number, DIGITS) for number in row) + "\n"
            for row in np.stack(columns, axis=-1).tolist()
        )
        lines += [
            f"[JOINT_{JOINTS.index(axis)}]",
            f"COMP_FILE = {corrections.stem}_{axis}.comp",
            "COMP_FILE_TYPE = 1",
        ]
    return {"": "\n".join(lines) + "\n", **files}


MATRIX_DIGITS = 9
MAX_COEFFICIENT = 0.1  # deviation of a coefficient from the identity: 0.1 rad or 10 %
_SETP = re.compile(r"setp\s+matrixkins\.C_([xyz])([xyz])\s+(\S+)", re.IGNORECASE)


def squareness(first_diagonal_mm: float, second_diagonal_mm: float) -> float:
    a, b = first_diagonal_mm, second_diagonal_mm
    return (b * b - a * a) / (2.0 * a * b)


def _read_matrix(sources: Sequence[Source], options: ReadOptions) -> Tables:
    coefficients: dict[tuple[str, str], float] = {}
    for source in sources:
        for at, bare in source.scan("#"):
            if "matrixkins.C_" not in bare:
                continue
            matched = _SETP.fullmatch(bare)
            if matched is None:
                at.refuse(at.quoted, "setp matrixkins.C_xy NUMBER")
            row, column = matched[1].upper(), matched[2].upper()
            value = at.number(matched[3], f"C_{matched[1]}{matched[2]}") - float(row == column)
            if abs(value) > MAX_COEFFICIENT:
                at.refuse(at.quoted, f"a matrix within ±{MAX_COEFFICIENT:g} of the identity")
            if (row, column) in coefficients:
                at.refuse(f"C_{row.lower()}{column.lower()} is set twice", "it once")
            for axis in (row, column):
                options.axis_named(axis, at)
            coefficients[row, column] = value
        if not coefficients:
            source.refuse("sets no coefficient", "setp matrixkins.C_xx … C_zz")
    matrix = tuple(tuple(coefficients.get((row, axis), 0.0) for axis in AXES) for row in AXES)
    return Tables((Affine(AXES, matrix),), (), (), ("mm/mm",))


def _write_matrix(corrections: RequiredCorrections) -> Files:
    allowed = [(row, column) for row in AXES for column in AXES]
    coefficients = corrections.linear_fit(allowed)
    lines = [format_comment("# ", corrections.scene.title)]
    for row, column in allowed:
        value = float(row == column) + coefficients.get((row, column), 0.0)
        text = format_number(float(corrections.round(value)), MATRIX_DIGITS)
        lines.append(f"setp matrixkins.C_{row.lower()}{column.lower()} {text}")
    return {"": "\n".join(lines) + "\n"}


FORMATS = (
    Format(
        **describe("linuxcnc-comp"), recognise=_is_comp, tables=_read_comp, write=_write_comp,
        most_points=MAX_ROWS, variants=(POSITIONS, OFFSETS),
    ),
    Format(
        **describe("linuxcnc-matrix"), recognise=has_pattern(r"matrixkins\.C_"),
        tables=_read_matrix, write=_write_matrix,
    ),
)  # fmt: skip
