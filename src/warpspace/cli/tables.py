"""Output for people: tables and sentences that fit the terminal, and progress bars.

The width is that of the terminal or of the variable COLUMNS; 80 if the output goes into a file or
another program. Only words wrap. A table with more columns than fit continues below with its first
columns repeated, so that no number is cut. Headings repeat every forty rows. Work of more than a
second shows its progress on stderr, unless that is no terminal or the output is ``--json``.
"""

import io
import os
import re
import shutil
import sys
import textwrap
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from itertools import zip_longest
from threading import Timer
from typing import TYPE_CHECKING, Any, NamedTuple

import click

if TYPE_CHECKING:
    from rich.progress import Progress

    from warpspace.analysis.blocks import Column

WIDTH_ELSEWHERE = 80  # characters per line if the output is no terminal
READABLE = 20  # characters per line of a text column before other columns move below
REPEATED = 40  # rows after which headings repeat
Row = Sequence[str]
_NARROW = re.compile("[\n -~\xa0-\xac\xae-\u02ff\u0370-\u0482\u2010-\u2027\u2100-\u2319]*")
"""Texts whose characters all take one cell of a terminal."""
_UNBROKEN_SPACES = re.compile(r"(?<=\d) (?=[µm°%])|(?<= [A-Z]) (?=[-+\d])")
"""Spaces without a line break: number and unit, axis and position."""


def output_width() -> int:
    return shutil.get_terminal_size((WIDTH_ELSEWHERE, 24)).columns


def print_text(text: str) -> None:
    text = plain(text)
    indent = text[: len(text) - len(text.lstrip(" "))]
    lines = textwrap.wrap(
        _UNBROKEN_SPACES.sub("\N{NO-BREAK SPACE}", text.strip()),
        max(output_width(), 20),
        initial_indent=indent,
        subsequent_indent=f"{indent}  ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    click.echo("\n".join(lines).replace("\N{NO-BREAK SPACE}", " "))


def print_table(columns: "Sequence[Column]", rows: Sequence[Row], indent: int = 2) -> None:
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
        click.echo(textwrap.indent(drawn, " " * indent))


class _Size(NamedTuple):
    """Widths of a column, in characters: no word cut, comfortable, no line wrapped."""

    least: int
    readable: int
    natural: int


def _measure(column: "Column", cells: Sequence[str]) -> _Size:
    lines = [line for text in (column.head, *cells) for line in text.splitlines()]
    natural = max(map(_text_width, lines), default=0)
    if not column.wraps:
        return _Size(natural, natural, natural)
    least = max((_text_width(word) for line in lines for word in line.split()), default=0)
    return _Size(least, min(natural, max(least, READABLE)), natural)


def _text_width(text: str) -> int:
    """Count the characters of a terminal that a text takes."""
    if _NARROW.fullmatch(text):
        return len(text)
    from rich.cells import cell_len

    return cell_len(text)


def _split(columns: "Sequence[Column]", widths: Sequence[int], room: int) -> list[list[int]]:
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
        candidate = [*parts[-1], *group]
        fits = sum(widths[index] for index in candidate) + len(candidate) - 1 <= room
        if fits or parts[-1] == leading:
            parts[-1] = candidate
        else:
            parts.append([*leading, *group])
    return parts


def _draw(columns: "Sequence[Column]", rows: Sequence[Row], gap: int, width: int) -> str:
    """Draw a table; its cells are wrapped, by rich, only if they do not fit."""
    has_header = any(column.heading for column in columns)
    lines = max((column.head.count("\n") for column in columns), default=0)
    heads = ["\n" * (lines - column.head.count("\n")) + column.head for column in columns]
    drawn: list[Row] = [heads] if has_header else []
    for number, row in enumerate(rows):
        if has_header and number and number % REPEATED == 0:
            drawn += [[""] * len(columns), heads]
        drawn.append(row)
    sizes = [max(map(len, "\n".join(cells).split("\n"))) for cells in zip(*drawn, strict=True)]
    is_narrow = all(_NARROW.fullmatch(cell) for row in drawn for cell in row)
    if not is_narrow or sum(sizes) + gap * (len(sizes) - 1) > width:
        return _draw_wrapped(columns, drawn, gap, width, has_header=has_header)
    aligned = [
        (" " * gap).join(
            text.rstrip().rjust(size) if column.is_number else text.ljust(size)
            for column, text, size in zip(columns, texts, sizes, strict=True)
        )
        for row in drawn
        for texts in zip_longest(*(cell.split("\n") for cell in row), fillvalue="")
    ]
    is_styled = sys.stdout.isatty() and os.environ.get("TERM") not in ("dumb", "unknown")
    bold = lines + 1 if has_header and is_styled else 0
    styled = [click.style(line, bold=True) for line in aligned[:bold]]
    return "\n".join(line.rstrip() for line in (*styled, *aligned[bold:]))


def _draw_wrapped(
    columns: "Sequence[Column]", rows: Sequence[Row], gap: int, width: int, *, has_header: bool
) -> str:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, padding=(0, gap, 0, 0), pad_edge=False, show_header=has_header)
    for column in columns:
        justify = "right" if column.is_number else "left"
        table.add_column(Text(column.head), justify=justify, no_wrap=not column.wraps)
    for row in rows[has_header:]:
        table.add_row(*map(Text, row))
    page = io.StringIO()
    console = Console(
        file=page, width=width, force_terminal=sys.stdout.isatty(), legacy_windows=False
    )
    console.print(table)
    return "\n".join(line.rstrip() for line in page.getvalue().splitlines())


