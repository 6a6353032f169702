"""Conventions: every choice is applied, measured against the scene's own, said, kept and undone."""

from dataclasses import replace

import numpy as np
import pytest

from app.parts import lone_part
from warpspace.analysis.repair import repaired
from warpspace.app.documents.files import shown_sides
from warpspace.app.documents.legend import order_conditions, picture_conditions, subject_words
from warpspace.app.documents.scene_file import (
    open_text,
    settings_line,
    state_to_toml,
    with_settings,
)
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.state.app_state import Picked, start_state
from warpspace.app.state.tree import put
from warpspace.app.tasks.conventions import (
    ConventionsSection,
    choices,
    chosen,
    effects_of,
    with_choice,
    with_own_conventions,
    with_reference,
    with_travel,
)
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import TravelDirection
from warpspace.picture.mesh import edge_pieces
from warpspace.picture.model import evaluate_picture
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.model import evaluate
from warpspace.scene.save import scene_to_toml

LIVE = LiveModel()
START = start_state(load_scene("dvf5000_first"), nodes=7)
WEIGHTS = LIVE.evaluate(START).grid.weights


@pytest.mark.parametrize("choice", choices(START.scene))
def test_every_choice_can_be_made_and_measures_its_change(choice):
    state = with_choice(START, choice)
    assert choice in chosen(state.scene)
    mean_um, max_um = effects_of(START)[choice]
    change = LIVE.evaluate(state).field.error_um - LIVE.evaluate(START).field.error_um
    length = np.linalg.norm(change, axis=-1)
    assert mean_um == pytest.approx(float((WEIGHTS * length).sum()), abs=1e-9)
    assert max_um == pytest.approx(float(length.max()), abs=1e-9)


def test_the_section_offers_what_is_in_force_and_holds_the_point_that_is_picked():
    section = lone_part(ConventionsSection)
    text = section.body(LIVE.evaluate(START))
    assert 'value="component_errors=after_motion" checked' in text
    assert "before motion" in text
    state = section.take(START, "choose", "reference=point")
    state = section.take(state, "set.reference", "X 100,5 mm")
    assert state.scene.reference["X"] == 100.5
    assert 'value="X 100.5 Y ' in section.body(LIVE.evaluate(state))
    assert "expected positions" in section.take(state, "set.reference", "<b>").notes[-1]
    clicked = replace(state, picked=Picked({"X": 0.0, "Y": 10.0, "Z": -280.0}))
    assert section.take(clicked, "pick", "").scene.reference == clicked.picked.at
    assert "disabled" in section.body(LIVE.evaluate(state))
    assert section.take(state, "own", "").scene is START.scene
    assert section.take(START, "set.Q", "<b>") is START


def test_nonsense_changes_nothing():
    for word in ("", "direction Q=1", "direction C=2", "reference=<b>", "x" * 500):
        assert with_choice(START, word) is START


def test_a_reference_is_held_still_clamped_and_taken_back():
    state = with_reference(START, {"X": 0.0, "Y": 0.0, "Z": -280.0})
    picture = LIVE.evaluate(state)
    assert np.abs(picture.field.error_um[3, 3, 3]).max() < 1e-9
    assert with_own_conventions(state) == START
    wild = with_reference(START, {"X": 1e9, "Y": float("nan")})
    assert wild.scene.reference["X"] == 275.0
    assert wild.scene.reference["Y"] == 0.0
    assert len(wild.notes) == 2


def test_lines_stay_on_the_outside_of_a_mirrored_volume():
    picture = LIVE.evaluate(with_choice(START.zeroed(), "direction X=-1"))
    lines, nodes = edge_pieces(picture).reshape(-1, 3), picture.grid.nominal_mm.reshape(-1, 3)
    assert (lines.max(axis=0) > nodes.max(axis=0)).all()
    assert (lines.min(axis=0) < nodes.min(axis=0)).all()


