"""LinuxCNC screw compensation: `COMP_FILE` of a joint, types 0 and 1.

LinuxCNC documentation, INI configuration, [JOINT_<num>], and src/emc/motion/command.c: rows of
nominal, forward and reverse, ascending, at most 256; type 0 holds actual positions, type 1 what is
added to the commanded one; linear between rows, end values held, by direction of travel.
"""

import re
from collections.abc import Sequence

import numpy as np

from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.kind import Files, Format, ReadOptions, resolve_axis
from warpspace.formats.measured import Imported
from warpspace.formats.numbers import check_position, read_number, read_whole, spell
from warpspace.formats.source import Source
from warpspace.formats.table_errors import errors_of
from warpspace.formats.terms import HELD, Line, Tables
from warpspace.machine.travel import TravelDirection

MOST_POINTS = 256
DIGITS = 6
JOINTS = "XYZABCUVW"
"""Axes of the joints 0 to 8 (trivkins)."""
POSITIONS, OFFSETS = "type-0", "type-1"
NEAR = 0.1
"""Share of its range by which an actual position may be off, for a file that names no type."""
_ROW = re.compile(r"\s*[-+0-9.]\S*\s+[-+0-9.]\S*\s+[-+0-9.]\S*\s*")
_SECTION = re.compile(r"\[JOINT_([0-9])\]")


def recognise(head: str, name: str) -> bool:
    """Tell it by rows of three numbers, or by the keys of its INI section."""
    if re.search(r"^\s*COMP_FILE\s*=", head, re.MULTILINE):
        return True
    rows = [line for line in head.splitlines() if line.strip()]
    return name.lower().endswith(".comp") or (
        len(rows) > 1 and all(_ROW.fullmatch(line) for line in rows)
    )


def _assignment(sources: Sequence[Source]) -> tuple[dict[str, tuple[str, str]], list[Source]]:
    """Read INI sections: file name to axis and type; and give the tables."""
    known: dict[str, tuple[str, str]] = {}
    tables: list[Source] = []
    for source in sources:
        if not re.search(r"COMP_FILE", source.head):
            tables.append(source)
            continue
        joint, file, kind = "", "", ""
        for number, line in enumerate([*source.lines, "[END]"], start=1):
            bare = line.split("#")[0].split(";")[0].strip()
            if bare.startswith("["):
                if joint and file:
                    known[file] = (joint, kind or POSITIONS)
                found = _SECTION.fullmatch(bare)
                if found and int(found[1]) >= len(JOINTS):
                    known_joints = f"expected a joint from 0 to {len(JOINTS) - 1}, {JOINTS}"
                    source.refuse(f"section {bare}; {known_joints}", number)
                joint, file, kind = (JOINTS[int(found[1])] if found else ""), "", ""
                continue
            key, _, value = (part.strip() for part in bare.partition("="))
            if key == "COMP_FILE":
                file = value.rsplit("/", 1)[-1]
            elif key == "COMP_FILE_TYPE":
                kind = f"type-{read_whole(value, source, number, key, 0, 1)}"
    return known, tables


def _rows(source: Source) -> np.ndarray:
    """Read the rows of a table, [n, 3]."""
    rows: list[list[float]] = []
    for number, line in enumerate(source.lines, start=1):
        bare = line.split("#")[0].split(";")[0].strip()
        if not bare:
            continue
        parts = bare.split()
        if len(parts) != 3:
            found = f"{len(parts)} numbers in {source.shown(number)}"
            source.refuse(f"{found}; expected three: nominal forward reverse", number)
        row = [read_number(part, source, number, "value") for part in parts]
        if rows and row[0] <= rows[-1][0]:
            found = f"nominal {row[0]:g} after {rows[-1][0]:g}"
            source.refuse(f"{found}; expected ascending positions, as LinuxCNC does", number)
        rows.append([check_position(value, source, number, "value") for value in row])
        if len(rows) > MOST_POINTS:
            source.refuse(f"has more than {MOST_POINTS} rows; LinuxCNC takes {MOST_POINTS}", number)
    if not rows:
        source.refuse("has no rows; expected nominal forward reverse")
    return np.array(rows)


