"""What the commands print for people: tables and sentences that fit the terminal.

The width is that of the terminal, or what the variable COLUMNS says; 80 where the output goes into
a file or another program. Only words wrap. A table with more columns than fit goes on below, with
its first columns repeated, so that no number is cut and nothing is left out. A long table has its
headings again every forty rows.
"""

import io
import re
import sys
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import click

from warpspace.cli.terminal import plain

WIDTH_ELSEWHERE = 80
"""Characters in a line where the output is no terminal."""
READABLE = 20
"""Characters in a line that a column of words has before others go on below."""
REPEATED = 40
"""Rows after which a long table has its headings again."""
Row = Sequence[str]
_TOGETHER = re.compile(r"(?<=\d) (?=[µm°%])|(?<= [A-Z]) (?=[-+\d])")
"""Blanks that no line ends with: between a number and its unit, an axis and its position."""


class Column(NamedTuple):
    """One column of a table.

    Parameters
    ----------
    heading : str
        What it holds; no column of a table without headings has one.
    unit : str, optional
        Stands in brackets below the heading.
    is_number : bool, optional
        Whether it is aligned at the right.
    wraps : bool, optional
        Whether long cells may take several lines, broken between words.
    leads : bool, optional
        Whether it is repeated where the table goes on below. Such columns come first.
    joins : bool, optional
        Whether it is never parted from the column before it.
    """

    heading: str = ""
    unit: str = ""
    is_number: bool = False
    wraps: bool = False
    leads: bool = False
    joins: bool = False

    @property
    def head(self) -> str:
        """Heading and unit, in two lines."""
        return f"{self.heading}\n[{self.unit}]" if self.unit else self.heading


def number_columns(headings: Iterable[str], unit: str = "") -> list[Column]:
    """Build columns of numbers that have the same unit and stay side by side."""
    return [
        Column(heading, unit, is_number=True, joins=index > 0)
        for index, heading in enumerate(headings)
    ]


def output_width() -> int:
    """Give the width to print in, in characters."""
    import shutil

    return shutil.get_terminal_size((WIDTH_ELSEWHERE, 24)).columns


def print_text(text: str) -> None:
    """Print a sentence.

    Parameters
    ----------
    text : str
        The blanks it begins with stand before every line; lines after the first get two more.
    """
    import textwrap

    text = plain(text)
    indent = text[: len(text) - len(text.lstrip(" "))]
    lines = textwrap.wrap(
        _TOGETHER.sub("\N{NO-BREAK SPACE}", text.strip()),
        max(output_width(), 20),
        initial_indent=indent,
        subsequent_indent=f"{indent}  ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    click.echo("\n".join(lines).replace("\N{NO-BREAK SPACE}", " "))


def print_table(columns: Sequence[Column], rows: Sequence[Row], indent: int = 2) -> None:
    """Print a table.

    Parameters
    ----------
    columns : sequence of Column
        The most important ones first.
    rows : sequence of sequence of str
        One text a column. It is printed as it stands: brackets are no mark-up.
    indent : int, optional
        Blanks before each line.
    """
    from textwrap import indent as indented

    room = output_width() - indent
    rows = [[plain(cell) for cell in row] for row in rows]
    sizes = [_measure(column, [row[i] for row in rows]) for i, column in enumerate(columns)]
    for number, part in enumerate(_split(columns, [size.readable for size in sizes], room)):
        if number:
            click.echo()
        cells = [[row[index] for index in part] for row in rows]
        if number:
            leading = sum(column.leads for column in columns)
            cells = [row for row in cells if any(row[leading:])]
        gaps = len(part) - 1
        gap = 2 if sum(sizes[index].natural for index in part) + 2 * gaps <= room else 1
        width = max(room, sum(sizes[index].least for index in part) + gap * gaps)
        drawn = _draw([columns[index] for index in part], cells, gap, width)
        click.echo(indented(drawn, " " * indent))


class _Size(NamedTuple):
    """Widths of a column, in characters: none of its words cut, pleasant to read, none wrapped."""

    least: int
    readable: int
    natural: int


def _measure(column: Column, cells: Sequence[str]) -> _Size:
    """Measure a column."""
    from rich.cells import cell_len

    lines = [line for text in (column.head, *cells) for line in text.splitlines()]
    natural = max(map(cell_len, lines), default=0)
    if not column.wraps:
        return _Size(natural, natural, natural)
    least = max((cell_len(word) for line in lines for word in line.split()), default=0)
    return _Size(least, min(natural, max(least, READABLE)), natural)


def _split(columns: Sequence[Column], widths: Sequence[int], room: int) -> list[list[int]]:
    """Share out the columns over as many tables as needed, by index; one blank between columns."""
    groups: list[list[int]] = []
    for index, column in enumerate(columns):
        if column.joins and groups:
            groups[-1].append(index)
        else:
            groups.append([index])
    leading = [index for group in groups if columns[group[0]].leads for index in group]
    parts = [leading]
    for group in groups:
        if group[0] in leading:
            continue
        wanted = [*parts[-1], *group]
        fits = sum(widths[index] for index in wanted) + len(wanted) - 1 <= room
        if fits or parts[-1] == leading:
            parts[-1] = wanted
        else:
            parts.append([*leading, *group])
    return parts


def _draw(columns: Sequence[Column], rows: Sequence[Row], gap: int, width: int) -> str:
    """Lay out a table in a width that it fits."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(
        box=None,
        padding=(0, gap, 0, 0),
        pad_edge=False,
        show_header=any(column.heading for column in columns),
    )
    for column in columns:
        table.add_column(
            Text(column.head),
            justify="right" if column.is_number else "left",
            no_wrap=not column.wraps,
        )
    lines = max((column.head.count("\n") for column in columns), default=0)
    heads = [Text("\n" * (lines - column.head.count("\n")) + column.head) for column in columns]
    for number, row in enumerate(rows):
        if table.show_header and number and number % REPEATED == 0:
            table.add_row()
            table.add_row(*heads)
        table.add_row(*map(Text, row))
    page = io.StringIO()
    console = Console(
        file=page, width=width, force_terminal=sys.stdout.isatty(), legacy_windows=False
    )
    console.print(table)
    return "\n".join(line.rstrip() for line in page.getvalue().splitlines())
