"""The design review: what it says, that it needs nothing else, and that it prints."""

import re
import shutil
import subprocess
from dataclasses import astuple, replace
from functools import partial
from importlib.resources import files
from typing import get_args

import numpy as np
import pytest

from golden.running import run_refused
from offline import EVIL, opened_offline, wait_for_the_map
from warpspace import evaluate, load_scene
from warpspace.analysis.blocks import Column, number_columns
from warpspace.analysis.commands.concepts import Concepts, compare_concepts
from warpspace.analysis.statistics import share_below
from warpspace.exceptions import NoRendererError, RenderError
from warpspace.outputs.report import ReportSettings, build_report, sections, write_report
from warpspace.outputs.report.review import build_review, first_page
from warpspace.outputs.report.templating import (
    Block,
    Embedded,
    Items,
    Table,
    Text,
    render_html,
    render_pdf,
)
from warpspace.scene.library import parse_scene

FAST = ReportSettings(grid=5, samples=2000, spec_um=50.0)
TITLE = f"{EVIL}#*_$[]"


def plain(text):
    return text.replace("\N{NO-BREAK SPACE}", " ")


def page_one(*scenes, **changes):
    review = build_review(scenes, replace(FAST, **changes))
    blocks = first_page(review, Text("the map", "body"))
    words = [str(astuple(block)) for block in blocks]
    return plain(" | ".join(words)).replace("\\xa0", " "), [
        one.share_within for one in review.scenes
    ]


def test_verdict_on_a_limit_that_is_exceeded():
    scene = load_scene("dvf5000_first")
    text, (within,) = page_one(scene, grid=11, spec_um=40.0, author="me", questions=("Why?",))
    assert "Fail: 90.6 % of the working volume of 550 × 450 × 400 mm is within the limit" in text
    assert "the largest error is 51.7 µm at X 275 Y −225 Z −480." in text
    assert within == share_below(evaluate(scene, grid=11), 40.0)
    for number in ("30.9 µm", "41.3 µm", "'within the limit', '90.6 %'"):
        assert number in text
    words = "Adjust front column bolts + 0.01 mm (10 µm), which changes EA0Z (squareness of Z to Y)"
    assert f"{words} from +33.9 to +21.7 µrad: the RMS" in text
    assert "from 51.7 to 49.5 µm; 92 % of the volume is within the limit" in text
    assert "Why?" in text


def test_the_limit_is_that_of_the_scene_unless_another_is_given():
    scene = replace(load_scene("dvf5000_first"), limit_um=60.0)
    text, shares = page_one(scene, spec_um=None)
    assert "within the limit of 60 µm." in text
    assert "No adjustment required: the error is within the limit." in text
    assert shares == [1.0]
    assert "is within the limit of 50 µm; the largest error is" in page_one(scene)[0]


@pytest.mark.parametrize(
    ("limit", "said"),
    [(4.0, "Fail: 0"), (4.9, "Undecided: the largest error"), (6.0, "Pass: the largest error")],
)
def test_a_verdict_is_given_where_it_holds_with_95_percent(limit, said):
    # the largest error is 5 µm, u 0.3: 4.9 is a third of u away, the others more than three
    text = 'machine = "dvf5000"\n[workspace]\nX = [-275, 275]\nY = [-225, 225]\nZ = [-480, -80]\n'
    text += "[errors]\nEXX = 5.0\n[uncertainty]\nEXX = 0.3\n"
    words, _ = page_one(parse_scene(text, "s"), spec_um=limit)
    assert said in words
    assert "'max', '5.0 ± 0.6 µm'" in words


def test_verdict_without_a_limit_and_on_a_perfect_machine():
    text, _ = page_one(load_scene("dvf5000_first"), spec_um=None)
    assert "No limit is set. The largest error in the working volume" in text
    assert "'RMS', '32" in text
    assert "from 51.7 to 49.5 µm." in text
    text, _ = page_one(load_scene("dvf5000_nominal"))
    assert "The error is zero" in text
    assert "No adjustment required" in text
    assert "nan" not in text


def test_verdicts_on_two_stand_in_one_table():
    text, shares = page_one(load_scene("dvf5000_first"), load_scene("dvf5000_second"), grid=11)
    assert "A: fail, limit 50 µm. B: pass, limit 50 µm." in text
    assert "mean error of B is 14.6 µm: 53 % less than A's 30.9 µm" in text
    assert "B: No adjustment required" in text
    assert shares[0] < shares[1] == 1.0


