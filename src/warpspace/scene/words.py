"""Spelling what stands in a scene file: keys, values and places, safe to show in one line."""

import re
from collections.abc import Iterable
from datetime import date, time

SHOWN = 60
"""Characters of a value or a key that a message shows."""
_DEPTH = 6
_ENTRIES = 8
_HUGE_BITS = 512
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+", re.ASCII)
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r"}


def spell_value(value: object) -> str:
    """Spell a value as TOML does, in at most a line.

    Parameters
    ----------
    value : object
        Whatever the TOML reader gives, however deep, long or large.

    Returns
    -------
    str
    """
    return _cut(_spell(value, _DEPTH))


def spell_key(name: str) -> str:
    """Spell a key as TOML does: bare where it may be, else between quotes."""
    return _cut(name if _BARE_KEY.fullmatch(name) else _quoted(name))


def location(key: str, parts: Iterable[int | str], tag_at: int | None = None) -> str:
    """Spell the place of a finding as it stands in the file.

    Parameters
    ----------
    key : str
        Place of the value that was validated; empty for a whole file.
    parts : iterable of int or str
        Keys and indices below it, as pydantic gives them.
    tag_at : int, optional
        Which of them is no key but the tag of a union.

    Returns
    -------
    str
        For instance ``points_mm.traces[1][2]``.
    """
    text = key
    for index, part in enumerate(parts):
        if index == tag_at:
            continue
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += f".{spell_key(part)}" if text else spell_key(part)
    return text


def _cut(text: str) -> str:
    """Cut a text to what a message shows."""
    return text if len(text) <= SHOWN else text[: SHOWN - 1] + "…"


def _quoted(text: str) -> str:
    """Put a text between quotes, with nothing in it that a terminal would obey."""
    shown = text[: SHOWN + 1]
    return (
        '"'
        + "".join(_ESCAPES.get(c, c if c.isprintable() else f"\\u{ord(c):04x}") for c in shown)
        + '"'
    )


def _spell(value: object, depth: int) -> str:
    """Spell a value down to a depth."""
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and value.bit_length() > _HUGE_BITS:
        return f"a whole number of {value.bit_length()} bits"
    if isinstance(value, date | time):
        return value.isoformat()
    if not isinstance(value, list | tuple | dict):
        return repr(value)
    left, right = "{}" if isinstance(value, dict) else "[]"
    if not value:
        return left + right
    if depth == 0:
        return f"{left}…{right}"
    if isinstance(value, dict):
        pairs = list(value.items())[:_ENTRIES]
        shown = [f"{spell_key(str(name))} = {_spell(entry, depth - 1)}" for name, entry in pairs]
    else:
        shown = [_spell(entry, depth - 1) for entry in value[:_ENTRIES]]
    inside = ", ".join([*shown, "…"] if len(value) > _ENTRIES else shown)
    return f"{{ {inside} }}" if isinstance(value, dict) else f"[{inside}]"
