"""Laser interferometer files `.rtl`: sections HEADER, TARGET DATA, RUNS, ENVIRONMENT, DEVIATIONS.

The structure is not published by its maker. What is understood here is inferred from files that
public programs write; an import says so, and a section or line beyond that is refused.
"""

import math
import re
from collections.abc import Sequence

import numpy as np

from warpspace.formats.kind import Format, ReadOptions, resolve_axis
from warpspace.formats.measured import BACKWARD, FORWARD, Imported, Run, Series, merge
from warpspace.formats.numbers import check_error, check_position, read_number, read_whole
from warpspace.formats.source import Source
from warpspace.machine.axes import is_linear
from warpspace.machine.limits import MAX_POINTS, MAX_RUNS

NAME = "rtl"
SECTIONS = ("HEADER", "TARGET DATA", "USER-TEXT", "RUNS", "DEVIATIONS", "ENVIRONMENT", "EOF")
INFERRED = (
    "the structure is not published, it was inferred: targets in mm, deviations in µm, actual −"
    " nominal; runs with odd numbers forward, even ones backward"
)
ONE_WAY = "the flags say one direction: runs with even numbers hold nothing, left out"
KNOWN = "expected Filetype, Target-count, Targets and Flags"
_SECTION = re.compile(r"([A-Z][A-Z -]*)::")
_KEY = re.compile(r"([A-Za-z][A-Za-z0-9 _-]*?)\s*:\s*(.*)")
Lines = list[tuple[int, str]]


def recognise(head: str, name: str) -> bool:
    """Tell it by its sections."""
    del name
    return "HEADER::" in head and ("TARGET DATA::" in head or "DEVIATIONS::" in head)


def _sections(source: Source) -> dict[str, Lines]:
    """Split a file into sections."""
    found: dict[str, Lines] = {}
    lines: Lines | None = None
    for number, text in enumerate(source.lines, start=1):
        bare = text.strip()
        if matched := _SECTION.fullmatch(bare):
            name = matched[1].strip()
            if name not in SECTIONS:
                expected = f"expected one of {', '.join(SECTIONS)}"
                source.refuse(f"section {name!r} is not understood; {expected}", number)
            if name in found:
                source.refuse(f"section {name} stands there twice; expected it once", number)
            lines = found.setdefault(name, [])
        elif bare:
            if lines is None:
                source.refuse(
                    f"{source.shown(number)} before any section; expected HEADER::", number
                )
            lines.append((number, bare))
    for name in ("TARGET DATA", "RUNS", "DEVIATIONS"):
        if name not in found:
            source.refuse(f"has no section {name}; expected it (is the file cut off?)")
    return found


def _targets(source: Source, lines: Lines) -> tuple[list[float], list[int]]:
    """Read the targets and the flags."""
    count, flags = 0, []
    values: list[float] = []
    within = False
    for number, text in lines:
        matched = _KEY.fullmatch(text)
        if matched is None:
            if not within:
                source.refuse(f"{source.shown(number)} is not understood; {KNOWN}", number)
            for part in text.split():
                value = read_number(part, source, number, "target")
                values.append(check_position(value, source, number, "target"))
            continue
        key, value = matched[1].strip().lower(), matched[2].strip()
        within = key == "targets"
        if key == "target-count":
            count = read_whole(value, source, number, key, 2, MAX_POINTS)
        elif key == "flags":
            flags = [read_whole(part, source, number, key, -9, 99) for part in value.split()]
        elif key == "targets":
            values += [read_number(part, source, number, "target") for part in value.split()]
        elif key != "filetype":
            source.refuse(f"{source.shown(number)} is not understood; {KNOWN}", number)
    if len(values) != count:
        line = lines[-1][0] if lines else None
        source.refuse(f"{len(values)} targets; expected {count} as Target-count says", line)
    if len(set(values)) != len(values):
        source.refuse("a target stands there twice; expected each once", lines[-1][0])
    return values, flags


