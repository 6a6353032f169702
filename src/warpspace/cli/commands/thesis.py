"""Command `thesis`: every printed number beside ours."""

from typing import TYPE_CHECKING

import click

from warpspace.cli.file_options import check_output, force_option
from warpspace.cli.options import json_option, print_json
from warpspace.cli.progress import progress
from warpspace.cli.tables import Column, print_table, print_text

if TYPE_CHECKING:
    from warpspace.analysis.thesis import Hypothesis, Row


@click.command()
@click.option("--markdown", type=click.Path(), help="Write the comparison to this .md file.")
@force_option
@json_option
def thesis(markdown: str | None, *, force: bool, as_json: bool) -> None:
    """Recompute every number that the thesis prints.

    That is its tables 4-1 to 4-8 and 5-3 to 5-5; each number comes with its unit.
    A number agrees where it lies within half of the last printed digit. Rows that do not agree say
    why; what was tried is listed below them. Nothing is tuned to agree.
    """
    from warpspace.analysis.thesis import thesis_hypotheses
    from warpspace.outputs.files import write_atomically
    from warpspace.outputs.thesis_page import thesis_markdown
    from warpspace.scene import verbs

    if markdown is not None:
        check_output(markdown, (".md",), force=force)
    needed = markdown is not None or not as_json
    with progress("computing", silent=as_json):
        rows = verbs.thesis()
        tried = thesis_hypotheses(verbs.thesis_case()) if needed else ()
    if markdown is not None:
        with write_atomically(markdown, overwrite=force) as temporary:
            temporary.write_text(thesis_markdown(rows, tried), encoding="utf-8")
    if as_json:
        print_json({"rows": [_json_row(row) for row in rows]})
        return
    _print(rows)
    _print_tried(tried)


def _print_tried(tried: "tuple[Hypothesis, ...]") -> None:
    """Print the readings that were tried, grouped by question."""
    click.echo()
    print_text("What was tried where the thesis is open (> is what the model uses):")
    question = ""
    for each in tried:
        if each.question != question:
            question = each.question
            print_text(f"  {question}")
        print_text(f"    {'>' if each.used else ' '} {each.reading}: {each.result}")


def _json_row(row: "Row") -> dict[str, object]:
    """Spell a row as the JSON output has it; a note only where there is one."""
    found: dict[str, object] = {
        "source": row.source,
        "key": row.key,
        "printed": row.printed,
        "computed": row.computed,
        "agrees": row.agrees,
    }
    return {**found, "note": row.note} if row.note else found


def _print(rows: "tuple[Row, ...]") -> None:
    """Print a table of each source, then the rows that do not agree with their reasons."""
    from warpspace.outputs.thesis_page import spell

    columns = (
        Column(leads=True),
        Column("quantity", wraps=True, leads=True),
        Column("printed", is_number=True, wraps=True),
        Column("ours", is_number=True, wraps=True, joins=True),
        Column("unit"),
    )
    for source in dict.fromkeys(row.source for row in rows):
        here = [row for row in rows if row.source == source]
        print_text(f"{source}: {sum(row.agrees for row in here)} of {len(here)} agree")
        cells = [
            (
                *("" if row.agrees else "≠", row.key),
                *(spell(row, row.printed), spell(row, row.computed, more=1), row.unit),
            )
            for row in here
        ]
        print_table(columns, cells)
        click.echo()
    different = [row for row in rows if not row.agrees]
    print_text(f"{len(rows) - len(different)} of {len(rows)} agree. The others:")
    for row in different:
        printed, computed = spell(row, row.printed), spell(row, row.computed, more=1)
        print_text(f"  {row.source}: {row.key}: printed {printed}, ours {computed} {row.unit}")
        print_text(f"      {row.note}")
