"""Sentences, tables and bars of a result as escaped HTML: for pages, reports and notebooks."""

from collections.abc import Iterable
from html import escape

from warpspace.analysis.blocks import Bars, Block, Column, Panel, Table

MOST_ROWS = 200
"""Rows of a table that a page shows; it counts the others."""


def blocks_html(blocks: Iterable[Block]) -> str:
    """Give everything a result says."""
    return "\n".join(block_html(block) for block in blocks)


def block_html(block: Block) -> str:
    """Give one sentence, table or chart."""
    if isinstance(block, Table):
        return table_html(block)
    if isinstance(block, Bars):
        return bars_html(block)
    if isinstance(block, str):
        return f"<p>{escape(block.strip())}</p>"
    return ""  # curves are drawn by whoever has a canvas


def table_html(table: Table) -> str:
    """Give a table; what a user wrote in it is text."""
    title = f"<p>{escape(table.title.strip())}</p>" if table.title else ""
    if not table.rows:
        return title + (f"<p>{escape(table.empty.strip())}</p>" if table.empty else "")
    head = "".join(_head(column) for column in table.shown)
    marks = [*table.marks, *[""] * len(table.rows)]
    body = "".join(
        f"<tr{_class(mark)}>"
        + "".join(_cell(column, text) for column, text in zip(table.shown, row, strict=True))
        + "</tr>"
        for row, mark in zip(table.cells()[:MOST_ROWS], marks, strict=False)
    )
    left = len(table.rows) - MOST_ROWS
    more = f"<p>… and {left:,} more rows</p>" if left > 0 else ""
    return f"{title}<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"


def bars_html(bars: Bars) -> str:
    """Give bars as a table whose cells are filled; nothing has to be drawn."""
    head = "".join(f"<th>{escape(panel.title)}{_unit(panel.unit)}</th>" for panel in bars.panels)
    rows = "".join(
        f"<tr><th>{escape(words)}</th>" + "".join(_bar(panel, row) for panel in bars.panels)
        for row, words in enumerate(bars.rows)
    )
    return (
        f'<table class="bars"><caption>{escape(bars.title)} · {escape(bars.subtitle)}</caption>'
        f"<thead><tr><th></th>{head}</tr></thead><tbody>{rows}</tbody></table>"
    )


def _bar(panel: Panel, row: int) -> str:
    numbers = [one.values[row] for one in panel.series]
    everything = [abs(v) for one in panel.series for v in one.values if v is not None]
    longest = max((*everything, panel.before or 0.0)) or 1.0
    parts = "".join(
        f'<div class="bar" style="width:{100.0 * abs(value) / longest:.1f}%">{value:.2f}</div>'
        for value in numbers
        if value is not None
    )
    return f"<td>{parts}</td>"


def _head(column: Column) -> str:
    kind = ' class="number"' if column.is_number else ""
    return f"<th{kind}>{escape(column.heading)}{_unit(column.unit)}</th>"


def _cell(column: Column, text: str) -> str:
    kind = ' class="number"' if column.is_number else ""
    return f"<td{kind}>{escape(text)}</td>"


def _unit(unit: str) -> str:
    return f" <small>{escape(unit)}</small>" if unit else ""


def _class(mark: str) -> str:
    return f' class="{mark}"' if mark else ""
