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
from warpspace.formats.measured import ImportedErrors
from warpspace.formats.registry import Files, Format, ReadOptions, describe, has_pattern
from warpspace.formats.source import (
    Source,
    SourceLine,
    format_comment,
    format_number,
    quote,
    unread_notes,
)
from warpspace.formats.terms import Affine, AxisTable, Tables, errors_from_tables
from warpspace.kinematics.chain import loop_error, nominal_point
from warpspace.kinematics.model import Loop, Model
from warpspace.kinematics.relative_motion import axis_frames
from warpspace.machine.axes import TravelDirection, is_linear
from warpspace.machine.definition import Machine, build_machine
from warpspace.units import Array

COMP = "linuxcnc-comp"
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
    if re.search(r"^\s*COMP_FILE\s*=", head, re.MULTILINE):
        return True
    rows = [line for line in head.splitlines() if line.strip()]
    if name.lower().endswith(".comp"):
        return any(map(_ROW.match, rows))
    matches = [match for match in map(_ROW.match, rows) if match]
    if len(matches) < max(len(rows), 2):
        return False
    numbers = np.array([match.groups()[:3] for match in matches], float)
    return any(_nearness(numbers)) and bool(np.all(np.diff(numbers[:, 0]) > 0.0))


def _nearness(rows: np.ndarray) -> tuple[bool, bool]:
    """Return true for actual positions, near the nominal ones; and for corrections, near zero."""
    limit = NEAR * max(np.ptp(rows[:, 0]), abs(rows[:, 0]).max(), 1e-9)
    follows = np.abs(rows[:, 1:] - rows[:, :1]).max() < limit
    return bool(follows), bool(np.abs(rows[:, 1:]).max() <= limit)


_READ_SECTIONS = ("[TRAJ]", "[KINS]", "[END]")
_READ_KEYS = ("LINEAR_UNITS", "KINEMATICS", "COORDINATES")


def _read_ini(source: Source, notes: list[str]) -> dict[str, Joint]:
    """Read the joints of an INI file by the name of their table."""
    joints: dict[str, Joint] = {}
    coordinates = _KINEMATICS.search(source.text)
    axes = coordinates[1].upper() if coordinates else JOINTS
    per_unit = INCH_MM if _INCH.search(source.text) else 1.0
    axis, file, kind = "", "", POSITIONS
    is_read, unread = True, list[SourceLine]()
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
            is_read = section is not None or bare in _READ_SECTIONS
            if not is_read:
                unread.append(at)
        elif key == "COMP_FILE":
            file = setting.rsplit("/", 1)[-1]
        elif key == "COMP_FILE_TYPE":
            kind = f"type-{at.integer(setting, key, 0, 1)}"
        elif key == "BACKLASH" and axis:
            notes.append(f"{source.base}: line {at.line}: ignored {bare}: not in a COMP_FILE")
        elif is_read and key not in _READ_KEYS:
            unread.append(at)
    notes += unread_notes(unread)
    return joints


def _rows(source: Source, per_unit: float, notes: list[str]) -> np.ndarray:
    rows: list[list[float]] = []
    for number, line in enumerate(source.lines, start=1):
        at, match = source.at(number), _ROW.match(line)
        if match is None:
            if not rows:
                problem = f"LinuxCNC stops here, at {at.quoted}, without a table"
                at.refuse(problem, "three numbers: nominal forward reverse")
            unread = [at for at, _ in source.scan() if at.line >= number]
            notes += [f"{note}: LinuxCNC stops at line {number}" for note in unread_notes(unread)]
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


CONTENTS = {POSITIONS: "actual positions", OFFSETS: "corrections"}


def _kind(source: Source, rows: np.ndarray, stated: str) -> tuple[str, tuple[str, ...]]:
    follows, stays = _nearness(rows)
    kind = POSITIONS if follows and not stays else OFFSETS
    if not stated:
        description = f"{CONTENTS[kind]} ({kind.replace('-', ' ')})"
        return kind, (f"second and third column: {description}; the other type is a variant",)
    if follows != stays and kind != stated:
        problem = f"looks like {CONTENTS[kind]}, but is {stated}"
        source.refuse(problem, f"{stated} (is it {kind}?)")
    return stated, ()


