"""The part in the box: what is drawn is what the machine makes, however it is looked at."""

import time
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from app.page_tab import open_page
from app.parts import LIVE
from warpspace.app.browser import actions as do
from warpspace.app.documents.legend import GEOMETRY_ONLY, part_html
from warpspace.app.documents.scene_file import open_link, open_text, state_to_link, state_to_toml
from warpspace.app.evaluation.compare import with_pin
from warpspace.app.evaluation.point_explanation import pick_line
from warpspace.app.evaluation.scene_overlays import moved_place, part_overlay
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import start_state
from warpspace.app.state.store import StateStore
from warpspace.app.state.tree import put
from warpspace.kinematics import transforms
from warpspace.parts.workpiece import Workpiece, evaluate_points, place_workpiece
from warpspace.resources import scenes_dir
from warpspace.scene.library import load_scene

SCENE = load_scene("dvf5000_first")
TRIANGLES = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
MESH = Workpiece(
    "tip", np.array([[0.0, 0, 0], [100, 0, 0], [0, 80, 0], [0, 0, 60]]), np.array(TRIANGLES, "i4")
)


def holding(state, mesh=MESH, place=""):
    state = replace(state, part=replace(state.part, mesh=mesh, name=mesh.name))
    return put(state, "part.place", place)


STATE = holding(start_state(SCENE))


@pytest.mark.parametrize("turned", [{}, {"B": 30.0, "C": 75.0}])
def test_what_is_drawn_is_what_the_machine_makes(turned):
    state = holding(replace(start_state(SCENE), positions={"B": 0.0, "C": 0.0, **turned}),
                    place="20,-30,140,0,0,25")  # fmt: skip
    state = put(state, "amplitudes.EXX", "12")
    found = LIVE.evaluate(state).part
    scene = replace(state, scene=state.active_scene()).standing
    made = evaluate_points(scene, place_workpiece(MESH, scene, state.part.place).vertices_mm)
    back = np.linalg.inv(found.pose)
    np.testing.assert_allclose(found.error_um @ back[:3, :3].T, made.error_um, atol=1e-4)
    np.testing.assert_allclose(transforms.apply(back, found.nominal_mm), made.point_mm, atol=1e-3)
    drawn = found.drawn_mm(1.0) - found.drawn_mm(0.0)
    np.testing.assert_allclose(drawn, 1e-3 * found.error_um, atol=1e-4)


def test_a_part_in_the_middle_stands_in_the_middle_of_the_box():
    picture = LIVE.evaluate(STATE)
    points = picture.part.nominal_mm
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
    np.testing.assert_allclose(middle, picture.grid.bounds_mm.mean(axis=0), atol=1e-3)


def test_the_change_of_a_part_is_b_less_a():
    changed = put(STATE, "amplitudes.EC0Y", "80")
    compared = put(put(with_pin(STATE), "amplitudes.EC0Y", "80"), "comparison.shown", "difference")
    found, a, b = (LIVE.evaluate(state).part for state in (compared, STATE, changed))
    np.testing.assert_allclose(found.error_um, b.error_um - a.error_um, atol=1e-4)


def test_turns_keep_the_middle_and_add_up():
    placed = part_overlay(STATE)
    for turn in 90.0 * np.eye(3):
        state = STATE
        for _ in range(4):
            part = part_overlay(state).of
            np.testing.assert_allclose(part.middle_mm, placed.of.middle_mm, atol=5e-3)
            place = moved_place(part, transforms.placed(part.middle_mm, turn))
            state = replace(state, part=replace(state.part, place=place))
        again = part_overlay(state).of.vertices_mm
        np.testing.assert_allclose(again, placed.of.vertices_mm, atol=5e-3)


def test_a_place_is_typed_linked_and_undone():
    store = StateStore(STATE)
    store.apply(lambda state: put(state, "part.place", "10; 20; 140"))
    assert store.state.part.place == (10.0, 20.0, 140.0)
    link = state_to_link(store.state, None, [SCENE])
    assert "place=10.0%2C20.0%2C140.0" in link
    assert "part=tip" in link
    opened, _ = open_link(link, [SCENE])
    assert opened.part == replace(store.state.part, mesh=None)
    assert store.undo() == "place"
    assert store.state.part.place is None
    assert "expected three numbers, or six" in put(STATE, "part.place", "1,2").notes[0]


