"""Numbers, switches and points as they stand in a line of settings, and back."""

from typing import NoReturn

from warpspace.machine.description import Vector
from warpspace.scene.files import parse_number


class Unreadable(ValueError):  # noqa: N818 - it is handled where text is read
    """A value that means nothing; where it has a text, that says what was expected."""


def refuse() -> NoReturn:
    """Say that a value means nothing."""
    raise Unreadable


def spell(value: object) -> str:
    """Spell a plain value; numbers to the last bit."""
    if isinstance(value, bool):
        return "1" if value else "0"
    return repr(value) if isinstance(value, float) else str(value)


def spell_numbers(numbers: tuple[float, ...]) -> str:
    """Spell numbers with commas between, to the last bit."""
    return ",".join(repr(float(number)) for number in numbers)


def read_switch(text: str) -> bool:
    """Read a switch."""
    if text not in ("0", "1"):
        raise Unreadable
    return text == "1"


def read_number(text: str) -> float:
    """Read a finite number."""
    try:
        return parse_number(text)
    except ValueError:
        raise Unreadable from None


def read_numbers(text: str, count: int | None = None) -> tuple[float, ...]:
    """Read numbers with commas between."""
    found = tuple(read_number(word) for word in text.split(","))
    if count is not None and len(found) != count:
        raise Unreadable
    return found


def read_point(text: str) -> Vector:
    """Read a point."""
    x, y, z = read_numbers(text, 3)
    return x, y, z