def _table(axis: str, places: np.ndarray, forward: np.ndarray, backward: np.ndarray) -> AxisTable:
    is_alike = np.array_equal(forward, backward)
    reverse = () if is_alike else tuple(backward.tolist())
    positions, upwards = tuple(places.tolist()), tuple(forward.tolist())
    return AxisTable(axis, axis, positions, upwards, backward=reverse)


def _combined(tables: Sequence[AxisTable], weights: Sequence[float]) -> AxisTable:
    at = np.unique(np.concatenate([table.positions for table in tables]))
    forward, backward = (
        np.sum([w * table.at(at, way) for w, table in zip(weights, tables, strict=True)], axis=0)
        for way in (1, -1)
    )
    return _table(tables[0].source, at, forward, backward)


def _joint_tables(
    sources: Sequence[Source], options: ReadOptions
) -> tuple[dict[str, list[AxisTable]], Tables]:
    """Read the tables by axis, in the order of the joints; two are the guides of a gantry."""
    joints: dict[str, Joint] = {}
    files: list[Source] = []
    notes: list[str] = []
    for source in sources:
        if re.search(r"^[ \t]*+COMP_FILE", source.text, re.MULTILINE):
            joints |= _read_ini(source, notes)
        else:
            files.append(source)
    names = [source.base for source in files]
    notes += [
        f"{name} of {joint[0]}: not among the files"
        for name, joint in joints.items()
        if name not in names
    ]
    files.sort(key=lambda source: [*joints, source.base].index(source.base))
    tables: dict[str, list[AxisTable]] = {}
    inches = any(size != 1.0 for _, _, size in joints.values())
    assumed: list[str] = [f"machine units {'inches' if inches else 'mm'} and degrees"]
    for source in files:
        axis, kind, per_unit = joints.get(source.base, ("", "", 1.0))
        has_pair = [joint[0] for joint in joints.values()].count(axis) == 2
        axis = (
            options.axis_named(axis, source)
            if axis
            else options.axis_of_file(source, "{axis} X, or its INI file")
        )
        if axis in tables and not has_pair:
            source.refuse(f"is a second table of {axis}", "one per joint, the limit of LinuxCNC")
        if has_pair and (options.machine is None or axis not in options.machine.gantries):
            source.refuse(
                f"belongs to one of two joints of {axis}, the guides of a gantry",
                f"{{machine}} with [machine.gantry] {axis} = {{ span_mm = … }}, their distance",
            )
        rows = _rows(source, per_unit, notes)
        kind, assumptions = _kind(source, rows, options.variant or kind)
        assumed += assumptions
        trims = rows[:, :1] - rows[:, 1:] if kind == POSITIONS else rows[:, 1:]
        tables.setdefault(axis, []).append(_table(axis, rows[:, 0], *trims.T))
    if not tables:
        sources[0].refuse("names files", "the files of its COMP_FILE lines with it")
    letters = [axis for axis, _, _ in joints.values()]
    for axis, parts in tables.items():
        if len(parts) < letters.count(axis):
            sources[0].refuse(f"has two joints of {axis}", "the files of both")
    assumed += [
        f"gantry {axis}: the joint with the lower number is the first guide"
        for axis, parts in tables.items()
        if len(parts) > 1
    ]
    means = tuple(_combined(parts, (1.0 / len(parts),) * len(parts)) for parts in tables.values())
    return tables, Tables(means, tuple(dict.fromkeys(assumed)), tuple(notes))


def _read_comp(sources: Sequence[Source], options: ReadOptions) -> Tables:
    return _joint_tables(sources, options)[1]


def _read_comp_errors(sources: Sequence[Source], options: ReadOptions) -> ImportedErrors:
    by_axis, tables = _joint_tables(sources, options)
    machine = options.machine
    imported = errors_from_tables(tables, COMP, sources[0], machine)
    for axis, parts in by_axis.items():
        if len(parts) == 1 or machine is None:
            continue
        gantry = machine.gantries[axis]
        difference = Tables((_combined(parts, (-1.0, 1.0)),))
        lead = errors_from_tables(difference, COMP, sources[0], machine).series
        turns = (error.scaled(gantry.rotation_key, gantry.rotation_weight) for error in lead)
        imported = replace(imported, series=(*imported.series, *turns))
    return imported


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