def test_the_part_of_a_scene_comes_and_goes_with_it(tmp_path):
    trimesh.creation.box((200, 150, 80)).export(tmp_path / "block.stl")
    (tmp_path / "ring.ngc").write_bytes(PROGRAM)
    text = (scenes_dir() / "dvf5000_first.toml").read_text("utf-8")
    part = '[part]\nfile = "block.stl"\nplace = [0, 0, 140, 0, 0, 30]\nprogram = "ring.ngc"\n'
    (tmp_path / "own.toml").write_text(f"{text}\n{part}", "utf-8")
    own = start_state(load_scene(tmp_path / "own.toml"))
    picture = LIVE.evaluate(own)
    assert None not in (picture.part, picture.path)
    assert (own.part.name, own.look.surface) == ("block.stl", "grid")
    other = own.with_scene(SCENE)
    assert other.part.is_empty
    assert other.look == start_state(SCENE).look
    assert "program.tcp" not in other.forms
    assert STATE.with_scene(own.scene).part == own.part
    sent, _ = open_text(state_to_toml(own), "sent", "sent")
    assert (sent.part.name, sent.part.is_empty) == ("block.stl", True)


def test_what_leaves_the_travel_is_said():
    words = part_html(LIVE.evaluate(put(STATE, "part.place", "2000,0,0")))
    assert "4 points beyond the travel" in words
    assert GEOMETRY_ONLY in words
    assert part_html(LIVE.evaluate(put(STATE, "part.shown", "0"))) == ""


def test_a_slider_moves_a_large_part_in_60_ms():
    count = 100_000
    point = np.random.default_rng(1).uniform(-100.0, 100.0, (count, 3))
    triangles = np.arange(count - 1)[:, None] % (count - 3) + [0, 1, 2]
    state = holding(start_state(SCENE), Workpiece("large", point, triangles.astype("i4")))
    times = []
    for value in range(6):  # the first one computes the response
        state, began = put(state, "amplitudes.EA0Z", str(value)), time.process_time()
        picture = LIVE.evaluate(state)
        picture.coloured(picture.part)
        picture.part.drawn_mm(1000.0)
        times.append(time.process_time() - began)
    assert min(times) < 0.06


# --- In the browser -------------------------------------------------------------------------------

PROGRAM = b"G21 G90\nG0 X-60 Y-40 Z-250\nG1 X60 F500\nG2 X60 Y40 J40\nG1 X-60\nG1 Y-40\nM30\n"
TOLERANCES = b'[[features]]\nname = "top"\nis = "plane 1"\nmeasure = "flatness"\ntolerance_um = 2\n'


def opened(tab, name, content):
    tab.give(name, content, tab.page.get_by_role("button", name="Open").first.click)


def drawn_part(tab) -> bool:
    """Whether the page draws what the session shows, a tenth of a millimetre apart at most."""
    found, picture = tab.drawn("/part/surface"), LIVE.evaluate(tab.state)
    if found is None or picture.part is None:
        return False
    wanted = picture.part.drawn_mm(picture.exaggeration)[picture.part.at]
    return found.shape == wanted.shape and np.abs(found - wanted).max() < 0.1


def test_a_part_is_opened_bent_by_a_slider_turned_and_judged(tab):
    block = trimesh.creation.box((200, 150, 80)).export(file_type="stl")
    opened(tab, "block.stl", block)
    tab.says("Part block.stl up to")
    tab.until(lambda: drawn_part(tab))
    tab.says("as cut", within="[data-key=part]")  # measured by itself
    before = tab.page.inner_text(".ws-part")
    tab.send(do.SetLeaf("amplitudes.EC0Y", "90"))
    tab.until(lambda: tab.page.inner_text(".ws-part") != before and drawn_part(tab))
    place = tab.state.part.place
    tab.click("x 90°")
    tab.until(lambda: tab.state.part.place != place and drawn_part(tab))
    tab.press("Control+z")
    tab.until(lambda: tab.state.part.place == place and drawn_part(tab))
    tab.give("top.toml", TOLERANCES,
             tab.page.get_by_role("button", name="Tolerances …").first.click)  # fmt: skip
    tab.says("top · flatness", within="[data-key=part]")
    assert tab.errors == []


def test_a_line_of_a_program_and_its_place_find_each_other(tab):
    opened(tab, "ring.ngc", PROGRAM)
    tab.says("Program ring.ngc up to")
    tab.says("Worst blocks", within="[data-key=program]")
    tab.click("4", within="[data-key=program]")
    tab.says("G2 X60 Y40 J40", within="[data-key=program]")
    tab.until(lambda: tab.drawn("/program/line") is not None)
    picture = LIVE.evaluate(tab.state)
    drawn = picture.path.drawn_mm(picture.exaggeration)
    end = drawn[np.flatnonzero(picture.path.of.line == 3)[-1]]
    marked = drawn[np.flatnonzero(picture.path.of.line == 4)[-1:]]
    np.testing.assert_allclose(tab.drawn("/program/line"), marked, atol=0.1)
    eye = end + np.array([0.0, -500.0, 0.0])
    assert pick_line(picture, eye, end - eye) == 3
    assert tab.errors == []


def test_the_part_of_a_scene_is_drawn_as_the_app_opens(browser):
    with Viewer(load_scene("part_on_dvf5000")) as viewer:
        tab = open_page(viewer, browser)
        tab.until(lambda: drawn_part(tab))
        assert tab.errors == []
        tab.page.context.close()
