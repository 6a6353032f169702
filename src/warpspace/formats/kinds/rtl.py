"""Laser interferometer files `.rtl`: sections HEADER, TARGET DATA, RUNS, ENVIRONMENT, DEVIATIONS.

The structure is not published by its maker, but inferred from files that public programs write; an
import states this, and other sections or lines are refused.
"""

import math
import re
from collections.abc import Sequence

import numpy as np

from warpspace.formats import measured
from warpspace.formats.registry import Format, ReadOptions, describe, has_pattern
from warpspace.formats.source import Source, SourceLine, unread_notes
from warpspace.machine.axes import is_linear
from warpspace.machine.limits import MAX_POINTS, MAX_RUNS

NAME = "rtl"
SECTIONS = ("HEADER", "TARGET DATA", "USER-TEXT", "RUNS", "DEVIATIONS", "ENVIRONMENT", "EOF")
INFERRED = (
    "unpublished structure, inferred: targets in mm, deviations in µm, actual − nominal; runs with"
    " odd numbers forward, with even numbers backward"
)
ONE_WAY = "unidirectional according to the flags: runs with even numbers are empty and ignored"
TARGET_KEYS = "Filetype, Target-count, Targets and Flags"
_SECTION = re.compile(r"([A-Z][A-Z -]*)::")
_KEY = re.compile(r"[A-Za-z][A-Za-z0-9 _-]*")
Lines = list[tuple[SourceLine, str]]


def _sections(source: Source) -> dict[str, Lines]:
    sections: dict[str, Lines] = {}
    lines: Lines | None = None
    for at, bare in source.scan():
        heading = _SECTION.fullmatch(bare)
        if heading:
            name = heading[1].strip()
            if name not in SECTIONS:
                at.refuse(f"section {name!r} is unknown", f"one of {', '.join(SECTIONS)}")
            if name in sections:
                at.refuse(f"section {name} occurs twice", "it once")
            lines = sections.setdefault(name, [])
        elif lines is None:
            at.refuse(f"{at.quoted} before any section", "HEADER::")
        else:
            lines.append((at, bare))
    for name in ("TARGET DATA", "RUNS", "DEVIATIONS"):
        if name not in sections:
            source.refuse(f"has no section {name}", "it (is the file truncated?)")
    return sections


def _pair(text: str) -> tuple[str, str] | None:
    key, colon, value = text.partition(":")
    matched = _KEY.fullmatch(key.rstrip()) if colon else None
    return (matched[0].lower(), value.strip()) if matched else None


def _targets(source: Source, lines: Lines) -> tuple[list[float], list[int]]:
    count, flags = 0, []
    values: list[float] = []
    within_targets = False
    for at, text in lines:
        pair = _pair(text)
        if pair is None:
            if not within_targets:
                at.refuse(f"{at.quoted} is unknown", TARGET_KEYS)
            values += [at.position(part, "target") for part in text.split()]
            continue
        key, value = pair
        within_targets = key == "targets"
        if key == "target-count":
            count = at.integer(value, key, 2, MAX_POINTS)
        elif key == "flags":
            flags = [at.integer(part, key, -9, 99) for part in value.split()]
        elif key == "targets":
            values += [at.number(part, "target") for part in value.split()]
        elif key != "filetype":
            at.refuse(f"{at.quoted} is unknown", TARGET_KEYS)
    end = lines[-1][0] if lines else source
    if len(values) != count:
        end.refuse(f"{len(values)} targets", f"{count}, the Target-count")
    if len(set(values)) != len(values):
        end.refuse("a target occurs twice", "each once")
    return values, flags


def _run_count(source: Source, lines: Lines) -> tuple[int, tuple[str, ...]]:
    """Return the count of runs, and notes on what else is in their section."""
    stated, unread = 0, list[SourceLine]()
    for at, text in lines:
        key, value = _pair(text) or ("", "")
        if key == "run-count":
            stated = at.integer(value, "Run-count", 1, MAX_RUNS)
        else:
            unread.append(at)
    if not stated:
        source.refuse("section RUNS has no Run-count", "Run-count: number")
    return stated, unread_notes(unread)


