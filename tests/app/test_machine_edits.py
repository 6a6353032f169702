"""Changing the machine of a state: what is kept, what goes, what undo brings back."""

import numpy as np
import pytest
import trimesh

from app.parts import body_of, lone_part
from warpspace.app.documents.scene_file import open_text, state_to_toml
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.machine_edits import (
    guide_errors,
    library,
    with_own_machine,
    with_word,
)
from warpspace.app.state.app_state import start_state
from warpspace.app.state.edits import with_curve, with_scene_tolerances
from warpspace.app.state.store import History
from warpspace.app.state.tree import put
from warpspace.app.tasks.machine_editor import EditorSection, MachinesWindow
from warpspace.bodies.placed import load_bodies
from warpspace.machine.errors import Constant, Directional, Ramp
from warpspace.scene.library import load_scene

LIVE = LiveModel()


@pytest.fixture
def state():
    return start_state(load_scene("dvf5000_first"))


def guides(state, axis):
    return guide_errors(state, state.scene.machine.gantries[axis])


def test_another_chain_keeps_changed_errors_and_drops_those_of_axes_that_go(state):
    state = state.with_amplitude("EAX", 33.0)
    state = state.with_amplitude("EXC", 4.0)
    state = put(state, "tolerances.EAX", repr(7.0))
    state = put(state, "tolerances.EXC", repr(7.0))
    state = put(state, "exclusions.excluded", "+EAX,+EXC")
    changed = with_word(state, "chain wBFXYZt")
    assert str(changed.scene.machine.chain) == "wBFXYZt"
    assert changed.amplitudes["EAX"] == 33.0
    assert changed.tolerances.own["EAX"].half_width == 7.0
    assert changed.exclusions.excluded == {"EAX"}
    assert not any(key.endswith("C") for key in changed.amplitudes)
    assert "EXC" not in changed.tolerances.own
    assert {*changed.positions} == {"B"}
    assert changed.origin is state.scene
    assert any("axis C left out" in note for note in changed.notes)
    assert with_scene_tolerances(changed).tolerances.own.keys() <= changed.amplitudes.keys()
    LIVE.evaluate(changed)


def test_curves_that_were_scaled_stay_the_same_functions_of_the_position(state):
    key = "EAX"
    state = state.with_amplitude(key, 2.5 * state.amplitudes[key])
    changed = with_word(state, "volume X 1 400")
    at = np.linspace(-200.0, 300.0, 5)
    shapes = [s.amplitudes[key] * s.scene.errors.shape(key, at) for s in (state, changed)]
    np.testing.assert_allclose(*shapes, rtol=1e-12)
    assert {*changed.changed_keys} == {*state.changed_keys} == {key}
    reset = changed.reset()
    own = state.scene.errors.evaluate(key, at)
    np.testing.assert_allclose(reset.amplitudes[key] * reset.scene.errors.shape(key, at), own)
    assert reset.scene.workspace == changed.scene.workspace


def test_the_machine_of_the_scene_comes_back_with_the_errors_of_its_axes(state):
    changed = with_word(with_word(state, "chain wFXYZt"), "offset X 0 12")
    assert with_word(changed, "own").scene == state.scene
    back = with_own_machine(changed)
    assert back.amplitudes == state.amplitudes
    assert back.loaded is None
    assert back.tolerances == state.tolerances
    assert with_own_machine(state) is state
    other = with_word(with_word(state, "chain wFXYZt"), "volume X 1 200")
    assert other.scene.workspace != state.scene.workspace
    assert other.changed_keys == ()
    back = with_own_machine(other)
    assert back.scene == state.scene
    assert back.amplitudes == pytest.approx(state.amplitudes)
    assert back.start == state.start
    moved = other.with_amplitude("EAX", 2.0 * other.amplitudes["EAX"])
    back = with_own_machine(moved)
    assert back.scene == state.scene
    assert back.amplitudes["EAX"] == pytest.approx(2.0 * state.amplitudes["EAX"])


def test_undo_takes_each_change_back(state):
    history = History(state)
    for number, word in enumerate(("left Y", "side X", "turn C", "chain wXFYt", "type scara")):
        history = history.push(with_word(history.present, word).without_notes(), 10.0 * number)
    while history.past:
        history = history.undo()
    assert history.present == state


@pytest.mark.parametrize(
    "word",
    [
        "chain wXXFt",
        "chain ",
        "left Q",
        "side F",
        "turn Q",
        "offset X 2 x",
        "offset X 0 abc",
        "offset X 0 1e999",
        "volume X 0 5000",
        "travel C 0 400",
        "volume B 1 40",
    ],
)
def test_what_cannot_be_is_refused_with_a_note_and_nothing_is_lost(state, word):
    changed = with_word(state, word)
    assert changed.without_notes() == state
    assert len(changed.notes) == 1


@pytest.mark.parametrize("word", ["", "own x", "type ../..", "offset X", "__class__ X 0 1"])
def test_words_that_are_none_change_nothing(state, word):
    assert with_word(state, word) is state


