"""Checks of the raw values that a scene file spells for a curve, each problem with its place."""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, cast

from warpspace.exceptions import SceneError
from warpspace.machine.limits import MIN_NUMBER

if TYPE_CHECKING:
    from warpspace.machine.curves.curve import ErrorFunction

Path = tuple[int | str, ...]
"""Keys and indices below the error, for instance ``("table", 3, 0)``."""
Points = Sequence[tuple[float, float]]
CsvColumn = Callable[[str, str], Points]
"""Reads axis positions and one column, by file and name of the column; may raise SceneError."""
ReadCurve = Callable[[object, Path], "ErrorFunction | None"]
"""Reads a curve within a curve, by its raw value and its place; None where problems were noted."""
MISSING = object()
"""Stands where a table has not all keys of its form."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One problem: its place below the error, what was expected, and the value found.

    Attributes
    ----------
    path : tuple of int or str
    text : str
    value : object
        The ellipsis where the message shows no value.
    """

    path: Path
    text: str
    value: object = ...


def is_number(value: object) -> bool:
    """Tell whether a raw value is a number; a truth value is none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


class ValueReader:
    """Checks raw values and collects what is wrong with them.

    Every method gives something usable, so that all problems are found in one reading.

    Parameters
    ----------
    csv_column : callable, optional
        Reads a column of a CSV file; without it CSV files are refused.
    axis : str, optional
        The axis of the error, for curves that name axes.
    axes : collection of str, optional
        All axes of the machine.
    curve : callable, optional
        Reads a curve within a curve; without it there are none.

    Attributes
    ----------
    findings : list of Finding
        What was noted.
    axis : str
    axes : tuple of str
    """

    def __init__(
        self,
        csv_column: CsvColumn | None = None,
        *,
        axis: str = "",
        axes: Collection[str] = (),
        curve: ReadCurve | None = None,
    ) -> None:
        self.findings: list[Finding] = []
        self.axis, self.axes = axis, tuple(axes)
        self._csv_column, self._curve = csv_column, curve

    def note(self, path: Path, text: str, value: object = ...) -> None:
        """Note a problem; of a missing value, that it is missing."""
        found = Finding(path, "is missing") if value is MISSING else Finding(path, text, value)
        self.findings.append(found)

    def number(
        self, value: object, path: Path, low: float = -math.inf, high: float = math.inf
    ) -> float:
        """Read a finite number between limits."""
        try:
            number = float(cast("float", value)) if is_number(value) else None
        except OverflowError:
            self.note(path, "is too large; expected a finite number", value)
            return math.nan
        if number is None:
            self.note(path, "expected a number", value)
            return math.nan
        if not math.isfinite(number):
            self.note(path, "expected a finite number", value)
        elif 0.0 < abs(number) < MIN_NUMBER:
            self.note(path, f"expected 0, or at least {MIN_NUMBER:.3g}", value)
        elif number < low:
            self.note(path, f"expected at least {low:g}", value)
        elif number > high:
            self.note(path, f"expected at most {high:g}", value)
        return number

    def entries(self, value: object, path: Path, most: int) -> Sequence[object]:
        """Read a list with at least one entry and at most so many."""
        if not isinstance(value, list | tuple):
            self.note(path, "expected a list", value)
            return ()
        entries = cast("Sequence[object]", value)
        if not entries:
            self.note(path, "expected at least 1, not 0 entries", value)
        elif len(entries) > most:
            self.note(path, f"expected at most {most} entries", value)
            return ()
        return entries

    def row(
        self, value: object, path: Path, spelling: str, limits: Sequence[tuple[float, float]]
    ) -> tuple[float, ...]:
        """Read a list of numbers, each between its limits, spelled for instance "[q, value]"."""
        if not isinstance(value, list | tuple) or len(cast("Sequence[object]", value)) != len(
            limits
        ):
            self.note(path, f"expected {spelling}", value)
            return (math.nan,) * len(limits)
        return tuple(
            self.number(entry, (*path, index), *limit)
            for index, (entry, limit) in enumerate(
                zip(cast("Sequence[object]", value), limits, strict=True)
            )
        )

    def text(self, value: object, path: Path, longest: int) -> str:
        """Read a text that is not empty."""
        if not isinstance(value, str):
            self.note(path, "expected a text", value)
            return ""
        if not value:
            self.note(path, "expected at least 1 character", value)
        elif len(value) > longest:
            self.note(path, f"expected at most {longest} characters", value)
        return value

    def table(self, value: object, path: Path, known: Collection[str]) -> dict[str, object]:
        """Read a table with exactly so many keys; what is missing stands as `MISSING`."""
        if not isinstance(value, dict):
            self.note(path, "expected a table", value)
            return {}
        found = cast("dict[str, object]", value)
        for key in found:
            if key not in known:
                self.note((*path, key), f"unknown key; expected {', '.join(known)}")
        return {**dict.fromkeys(known, MISSING), **found}

    def ascending(
        self, value: object, path: Path, most: int, limit: tuple[float, float]
    ) -> tuple[float, ...]:
        """Read a list of ascending numbers between limits."""
        before = len(self.findings)
        found = tuple(
            self.number(entry, (*path, index), *limit)
            for index, entry in enumerate(self.entries(value, path, most))
        )
        for number, (low, high) in enumerate(pairwise(found), start=2):
            if len(self.findings) == before and not low < high:
                text = f"entry {number} is {high:g} after {low:g}; expected ascending positions"
                self.note(path, text)
        return found

    def curve(self, value: object, path: Path) -> "ErrorFunction | None":
        """Read a curve within this one; None where problems were noted."""
        if self._curve is None:
            self.note(path, "expected a number", value)
            return None
        return self._curve(value, path)

    def csv_points(self, file: str, column: str) -> Points:
        """Read a column of a CSV file; nothing where a problem was noted before."""
        if self.findings:
            return ()
        if self._csv_column is None:
            self.note((), "CSV files are not read here; expected the values as { table = }")
            return ()
        try:
            return self._csv_column(file, column)
        except SceneError as error:
            for problem in error.problems:
                self.note((), f"{error.source}: {problem}")
            return ()
