"""Compensation value lists of the ISG kernel and TwinCAT CNC: leadscrew error, `kw.ssfk`.

TwinCAT 3 CNC TF5200, axis compensation, pages 308687883 and 113432971: values are absolute position
errors, actual − nominal, which the control takes out; unit 1 is 0.1 µm or 0.0001°; linear between
the points, end values held. With `interval` 0 each point has its own position.
"""

import re
from collections.abc import Sequence

import numpy as np

from warpspace.formats.registry import ERROR, Format, ReadOptions, describe, has_pattern
from warpspace.formats.source import Source, SourceLine, unread_notes
from warpspace.formats.terms import AxisTable, Tables

NAME = "isg-list"
RESOLUTION = 1e-4  # mm or degrees per unit
MAX_ROWS = 10_000
MAX_POSITION = 10**12
SIGN = "values are errors, actual − nominal, which the control subtracts"
PREFIX = "kw.ssfk."
AXIS = "kopf.log_achs_name"
READ_KEYS = (AXIS, *(
    PREFIX + name
    for name in ("interval", "kw_startpos", "kw_nr_max", "unit", "bilateral", "modulo", "table[")
))  # fmt: skip
_SETTING = re.compile(r"((?:kopf|kw)\.\S+)\s+(\S.*)")
_AXIS_NAME = re.compile(r"([XYZABCUVW]\d?)[-_ ]?(?:ACHSE|AXIS)", re.IGNORECASE)
Entries = dict[str, tuple[SourceLine, str]]


def _entries(source: Source, notes: list[str]) -> Entries:
    entries: Entries = {}
    unread: list[SourceLine] = []
    for at, bare in source.scan("#", "/*"):
        match = _SETTING.fullmatch(bare)
        if match is None and bare.startswith(PREFIX):
            at.refuse(at.quoted, f"{PREFIX}NAME NUMBER")
        if match is None or not match[1].startswith(READ_KEYS):
            unread.append(at)
        elif match[1] in entries:
            at.refuse(f"{match[1]} is repeated", "it once")
        else:
            entries[match[1]] = (at, match[2])
    notes += unread_notes(unread)
    return entries


def _axis(source: Source, entries: Entries, options: ReadOptions) -> str:
    if options.axis or AXIS not in entries:
        return options.axis_of_file(source, f"{AXIS}, or {{axis}} X")
    at, name = entries[AXIS]
    match = _AXIS_NAME.fullmatch(name)
    is_assigned = name.upper() in options.names
    return options.axis_named(match[1] if match and not is_assigned else name, at)


def _table(source: Source, options: ReadOptions, notes: list[str]) -> AxisTable:
    entries = _entries(source, notes)

    def setting(name: str, low: int, high: int, *, default: int | None = None) -> int:
        key = PREFIX + name
        if key not in entries and default is None:
            source.refuse(f"has no {key}", f"{key} NUMBER")
        at, number = entries.get(key, (source.at(1), str(default)))
        return at.integer(number, key, low, high)

    axis = _axis(source, entries, options)
    if not setting("unit", 0, 1):
        problem = "unit 0: increments of the encoder, whose size is not in the file"
        entries[f"{PREFIX}unit"][0].refuse(problem, "unit 1, 0.1 µm")
    if setting("modulo", 0, 1, default=0):
        problem = "modulo 1: the period is not in the file"
        entries[f"{PREFIX}modulo"][0].refuse(problem, "modulo 0")
    count = setting("kw_nr_max", 2, MAX_ROWS)
    interval = setting("interval", 0, MAX_POSITION)
    names = ["pos"] if interval else ["setpoint", "pos"]
    names += ["neg"] if setting("bilateral", 0, 1, default=0) else []
    keys = {name: [f"{PREFIX}table[{index}].{name}" for index in range(count)] for name in names}
    table_keys = {key for column in keys.values() for key in column}
    for key, (at, _) in entries.items():
        if "[" in key and key not in table_keys:
            expected = f"{' and '.join(names)} with an index below {count}, for interval {interval}"
            at.refuse(f"{key} is not used", expected)

    def column(name: str) -> np.ndarray:
        missing = next((key for key in keys[name] if key not in entries), "")
        if missing:
            source.refuse(f"has no {missing}", f"{count} points, kw_nr_max")
        return RESOLUTION * np.array(
            [at.number(number, name) for at, number in map(entries.__getitem__, keys[name])]
        )

    if interval:
        start = setting("kw_startpos", -MAX_POSITION, MAX_POSITION)
        places = (start + interval * np.arange(count)) * RESOLUTION
    else:
        places = column("setpoint")
    factor = options.factor(ERROR)
    forward, backward = (
        tuple((factor * column(name)).tolist()) if name in names else () for name in ("pos", "neg")
    )
    before = -np.inf
    for place, key in zip(places.tolist(), keys[names[0]], strict=True):
        at, _ = entries[key]
        at.ascending(at.checked_position(place, "position"), before, "position")
        before = place
    return AxisTable(axis, axis, tuple(places.tolist()), forward, backward=backward)


def read_tables(sources: Sequence[Source], options: ReadOptions) -> Tables:
    notes: list[str] = []
    (source,) = sources  # each file is a list of its own
    assumed = (options.sign_statement(SIGN),)
    return Tables((_table(source, options, notes),), assumed, tuple(notes), ("0.1 µm", "0.0001°"))


FORMATS = (
    Format(
        **describe(NAME), recognise=has_pattern(r"^kw\.ssfk\."), tables=read_tables,
    ),
)  # fmt: skip
