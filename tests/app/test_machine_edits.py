"""Changing the machine: what stays, what goes, what undo brings back; all of it reads back."""

import re
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from app.parts import LIVE, body_of, lone_part
from warpspace.app.browser import actions as do
from warpspace.app.browser.html import attributes
from warpspace.app.documents.scene_file import open_text, state_to_toml
from warpspace.app.evaluation.machine_edits import (
    edited,
    guide_errors,
    library,
    with_own_machine,
    with_word,
)
from warpspace.app.panels import machine_editor
from warpspace.app.panels.error_list import origin_words
from warpspace.app.state.app_state import start_state
from warpspace.app.state.edits import with_curve, with_scene_tolerances
from warpspace.app.state.tree import put
from warpspace.bodies.placed import load_bodies
from warpspace.exceptions import ChainError, WarpspaceError
from warpspace.kinematics.chain import nominal_point
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.machine.errors import Constant, Directional, Ramp
from warpspace.machine.limits import MAX_ERROR
from warpspace.scene.library import load_scene, parse_scene, scene_names
from warpspace.scene.scene_writer import scene_to_toml

STATE = start_state(load_scene("dvf5000_first"), nodes=5)


@pytest.fixture
def state():
    return start_state(STATE.scene)


def guides(state, axis):
    return guide_errors(state, state.scene.machine.gantries[axis])


def test_another_chain_keeps_changed_errors_and_drops_those_of_axes_that_go(state):
    for key in ("EAX", "EXC"):
        state = put(put(state, f"amplitudes.{key}", "33"), f"tolerances.{key}", "7")
    state = put(state, "exclusions.excluded", "+EAX,+EXC")
    changed = with_word(state, "chain wBFXYZt")
    assert changed.amplitudes["EAX"] == 33.0
    assert changed.tolerances.individual["EAX"].half_width == 7.0
    assert changed.exclusions.excluded == {"EAX"}
    keys = (*changed.amplitudes, *changed.tolerances.individual)
    assert not any(key.endswith("C") for key in keys)
    assert {*changed.positions} == {"B"}
    assert changed.origin is state.scene
    assert any("axis C removed" in note for note in changed.notes)
    assert with_scene_tolerances(changed).tolerances.individual.keys() <= changed.amplitudes.keys()
    LIVE.evaluate(changed)


def test_curves_that_were_scaled_stay_the_same_functions_of_the_position(state):
    key, at = "EAX", np.linspace(-200.0, 300.0, 5)

    def curve(state):
        return state.amplitudes[key] * state.scene.errors.shape_at(key, {"X": at})

    scaled = state.with_amplitude(key, 2.5 * state.amplitudes[key])
    changed = with_word(scaled, "volume X 1 400")
    np.testing.assert_allclose(curve(changed), curve(scaled), rtol=1e-12)
    assert changed.changed_keys == scaled.changed_keys == (key,)
    reset = changed.reset()
    np.testing.assert_allclose(curve(reset), curve(state))
    assert reset.scene.workspace == changed.scene.workspace


def test_the_machine_of_the_scene_comes_back_with_the_errors_of_its_axes(state):
    assert with_own_machine(state) is state
    back = with_word(with_word(with_word(state, "chain wFXYZt"), "offset X 0 12"), "own")
    assert (back.scene, back.amplitudes, back.tolerances, back.loaded) == (
        state.scene, state.amplitudes, state.tolerances, None
    )  # fmt: skip
    other = with_word(with_word(state, "chain wFXYZt"), "volume X 1 200")
    assert other.changed_keys == ()
    back = with_own_machine(other.with_amplitude("EAX", 2.0 * other.amplitudes["EAX"]))
    assert (back.scene, back.start) == (state.scene, state.start)
    doubled = {**state.amplitudes, "EAX": 2.0 * state.amplitudes["EAX"]}
    assert back.amplitudes == pytest.approx(doubled)


