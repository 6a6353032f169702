"""The outline of TOML text (keys, brackets, strings), bounded before the text is parsed.

A TOML reader's memory grows with the square of the parts of one key, and each table costs far more
memory than its two brackets. One pass over the text counts what would be expensive; it takes time
in proportion to the length of the text and no memory.
"""

import re

from warpspace.exceptions import SceneError
from warpspace.machine.limits import MAX_KEY_PARTS, MAX_KEYS, MAX_MARKS, MAX_NESTING

_TOKENS = re.compile(
    r'"""(?:[^"\\]++|\\.|"(?!""))*+(?:"{3,5})?'  # a text may end with two quotes of its own
    r"|'''(?:[^']++|'(?!''))*+(?:'{3,5})?"
    r'|"(?:[^"\\\n]++|\\[^\n])*+"?'
    r"|'[^'\n]*+'?"
    r"|#[^\n]*+"
    r"|[.,=\n\[\]{}]",
    re.DOTALL,
)
"""What matters in TOML: punctuation, and whole texts and remarks, which are passed over."""


def check_outline(text: str, source: str) -> None:
    """Refuse text whose keys, nesting or number of keys no scene needs.

    Valid text is understood as a TOML reader does, so that nothing in a text or remark counts. Of
    text that is not valid only the part before the first mistake matters.

    Parameters
    ----------
    text : str
        TOML, or anything.
    source : str
        What it is called in messages.

    Raises
    ------
    SceneError
        Naming the line and what was expected.
    """
    dots = depth = keys = 0
    for count, found in enumerate(_TOKENS.finditer(text)):
        mark = found[0]
        if count >= MAX_MARKS:
            _refuse(
                text,
                found,
                source,
                f"more than {MAX_MARKS:,} brackets, commas, dots and lines; expected long tables in"
                " CSV files of their own",
            )
        if mark == ".":  # between the parts of a key; a number has one at most
            dots += 1
            if dots >= MAX_KEY_PARTS:
                _refuse(
                    text,
                    found,
                    source,
                    f"a key of over {MAX_KEY_PARTS} parts; expected at most {MAX_KEY_PARTS}",
                )
            continue
        if mark[0] in "\"'#":
            continue
        if mark == "=" or (mark == "]" and depth == 1):
            keys += dots + 1
        elif mark == "{":
            keys += 1
        if keys > MAX_KEYS:
            _refuse(text, found, source, f"more than {MAX_KEYS:,} parts of keys")
        dots = 0
        if mark in "]}":
            depth = max(depth - 1, 0)
        elif mark in "[{":
            depth += 1
            if depth > MAX_NESTING:
                expected = f"is not valid TOML: nested too deeply, more than {MAX_NESTING} levels"
                _refuse(text, found, source, expected)


def _refuse(text: str, found: re.Match[str], source: str, problem: str) -> None:
    """Raise the error of a place in the text."""
    line = text.count("\n", 0, found.start()) + 1
    raise SceneError(source, [f"line {line}: {problem}"])
