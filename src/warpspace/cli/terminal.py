"""Texts on their way to a terminal: characters that would steer it are spelt out.

Titles of scenes and names of files come from strangers. Control characters in them could move the
cursor, recolour the screen or rename its window, and characters that change the direction of
writing could make a name look like another.
"""

import re
from typing import Any

import click

_STEERING = re.compile(
    "[\x00-\x1f\x7f-\x9f"  # control characters
    "\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"  # direction of writing
    "\u2028\u2029"  # line and paragraph separators
    "\ud800-\udfff]"  # bytes of file names that are no text
)
_LINE_BREAKS = "\n\t"


def plain(text: str, *, breaks: bool = True) -> str:
    r"""Spell out the characters that would steer a terminal, for instance ``\x1b``.

    Parameters
    ----------
    text : str
    breaks : bool, optional
        Whether line breaks and tabs stay.

    Returns
    -------
    str
        Can be encoded whatever it was made from.
    """
    kept = _LINE_BREAKS if breaks else ""
    return _STEERING.sub(lambda found: found[0] if found[0] in kept else _spell(found[0]), text)


def escape_json(text: str) -> str:
    r"""Spell out the same characters in JSON text, as ``\u001b``; it means the same as before.

    Parameters
    ----------
    text : str
        JSON without line breaks between its parts.

    Returns
    -------
    str
    """
    return _STEERING.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def echo(text: str = "", *, err: bool = False, breaks: bool = True, **style: Any) -> None:
    """Print a text without characters that would steer the terminal.

    Parameters
    ----------
    text : str, optional
    err : bool, optional
        Whether it goes to stderr.
    breaks : bool, optional
        Whether line breaks stay.
    style : optional
        Colours, as `click.style` takes them.
    """
    click.secho(plain(text, breaks=breaks), err=err, **style)


def _spell(character: str) -> str:
    """Spell one character as an escape."""
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:
        code -= 0xDC00  # a byte of a file name
    return f"\\x{code:02x}" if code <= 0xFF else f"\\u{code:04x}"
