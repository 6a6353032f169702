"""Options of tests: fields of their dataclasses, from which command line and app build theirs."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal

from warpspace.exceptions import OptionError

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


def check_count(name: str, value: int, low: int, high: int) -> None:
    """Refuse a number of points that makes no test.

    Raises
    ------
    OptionError
    """
    if not low <= value <= high:
        raise OptionError(f"{name}: {value}; expected {low:,} to {high:,}")
