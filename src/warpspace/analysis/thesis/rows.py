"""What the thesis comparison is made of: printed numbers, the case they belong to, and rows."""

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from warpspace.field.grid import Workspace
from warpspace.kinematics.model import Model
from warpspace.machine.errors import ErrorSet
from warpspace.machine.tolerances import ToleranceSet

Value = float | str
KEPT = "O"
MISSED = "X"


@dataclass(frozen=True, slots=True)
class ThesisCase:
    """What the tables are recomputed from.

    Attributes
    ----------
    model : Model
        The DVF5000, its workpiece point on the top rim of the largest workpiece.
    workspace : Workspace
    general, proposed : ToleranceSet
        Tables 4-6 and 4-7.
    first, second : ErrorSet
        The two machines measured.
    """

    model: Model
    workspace: Workspace
    general: ToleranceSet
    proposed: ToleranceSet
    first: ErrorSet
    second: ErrorSet


@dataclass(frozen=True, slots=True)
class Row:
    """One printed number or word, and ours.

    Attributes
    ----------
    source : str
        Table or figure, and page.
    key : str
        What it is: parameter key and column.
    printed, computed : float or str
    agrees : bool
        At the printed precision: within half of the last printed digit.
    unit : str
    digits : int
        Decimals that are printed.
    note : str
        Why not, or what there is to know; empty for most.
    """

    source: str
    key: str
    printed: Value
    computed: Value
    agrees: bool
    unit: str = ""
    digits: int = 0
    note: str = ""


@cache
def printed_tables() -> dict[str, Any]:
    """Read the printed numbers.

    Returns
    -------
    dict of str to table
    """
    text = (files("warpspace.analysis.thesis") / "tables.toml").read_text("utf-8")
    return tomllib.loads(text)


def source_of(table: str) -> str:
    """Give the place of a table in the thesis, for instance "table 4-3, p. 50"."""
    kind, chapter, number = table.split("_")
    entry = printed_tables()[table]
    where = f"p. {entry['page']}" if "page" in entry else f"section {entry['section']}"
    return f"{kind} {chapter}-{number}, {where}"


def agrees(printed: float, computed: float, digits: int) -> bool:
    """Tell whether a number agrees with a printed one within half of the last printed digit."""
    return abs(computed - printed) <= 0.5 * 10.0**-digits + 1e-9


def number_row(
    table: str,
    key: str,
    printed: float,
    computed: float,
    digits: int = 0,
    unit: str = "",
    note: str = "",
) -> Row:
    """Build the row of a number."""
    same = agrees(printed, computed, digits)
    return Row(source_of(table), key, float(printed), computed, same, unit, digits, note)


def text_row(
    table: str, key: str, printed: str, computed: str, unit: str = "", note: str = ""
) -> Row:
    """Build the row of a word, or of several numbers that are printed together."""
    return Row(source_of(table), key, printed, computed, printed == computed, unit, 0, note)


def spell_tolerance(centre: float, half_width: float) -> str:
    """Spell a tolerance as the thesis prints it: ``±10``, ``-8±6``."""
    return f"{centre:g}±{half_width:g}" if centre else f"±{half_width:g}"
