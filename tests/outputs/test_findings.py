"""Review notes in the report: tables, open questions, and the story as one figure a step."""

import re
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from offline import EVIL
from warpspace import evaluate, load_scene
from warpspace.analysis.blocks import Table
from warpspace.analysis.reviewing import note_numbers
from warpspace.app.documents.scene_file import view_of
from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.state.app_state import start_state
from warpspace.app.state.tree import put
from warpspace.outputs.report import ReportSettings, build_report, findings
from warpspace.outputs.report.render import Picture, render_html, render_pdf
from warpspace.outputs.report.review import build_review, first_page
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


def tables_of(scene):
    return [block for block in findings.tables(scene) if isinstance(block, Table)]


def test_tables_say_what_was_decided_answered_and_no_longer_holds():
    (numbers,) = note_numbers(SCENE, [note()])
    old = note("Measured last year.", numbers={**numbers, "max_um": numbers["max_um"] + 1.0})
    decision = note(
        "One shim.", kind="decision", numbers=numbers, before={"max_um": 60.0},
        change={"EA0Z": (33.9, 20.2)}, replies=(Reply("Done.", "B", WHEN),),
    )  # fmt: skip
    notes, decided, replies = tables_of(noted(old, decision))
    assert list(notes.marks) == ["worse", ""]
    assert "changed: 52.7 → 51.7 µm" in notes.rows[0][4]
    assert decided.rows == [
        ("2", "One shim.", "EA0Z 33.9 → 20.2 µrad", "max 60.00 → 51.72"),
    ]
    assert replies.rows == [("2", "Done.", "B 2026-11-22")]


def test_open_questions_stand_on_the_first_page():
    scene = noted(note("Why?", kind="question"), note("Old?", kind="question", status="done"))
    said = str(first_page(build_review([scene], replace(FAST, questions=("When?",))), "map")[-1])
    assert said == "Items(items=('When?', 'Why? (note 1, A. Engineer)'))"


def test_a_step_shows_errors_component_loop_and_view_as_they_were():
    state = put(put(put(put(START, "amplitudes.EA0Z", "5"), "component", "z"), "loop", "relative"),
                "exclusions.excluded", "EAY")  # fmt: skip
    changed = replace(SCENE, errors=SCENE.errors.with_amplitude("EXX", 9.0, (0.0, 1.0)))
    shown = findings.shown_by(changed, note(view=view_of(state, ABOVE)))
    assert (shown.component, shown.loop, shown.view) == ("z", "relative", "top")
    assert shown.remarks == ("Excluded: EAY.",)
    then = evaluate(state.active_scene(), grid=3).error_um
    assert evaluate(shown.scene, grid=3).error_um == pytest.approx(then, abs=1e-9)


def test_a_packed_scene_is_restored_and_what_cannot_be_read_is_said():
    other = load_scene("dvf5000_second")
    state = replace(start_state(other), loaded=SCENE)
    shown = findings.shown_by(SCENE, note(view=view_of(state, None)))
    expected = evaluate(other, grid=3).error_um
    assert evaluate(shown.scene, grid=3).error_um == pytest.approx(expected, abs=1e-9)
    for view in ("file=AAAA", "EXX=nan", "EXX=1e99", "B=much", "EXX=" + "9" * 400):
        assert findings.shown_by(SCENE, note(view=view)).remarks == (findings.AS_NOW,)


@pytest.mark.render
def test_findings_are_in_page_and_paper_escaped(renderer):
    hostile = f"{EVIL}#*_$[] =1+1 @x \\ <!-- ]]>"
    story = [note(hostile, step=2), note("First.", step=1, view=view_of(START, ABOVE))]
    scene = noted(*story, note(hostile, kind="question", replies=(Reply(hostile, hostile, WHEN),)))
    report = build_report([scene], FAST)
    assert [part.heading for part in report.sections[:2]] == ["", findings.HEADING]
    assert report.sections[2].heading.startswith("Appendix A")
    drawn = [block for block in report.sections[1].blocks if isinstance(block, Picture)]
    assert [one.caption.partition(":")[0] for one in drawn] == ["Step 1 of 2", "Step 2 of 2"]
    assert "view from above" in drawn[0].caption
    page = re.sub(r'(src|srcdoc)="[^"]*"', "", render_html(report))
    assert "<img src=x" not in page
    assert "<script>window" not in page
    paper = build_report([scene], FAST, form="pdf")
    assert render_pdf(paper).startswith(b"%PDF")
