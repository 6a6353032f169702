"""Options of tests: fields of their dataclasses, from which command line and app build theirs."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal

from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_LENGTH_MM

OptionKind = Literal["text", "number", "count", "choice", "axis", "point", "vector"]
EMPTY: Mapping[str, float] = {}


@dataclass(frozen=True, slots=True)
class TestOption:
    """One option of a test.

    Attributes
    ----------
    name : str
        Of the field.
    kind : str
        "axis": name of an axis; "point": axis positions; "vector": three numbers in mm.
    about : str
        One sentence.
    default : object
        None or empty where the test chooses.
    choices : tuple of str
        Of a choice.
    unit : str
    """

    name: str
    kind: OptionKind
    about: str
    default: Any
    choices: tuple[str, ...] = ()
    unit: str = ""

    __test__ = False

    @property
    def flag(self) -> str:
        """As it is typed: ``--radius`` for the field `radius_mm`."""
        return "--" + self.name.removesuffix("_mm").removesuffix("_deg").replace("_", "-")


def option(
    default: Any,
    kind: OptionKind,
    about: str,
    *,
    choices: tuple[str, ...] = (),
    unit: str = "",
) -> Any:
    """Give a field of a test that a user may set."""
    meta = {"kind": kind, "about": about, "choices": choices, "unit": unit}
    if kind == "point":
        return field(default_factory=dict[str, float], metadata=meta)
    return field(default=default, metadata=meta)


def options_of(test: type) -> tuple[TestOption, ...]:
    """List the options of a test, its own before those that all have."""
    found = [
        TestOption(
            entry.name,
            entry.metadata["kind"],
            entry.metadata["about"],
            None if entry.metadata["kind"] == "point" else entry.default,
            entry.metadata["choices"],
            entry.metadata["unit"],
        )
        for entry in fields(test)
        if entry.metadata
    ]
    return (*found[SHARED:], *found[:SHARED])


SHARED = 2
"""Options that every test has, the first fields of the base class."""


def read_options(test: type, texts: Mapping[str, str], axes: Collection[str]) -> dict[str, Any]:
    """Read options of a test from texts.

    Parameters
    ----------
    test : type
        Of the test.
    texts : mapping of str to str
        By name; those that are empty or left out are the test's own choice, unknown names count
        for nothing.
    axes : collection of str
        Of the machine.

    Returns
    -------
    dict of str to object
        What the test is built with.

    Raises
    ------
    OptionError
        If one cannot be read.
    """
    return {
        one.name: read_option(one, texts[one.name], axes)
        for one in options_of(test)
        if texts.get(one.name, "").strip()
    }


def read_option(one: TestOption, text: str, axes: Collection[str]) -> Any:
    """Read one option from its text; see `read_options`."""
    word = text.strip()
    if one.kind == "choice":
        if word not in one.choices:
            raise OptionError(f"{one.flag} {word!r}; expected one of {', '.join(one.choices)}")
        return word
    if one.kind == "axis":
        if word.upper() not in axes:
            raise OptionError(f"{one.flag} {word!r}; expected one of {', '.join(axes)}")
        return word.upper()
    if one.kind == "point":
        return _point(one.flag, word, axes)
    if one.kind == "vector":
        x, y, z = _numbers(one.flag, word, 3)
        return x, y, z
    (number,) = _numbers(one.flag, word, 1)
    if one.kind != "count":
        return number
    if number != int(number):
        raise OptionError(f"{one.flag} {word!r}; expected a whole number")
    return int(number)


def _numbers(flag: str, text: str, count: int) -> tuple[float, ...]:
    """Read finite numbers with commas between."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count or not all(abs(number) <= MAX_LENGTH_MM for number in numbers):
        expected = "a number" if count == 1 else "three numbers in mm, for instance 100,0,50"
        raise OptionError(f"{flag} {text!r}; expected {expected}")
    return numbers


def _point(flag: str, text: str, axes: Collection[str]) -> dict[str, float]:
    """Read axis positions, ``X=10,B=30``."""
    found: dict[str, float] = {}
    for part in text.split(","):
        name, equals, number = part.partition("=")
        name = name.strip().upper()
        if not equals or name not in axes or name in found:
            raise OptionError(
                f"{flag} {text!r}; expected positions of {', '.join(axes)}: X=10,B=30"
            )
        found[name] = _numbers(flag, number, 1)[0]
    return found


def check_count(name: str, value: int, low: int, high: int) -> None:
    """Refuse a number of points that makes no test.

    Raises
    ------
    OptionError
    """
    if not low <= value <= high:
        raise OptionError(f"{name}: {value}; expected {low:,} to {high:,}")
