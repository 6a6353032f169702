"""Checks of the rows of numbers that a user edits; problems name the row."""

from warpspace.exceptions import OptionError
from warpspace.machine.curves.curve import Rows
from warpspace.machine.limits import MAX_ERROR


def single_value(rows: Rows) -> float:
    """Take the one number there is."""
    if len(rows) != 1 or len(rows[0]) != 1:
        raise OptionError("expected one number")
    return limited(rows[0][0], 1)


def limited(value: float, row: int, limit: float = MAX_ERROR, what: str = "value") -> float:
    """Refuse what is too large."""
    if abs(value) > limit:
        raise OptionError(f"row {row}: {what} {value:g}; expected at most ±{limit:g}")
    return value


def refuse_more(count: int, most: int, what: str) -> None:
    """Refuse too many numbers or rows."""
    if count > most:
        raise OptionError(f"{count} {what}; expected at most {most}")
