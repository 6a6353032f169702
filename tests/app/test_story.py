"""A story: notes in order, each with what was on the screen, in one file without a network."""

from dataclasses import replace

import numpy as np
import pytest

from app.page_tab import open_page
from app.wire import Wire, dial, end_work
from offline import EVIL, opened_offline, wait_for_the_map
from warpspace.app.browser import actions as do
from warpspace.app.browser.html import linked
from warpspace.app.documents.offline_page import build_story_html
from warpspace.app.documents.scene_file import view_of
from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import start_state
from warpspace.picture.map_mesh import map_mesh
from warpspace.scene.library import load_scene
from warpspace.scene.notes import Note

START = start_state(load_scene("dvf5000_first"))
STEPS = 8
PLACES_IN_THE_APP = "() => window.__viserMutable.camera.position.toArray()"
MOST_BYTES = 1_200_000
PLACES = """() => {
  const view = document.querySelector("iframe").contentWindow.__viserMutable;
  let mesh = null;
  view?.nodeRefFromName["/box/surface"]?.traverse(part => {
    if (!mesh && part.isMesh && part.geometry.attributes.color) mesh = part;
  });
  const { position, color } = mesh?.geometry.attributes ?? {};
  return [position?.array.slice(0, 300), color?.array.slice(0, 300)].map(a => [...a ?? []]).concat(
    [view?.camera.position.toArray() ?? []]);
}"""


def places_near(page, mesh, camera):
    """Give the places as soon as they are those, or what they are after ten seconds."""
    for _ in range(200):
        found = page.evaluate(PLACES)
        if np.allclose(found[0], mesh, atol=0.02) and np.allclose(found[2], camera, atol=1e-3):
            break
        page.wait_for_timeout(50)
    return found


def camera(number):
    return CameraMemory((9.0 + number, -12.0, 8.0), (0.5, 0.0, -2.5), (0.0, 0.0, 1.0), 0.4)


def shown(number):
    """Give what step `number` shows."""
    bent = {**START.amplitudes, "EA0Z": 33.9 - 8.0 * number}
    return replace(START, amplitudes=bent, component="x" if number == 3 else "norm")


def told(text="Look here.", **changes):
    notes = [
        Note(text=f"{text} {number}", author="Ada", step=number + 1, **changes,
             view=view_of(shown(number), camera(number)))
        for number in reversed(range(STEPS))
    ]  # fmt: skip
    return replace(START, review=tuple(notes))


def test_links_are_made_of_http_alone():
    found = linked('<i> "javascript:x" http://a.b/c?d=1&e. data:text')
    assert str(found) == (
        "&lt;i&gt; &quot;javascript:x&quot; <a href=\"http://a.b/c?d=1&amp;e\" target=\"_blank\""
        " rel=\"noopener noreferrer\">http://a.b/c?d=1&amp;e</a>. data:text"
    )  # fmt: skip


def test_a_step_that_cannot_be_drawn_keeps_its_words_and_says_why():
    state = told()
    lost = replace(state.review[0], view="compare.b=scene%3Dgone")
    page = build_story_html(replace(state, review=(lost, *state.review[1:]), nodes=3))
    assert "The drawing of the previous step is shown" in page
    assert f"Look here. {STEPS - 1}" in page


def test_a_story_in_a_file_moves_points_colours_and_camera_without_a_network(browser, tmp_path):
    text = build_story_html(told(EVIL, numbers={"mean_um": 1.0}), {"title": EVIL})
    assert len(text.encode()) <= MOST_BYTES
    path = tmp_path / "story.html"
    path.write_text(text, encoding="utf-8")
    with opened_offline(browser, path) as page:
        wait_for_the_map(page, page.frame_locator("iframe").locator("canvas").first, 20_000)
        assert "1 of 8" in page.inner_text("aside")
        assert f"{EVIL} 0" in page.inner_text("aside")
        assert "changed: 1.0 → 30.9 µm" in page.inner_text("aside")
        before = page.evaluate(PLACES)
        page.keyboard.press("ArrowRight")
        expected = map_mesh(LiveModel().evaluate(shown(1))).vertices_mm.reshape(-1)[:300]
        after = places_near(page, expected, [12.0, 8.0, -10.0])
        assert "2 of 8" in page.inner_text("aside")
        for was, now in zip(before, after, strict=True):
            assert was != now
        assert after[0] == pytest.approx(expected.tolist(), abs=0.02)
        # viser draws in a world whose y is up and whose x looks against our y
        assert after[2] == pytest.approx([12.0, 8.0, -10.0], abs=1e-3)
        page.keyboard.press("ArrowLeft")
        for was, now in zip(before, places_near(page, before[0], before[2]), strict=True):
            assert now == pytest.approx(was, abs=0.02)


