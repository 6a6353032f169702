"""The table in docs/reliability.md: only rows that were run change."""

import re
from pathlib import Path

from reliability.row import Outcome, Row

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reliability.md"
BEGIN, END = "<!-- rows -->", "<!-- end of rows -->"
HEAD = ("| row | what must hold | count | date | result |", "|---|---|--:|---|---|")


def read_table(text: str) -> dict[str, str]:
    """Give the lines of the table by their row."""
    body = text.partition(BEGIN)[2].partition(END)[0]
    found = re.findall(r"^(\| `([a-z]+)` .*)$", body, re.MULTILINE)
    return {name: line for line, name in found}


def spell_row(row: Row, outcome: Outcome, date: str) -> str:
    """Spell a line of the table; the count is what was run, and how much of the full one."""
    held = f"held: {outcome.result}" if not outcome.faults else f"**fails**: {outcome.faults[0]}"
    clean = re.sub(r"\s+", " ", held).replace("|", "\\|")[:600]
    count = f"{outcome.count:,} {row.unit}"
    if outcome.count < row.full:
        count += f" (of {row.full:,})"
    return f"| `{row.name}` | {row.what} | {count} | {date} | {clean} |"


def put_rows(text: str, lines: dict[str, str], order: tuple[str, ...]) -> str:
    """Put lines in place of those of the same rows."""
    merged = {**read_table(text), **lines}
    body = "\n".join([*HEAD, *(merged[name] for name in order if name in merged)])
    before, _, rest = text.partition(BEGIN)
    return f"{before}{BEGIN}\n{body}\n{END}{rest.partition(END)[2]}"
