"""Review notes in the app: pinned, shown again, answered, decided, taken back."""

from dataclasses import replace

import numpy as np
import pytest

from app.frames import new_visitor
from app.page_tab import SCENES, Tab
from app.parts import LIVE, Alone
from warpspace.analysis.note_tables import note_numbers
from warpspace.app.browser import actions as do
from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.drawing.labels import note_labels
from warpspace.app.evaluation.machine_bodies import drawn_bodies
from warpspace.app.evaluation.point_explanation import drawn_places, explain_point
from warpspace.app.panels.note_panels import NotesPanel
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import Picked, start_state
from warpspace.app.state.tree import put
from warpspace.kinematics.model import Loop
from warpspace.scene.library import load_scene
from warpspace.scene.notes import Note, NoteAnchor, changed_number, story

START = start_state(SCENES[0])
EVIL = "<img src=x onerror='window.taken=1'>"
CAMERA = CameraMemory((9.0, -12.0, 8.0), (0.5, 0.0, -2.5), (0.0, 0.0, 1.0), 0.4)


def alone(state=START):
    """A notes part on a page that is not there, and the cameras it was put to."""
    cameras: list[CameraMemory] = []
    found = Alone(NotesPanel, state, move_camera=cameras.append, last_decision=None)
    found.context.camera.remember = lambda: CAMERA
    return found, cameras


def pin(part, text="Look", kind="note"):
    part.do(do.Input.PIN_NOTE())
    part.store.apply(lambda state: put(put(state, "page.note_text", text), "page.note_kind", kind))
    return part.do(do.Input.SAVE_NOTE()).review[-1]


def test_a_note_is_shown_again_as_it_was_and_back_leads_to_where_one_was():
    part, cameras = alone()
    first = pin(part)
    part.store.apply(lambda state: state.with_amplitude("EA0Z", 0.0))
    second = pin(part)
    present = part.store.apply(lambda state: state.with_amplitude("EA0Z", 5.0)) or part.store.state
    assert part.do(do.Input.SHOW_NOTE(first.id)).amplitudes["EA0Z"] == START.amplitudes["EA0Z"]
    assert "Note 1, state of" in part.part.render(part.context.picture)["reopened"]
    assert part.do(do.Input.SHOW_NOTE(second.id)).amplitudes["EA0Z"] == 0.0
    part.do(do.ReplyToNote(second.id, "seen"))  # is not lost
    back = part.do(do.Signal.LEAVE_NOTE_VIEW)
    assert replace(back, review=present.review) == present
    assert back.review[1].replies[0].text == "seen"
    assert cameras == [CAMERA] * 3
    assert part.part.render(part.context.picture)["reopened"] == ""


def test_numbers_of_a_note_are_those_of_check_and_grow_stale():
    part, _ = alone()
    note = pin(part)
    scene = part.store.state.resulting_scene()
    assert note.numbers == note_numbers(scene, [note])[0]
    assert note.numbers["here_um"] == note.numbers["max_um"]  # nothing was asked: the worst point
    moved = part.store.state.with_amplitude("EA0Z", 0.0).resulting_scene()
    assert changed_number(note.numbers, note_numbers(moved, [note])[0])


def test_a_decision_holds_what_was_changed_and_is_taken_back_where_it_still_holds():
    part, _ = alone()
    part.context.last_decision = START, "Repair: EA0Z to 20"
    part.store.apply(lambda state: state.with_amplitude("EA0Z", 20.0).with_amplitude("EB0Z", 1.5))
    part.do(do.Signal.RECORD_DECISION)
    note = part.do(do.Input.SAVE_NOTE()).review[0]
    assert note.kind == "decision"
    assert note.text == "Repair: EA0Z to 20\nReason:"
    was = START.amplitudes
    assert note.change == {"EA0Z": (was["EA0Z"], 20.0), "EB0Z": (was["EB0Z"], 1.5)}
    assert note.before != note.numbers
    part.store.apply(lambda state: state.with_amplitude("EB0Z", 2.0))
    found = part.do(do.EditNote(note.id, "revert"))
    assert found.amplitudes == {**was, "EB0Z": 2.0}
    assert "EB0Z not reverted: now 2 instead of 1.5" in found.review[0].replies[0].text


def test_one_of_two_versions_stays_and_what_was_deleted_comes_back():
    base = Note(id="a1", text="old")
    mine, yours = base.edited(text="mine"), base.edited(text="yours")
    part, _ = alone(replace(START, review=(replace(mine, versions=(yours,)),)))
    kept = part.do(do.ChooseVersion("a1", 1)).review[0]
    assert (kept.text, kept.versions) == ("yours", ())
    assert {mine.version, yours.version} <= set(kept.replaces)
    part.do(do.EditNote("a1", "delete"))
    part.do(do.EditNote("a1", "add"))  # of a note that has gone
    assert part.store.state.review == ()
    part.store.undo()
    assert part.store.state.review == (kept,)


def test_a_story_is_put_in_order_and_what_two_have_edited_waits_for_a_choice():
    one, two, three = (Note(id=name, text=name) for name in ("a", "b", "c"))
    part, _ = alone(replace(START, review=(one, two, three)))
    for name, move, wanted in (
        ("b", "add", "b"), ("c", "add", "bc"), ("a", "add", "bca"), ("b", "up", "bca"),
        ("a", "up", "bac"), ("b", "down", "abc"), ("a", "out", "bc"),
    ):  # fmt: skip
        found = story(part.do(do.EditNote(name, move)).review)
        assert "".join(note.id for note in found) == wanted
        assert [note.step for note in found] == [*range(1, len(wanted) + 1)]
    two = part.store.state.review[1]
    torn = replace(two.edited(text="mine"), versions=(two.edited(text="yours"),))
    part.store.apply(lambda state: replace(state, review=(one, torn, three)))
    assert part.do(do.EditNote("a", "add")).review == (one, torn, three)


