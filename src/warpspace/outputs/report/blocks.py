"""What a report is made of. Plain text throughout: templates escape, nobody writes markup."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Align = Literal["left", "right"]
Mark = Literal["", "strong", "bad"]


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph; `role` is "lead" for the verdict, "body", or "note" for small print."""

    text: str
    role: str = "body"
    kind: str = "text"


@dataclass(frozen=True, slots=True)
class Card:
    """One number to remember: what it is, its value with unit, a remark."""

    label: str
    value: str
    remark: str = ""


@dataclass(frozen=True, slots=True)
class Cards:
    """Numbers side by side."""

    cards: tuple[Card, ...]
    kind: str = "cards"


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a table: heading, alignment, and share of the width on paper."""

    heading: str
    align: Align = "left"
    width: float = 1.0


@dataclass(frozen=True, slots=True)
class Table:
    """A table that may run over several pages; `marks` has one entry a row, or none."""

    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[str, ...], ...]
    marks: tuple[Mark, ...] = ()
    kind: str = "table"


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure as the bytes of an SVG or PDF file, with its caption."""

    name: str
    caption: str
    data: bytes
    form: str
    width: float = 1.0
    kind: str = "picture"


@dataclass(frozen=True, slots=True)
class Embedded:
    """A page of its own inside the page, for instance a 3-D view; left out on paper."""

    title: str
    html: str
    kind: str = "embedded"


@dataclass(frozen=True, slots=True)
class Items:
    """A list of remarks."""

    items: tuple[str, ...]
    kind: str = "items"


@dataclass(frozen=True, slots=True)
class Code:
    """Text as it stands in a file."""

    text: str
    kind: str = "code"


Block = Text | Cards | Table | Picture | Embedded | Items | Code


@dataclass(frozen=True, slots=True)
class Section:
    """A part of the report with a heading; the first stands on the page read first."""

    heading: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class Report:
    """A whole report.

    Attributes
    ----------
    title, subtitle : str
    overline : str
        What kind of document it is.
    facts : tuple of str
        Machine, date, version: one line below the title.
    sections : tuple of Section
    """

    title: str
    subtitle: str
    overline: str
    facts: tuple[str, ...]
    sections: tuple[Section, ...]

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """All figures, in order."""
        return tuple(b for part in self.sections for b in part.blocks if isinstance(b, Picture))


def table(
    caption: str,
    columns: Sequence[Column],
    rows: Sequence[Sequence[str]],
    marks: Sequence[Mark] = (),
) -> Table:
    """Put a table together."""
    return Table(caption, tuple(columns), tuple(tuple(row) for row in rows), tuple(marks))