@pytest.mark.parametrize("axis", ["X", "Y", "Z", "B"])
def test_an_axis_that_returns_brings_all_that_went_with_it(axis):
    back = with_word(with_word(start_state(PLAIN), f"remove {axis}"), "own")
    assert (back.scene, back.tolerances) == (PLAIN, PLAIN.tolerances)
    assert back.amplitudes == start_state(PLAIN).amplitudes


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("chain wXXFt", "twice"),
        ("chain ", "cannot be read"),
        ("chain wFt", "no axis"),
        ("chain w" + "X" * 200, "cannot be read"),
        ("chain wA0A1A2A3A4A5A6A7A8Ft", "9 axes"),
        ("left Q", "unknown axis 'Q'"),
        ("offset A 0 1", "unknown frame 'A'"),
        ("travel X 2 1", "2 numbers"),
        ("offset X 2 x", "expected a number in mm"),
        ("rotation X 0 1e999", "expected a number in °"),
        ("offset X 0 1e9", "expected"),
        ("travel X 0 400", "lower < upper"),
        ("volume X 0 5000", "lower < upper"),
        ("volume B 1 40", "expected one position"),
        ("gantry B", "rotary"),
        ("gantry Q", "Q"),
        ("span X 0 1800", "gantry"),
        ("across X", "gantry"),
        ("mesh X", "body"),
        *((word, "^$") for word in ("", "own x", "type ../..", "offset X", "__class__ X 0 1")),
        *((word, "^$") for word in ("guide X 0 1", "chain w(C)BF XYZ t")),
    ],
)
def test_what_cannot_be_is_refused_with_a_note_and_words_that_are_none_without(state, word, said):
    changed = with_word(state, word)
    assert changed.without_notes() == state
    (note,) = changed.notes or ("",)
    assert re.search(said, note)


def test_every_machine_of_the_library_starts_with_its_own_scene(state):
    state = state.with_amplitude("EAX", 33.0)
    window = lone_part(machine_editor.MachinesDialog)
    for name, scene in library().items():
        changed = window.handle(state, do.Input.CHOOSE_MACHINE(name))
        if name == state.scene.machine.name:  # as it was opened, with all that has been entered
            assert changed == state
            continue
        assert changed.scene == changed.origin == scene
        assert changed.amplitudes == start_state(scene).amplitudes
        assert {title in changed.notes[0] for title in (scene.title, state.scene.title)} == {True}


def test_a_broken_scene_beside_the_bundled_ones_hides_no_machine(tmp_path, monkeypatch):
    monkeypatch.setattr("warpspace.scene.library.scenes_dir", lambda: tmp_path)
    (tmp_path / "a_broken.toml").write_text("errors = 7")
    (tmp_path / "whole.toml").write_text(scene_to_toml(PLAIN))
    assert {*library.__wrapped__()} == {"whole"}


def test_what_stands_somewhere_stays_within_the_ranges_of_another_machine(state):
    for path, text in (
        ("rotary.held.C", "0,200"),
        ("rotary.held.B", "-30"),
        ("look.slices_mm.Z", "-100"),
        ("machine.linear_mm.X", "250"),
    ):
        state = put(state, path, text)
    changed = with_word(state, "travel C 1 180")
    for word in ("volume Z 1 -200", "volume X 1 100", "travel X 1 100", "remove B"):
        changed = with_word(changed, word)
    assert changed.rotary.held == {"C": (0.0,)}
    assert changed.look.slices_mm == {"Z": -200.0}
    assert changed.machine.linear_mm == {"X": 100.0}
    opened, _ = open_text(state_to_toml(changed), "own", "own.toml")
    assert opened.notes == ()
    assert opened.rotary == changed.rotary
    assert LIVE.evaluate(changed).traces
    assert changed.with_scene(load_scene("machine_c_frame_mill")).rotary.held == {}


def test_errors_measured_on_another_chain_are_assumptions_and_the_title_says_so():
    text = scene_to_toml(load_scene("dvf5000_first")) + "[uncertainty]\nEA0Z = 2\n"
    opened = start_state(parse_scene(text, "measured"))
    changed = with_word(opened, "remove B")
    assert changed.scene.title == f"{opened.scene.title}, chain wCFXYZt"
    assert not changed.scene.uncertainty
    assert f"errors of {opened.scene.title} are kept as assumptions" in " ".join(changed.notes)
    assert "u =" in origin_words(opened, "EA0Z")[0]
    assert origin_words(changed, "EA0Z")[0].endswith("for the chain wCBFXYZt")
    assert with_word(changed, "own").scene is opened.scene


def test_a_chain_that_is_refused_leaves_the_accepted_one_in_its_box_with_the_reason(state):
    editor = lone_part(machine_editor.EditorSection)
    assert editor.handle(state, do.EditMachine("chain", "wC<script>")) is state
    text = editor.body(LIVE.evaluate(state))
    assert f'value="{state.scene.machine.chain}"' in text
    assert "wC&lt;script&gt;" in text
    assert "cannot be read" in text
    assert "the machine is unchanged" in text
    assert "<script>" not in text
    moved = editor.handle(state, do.EditMachine("offset X 0", "12,5"))
    assert moved.scene.machine.axes["X"].offset_mm[0] == 12.5
    assert "cannot be read" not in editor.body(LIVE.evaluate(moved))