def _kind(rows: np.ndarray, given: str) -> tuple[str, tuple[str, ...]]:
    """Find the type of a table, and say so where it was guessed."""
    if given:
        return given, ()
    span = max(np.ptp(rows[:, 0]), abs(rows[:, 0]).max(), 1e-9)
    positions = np.abs(rows[:, 1:] - rows[:, :1]).max() < NEAR * span
    kind = POSITIONS if positions and np.abs(rows[:, 1]).max() > NEAR * span else OFFSETS
    said = "actual positions (type 0)" if kind == POSITIONS else "offsets (type 1)"
    return kind, (f"second and third column taken for {said}; --variant says otherwise",)


def read_tables(sources: Sequence[Source], options: ReadOptions) -> Tables:
    """Read the tables as the motion controller holds them."""
    known, tables = _assignment(sources)
    terms: list[Line] = []
    assumed: list[str] = ["machine units mm and degrees"]
    for source in tables:
        last = source.name.replace("\\", "/").rsplit("/", 1)[-1]
        axis, kind = known.get(last, ("", ""))
        stem = last.rsplit(".", 1)[0]
        if not axis:
            letter = stem.upper().rsplit("_", 1)[-1]
            axis = options.axis or (letter if len(letter) == 1 and letter in JOINTS else "")
        if not axis:
            expected = "expected --axis X, or its INI file"
            raise source.unsaid(f"does not say which axis it is for; {expected}")
        axis = resolve_axis(axis, source, None, options)
        if any(term.source == axis for term in terms):
            source.refuse(f"is a second table of {axis}; expected one a joint, as LinuxCNC takes")
        rows = _rows(source)
        kind, said = _kind(rows, options.variant or kind)
        assumed += said
        trims = rows[:, :1] - rows[:, 1:] if kind == POSITIONS else rows[:, 1:]
        nominal, forward, reverse = rows[:, 0], trims[:, 0], trims[:, 1]
        same = np.array_equal(forward, reverse)
        terms.append(
            Line(
                axis,
                axis,
                tuple(nominal.tolist()),
                tuple(forward.tolist()),
                HELD,
                () if same else tuple(reverse.tolist()),
            )
        )
    if not terms:
        sources[0].refuse("names files; expected the files of its COMP_FILE lines beside it")
    return Tables(tuple(terms), tuple(dict.fromkeys(assumed)))


def read(sources: Sequence[Source], options: ReadOptions) -> Imported:
    """Read the positioning errors that the tables correct."""
    return errors_of(read_tables(sources, options), FORMAT.name, sources[0], options)


def write(wanted: Wanted) -> Files:
    """Write a table of type 1 for each axis, and the INI lines that name them."""
    files: dict[str, str] = {}
    lines = [f"# {wanted.title}"]
    for axis in wanted.axes:
        if axis not in wanted.corrector.moved or axis not in JOINTS:
            continue
        places = wanted.places(axis)
        ways = (TravelDirection.FORWARD, TravelDirection.BACKWARD)
        forward, backward = (
            wanted.round(wanted.toward(way, axis).averaged([axis])[axis]).tolist() for way in ways
        )
        files[f"_{axis}.comp"] = "".join(
            f"{spell(q, DIGITS)} {spell(there, DIGITS)} {spell(back, DIGITS)}\n"
            for q, there, back in zip(places.tolist(), forward, backward, strict=True)
        )
        lines += [
            f"[JOINT_{JOINTS.index(axis)}]",
            f"COMP_FILE = {wanted.stem}_{axis}.comp",
            "COMP_FILE_TYPE = 1",
        ]
    return {"": "\n".join(lines) + "\n", **files}


FORMAT = Format(
    name="linuxcnc-comp",
    title="LinuxCNC COMP_FILE, screw compensation of a joint",
    source="LinuxCNC documentation, INI Configuration, [JOINT_<num>] COMP_FILE",
    endings=(".comp", ".ini", ".txt"),
    holds="the positioning error of each axis, forward and backward",
    units="mm, degrees (machine units)",
    grid="any ascending positions",
    limits="256 rows a joint; end values held",
    recognise=recognise,
    read=read,
    tables=read_tables,
    write=write,
    most_points=MOST_POINTS,
    variants=(POSITIONS, OFFSETS),
)
