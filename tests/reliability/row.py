"""What a row of the table is: something that is tried so many times, and what came of it."""

from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass
class Outcome:
    """What came of a row.

    Attributes
    ----------
    count : int
        How many times it was tried, really.
    result : str
        In a few words, with numbers.
    faults : list of str
        What must not be; none where the row holds.
    """

    count: int
    result: str
    faults: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Row:
    """One row of the table.

    Attributes
    ----------
    name : str
        By which it is asked for.
    what : str
        What is tried, and what must hold.
    full : int
        How many times, where nobody says a fraction.
    unit : str
        What is counted.
    run : callable
        Takes a count and gives the outcome.
    """

    name: str
    what: str
    full: int
    unit: str
    run: Callable[[int], Outcome]