_STEERING = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f"  # control characters but tabs and line breaks
    "\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"  # direction of writing
    "\u2028\u2029"  # line and paragraph separators
    "\ud800-\udfff]"  # bytes of file names that are no text
)


def plain(text: str) -> str:
    r"""Escape control characters, for instance as ``\x1b``."""
    return _STEERING.sub(lambda match: _spell(match[0]), text)


def escape_json(text: str) -> str:
    r"""Escape control characters in JSON text as ``\u001b``; its content stays the same."""
    return _STEERING.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def echo(text: str = "", *, err: bool = False, **style: Any) -> None:
    """Print a text without control characters."""
    click.secho(plain(text), err=err, **style)


def warn(*sentences: str) -> None:
    """Print warnings on stderr."""
    for sentence in sentences:
        echo(f"warpspace: warning: {sentence}", err=True, fg="yellow")


def _spell(character: str) -> str:
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:
        code -= 0xDC00  # a byte of a file name
    return f"\\x{code:02x}" if code <= 0xFF else f"\\u{code:04x}"


DELAY_S = 1.0  # before a progress bar appears


class ProgressBar:
    """Progress of some work, shown in a bar unless output is silent."""

    def __init__(self, bar: "Progress | None" = None) -> None:
        self._bar = bar

    def advance(self, steps: float) -> None:
        if self._bar is not None:
            self._bar.advance(self._bar.task_ids[0], steps)

    def reach(self, share: float) -> None:
        """Set the share of the work that is done, 0 to 1."""
        if self._bar is not None:
            self._bar.update(self._bar.task_ids[0], completed=share)


@contextmanager
def progress(
    doing: str, total: float | None = None, unit: str = "", *, silent: bool = False
) -> Generator[ProgressBar]:
    """Show the progress of some work in a bar that appears after a delay."""
    if silent or not sys.stderr.isatty():
        yield ProgressBar()
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    counted = "{task.completed:,.0f} of {task.total:,.0f} " + unit
    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=None),
        *([TextColumn(counted, markup=False)] if total is not None and unit else []),
        TimeElapsedColumn(),
        console=Console(file=sys.stderr),
        transient=True,
        expand=True,
        redirect_stdout=False,
        redirect_stderr=False,
    )
    task = bar.add_task(doing, total=total, start=False)

    def show() -> None:
        bar.start_task(task)
        bar.start()

    timer = Timer(DELAY_S, show)
    timer.daemon = True
    timer.start()
    try:
        yield ProgressBar(bar)
    finally:
        timer.cancel()
        timer.join()
        if bar.live.is_started:
            bar.stop()
