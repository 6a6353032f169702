"""Presentation of the comparison with the thesis: blocks, a JSON object, a page in Markdown."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from warpspace.analysis.blocks import Block, Column, Table
from warpspace.thesis_example.rows import Row

COLUMNS = (
    Column(leads=True),
    Column("quantity", wraps=True, leads=True),
    Column("printed", "s", wraps=True),
    Column("ours", "s", wraps=True, joins=True),
    Column("unit"),
)


def _by_source(rows: Sequence[Row]) -> dict[str, list[Row]]:
    return {source: list(group) for source, group in groupby(rows, lambda row: row.source)}


def thesis_blocks(rows: Sequence[Row]) -> Iterator[Block]:
    for source, group in _by_source(rows).items():
        cells = [
            (
                "" if row.agrees else "≠",
                row.key,
                format_number(row, row.printed),
                format_number(row, row.computed, extra_digits=1),
                row.unit,
            )
            for row in group
        ]
        agreeing = sum(row.agrees for row in group)
        yield Table(COLUMNS, cells, f"{source}: {agreeing} of {len(group)} agree")
        yield ""
    different = [row for row in rows if not row.agrees]
    yield f"{len(rows) - len(different)} of {len(rows)} agree. The others:"
    for row in different:
        printed = format_number(row, row.printed)
        computed = format_number(row, row.computed, extra_digits=1)
        yield f"  {row.source}: {row.key}: printed {printed}, ours {computed} {row.unit}"
        yield f"      {row.note}"


def thesis_json(rows: Sequence[Row]) -> dict[str, Any]:
    keys = ("source", "key", "printed", "computed", "agrees")
    return {
        "rows": [
            {key: getattr(row, key) for key in ((*keys, "note") if row.note else keys)}
            for row in rows
        ]
    }


def markdown_page(rows: Sequence[Row]) -> str:
    from jinja2 import StrictUndefined, Template  # other commands start without it

    text = Path(__file__).with_name("thesis.md.j2").read_text("utf-8")
    page = Template(text, undefined=StrictUndefined, keep_trailing_newline=True)
    return page.render(rows=rows, groups=_by_source(rows), format_number=format_number)


def format_number(row: Row, value: float | str, extra_digits: int = 0) -> str:
    """Format a number of a row with the printed digits, or more."""
    if isinstance(value, str):
        return value
    if value == int(value) and row.digits == 0:
        return f"{value:.0f}"
    return f"{value:.{row.digits + extra_digits}f}"