def test_every_machine_of_the_library_starts_with_its_own_scene(state):
    state = state.with_amplitude("EAX", 33.0)
    window = lone_part(MachinesWindow)
    assert "dvf5000" in library()
    for name, scene in library().items():
        changed = window.take(state, "choose", name)
        LIVE.evaluate(changed)
        if name == "dvf5000":  # as it was opened, with all that has been entered
            assert changed == state
            continue
        assert changed.scene == changed.origin == scene
        assert changed.amplitudes == start_state(scene).amplitudes
        assert scene.title in changed.notes[0]
        assert state.scene.title in changed.notes[0]


def test_a_chain_that_is_refused_stays_in_its_box_with_the_reason(state):
    editor = lone_part(EditorSection)
    assert editor.take(state, "set.chain", "wC<script>") is state
    text = editor.body(LIVE.evaluate(state))
    assert 'value="wC&lt;script&gt;"' in text
    assert "cannot be read" in text
    assert "<script>" not in text
    moved = editor.take(state, "set.offset X 0", "12,5")
    assert moved.scene.machine.axes["X"].offset_mm[0] == 12.5
    assert "cannot be read" not in editor.body(LIVE.evaluate(moved))


def test_a_gantry_is_made_its_guides_are_set_and_their_distance_keeps_them(state):
    made = with_word(state, "gantry X")
    gantry = made.scene.machine.gantries["X"]
    assert (gantry.span_mm, gantry.across) == (450.0, "y")  # as far as Y travels
    made = made.with_amplitude("EXX", 0.0).with_amplitude("ECX", 0.0)
    one = with_word(with_word(made, "guide X 0 4"), "guide X 1 13")
    # by hand: the second guide, at +225 mm in y, is 9 µm ahead, which turns X about −z
    assert one.amplitudes["EXX"] == pytest.approx(8.5)
    assert one.amplitudes["ECX"] == pytest.approx(-9.0 / 450.0 * 1000.0)
    assert guides(one, "X") == pytest.approx((4.0, 13.0))
    nearer = with_word(one, "span X 0 225")
    assert guides(nearer, "X") == pytest.approx((4.0, 13.0))
    assert nearer.amplitudes["ECX"] == pytest.approx(-40.0)
    turned = with_word(one, "across X")
    assert turned.scene.machine.gantries["X"].across == "z"
    assert with_word(one, "gantry X").scene.machine.gantries == {}
    opened, _ = open_text(state_to_toml(nearer), "own", "own.toml")
    assert opened.scene.machine.gantries == nearer.scene.machine.gantries
    assert guides(opened, "X") == pytest.approx((4.0, 13.0))


def test_guides_share_the_curve_of_the_axis_and_other_curves_are_said(state):
    made = with_word(state, "gantry Y")
    ramp = Ramp(made.axis_span("EYY"), 8.0)
    made = with_curve(made.with_amplitude("ECY", 0.0), "EYY", ramp)
    pair = with_word(made, "guide Y 1 12")
    assert guides(pair, "Y") == pytest.approx((8.0, 12.0))
    assert pair.curve("ECY").evaluate(np.array([-225.0])) == pytest.approx(0.0)
    other = with_curve(pair, "ECY", Constant(ramp.span, 5.0))
    assert guides(other, "Y") is None
    there, back = (Ramp(ramp.span, value) for value in (8.0, 6.0))
    by_direction = with_curve(pair, "ECY", Directional(ramp.span, there, back))
    assert guides(by_direction, "Y") is None
    refused = with_word(other, "guide Y 0 1")
    assert "different curves" in refused.notes[-1]
    assert refused.amplitudes == other.amplitudes


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("gantry B", "rotary axis"),
        ("gantry Q", "Q"),
        ("span X 0 1800", "gantry"),
        ("across X", "gantry"),
        ("mesh X", "body"),
        ("guide X 0 1", ""),
        ("guide X 7 1", ""),
    ],
)
def test_words_about_guides_and_meshes_that_are_not_there_change_nothing(state, word, said):
    changed = with_word(state, word)
    assert changed.scene is state.scene
    assert said in " ".join(changed.notes)


def test_meshes_of_the_scene_are_listed_without_their_folder_and_go(tmp_path):
    trimesh.creation.box(extents=(20.0, 30.0, 40.0)).export(tmp_path / "pillar.stl")
    path = tmp_path / "own.toml"
    text = state_to_toml(start_state(load_scene("machine_c_frame_mill")))
    mesh = '{ file = "pillar.stl", unit = "cm", offset_mm = [0, 0, 50] }'
    path.write_text(f"{text}\n[bodies]\nX = {mesh}\n", encoding="utf-8")
    state = start_state(load_scene(path))
    html = body_of(EditorSection, state)
    assert "pillar.stl · cm · offset 0, 0, 50 mm" in html
    assert str(tmp_path) not in html
    moved = with_word(state, "offset X 2 150")
    assert moved.scene.machine.bodies == state.scene.machine.bodies
    assert not any("cannot be read" in note for note in moved.scene.notes)
    gone = with_word(state, "mesh X")
    assert "X" not in gone.scene.machine.bodies
    assert "pillar.stl" not in body_of(EditorSection, gone)
    shown = {body.name for body in load_bodies(gone.scene.machine)}
    assert "X_pillar" not in shown
    assert "X_pillar" in {body.name for body in load_bodies(moved.scene.machine)}