TWO_WAYS = parse_scene(
    """title = "two ways"
machine = "dvf5000"
[workspace]
X = [-275, 275]
Y = [-225, 225]
Z = [-480, -80]
[errors]
EXX = { table2 = { axes = ["X", "Z"], X = [-275, 275], Z = [-480, -80], values = [
  [0, 4], [3, 9]] } }
EYX = { forward = { table = [[-275, 1], [275, 3]] }, backward = { ramp = 2 } }
[uncertainty]
EYX = 0.4
[measured.EYX]
runs = [
  { direction = "+", points = [[-275, 1.1], [0, 2], [0, 2.2]] },
  { direction = "-", points = [[0, 1]] },
]
""",
    "two_ways",
)
TWO = start_state(TWO_WAYS, nodes=5)


@pytest.mark.parametrize("way", TravelDirection)
def test_the_box_the_heading_and_files_have_the_direction(way):
    state = with_travel(TWO, way)
    picture = LIVE.evaluate(state)
    words = "reversal" if way == "difference" else {"mean": "mean of both"}.get(way, way)
    assert any(words in said for said in subject_words(picture))
    assert words in picture_conditions(picture)[0]
    shares = {"mean": 3.25, "forward": 3.0, "backward": 2.0, "difference": 1.0}
    at_end = float(picture.field.error_um[-1, 0, 0, 1])
    assert at_end == pytest.approx(2.5 if way == "mean" else shares[way])
    back, _ = open_text(state_to_toml(state), "two_ways", "x.toml")
    assert back.scene.model.direction == way
    assert with_own_conventions(state).scene == TWO_WAYS


def test_readings_and_uncertainties_are_saved_with_what_is_changed():
    changed = TWO.with_amplitude("EYX", 6.0)
    back, _ = open_text(state_to_toml(changed), "two_ways", "x.toml")
    assert back.scene.measured == TWO_WAYS.measured
    assert back.scene.uncertainty == TWO_WAYS.uncertainty
    assert changed.reset().scene == TWO_WAYS


WORDS = "placement of the workpiece fitted out"
SECOND = load_scene("dvf5000_second")
PLACED = replace(replace(start_state(SECOND), placed=True, nodes=5), loop=Loop("relative"))


def test_the_drawn_field_is_that_of_the_command():
    picture = LIVE.evaluate(PLACED)
    wanted = evaluate(SECOND, grid=5, loop="relative", placed=True)
    np.testing.assert_allclose(picture.field.error_um, wanted.error_um, atol=1e-9)
    assert (
        picture.statistics.rms_um
        < 0.5 * LIVE.evaluate(replace(PLACED, placed=False)).statistics.rms_um
    )
    assert WORDS in picture_conditions(picture)
    assert WORDS not in picture_conditions(LIVE.evaluate(replace(PLACED, loop=Loop("tool"))))


def test_files_and_links_keep_it():
    assert "placed=1" in settings_line(PLACED)
    assert with_settings(start_state(SECOND), settings_line(PLACED)).placed
    scene = PLACED.resulting_scene()
    assert start_state(parse_scene(scene_to_toml(scene), "x")).placed
    (shown,) = shown_sides(LIVE.evaluate(PLACED))
    exported = evaluate_picture(shown.active_scene(), grid=PLACED.nodes, loop=shown.loop)
    np.testing.assert_allclose(
        exported.field.error_um, LIVE.evaluate(PLACED).field.error_um, atol=1e-9
    )
    assert WORDS in exported.conditions


def test_turned_axes_carry_the_volume_that_is_fitted():
    turned = put(put(PLACED, "positions.C", "90"), "positions.B", "-40")
    shown, exported = (
        LIVE.evaluate(turned),
        evaluate(turned.resulting_scene(), grid=5, loop="relative"),
    )
    np.testing.assert_allclose(shown.field.error_um, exported.error_um, atol=1e-9)


def test_the_heading_and_files_say_when_the_first_order_is_not_enough():
    measured = load_scene("dvf5000_first")
    assert order_conditions(LIVE.evaluate(start_state(measured))) == ()
    large = start_state(repaired(measured, {"EC0Y": 3000.0, "EA0Z": 3000.0}))
    picture = LIVE.evaluate(large)
    (words,) = order_conditions(picture)
    assert words.startswith("first order; the exact chain differs by up to")
    assert words in picture_conditions(picture)
    # what is excluded does not count
    excluded = replace(large.exclusions, excluded=frozenset({"EC0Y", "EA0Z"}))
    assert order_conditions(LIVE.evaluate(replace(large, exclusions=excluded))) == ()