def _deviations(lines: Lines, targets: int, stated: int) -> dict[int, np.ndarray]:
    rows: list[tuple[SourceLine, int, int, float]] = []
    for at, text in lines:
        if re.match(r"Run\s+Target\s+Data", text, re.IGNORECASE):
            continue
        parts = text.split()
        if len(parts) != 3:
            at.refuse(at.quoted, "run, target, deviation")
        run = at.integer(parts[0], "run", 1, MAX_RUNS)
        target = at.integer(parts[1], "target", 1, MAX_POINTS)
        rows.append((at, run, target, at.error(parts[2], "deviation")))
    table: dict[int, np.ndarray] = {}
    for at, run, target, error in rows:
        if target > targets:
            at.refuse(f"target {target}", f"at most {targets}")
        if run > stated:
            at.refuse(f"run {run}", f"at most {stated}, the Run-count")
        row = table.setdefault(run, np.full(targets, math.nan))
        if not math.isnan(row[target - 1]):
            at.refuse(f"run {run}, target {target} occurs twice", "it once")
        row[target - 1] = error
    return table


def _read_one(source: Source, options: ReadOptions) -> measured.ImportedErrors:
    sections = _sections(source)
    targets, flags = _targets(source, sections["TARGET DATA"])
    stated, unread = _run_count(source, sections["RUNS"])
    unidirectional = len(flags) > 1 and flags[1] == 1
    if options.axis:
        axis = options.axis_named(options.axis, source)
    else:
        pairs = [(at, _pair(text)) for at, text in sections.get("USER-TEXT", [])]
        named = [(at, pair[1]) for at, pair in pairs if pair and pair[0] == "axis" and pair[1]]
        if not named:
            source.refuse("does not state its axis", "{axis} X")
        at, value = named[0]
        axis = options.axis_named(value.split()[0], at)
    table = _deviations(sections["DEVIATIONS"], len(targets), stated)
    rows_by_run = {run: row for run, row in sorted(table.items()) if run % 2 or not unidirectional}
    expected = [run for run in range(1, stated + 1) if run % 2 or not unidirectional]
    if list(rows_by_run) != expected or any(np.isnan(row).any() for row in rows_by_run.values()):
        counted = sum(int((~np.isnan(row)).sum()) for row in rows_by_run.values())
        required = f"{len(expected) * len(targets)}: {len(expected)} runs of {len(targets)} targets"
        source.refuse(f"{counted} readings", f"{required} (is the file truncated?)")
    order = np.argsort(targets)
    runs = tuple(
        measured.MeasuredRun(
            (run + 1) // 2,
            measured.FORWARD if run % 2 else measured.BACKWARD,
            tuple(row[order].tolist()),
        )
        for run, row in rows_by_run.items()
    )
    if not is_linear(axis):
        source.refuse(f"is for the rotary axis {axis}, whose units are unknown; expected a CSV")
    key = f"E{'XYZ'['XYZUVW'.index(axis[0]) % 3]}{axis}"
    series = measured.ErrorSeries(key, tuple(float(targets[index]) for index in order), runs)
    air = [text for _, text in sections.get("ENVIRONMENT", [])]
    header = [at for at, text in sections.get("HEADER", []) if _pair(text) is None]
    notes = (*source.notes, *unread_notes(header), *unread)
    if air:
        notes += (f"environment: {'; '.join(air)}",)
    assumed = (INFERRED, ONE_WAY) if unidirectional else (INFERRED,)
    return measured.ImportedErrors(
        NAME, (series,), units=("mm", "µm"), assumed=assumed, notes=notes
    )


def read(sources: Sequence[Source], options: ReadOptions) -> measured.ImportedErrors:
    readings = measured.merge([_read_one(source, options) for source in sources])
    return measured.errors_of_readings(readings, options.machine)


FORMATS = (
    Format(
        **describe(NAME),
        recognise=has_pattern(r"(?s)\A(?=.*HEADER::)(?=.*(TARGET DATA|DEVIATIONS)::)"),
        read=read,
    ),
)