MATRIX = "linuxcnc-matrix"
MATRIX_DIGITS = 9
HALF_MM = 100.0  # half of the lines along which the exact chain is evaluated
ITERATIONS = 3  # the remainder shrinks by the size of the angles
MIN_SLOPE = 1e-5  # µm/mm; smaller slopes are omitted
MAX_COEFFICIENT = 0.1  # deviation of a coefficient from the identity: 0.1 rad or 10 %
_SETP = re.compile(r"setp\s+matrixkins\.C_([xyz])([xyz])\s+(\S+)", re.IGNORECASE)


def squareness(first_diagonal_mm: float, second_diagonal_mm: float) -> float:
    a, b = first_diagonal_mm, second_diagonal_mm
    return (b * b - a * a) / (2.0 * a * b)


def _read_matrix(sources: Sequence[Source], options: ReadOptions) -> Tables:
    coefficients: dict[tuple[str, str], float] = {}
    notes: list[str] = []
    for source in sources:
        unread: list[SourceLine] = []
        for at, bare in source.scan("#"):
            if not re.search(r"\bC_[a-z]", bare, re.IGNORECASE):
                unread.append(at)
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
        notes += unread_notes(unread)
    matrix = tuple(tuple(coefficients.get((row, axis), 0.0) for axis in AXES) for row in AXES)
    return Tables((Affine(AXES, matrix),), (), tuple(notes), ("mm/mm",))


def _read_matrix_errors(sources: Sequence[Source], options: ReadOptions) -> ImportedErrors:
    """Read the errors that the matrix corrects: the joints are C·p, so that p errs by C⁻¹·p − p."""
    tables = _read_matrix(sources, options)
    identity = np.eye(len(AXES))
    inverses = [
        Affine(AXES, tuple(map(tuple, (identity - np.linalg.inv(identity + term.matrix)).tolist())))
        for term in tables.terms
        if isinstance(term, Affine)
    ]
    return _exact_errors(
        errors_from_tables(
            replace(tables, terms=tuple(inverses)), MATRIX, sources[0], options.machine
        ),
        options.machine or build_machine("wFXYZt"),
    )


def _exact_errors(imported: ImportedErrors, machine: Machine) -> ImportedErrors:
    """Add slopes of translations, so that the exact chain has the error of the first order."""
    model, rotations = Model(machine), {**imported.constants}
    slopes = {key: curve["poly"][1] for key, curve in imported.curves.items()}
    position = np.repeat(np.eye(len(AXES)), 2, axis=0) * np.tile([HALF_MM, -HALF_MM], 3)[:, None]
    at = {axis: np.zeros(len(position)) for axis in machine.axes}
    at |= {axis: position[:, index] for index, axis in enumerate(AXES)}
    point_mm = nominal_point(model, Loop.TOOL, at)

    def error_um(*, exact: bool) -> Array:
        errors = rotations | {key: slope * at[key[2:]] for key, slope in slopes.items()}
        arrays = {key: np.asarray(error) for key, error in errors.items()}
        return loop_error(model, Loop.RELATIVE, at, arrays, point_mm, exact=exact)[0]

    nominal_um = error_um(exact=False)
    zero = dict.fromkeys(machine.axes, np.zeros(()))
    for _ in range(ITERATIONS):
        remainder_um = nominal_um - error_um(exact=True)
        changes = (remainder_um[::2] - remainder_um[1::2]) / (2.0 * HALF_MM)
        for axis, change in zip(AXES, changes, strict=True):
            frames, sign = axis_frames(model, zero, axis)
            shares = sign * np.asarray(frames.after)[:3, :3].T @ change
            for letter, share in zip(AXES, shares.tolist(), strict=True):
                key = f"E{letter}{axis}"
                slopes[key] = slopes.get(key, 0.0) + share
    curves = {
        key: {"poly": [0.0, slope]} for key, slope in slopes.items() if abs(slope) > MIN_SLOPE
    }
    return replace(imported, curves=curves)


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
        **describe(COMP), recognise=_is_comp, read=_read_comp_errors, tables=_read_comp,
        write=_write_comp,
        most_points=MAX_ROWS, variants=(POSITIONS, OFFSETS),
    ),
    Format(
        **describe(MATRIX), recognise=has_pattern(r"matrixkins\.C_"),
        read=_read_matrix_errors, tables=_read_matrix, write=_write_matrix,
    ),
)  # fmt: skip
