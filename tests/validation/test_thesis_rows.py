"""Every row of the comparison with the thesis, and the page that is generated from it."""

from pathlib import Path

import pytest

import warpspace
from warpspace.analysis.thesis import Hypothesis, thesis_hypotheses
from warpspace.outputs.thesis_page import thesis_markdown
from warpspace.scene.verbs import thesis_case

ROWS = warpspace.thesis()
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
PAGE = Path(__file__).parents[2] / "docs" / "thesis.md"


@pytest.mark.parametrize("row", [pytest.param(r, id=f"{r.source} {r.key}") for r in ROWS])
def test_row(row) -> None:
    expected = (row.source, row.key) not in DISAGREE
    assert row.agrees is expected
    if isinstance(row.printed, str):
        assert (row.printed == row.computed) is expected
    else:
        half = 0.5 * 10.0**-row.digits + 1e-9
        assert (abs(row.printed - row.computed) <= half) is expected
    assert expected or len(row.note) > 40


def test_exactly_these_rows_disagree() -> None:
    assert {(row.source, row.key) for row in ROWS if not row.agrees} == DISAGREE


def test_all_tables_are_there_and_no_row_is_twice() -> None:
    tables = {row.source.split(",")[0] for row in ROWS}
    assert tables == {
        *(f"table 4-{n}" for n in range(1, 9)),
        *(f"table 5-{n}" for n in range(3, 6)),
        "figure 4-3",
    }
    assert len({(row.source, row.key) for row in ROWS}) == len(ROWS)


@pytest.mark.parametrize(
    ("machine", "marks"), [("first", "XXXXXXO"), ("second", "OOXOOOO")], ids=["first", "second"]
)
def test_table_5_5_page_74_marks_with_the_values_of_tables_5_3_and_5_4(machine, marks) -> None:
    scene = warpspace.load_scene(f"dvf5000_{machine}")
    proposed = warpspace.load_scene("dvf5000_proposed").tolerances
    found = {c.key: c.mark for c in warpspace.measured(scene, tolerances=proposed).checks}
    order = ["EAX", "EAY", "ECY", "EAZ", "EC0Y", "EA0Z", "EB0Z"]
    assert "".join(found[key] for key in order) == marks


@pytest.fixture(scope="module")
def tried() -> tuple[Hypothesis, ...]:
    return thesis_hypotheses(thesis_case())


def test_generated_page_is_up_to_date(tried) -> None:
    expected = thesis_markdown(ROWS, tried)
    assert PAGE.read_text("utf-8") == expected, (
        "run: warpspace thesis --markdown docs/thesis.md --force"
    )


def test_hypotheses_reach_a_verdict_on_every_question(tried) -> None:
    for question in {each.question for each in tried}:
        assert any(each.used for each in tried if each.question == question)
    results = {each.reading: each.result for each in tried}
    assert results["after motion"].startswith("40 of 40")
    assert int(results["before motion"].split()[0]) < 40
    assert results["ramps over the travel, 11³ nodes"] == "31.66 and 14.58"
