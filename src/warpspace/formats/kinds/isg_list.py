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
SETTINGS = ("interval", "kw_startpos", "kw_nr_max", "unit", "bilateral", "modulo")
COLUMNS = ("setpoint", "pos", "neg")
_ENTRY = re.compile(r"(kopf|kw\.ssfk)\.(\w+|table\[(\d{1,6})\]\.(\w+))\s+(\S.*)")
_AXIS = re.compile(r"([XYZABCUVW]\d?)[-_ ]?(?:ACHSE|AXIS)", re.IGNORECASE)
Entry = tuple[SourceLine, str]


def _entries(
    source: Source, notes: list[str]
) -> tuple[dict[str, Entry], dict[str, dict[int, Entry]]]:
    """Read the settings, and the columns of the table by index."""
    settings: dict[str, Entry] = {}
    columns: dict[str, dict[int, Entry]] = {name: {} for name in COLUMNS}
    unread: list[SourceLine] = []
    for at, bare in source.scan("#", "/*"):
        match = _ENTRY.fullmatch(bare)
        if match is None:
            if bare.startswith("kw.ssfk."):
                at.refuse(at.quoted, "kw.ssfk.NAME NUMBER")
            unread.append(at)
            continue
        group, key, index, column, text = match.groups()
        if index and column not in COLUMNS:
            at.refuse(f"{key} is unknown", f"one of {', '.join(COLUMNS)}")
        if not index and key not in SETTINGS and group != "kopf":
            unread.append(at)
            continue
        place, table = (int(index), columns[column]) if index else (key, settings)
        if place in table:
            at.refuse(f"{group}.{key} is repeated", "it once")
        table[place] = (at, text.strip())  # pyright: ignore[reportArgumentType]
    notes += unread_notes(unread)
    return settings, columns


def _axis(source: Source, settings: dict[str, Entry], options: ReadOptions) -> str:
    if options.axis or "log_achs_name" not in settings:
        return options.axis_of_file(source, "kopf.log_achs_name, or --axis X")
    at, name = settings["log_achs_name"]
    match = _AXIS.fullmatch(name)
    is_assigned = name.upper() in options.names
    return options.axis_named(match[1] if match and not is_assigned else name, at)


def _table(source: Source, options: ReadOptions, notes: list[str]) -> AxisTable:
    settings, columns = _entries(source, notes)

    def setting(name: str, low: int, high: int, default: int | None = None) -> int:
        if name not in settings:
            if default is None:
                source.refuse(f"has no kw.ssfk.{name}", f"kw.ssfk.{name} NUMBER")
            return default
        at, text = settings[name]
        return at.integer(text, f"kw.ssfk.{name}", low, high)

    axis = _axis(source, settings, options)
    if not setting("unit", 0, 1):
        settings["unit"][0].refuse(
            "unit 0: increments of the encoder, whose size is not in the file", "unit 1, 0.1 µm"
        )
    if setting("modulo", 0, 1, 0):
        settings["modulo"][0].refuse("modulo 1: the period is not in the file", "modulo 0")
    count = setting("kw_nr_max", 2, MAX_ROWS)
    interval = setting("interval", 0, MAX_POSITION)
    is_bilateral = bool(setting("bilateral", 0, 1, 0))

    def column(name: str) -> np.ndarray:
        missing = next((i for i in range(count) if i not in columns[name]), None)
        excess = next((i for i in sorted(columns[name]) if i >= count), None)
        if missing is not None:
            source.refuse(f"has no table[{missing}].{name}", f"{count} entries, kw_nr_max")
        if excess is not None:
            at = columns[name][excess][0]
            at.refuse(f"table[{excess}].{name}", f"an index below {count}, kw_nr_max")
        entries = (columns[name][i] for i in range(count))
        return np.array([at.number(text, name) for at, text in entries]) * RESOLUTION

    if columns["neg"] and not is_bilateral:
        at = next(iter(columns["neg"].values()))[0]
        at.refuse("values in the negative direction of a unilateral list", "bilateral 1")
    if interval:
        start = setting("kw_startpos", -MAX_POSITION, MAX_POSITION)
        places = (start + interval * np.arange(count)) * RESOLUTION
    else:
        places = column("setpoint")
    factor = options.factor(ERROR)
    forward = factor * column("pos")
    backward = factor * column("neg") if is_bilateral else np.zeros(0)
    for i, place in enumerate(places.tolist()):
        at, _ = columns["pos" if interval else "setpoint"][i]
        at.checked_position(place, "position")
        if i:
            at.ascending(place, float(places[i - 1]), "position")
    positions, values, reverse = (tuple(row.tolist()) for row in (places, forward, backward))
    return AxisTable(axis, axis, positions, values, backward=reverse)


def read_tables(sources: Sequence[Source], options: ReadOptions) -> Tables:
    notes: list[str] = []
    (source,) = sources  # each file is a list of its own
    table = _table(source, options, notes)
    return Tables((table,), (options.sign_statement(SIGN),), tuple(notes), ("0.1 µm", "0.0001°"))


FORMATS = (
    Format(
        **describe(NAME), recognise=has_pattern(r"^kw\.ssfk\."), tables=read_tables,
    ),
)  # fmt: skip