def test_a_gantry_is_made_its_guides_are_set_and_their_distance_keeps_them(state):
    made = with_word(state, "gantry X")
    gantry = made.scene.machine.gantries["X"]
    assert (gantry.span_mm, gantry.across) == (450.0, "y")  # as far as Y travels
    assert with_word(made, "gantry X").scene.machine.gantries == {}
    turned = with_word(made, "across X")
    assert turned.scene.machine.gantries["X"].across == "z"
    made = made.with_amplitude("EXX", 0.0).with_amplitude("ECX", 0.0)
    one = with_word(with_word(made, "guide X 0 4"), "guide X 1 13")
    # by hand: the second guide, at +225 mm in y, is 9 µm ahead, which turns X about −z
    assert [one.amplitudes[key] for key in ("EXX", "ECX")] == pytest.approx([8.5, -20.0])
    nearer = with_word(one, "span X 0 225")
    assert nearer.amplitudes["ECX"] == pytest.approx(-40.0)
    opened, _ = open_text(state_to_toml(nearer), "own", "own.toml")
    assert opened.scene.machine.gantries == nearer.scene.machine.gantries
    for found in (one, nearer, opened):
        assert guides(found, "X") == pytest.approx((4.0, 13.0))
    far = with_word(one, "guide X 0 1e9")
    assert far.amplitudes["EXX"] == MAX_ERROR
    assert "clamped" in far.notes[-1]


def test_guides_share_the_curve_of_the_axis_and_other_curves_are_said(state):
    made = with_word(state, "gantry Y")
    ramp = Ramp(made.axis_span("EYY"), 8.0)
    made = with_curve(made.with_amplitude("ECY", 0.0), "EYY", ramp)
    pair = with_word(made, "guide Y 1 12")
    assert guides(pair, "Y") == pytest.approx((8.0, 12.0))
    assert pair.curve("ECY").evaluate(np.array([-225.0])) == pytest.approx(0.0)
    for curve in (Constant(ramp.span, 5.0), Directional(ramp.span, ramp, Ramp(ramp.span, 6.0))):
        other = with_curve(pair, "ECY", curve)
        assert guides(other, "Y") is None
        refused = with_word(other, "guide Y 0 1")
        assert "different curves" in refused.notes[-1]
        assert refused.amplitudes == other.amplitudes


def test_meshes_of_the_scene_are_listed_without_their_folder_and_go(tmp_path):
    trimesh.creation.box(extents=(20.0, 30.0, 40.0)).export(tmp_path / "pillar.stl")
    path = tmp_path / "own.toml"
    text = scene_to_toml(load_scene("machine_c_frame_mill"))
    mesh = '{ file = "pillar.stl", unit = "cm", offset_mm = [0, 0, 50] }'
    path.write_text(f"{text}\n[bodies]\nX = {mesh}\n", encoding="utf-8")
    state = start_state(load_scene(path))
    html = body_of(machine_editor.EditorSection, state)
    assert "pillar.stl · cm · offset 0, 0, 50 mm" in html
    assert str(tmp_path) not in html
    moved, gone = with_word(state, "offset X 2 150").scene, with_word(state, "mesh X")
    assert moved.machine.bodies == state.scene.machine.bodies
    assert not any("cannot be read" in note for note in moved.notes)
    assert "pillar.stl" not in body_of(machine_editor.EditorSection, gone)
    for machine, is_there in ((moved.machine, True), (gone.scene.machine, False)):
        assert ("X_pillar" in {body.name for body in load_bodies(machine)}) is is_there


# --- Where the axes stand, and traces of rotary ones ----------------------------------------------


def test_every_axis_has_a_slider_whose_event_moves_it():
    moved = put(put(STATE, "positions.B", "-30"), "machine.linear_mm.X", "100")
    text = body_of(machine_editor.PositionsSection, moved)
    assert text.count('type="range"') == 5
    assert 'value="-30"' in text
    assert "Tool point: axes X 100 " in text