def test_a_note_on_a_trace_or_a_body_is_pinned_where_that_is_drawn():
    point = Picked({"X": 0.0, "B": 20.0}, Loop.WORKPIECE, (0.0, 275.0, 450.0))
    part, _ = alone(replace(START, picked=point))
    traced = pin(part)
    assert traced.on == NoteAnchor("workpiece", point.point_mm)
    assert (traced.at["B"], {*traced.at}) == (20.0, {*START.scene.machine.axes})
    found = explain_point(START, point, 1.0)
    assert traced.numbers["here_um"] == pytest.approx(np.linalg.norm(found.drawn_um), abs=0.02)
    assert (
        part.do(do.Input.SHOW_NOTE(replace(traced, view="").id)).picked.point_mm == point.point_mm
    )
    part.store.apply(lambda state: put(state, "page.note_place", "Z"))
    part.store.apply(lambda state: put(state, "page.note_text", "Column"))
    body = part.do(do.Input.SAVE_NOTE()).review[-1]
    assert (body.on, dict(body.at)) == (NoteAnchor(body="Z"), {})
    state = replace(START, review=(traced, body))
    (flag,) = note_labels(LIVE.evaluate(state))  # no body is drawn
    drawn = LIVE.evaluate(put(state, "machine.shown", "1"))
    shown, middle = note_labels(drawn)
    np.testing.assert_allclose(flag.at_mm, shown.at_mm)
    explained = explain_point(state, point, drawn.exaggeration)
    np.testing.assert_allclose(shown.at_mm, explained.drawn_mm)
    points = np.concatenate([b.vertices_mm for b in drawn_bodies(drawn) if b.body.frame == "Z"])
    assert middle.text == "⚑ 2"
    assert ((points.min(axis=0) < middle.at_mm) & (middle.at_mm < points.max(axis=0))).all()


@pytest.mark.parametrize("name", ["dvf5000_first", "fork_head_bc", "teach_tilted_c"])
def test_flags_stand_where_the_points_asked_about_are_drawn(name):
    state = start_state(load_scene(name))
    spans = state.scene.machine.axes
    points = [{a: 0.3 * one.travel[0] for a, one in spans.items()}, dict.fromkeys(spans, 1.0)]
    for loop in Loop:
        shown = replace(state, loop=loop)
        found = drawn_places(shown, points, 100.0)
        wanted = [explain_point(shown, Picked(at), 100.0).drawn_mm for at in points]
        # the box is drawn to first order, a point asked about exactly
        np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-3)


@pytest.mark.parametrize(
    "action",
    [
        do.Input.SHOW_NOTE(EVIL), do.ChooseVersion("a1", 9), do.Input.SAVE_NOTE("a1"),
        do.RevealNote(0), do.RevealNote(99), do.EditNote("b2", "add"), do.ReplyToNote(EVIL, "x"),
        do.Signal.LEAVE_NOTE_VIEW,
    ],
)  # fmt: skip
def test_hostile_actions_change_nothing(action):
    part, _ = alone(replace(START, review=(Note(id="a1", text=EVIL, author=EVIL),)))
    review = part.store.state.review
    assert part.do(action).review == review
    part.do(do.Signal.OPEN_NOTES)
    assert "<img" not in str(part.part.render(part.context.picture))


def stands(tab):
    """Give where the camera of a tab stands, as ten numbers."""
    one = tab.session.context.camera.remember()
    return [*one.position, *one.look_at, *one.up, one.fov_rad]


def test_a_note_in_the_browser(browser):
    with Viewer(SCENES[0]) as own, new_visitor(browser) as context:
        tab = Tab(context.new_page(), own)
        page = tab.page
        tab.press("n")
        page.locator("#ws-notes textarea:focus").wait_for()
        page.keyboard.type("Why here? http://a.b/c")
        tab.type("Your name", "Ada")
        tab.click("Save note")
        tab.until(lambda: len(tab.state.review) == 1)
        note = tab.state.review[0]
        assert note.author == "Ada"
        page.locator(".ws-words [data-kind=note]").wait_for()
        page.reload()
        page.wait_for_selector("html[data-warpspace=open]")
        tab.send(do.SetLeaf("amplitudes.EA0Z", "3"))
        tab.send(do.ViewFrom("front"))
        tab.until(lambda: tab.state.amplitudes["EA0Z"] == 3.0)
        page.locator(".ws-words [data-kind=note]").click()
        page.locator("#ws-notes").get_by_text("changed: ").wait_for()
        before = stands(tab)
        tab.click("Show")
        tab.until(lambda: tab.state.amplitudes == START.amplitudes)
        scene = tab.state.resulting_scene()
        assert note_numbers(scene, [note])[0] == note.numbers
        wanted = [float(x) for x in note.view.partition("camera=")[2].split("&")[0].split("%2C")]
        tab.until(lambda: np.allclose(stands(tab), wanted, rtol=0.0, atol=1e-6))
        tab.click("Back")
        tab.until(lambda: tab.state.amplitudes["EA0Z"] == 3.0)
        tab.until(lambda: np.allclose(stands(tab), before, rtol=0.0, atol=1e-6))
        page.locator("#ws-notes [data-do*=show_note]").focus()
        page.keyboard.press("Escape")
        tab.until(lambda: page.locator("#ws-notes > *").count() == 0)
        assert page.evaluate("document.activeElement.dataset.do") == "open_notes"
        assert tab.errors == []
