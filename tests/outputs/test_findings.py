"""Review notes in the report: tables, open questions, and the story as one figure a step."""

import re
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from offline import EVIL
from warpspace import evaluate, load_scene
from warpspace.analysis.note_tables import note_numbers, notes_table
from warpspace.app.documents.scene_file import view_of
from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.evaluation.compare import scene_side
from warpspace.app.state.app_state import Comparison, start_state
from warpspace.app.state.tree import put
from warpspace.cli.services import build_story
from warpspace.outputs.report import ReportSettings, build_report
from warpspace.outputs.report.review import build_review, first_page
from warpspace.outputs.report.templating import ReportFigure, render_html, render_pdf
from warpspace.scene.notes import Note, Reply

FAST = ReportSettings(grid=5, samples=2000)
SCENE = load_scene("dvf5000_first")
START = start_state(SCENE)
WHEN = datetime(2026, 11, 22, tzinfo=UTC)
ABOVE = CameraMemory((0.1, 0.0, 9.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.4)


def noted(*notes):
    return replace(SCENE, review=notes)


def note(text="Bent.", **entries):
    return Note(text=text, author="A. Engineer", date=WHEN, **entries)


def test_the_table_says_what_was_decided_answered_and_no_longer_holds():
    (numbers,) = note_numbers(SCENE, [note()])
    old = note("Measured\nlast year.", numbers={**numbers, "max_um": numbers["max_um"] + 1.0})
    decision = note(
        "One shim.", kind="decision", numbers=numbers, before={"max_um": 60.0},
        change={"EA0Z": (33.9, 20.2)}, replies=(Reply("Done.", "B", WHEN),), versions=(old,),
    )  # fmt: skip
    table = notes_table(noted(old, decision))
    said = ["1 note, open", "2 decision, open", "2 reply", "2 note, open"]
    assert [" ".join(row[:2]) for row in table.cells()] == said
    assert table.marks == ["worse", "", "", "worse"]
    assert table.cells()[0][2:] == [
        "Measured last year.", "A. Engineer 2026-11-22", "the whole",
        "mean 30.89, max 52.72 µm; changed: 52.7 → 51.7 µm",
    ]  # fmt: skip
    assert table.cells()[1][-1] == "EA0Z 33.9 → 20.2 µrad; mean 30.89, max 60.00 → 51.72 µm"
    assert table.cells()[2][2:] == ["Done.", "B 2026-11-22", "", ""]
    assert len(table.csv_rows()[0]) == 9


def test_open_questions_stand_on_the_first_page():
    scene = noted(note("Why?", kind="question"), note("Old?", kind="question", status="done"))
    said = str(first_page(build_review([scene], replace(FAST, questions=("When?",))), "map")[-1])
    assert said == "Items(items=('When?', 'Why? (note 1, A. Engineer)'))"


def test_a_step_shows_errors_component_loop_and_view_as_they_were():
    state = put(put(put(put(START, "amplitudes.EA0Z", "5"), "component", "z"), "loop", "relative"),
                "exclusions.excluded", "EAY")  # fmt: skip
    changed = replace(SCENE, errors=SCENE.errors.with_amplitude("EXX", 9.0, (0.0, 1.0)))
    story = [note(view=view_of(state, ABOVE), step=1), note(view=view_of(START, ABOVE), step=2)]
    (said, name, (scene,), settings), (_, _, (other,), _) = build_story(
        replace(changed, review=story), 5
    )
    assert (name, settings.component, settings.loop, settings.view) == (
        "error-map", "z", "relative", "top"
    )  # fmt: skip
    assert settings.conditions == ("excluded: EAY",)
    for word in ("E_z", "relative loop", "view from above", "excluded: EAY"):
        assert word in said
    then = evaluate(state.active_scene(), grid=3).error_um
    assert evaluate(scene, grid=3).error_um == pytest.approx(then, abs=1e-9)
    own = evaluate(SCENE, grid=3).error_um
    assert evaluate(other, grid=3).error_um == pytest.approx(own, abs=1e-9)


def test_a_packed_scene_and_a_comparison_are_restored_and_what_cannot_be_read_is_said():
    second = load_scene("dvf5000_second")
    compared = replace(START, comparison=Comparison(b=scene_side(second)))
    views = [view_of(replace(start_state(second), loaded=SCENE), None), view_of(compared, None),
             "file=AAAA", "EXX=nan", "EXX=1e99", "B=much", "scene=gone"]  # fmt: skip
    story = [note(view=view, step=1 + number) for number, view in enumerate(views)]
    (_, _, (packed,), own), both, *unread = build_story(noted(*story), 5)
    expected = evaluate(second, grid=3).error_um
    assert evaluate(packed, grid=3).error_um == pytest.approx(expected, abs=1e-9)
    assert both[1] == "comparison"
    assert len(both[2]) == 2
    assert {one.range_top for _, name, _, one in unread if name == "error-map"} == {own.range_top}
    assert "the scene as it is now" in unread[0][0]
    for said, *_ in unread[1:]:
        assert "ignored settings" in said or "clamped to 100000" in said


@pytest.mark.render
def test_findings_are_in_page_and_paper_escaped(renderer):
    hostile = f"{EVIL}#*_$[] =1+1 @x \\ <!-- ]]>"
    story = [note(hostile, step=2), note("First.", step=1, view=view_of(START, ABOVE))]
    scene = noted(*story, note(hostile, kind="question", replies=(Reply(hostile, hostile, WHEN),)))
    shares: list[float] = []
    report = build_report([scene], FAST, story_steps=build_story, watch=shares.append)
    assert shares == sorted(shares)
    assert len(shares) > 2 * len(story)
    assert [part.heading for part in report.sections[:2]] == ["", "Findings and decisions"]
    assert report.sections[2].heading.startswith("Appendix A")
    drawn = [block for block in report.sections[1].blocks if isinstance(block, ReportFigure)]
    assert [one.caption.partition(":")[0] for one in drawn] == ["Step 1 of 2", "Step 2 of 2"]
    assert "view from above" in drawn[0].caption
    page = re.sub(r'(src|srcdoc)="[^"]*"', "", render_html(report))
    assert "<img src=x" not in page
    assert "<script>window" not in page
    assert render_pdf(report).startswith(b"%PDF")