def test_traces_are_drawn_in_numbers_where_an_error_moves_them():
    assert "No error moves the traced points" in body_of(machine_editor.RotarySection, STATE)
    rising = Ramp(STATE.axis_span("EZC"), 8.0)  # by hand: 8 µm higher after a turn
    state = with_curve(STATE, "EZC", rising)
    text = body_of(machine_editor.RotarySection, state)
    assert text.count("<svg") == 3
    assert "8.0 µm" in text
    located = with_curve(STATE, "EX0C", Constant(rising.span, 6.0))
    text = body_of(machine_editor.RotarySection, located.with_amplitude("EA0C", 20.0))
    for head, unit in (("displaced", "µm"), ("inclined", "µrad"), ("radial", "µm")):
        assert f"<th>{head} <small>{unit}</small></th>" in text
    # by hand: 450 mm above the table, 20 µrad add 9 µm across to 6 µm
    row = ("275.0", "10.82", "20.00", "21.63 /\u00a00.00", "0.00 /\u00a00.00", "40.00 /\u00a00.00")
    name = "C at B 0°, point (0, 275, 450) mm"
    assert f"{name}</td></tr><tr><td>{'</td><td>'.join(row)}</td>" in text
    hidden = body_of(machine_editor.RotarySection, put(state, "shown.traces", "0"))
    assert "Show traces" in hidden
    assert "<svg" not in hidden
    mill = start_state(load_scene("machine_c_frame_mill"))
    assert "no rotary axis" in body_of(machine_editor.RotarySection, mill)


def test_the_axis_is_played_and_axes_are_held_at_quarters():
    state = replace(STATE, page=replace(STATE.page, task="machine", open=frozenset({"rotary"})))
    text = body_of(machine_editor.RotarySection, state)
    for action in (
        do.Input.PLAY("C"), do.SetLeaf("rotary.held.C", "0,90,180,270"),
        do.SetLeaf("rotary.off", "+1"),
    ):  # fmt: skip
        assert attributes(data_do=action) in text


# --- A scene alone -------------------------------------------------------------------------------

PLAIN = parse_scene(
    """
title = "Plain"
[machine]
title = "Mine"
chain = "wBFXYZt"
[machine.offset_mm]
B = [0, 0, -100]
S = [0, 0, 300]
t = [0, 0, -80]
[machine.rotation_deg]
S = [0, 0, 5]
[machine.travel]
X = [-300, 300]
[convention.component_errors]
X = "after_motion"
Y = "after_motion"
Z = "before_motion"
B = "before_motion"
[workspace]
X = [-200, 200]
Y = [-100, 100]
Z = [-50, 50]
B = 10
[points_mm]
tool = [0, 0, -20]
[errors]
EXX = { ramp = 10.0 }
EAY = { poly = [1.0, 0.01] }
EXB = 3.0
EA0B = 20.0
[tolerances]
default = { translation = 5.0, rotation = 8.0, squareness = 20.0 }
EXB = 4.0
EYY = 2.0
[view]
reference = { X = 0, Y = 0, Z = 0, B = 0 }
""",
    "plain",
)


def edit(word, scene=PLAIN):
    """The changed scene, having made sure that its file reads back equal."""
    scene, _ = edited(scene, word)
    read = parse_scene(scene_to_toml(scene), scene.name)
    dressed = replace(read.machine, name=scene.machine.name, body_dir=scene.machine.body_dir)
    assert replace(read, model=replace(read.model, machine=dressed)) == scene
    return scene


def test_another_chain_keeps_what_belongs_to_axes_that_stay():
    scene = edit("chain w C F X Y Z t")
    machine, was = scene.machine, PLAIN.machine
    assert str(machine.chain) == "wCFXYZt"
    assert (machine.axes["X"], machine.fixed_mm, machine.fixed_deg) == (
        was.axes["X"], was.fixed_mm, was.fixed_deg
    )  # fmt: skip
    assert machine.axes["C"].travel == (0.0, 360.0)
    kept = {axis: PLAIN.workspace.ranges[axis] for axis in "XYZ"}
    assert scene.workspace.ranges == {**kept, "C": (0.0, 0.0)}
    assert ({*scene.errors}, {*scene.tolerances.individual}) == ({"EXX", "EAY"}, {"EYY"})
    assert scene.tolerances.default == PLAIN.tolerances.default
    assert scene.reference == {"X": 0.0, "Y": 0.0, "Z": 0.0}
    _, (note,) = edited(PLAIN, "chain wCFXYZt")
    assert note == (
        "axis B removed, with its errors EXB, EA0B; its tolerances EXB; its reference position"
    )


def test_a_linear_axis_that_changes_sides_moves_the_tool_over_the_workpiece_as_before():
    there = edit("chain wYBFXZt")
    assert [there.machine.axes[axis].direction for axis in "XYZB"] == [1, -1, 1, 1]
    (note,) = there.notes
    assert note.startswith("machine.direction.B = 1 by default: positive B turns the tool about −B")
    back = edit("chain wBFXYZt", there)
    assert {axis.direction for axis in back.machine.axes.values()} == {1}
    assert edit("chain wUBFXYZt").machine.axes["U"].direction == -1