def test_rows_of_zeros_are_counted_and_errors_that_are_zero():
    columns = (Column("key"), *number_columns(("x", "y")))
    rows = [("a", 0.0, 0.001), ("b", 0.0, 0.2), ("c", None, None)]
    table, none = sections.report_blocks(
        [Table(columns, rows, "Of errors.", marks=("", "worse", "key")), Table(columns, rows[:1])]
    )
    assert [row[0] for row in table.rows] == ["b", "c"]
    assert table.marks == ["worse", "key"]
    assert none == Text("Rows of zeros omitted: 1.", "note")
    assert table.title == "Of errors. Rows of zeros omitted: 1."
    reviewed = build_review((load_scene("dvf5000_first"),), FAST).scenes[0]
    found = sections.parameters(reviewed)
    assert len(found.rows) == 7
    assert found.title.endswith("Errors equal to zero omitted: 34.")
    assert {
        row[0] for row, mark in zip(found.rows, found.marks, strict=True) if mark == "worse"
    } == {"EAY", "EAZ", "EA0Z"}


def test_difference_of_two_scenes_is_taken_as_vectors():
    scenes = load_scene("dvf5000_first"), load_scene("dvf5000_second")
    first, second = (evaluate(scene, grid=5).error_um for scene in scenes)
    largest = np.linalg.norm(second - first, axis=-1).max()
    assert build_review(scenes, FAST).difference.max_um == pytest.approx(largest)


@pytest.fixture(scope="module")
def both(renderer):
    hostile = replace(load_scene("dvf5000_first"), title=TITLE, name="<b>")
    other = [load_scene("machine_printer_3d")]
    return build_report(
        [hostile, load_scene("dvf5000_second")],
        replace(FAST, author=TITLE, questions=(TITLE,)),
        embed=lambda scene, **_: f"<p>{scene.machine.title}</p>",
        concepts=other,
    )


@pytest.mark.render
def test_every_part_is_there(both):
    headings = [section.heading for section in both.sections]
    assert headings[0] == ""
    assert [heading.split(" · ")[0] for heading in headings[1:]] == [
        f"Appendix {letter}" for letter in "ABCDEFGHIJ"
    ]
    first = both.sections[0].blocks
    assert isinstance(first[0], Text)
    assert isinstance(first[1], Table)
    assert Items((TITLE,)) in first
    assert f"by {TITLE}" in both.facts
    tables = [b for s in both.sections for b in s.blocks if isinstance(b, Table)]
    for table in tables:
        assert all(len(row) == len(table.columns) for row in table.rows)
        assert not table.marks or len(table.marks) == len(table.rows)
    assert sum(isinstance(b, Embedded) for b in both.sections[1].blocks) == 2
    names = {picture.name for picture in both.pictures}
    assert {"error-map", "chart", "concepts"} <= names


@pytest.mark.render
def test_concepts_have_the_numbers_of_the_command(both):
    heading = "Comparison of concepts"
    section = next(part for part in both.sections if part.heading.endswith(heading))
    table = next(block for block in section.blocks if isinstance(block, Table))
    scenes = [
        load_scene(name) for name in ("dvf5000_first", "dvf5000_second", "machine_printer_3d")
    ]
    expected = compare_concepts(scenes, Concepts(limit_um=50.0, samples=2000))
    for row, name, concept in zip(table.cells(), "ABC", expected, strict=True):
        assert (row[0], row[2]) == (name, str(concept.scene.machine.chain))
        assert float(row[3]) == pytest.approx(concept.sampled.mean_um, rel=5e-3)
        assert float(row[4]) == pytest.approx(concept.sampled.p95_um, rel=5e-3)
        assert row[6] == f"{100 * concept.sampled.probability.probability:.2f}"


@pytest.mark.parametrize("template", ["report.html.j2", "report.typ"])
def test_templates_draw_every_kind_of_block(template):
    folder = files("warpspace.outputs.report") / "templates"
    text = (folder / template).read_text("utf-8")
    printed = set(get_args(Block)) - ({Embedded} if template.endswith(".typ") else set())
    missing = [kind for kind in printed if f'kind == "{kind.__name__.lower()}"' not in text]
    assert missing == []