def _deviations(source: Source, lines: Lines) -> list[tuple[int, int, int, float]]:
    """Read line, run, target and deviation of each reading."""
    found: list[tuple[int, int, int, float]] = []
    for number, text in lines:
        if re.match(r"Run\s+Target\s+Data", text, re.IGNORECASE):
            continue
        parts = text.split()
        if len(parts) != 3:
            source.refuse(f"{source.shown(number)}; expected run, target, deviation", number)
        run = read_whole(parts[0], source, number, "run", 1, MAX_RUNS)
        target = read_whole(parts[1], source, number, "target", 1, MAX_POINTS)
        value = read_number(parts[2], source, number, "deviation")
        found.append((number, run, target, check_error(value, source, number, "deviation")))
    return found


def _axis(source: Source, sections: dict[str, Lines], options: ReadOptions) -> str:
    """Find the axis: what the user says, else what the file says."""
    if options.axis:
        return resolve_axis(options.axis, source, None, options)
    for number, text in sections.get("USER-TEXT", []):
        matched = _KEY.fullmatch(text)
        if matched and matched[1].strip().lower() == "axis" and matched[2].strip():
            return resolve_axis(matched[2].split()[0], source, number, options)
    raise source.unsaid("does not name its axis; expected --axis X")


def _read_one(source: Source, options: ReadOptions) -> Imported:
    """Read one file."""
    sections = _sections(source)
    targets, flags = _targets(source, sections["TARGET DATA"])
    stated = 0
    for number, text in sections["RUNS"]:
        matched = _KEY.fullmatch(text)
        if matched and matched[1].strip().lower() == "run-count":
            stated = read_whole(matched[2], source, number, "Run-count", 1, MAX_RUNS)
    if not stated:
        source.refuse("section RUNS has no Run-count; expected Run-count: number")
    one_way = len(flags) > 1 and flags[1] == 1
    axis = _axis(source, sections, options)
    table: dict[int, np.ndarray] = {}
    for number, run, target, value in _deviations(source, sections["DEVIATIONS"]):
        if target > len(targets):
            source.refuse(f"target {target}; expected at most {len(targets)}", number)
        if run > stated:
            source.refuse(f"run {run}; expected at most {stated} as Run-count says", number)
        row = table.setdefault(run, np.full(len(targets), math.nan))
        if not math.isnan(row[target - 1]):
            source.refuse(
                f"run {run}, target {target} stands there twice; expected it once", number
            )
        row[target - 1] = value
    kept = {run: row for run, row in table.items() if not (one_way and run % 2 == 0)}
    expected = [run for run in range(1, stated + 1) if not (one_way and run % 2 == 0)]
    if sorted(kept) != expected or any(np.isnan(row).any() for row in kept.values()):
        counted = sum(int((~np.isnan(row)).sum()) for row in kept.values())
        wanted = len(expected) * len(targets)
        source.refuse(
            f"{counted} readings; expected {wanted}: {len(expected)} runs of {len(targets)} targets"
            " (is the file cut off?)"
        )
    order = np.argsort(targets)
    runs = tuple(
        Run((run + 1) // 2, FORWARD if run % 2 else BACKWARD, tuple(row[order].tolist()))
        for run, row in sorted(kept.items())
    )
    places = tuple(float(targets[index]) for index in order)
    if not is_linear(axis):
        source.refuse(f"is for the rotary axis {axis}; its units are not known: expected a CSV")
    series = Series(f"E{'XYZ'['XYZUVW'.index(axis[0]) % 3]}{axis}", places, runs)
    air = [text for _, text in sections.get("ENVIRONMENT", [])]
    notes = (f"environment: {'; '.join(air)}",) if air else ()
    assumed = (INFERRED, *((ONE_WAY,) if one_way else ()))
    return Imported(
        NAME, (series,), units=("mm", "µm"), assumed=assumed, notes=(*source.notes, *notes)
    )


def read(sources: Sequence[Source], options: ReadOptions) -> Imported:
    """Read the positioning errors of files."""
    return merge([_read_one(source, options) for source in sources])


FORMAT = Format(
    name=NAME,
    title="laser interferometer file .rtl, positioning runs",
    source="not published; inferred from files that public programs write (docs/import.md)",
    endings=(".rtl",),
    holds="the positioning error of one axis, run by run, forward and backward",
    units="mm, µm (inferred)",
    grid="any targets",
    limits="read only",
    recognise=recognise,
    read=read,
)
