"""Every row of the comparison with the thesis, and the page that is generated from it."""

from pathlib import Path

import pytest

import warpspace
from warpspace.thesis_example.rows import markdown_page

# What the print and the model cannot agree on; each has a sentence why.
DISAGREE = {
    ("table 4-1, p. 47", "O_zC"),
    ("table 4-8, section 4.3", "tool loop, proposed tolerance: volumetric error"),
    ("table 4-8, section 4.3", "workpiece loop, general tolerance: volumetric error"),
    ("table 4-8, section 4.3", "workpiece loop, proposed tolerance: volumetric error"),
    ("table 5-5, p. 74", "first machine EA0Z"),
    ("table 5-5, p. 74", "first machine EA0Z mark"),
    ("table 5-5, p. 74", "first machine EB0Z"),
    ("table 5-5, p. 74", "first machine EB0Z mark"),
    ("table 5-5, p. 74", "second machine EA0Z"),
    ("table 5-5, p. 74", "second machine EB0Z"),
}
PAGE = Path(__file__).parents[2] / "docs" / "thesis_rows.md"


@pytest.fixture(scope="module")
def rows():
    return warpspace.thesis()


def is_right(row):
    """Whether a row agrees, or not, as it has to, and says why if not."""
    expected = (row.source, row.key) not in DISAGREE
    if isinstance(row.printed, str):
        near = row.printed == row.computed
    else:
        near = abs(row.printed - row.computed) <= 0.5 * 10.0**-row.digits + 1e-9
    return row.agrees is near is expected and (expected or len(row.note) > 40)


def test_every_row(rows):
    assert [row for row in rows if not is_right(row)] == []
    assert {(row.source, row.key) for row in rows if not row.agrees} == DISAGREE


def test_all_tables_are_there_and_no_row_is_twice(rows):
    tables = {f"table 4-{n}" for n in range(1, 9)} | {f"table 5-{n}" for n in range(3, 6)}
    assert {row.source.split(",")[0] for row in rows} == tables | {"figure 4-3"}
    assert len({(row.source, row.key) for row in rows}) == len(rows)


def test_generated_page_is_up_to_date(rows):
    expected = markdown_page(rows)
    assert PAGE.read_text("utf-8") == expected, (
        "run: warpspace thesis --markdown docs/thesis_rows.md --force"
    )