@pytest.mark.render
def test_page_points_nowhere_and_escapes(both):
    page = render_html(both)
    assert not re.search("<script>window|<img src=x", page)
    outer = re.sub(r'(src|srcdoc)="[^"]*"', "", page)
    assert not re.search(r"https?://|<link|@import|url\(", outer)


@pytest.mark.nightly
@pytest.mark.render
def test_pdf_repeats_and_says_everything(renderer, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    scene = replace(load_scene("dvf5000_first"), title=TITLE)
    first, second = (render_pdf(build_report([scene], FAST, form="pdf")) for _ in range(2))
    assert first == second
    assert first.startswith(b"%PDF-")
    if shutil.which("pdftotext") is None:
        return
    (tmp_path / "a.pdf").write_bytes(first)
    command = ["pdftotext", "-layout", str(tmp_path / "a.pdf"), "-"]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    pages = text.split("\f")[:-1]
    assert len(pages) >= 4
    for number, page in enumerate(pages, start=1):
        assert re.search(rf"\b{number}\s*/\s*{len(pages)}\b", page)
    assert "2023-11-14" in text
    assert "#*_$[]" in text, "markup of the typesetter in a title is text"
    flat = re.sub(r"\s+", " ", text)
    words = ["Error budget at the worst point", "Recommended adjustment", "exact chain", "SHA-256"]
    assert [part for part in (*words, 'machine = "dvf') if part not in flat] == []


@pytest.mark.render
@pytest.mark.nightly
@pytest.mark.parametrize("loop", ["workpiece", "relative"])
def test_other_loops_and_scenes_without_tolerances(loop, renderer, tmp_path):
    path = tmp_path / "bare.toml"
    path.write_text('title = "bare"\nmachine = "dvf5000"\n[errors]\nEXC = 4.0\n')
    report = build_report([load_scene(path)], replace(FAST, loop=loop), form="pdf")
    assert render_pdf(report).startswith(b"%PDF-")
    notes = [b.text for s in report.sections for b in s.blocks if isinstance(b, Text)]
    assert any("no tolerances" in note for note in notes)


def test_without_a_renderer_nothing_is_written(tmp_path, monkeypatch):
    def crash(*_):
        raise NoRendererError("VTK cannot draw off screen here. Install libegl1 libgl1-mesa-dri.")

    monkeypatch.setattr("warpspace.outputs.processes.FigureWorker.begin", crash)
    with pytest.raises(RenderError, match="libegl1"):
        write_report([load_scene("dvf5000_first")], tmp_path / "a.html", FAST)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("fails", [1, 2])
def test_a_figure_is_tried_twice_then_its_place_says_that_it_is_missing(
    fails, tmp_path, monkeypatch
):
    drawn: list[str] = []

    def draw(name):
        drawn.append(name)
        if name == "slices" and drawn.count(name) <= fails:
            raise RenderError("the renderer crashed")
        return b"<svg xmlns='http://www.w3.org/2000/svg'/>"

    monkeypatch.setattr(
        "warpspace.outputs.processes.FigureWorker.begin", lambda _, name, *__: partial(draw, name)
    )
    line = "report dvf5000_first --samples 500 --grid 3 -o a.html"
    status, _, said = run_refused(line, tmp_path)
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert drawn.count("slices") == 2
    assert status == (0 if fails == 1 else 2)
    assert ("is written without figures: slices (the renderer crashed)" in said) == (fails == 2)
    assert ("This figure is missing: slices" in page) == (fails == 2)


@pytest.mark.render
def test_page_opens_without_network_and_draws(browser, renderer, tmp_path):
    from warpspace.cli.services import embed_view

    path = tmp_path / "report.html"
    scene = replace(load_scene("dvf5000_first"), title=TITLE)
    write_report([scene], path, FAST, embed=embed_view)
    with opened_offline(browser, path) as page:
        page.locator("iframe").scroll_into_view_if_needed()
        canvas = page.frame_locator("iframe").frame_locator("iframe").locator("canvas").first
        wait_for_the_map(page, canvas, 5_000)
        pictures = page.evaluate("Array.from(document.images, image => image.naturalWidth)")
        assert pictures
        assert min(pictures) > 0
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