def place_of(tab):
    return np.array(tab.page.evaluate(PLACES_IN_THE_APP))


def test_a_story_in_the_app_goes_from_step_to_step_and_back_to_before(browser):
    scene = replace(START.scene, review=told().review)
    with Viewer(scene, shared=True) as viewer:
        tab = open_page(viewer, browser)
        before, camera_before = tab.state, tab.still(lambda: place_of(tab))
        tab.send(do.SetLeaf("component", "y"))
        tab.until(lambda: tab.state.component == "y")
        before = tab.state
        with tab.page.expect_download() as file:
            tab.send(do.Signal.SAVE_STORY)
        assert file.value.suggested_filename == "dvf5000_first_story.html"
        tab.send(do.Signal.START_STORY)
        tab.says("1 of 8", "#ws-story")
        tab.page.keyboard.press("ArrowRight")
        tab.says("2 of 8", "#ws-story")
        tab.until(lambda: tab.shows_state(shown(1)))
        tab.until(lambda: np.allclose(place_of(tab), [12.0, 8.0, -10.0], atol=1e-6))
        assert not tab.page.locator("#ws-left").is_visible()
        tab.page.keyboard.press("g")  # no key but its own acts
        tab.page.keyboard.press("ArrowLeft")
        tab.says("1 of 8", "#ws-story")
        assert viewer.sessions[0].context.store.state is before  # nobody else is disturbed
        tab.page.keyboard.press("Escape")
        tab.until(lambda: tab.state is before)
        tab.until(lambda: np.allclose(place_of(tab), camera_before, atol=1e-6))
        assert tab.page.locator("#ws-left").is_visible()
        assert tab.errors == []


def pointer_of(tab):
    """Return number, name and place of another tab."""
    return tab.latest.get("Page.pointer", [])


def test_tabs_of_a_shared_review_see_each_others_notes_and_pointers():
    with Viewer(START.scene, shared=True) as viewer, dial(viewer) as mine, dial(viewer) as yours:
        one, other = Wire(mine), Wire(yours)
        assert all(tab.read_until(lambda tab=tab: tab.is_open, 60.0) for tab in (one, other))
        for action in (do.Input.PIN_NOTE(), do.SetLeaf("page.note_text", "Why?"),
                       do.Input.SAVE_NOTE()):  # fmt: skip
            one.say(action)
        other.say(do.Signal.OPEN_NOTES)
        assert other.read_until(lambda: "Why?" in other.pieces["notes"])
        for hostile in ((1, 2, 3), (np.nan, 0, 0, 0, 0, 1), (0,) * 6, "x", (1e300, 0, 0, 1, 1, 1)):
            one.say(do.PointAt(hostile, ""))
        at = do.PointAt((0, -20, 1.5, 0, 1, 0), EVIL)  # of those too soon after it none is taken
        assert other.read_until(lambda: one.say(at) or any(pointer_of(other)[2:]))
        assert pointer_of(other)[1] == " ".join(EVIL[:24].split())
        assert pointer_of(other)[2] == pytest.approx([0.0, -1.95, 1.5], abs=0.1)
        mine.close()
        assert other.read_until(lambda: pointer_of(other)[2] is None)
        assert pointer_of(one) == []
        end_work(viewer)


def _is_near(page, dots):
    page.mouse.move(700, 480)
    page.mouse.move(705, 482)
    dots.wait_for()
    box = dots.bounding_box()
    return box and (box["x"], box["y"]) == pytest.approx((700, 477), abs=8)


def test_the_pointer_of_another_tab_is_a_dot_that_goes_by_itself(browser):
    with Viewer(START.scene, shared=True) as viewer:
        one, other = open_page(viewer, browser), open_page(viewer, browser)
        one.page.evaluate("name => localStorage.setItem('warpspace-author', name)", EVIL)
        dots = other.page.locator(".ws-pointer")
        one.page.mouse.move(700, 480)
        one.page.mouse.move(705, 482)
        dots.wait_for()
        assert dots.inner_text() == EVIL[:24]
        # both look from the same side, once both have come to rest
        other.until(lambda: _is_near(one.page, dots))
        assert one.page.locator(".ws-pointer").count() == 0
        dots.wait_for(state="detached", timeout=10_000)  # after three seconds without a move
        assert other.page.evaluate("window.hacked") is None
        assert other.errors == []