def test_a_second_axis_stands_still_and_one_in_place_of_another_spans_the_volume():
    scene = edit("chain wBFXYZWt")
    assert scene.workspace.ranges["W"] == (0.0, 0.0)
    assert scene.workspace.volume_axes == ("X", "Y", "Z")
    scene = edit("chain wBFUYZt")
    assert scene.workspace.ranges["U"] == (-250.0, 250.0)
    assert scene.workspace.volume_axes == ("U", "Y", "Z")
    arms = load_scene("machine_scara")
    assert edit("chain wFC1C2ZXt", arms).workspace.ranges["X"] == (0.0, 0.0)


def test_an_axis_moves_along_the_chain_across_the_frame_and_away():
    names, scene = [], PLAIN
    for way in ("right", "right", "left", "left", "left"):
        scene = edit(f"{way} B", scene)
        names.append(str(scene.machine.chain))
    assert names == ["wFBXYZt", "wFXBYZt", "wFBXYZt", "wBFXYZt", "wBFXYZt"]
    assert scene == replace(PLAIN, model=replace(PLAIN.model, machine=scene.machine))
    assert {*scene.errors} == {*PLAIN.errors}
    scene = edit("side Y")
    assert str(scene.machine.chain) == "wBYFXZt"
    assert str(edit("side Y", scene).machine.chain) == "wBFYXZt"
    for axis in ("B", "Y", "Z"):
        scene = edit(f"remove {axis}", scene)
    with pytest.raises(ChainError, match="no axis"):
        edit("remove X", scene)


def tool_point(scene, **at):
    return nominal_point(scene.model, Loop.TOOL, complete_coordinates(scene.machine, at))


def test_an_offset_moves_the_tool_point_and_a_rotation_turns_what_stands_behind_it():
    moved = tool_point(edit("offset Y 2 150")) - tool_point(PLAIN)
    np.testing.assert_allclose(moved, [0.0, 0.0, 150.0], atol=1e-9)
    for frame in ("S", "t", "w", "B"):
        assert edit(f"offset {frame} 0 12.5") != PLAIN
    turned = edit("rotation X 2 90")
    along = tool_point(turned, X=100.0) - tool_point(turned, X=0.0)
    np.testing.assert_allclose(along, [0.0, 100.0, 0.0], atol=1e-9)
    fixed = {"S": (0.0, 0.0, 5.0), "t": (0.0, 30.0, 0.0)}
    assert edit("rotation t 1 30°").machine.fixed_deg == fixed
    assert edit("rotation S 2 0").machine.fixed_deg == {}


def test_a_travel_a_direction_and_bodies_that_stay_as_long_as_the_frames_do():
    scene = edit("travel X 1 150 mm")
    assert (scene.machine.axes["X"].travel, scene.workspace) == ((-300.0, 150.0), PLAIN.workspace)
    assert any("reaches beyond the travel" in note for note in scene.notes)
    assert edit("volume Z 0 50").workspace.ranges["Z"] == (50.0, 50.0)
    assert edit("turn B").machine.axes["B"].direction == -1
    scene = load_scene("dvf5000_first")
    own = scene.machine.body_dir
    assert own
    assert edit("travel X 1 400", scene).machine.body_dir == own
    moved = edit("offset X 0 1", scene).machine
    named = (moved.body_dir, moved.name, moved.title)
    assert named == ("", scene.name, f"Machine {moved.chain}")


AXES = st.sampled_from(("X", "Y", "Z", "A", "B", "C", "C1", "U", "W", "S", "t", "w"))
AXIS_WORDS = st.sampled_from(
    ("left", "right", "side", "remove", "turn", "gantry", "across", "mesh")
)
NUMBER_WORDS = st.sampled_from(("offset", "rotation", "travel", "volume", "span"))
NUMBERS = st.floats(allow_nan=True, allow_infinity=True) | st.integers(-400, 400)
SIDES = st.lists(AXES, max_size=3).map("".join)
WORDS = st.one_of(
    st.builds("chain w{}F{}t".format, SIDES, SIDES),
    st.builds("{} {}".format, AXIS_WORDS, AXES),
    st.builds("{} {} {} {!r}".format, NUMBER_WORDS, AXES, st.integers(0, 2), NUMBERS),
    st.just("sizes"),
)
SCENES = st.just(PLAIN) | st.sampled_from(scene_names()).map(load_scene)


@given(SCENES, st.lists(WORDS, min_size=1, max_size=6))
def test_whatever_is_done_gives_a_scene_that_reads_back_or_leaves_the_old_one(scene, words):
    for word in words:
        try:
            scene = edit(word, scene)
        except WarpspaceError:
            continue
