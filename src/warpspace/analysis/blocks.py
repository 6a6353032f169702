"""Content of a result: sentences, tables, and charts as numbers, independent of a renderer."""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from markupsafe import escape

if TYPE_CHECKING:
    from warpspace.units import Array

Form: TypeAlias = str | Callable[[Any], str]
Role: TypeAlias = Literal["plain", "key", "set", "none"]
Kind: TypeAlias = Literal["lines", "polar", "plane"]
Style: TypeAlias = Literal["line", "dashed", "dots", "thin"]
Mark: TypeAlias = Literal["", "better", "worse", "key"]


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a table: rows hold raw values, `form` formats them."""

    heading: str = ""
    form: Form = ""  # format specification, or what spells a value; None is an empty cell
    unit: str = ""  # stands in brackets below the heading
    key: str = ""  # heading in a CSV file; without one it is in none
    wraps: bool = False  # long cells may take several lines, broken between words
    leads: bool = False  # repeated where the table goes on below; such columns come first
    joins: bool = False  # never parted from the column before it
    shows: bool = True  # in text and on pages; otherwise only in the CSV file

    @property
    def head(self) -> str:
        """Heading and unit, in two lines."""
        return f"{self.heading}\n[{self.unit}]" if self.unit else self.heading

    @property
    def is_number(self) -> bool:
        """True if its cells are right-aligned."""
        return isinstance(self.form, str) and bool(self.form)

    @property
    def rounded(self) -> "Column":
        """The column on pages, where errors have one decimal; tables of commands have two."""
        is_error = self.unit in ("µm", "µrad") and self.form in (".2f", "+.2f")
        return replace(self, form=str(self.form).replace("2", "1")) if is_error else self

    def spell(self, value: Any) -> str:
        if value is None:
            return ""
        if callable(self.form):
            return self.form(value)
        if self.form:
            return f"{value:{self.form}}"
        return value if isinstance(value, str) else str(value)


def number_columns(
    heads: Iterable[str], form: str = ".2f", unit: str = "", keys: Sequence[str] = ()
) -> tuple[Column, ...]:
    """Return columns of numbers with a common unit that stay side by side."""
    heads = tuple(heads)
    return tuple(
        Column(head, form, unit, key, joins=index > 0)
        for index, (head, key) in enumerate(zip(heads, keys or [""] * len(heads), strict=True))
    )


@dataclass(frozen=True, slots=True)
class Table:
    """A table; one whose columns have keys can be written as CSV."""

    columns: tuple[Column, ...]
    rows: Sequence[Sequence[Any]]  # raw values, one a column
    title: str = ""
    empty: str = ""  # what stands there instead where there is no row
    marks: Sequence[Mark] = ()  # of rows, on a page
    csv_order: tuple[str, ...] = ()  # keys, where a file has them in another order
    file_rows: Sequence[Sequence[Any]] = ()  # of a file, where text shows fewer
    exact: bool = False  # numbers of a file with all their digits; otherwise nine

    @property
    def visible_columns(self) -> tuple[Column, ...]:
        """The columns of text and pages."""
        return tuple(column for column in self.columns if column.shows)

    def cells(self, *, rounded: bool = True) -> list[list[str]]:
        columns = [column.rounded if rounded else column for column in self.columns]
        return [
            [c.spell(v) for c, v in zip(columns, row, strict=True) if c.shows] for row in self.rows
        ]

    def csv_rows(self) -> list[list[Any]]:
        place = {column.key: i for i, column in enumerate(self.columns) if column.key}
        order = [place[key] for key in self.csv_order] if self.csv_order else [*place.values()]
        head = [self.columns[i].key for i in order]
        rows = self.file_rows or self.rows
        return [head, *([_plain(row[i], exact=self.exact) for i in order] for row in rows)]


def _plain(value: Any, *, exact: bool) -> Any:
    if isinstance(value, bool):
        return int(value)
    if isinstance(value, float) and not exact:
        return float(f"{value:.9g}")
    return "" if value is None else value


@dataclass(frozen=True, slots=True)
class Series:
    """Bars of one kind, one a row; None where a row has none."""

    values: Sequence[float | None]
    role: Role = "plain"  # its colour; "key" stands out, "set" is of another kind
    spread: Sequence[float] = ()  # half lengths of intervals
    as_mark: bool = False  # a stroke instead of a bar
    form: str = ""  # of the number beside each bar; empty for none


@dataclass(frozen=True, slots=True)
class Panel:
    """One column of bars; panels of a chart share their rows."""

    title: str
    series: tuple[Series, ...]
    unit: str = ""
    before: float | None = None  # a line across all rows
    signed: bool = False
    width: float = 1.0  # beside the others


@dataclass(frozen=True, slots=True)
class Bars:
    """A chart of horizontal bars."""

    title: str
    subtitle: str
    rows: Sequence[str]
    panels: tuple[Panel, ...]
    keys: Sequence[bool] = ()  # rows whose plain bars stand out
    legend: tuple[tuple[str, Role | Literal["before"]], ...] = ()


@dataclass(frozen=True, slots=True)
class Curve:
    """One curve of a chart."""

    name: str  # in the legend; a curve without one is not in it
    x: "Array"  # [n]; in polar charts the angle in degrees
    y: "Array"  # [n]
    colour: int = 0  # which colour of series; the same thing has the same, whoever measured it
    style: Style = "line"  # for the model; "dots" for data, "dashed" for fits, "thin" for nominal


@dataclass(frozen=True, slots=True)
class Band:
    """Area between two curves: scatter."""

    name: str
    x: "Array"  # [n]
    low: "Array"
    high: "Array"
    colour: int = 0


@dataclass(frozen=True, slots=True)
class Lines:
    """A chart of curves: "lines" over an abscissa, "polar" around the angle, "plane" to scale."""

    kind: Kind
    title: str
    x_label: str  # with unit
    y_label: str
    curves: tuple[Curve, ...]
    bands: tuple[Band, ...] = ()
    note: str = ""  # what a reader has to know: a factor, a reference
    log: bool = False  # whether both scales are logarithmic


@dataclass(frozen=True, slots=True)
class Histogram:
    """A distribution with marks and a limit."""

    title: str
    subtitle: str
    x_label: str  # with unit
    y_label: str
    edges: "Array"  # [n + 1]
    heights: "Array"  # [n]
    marks: tuple[tuple[str, float], ...] = ()  # word and place
    limit: float | None = None
    captions: tuple[str, ...] = ()  # in words, in the chart: the first of them large


Block: TypeAlias = str | Table | Bars | Lines | Histogram
"""A sentence (the blanks it begins with indent it in text), a table or a chart."""


MOST_ROWS = 200  # rows of a table that a page shows; it counts the others


def blocks_html(blocks: Iterable[Block]) -> str:
    return "\n".join(_block_html(block) for block in blocks)


def _block_html(block: Block) -> str:
    if isinstance(block, Table):
        return table_html(block)
    if isinstance(block, Bars):
        return _bars_html(block)
    if isinstance(block, str):
        return f"<p>{escape(block.strip())}</p>"
    return ""  # curves are drawn by whoever has a canvas


def table_html(table: Table) -> str:
    """Render a table; user input is escaped."""
    title = f"<p>{escape(table.title.strip())}</p>" if table.title else ""
    if not table.rows:
        return title + (f"<p>{escape(table.empty.strip())}</p>" if table.empty else "")
    head = "".join(_head(column) for column in table.visible_columns)
    marks = [*table.marks, *[""] * len(table.rows)]
    body = "".join(
        (f'<tr class="{mark}">' if mark else "<tr>")
        + "".join(
            _cell(column, text) for column, text in zip(table.visible_columns, row, strict=True)
        )
        + "</tr>"
        for row, mark in zip(table.cells()[:MOST_ROWS], marks, strict=False)
    )
    n_hidden = len(table.rows) - MOST_ROWS
    footer = f"<p>… and {n_hidden:,} more rows</p>" if n_hidden > 0 else ""
    return f"{title}<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{footer}"


def table_markdown(table: Table) -> str:
    """Render a table in Markdown; user input is escaped."""
    heads = [column.head for column in table.visible_columns]
    rule = ["---:" if column.is_number else "---" for column in table.visible_columns]
    rows = [rule, *([*map(_escaped, row)] for row in table.cells())]
    lines = [f"| {' | '.join(row)} |" for row in (heads, *rows)] if table.rows else [table.empty]
    return "\n".join((f"# {_escaped(table.title)}", "", *lines, ""))


def _escaped(text: str) -> str:
    return re.sub(r"([\\`*_{}\[\]<>#|~&!$])", r"\\\1", " ".join(text.split()))


def _bars_html(bars: Bars) -> str:
    head = "".join(f"<th>{escape(panel.title)}{_unit(panel.unit)}</th>" for panel in bars.panels)
    rows = "".join(
        f"<tr><th>{escape(label)}</th>" + "".join(_bar(panel, row) for panel in bars.panels)
        for row, label in enumerate(bars.rows)
    )
    return (
        f'<table class="bars"><caption>{escape(bars.title)} · {escape(bars.subtitle)}</caption>'
        f"<thead><tr><td></td>{head}</tr></thead><tbody>{rows}</tbody></table>"
    )


def _bar(panel: Panel, row: int) -> str:
    numbers = [
        (series.values[row], Column("", series.form or ".2f", panel.unit).rounded.form)
        for series in panel.series
    ]
    everything = [abs(v) for series in panel.series for v in series.values if v is not None]
    longest = max((*everything, panel.before or 0.0)) or 1.0
    parts = "".join(
        f'<div class="bar" style="width:{100.0 * abs(value) / longest:.1f}%">{value:{form}}</div>'
        for value, form in numbers
        if value is not None
    )
    return f"<td>{parts}</td>"


def _head(column: Column) -> str:
    if not column.heading:
        return "<td></td>"
    kind = ' class="number"' if column.is_number else ""
    return f"<th{kind}>{escape(column.heading)}{_unit(column.unit)}</th>"


def _cell(column: Column, text: str) -> str:
    kind = ' class="number"' if column.is_number else ""
    return f"<td{kind}>{escape(text)}</td>"


def _unit(unit: str) -> str:
    return f" <small>{escape(unit)}</small>" if unit else ""
