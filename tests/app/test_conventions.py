"""Conventions: every choice is applied, measured against the scene's own, said, kept and undone."""

from dataclasses import replace

import numpy as np
import pytest

from app.parts import lone_part
from warpspace.analysis.commands.adjust import apply_adjustments
from warpspace.analysis.convention_costs import convention_costs
from warpspace.app.browser import actions as do
from warpspace.app.documents.legend import order_conditions, picture_conditions, subject_words
from warpspace.app.documents.scene_file import open_text, state_to_toml
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.panels import conventions
from warpspace.app.state.app_state import Picked, start_state
from warpspace.app.state.tree import put
from warpspace.field.evaluate import View
from warpspace.field.grid import Workspace
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.axes import TravelDirection
from warpspace.machine.definition import build_machine
from warpspace.machine.errors import Constant, ErrorSet, Ramp, TableCurve
from warpspace.picture.map_mesh import edge_pieces
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.model import Scene, evaluate

LIVE = LiveModel()
START = start_state(load_scene("dvf5000_first"), nodes=7)
WEIGHTS = LIVE.evaluate(START).grid.weights


@pytest.mark.parametrize("choice", conventions.choices(START.scene))
def test_every_choice_can_be_made_and_measures_its_change(choice):
    state = conventions.with_choice(START, choice)
    assert choice in conventions.chosen(state.scene)
    mean_um, max_um = conventions.effects_of(START)[choice]
    change = LIVE.evaluate(state).field.error_um - LIVE.evaluate(START).field.error_um
    length = np.linalg.norm(change, axis=-1)
    assert mean_um == pytest.approx(float((WEIGHTS * length).sum()), abs=1e-9)
    assert max_um == pytest.approx(float(length.max()), abs=1e-9)
    # the loop is no choice of this list: it is that of the drawing
    in_all = conventions.effects_of(replace(state, loop=Loop.TOOL))["all"]
    assert in_all == pytest.approx((mean_um, max_um))
    assert conventions.effects_of(replace(START, loop=Loop.RELATIVE))["all"] == (0.0, 0.0)


def test_the_section_offers_what_is_in_force_and_holds_the_point_that_is_picked():
    section = lone_part(conventions.ConventionsSection)
    text = section.body(LIVE.evaluate(START))
    assert 'value="component_errors=after_motion" checked' in text
    assert "before motion" in text
    state = section.handle(START, do.Input.CHOOSE_CONVENTION("reference=point"))
    state = section.handle(state, do.Input.SET_REFERENCE("X 100,5 mm"))
    assert state.scene.reference["X"] == 100.5
    assert 'value="X 100.5 Y ' in section.body(LIVE.evaluate(state))
    refused = section.handle(state, do.Input.SET_REFERENCE("<b>"))
    assert "expected axis positions" in refused.notes[-1]
    clicked = replace(state, picked=Picked({"X": 0.0, "Y": 10.0, "Z": -280.0}))
    state_there = section.handle(clicked, do.Signal.USE_PICKED_REFERENCE)
    assert state_there.scene.reference == clicked.picked.at
    assert "disabled" in section.body(LIVE.evaluate(state))
    assert section.handle(state, do.Signal.RESET_CONVENTIONS).scene is START.scene
    for word in ("", "direction Q=1", "direction C=2", "reference=<b>", "x" * 500):
        assert section.handle(START, do.Input.CHOOSE_CONVENTION(word)) is START


def test_a_reference_is_held_still_clamped_and_taken_back():
    state = conventions.with_reference(START, {"X": 0.0, "Y": 0.0, "Z": -280.0})
    picture = LIVE.evaluate(state)
    assert np.abs(picture.field.error_um[3, 3, 3]).max() < 1e-9
    assert conventions.with_own_conventions(state) == START
    wild = conventions.with_reference(START, {"X": 1e9, "Y": float("nan")})
    assert wild.scene.reference["X"] == 275.0
    assert wild.scene.reference["Y"] == 0.0
    assert len(wild.notes) == 2


def test_lines_stay_on_the_outside_of_a_mirrored_volume():
    picture = LIVE.evaluate(conventions.with_choice(START.zeroed(), "direction X=-1"))
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
    state = conventions.with_travel(TWO, way)
    picture = LIVE.evaluate(state)
    words = "reversal" if way == "difference" else {"mean": "mean of both"}.get(way, way)
    assert any(words in said for said in subject_words(picture))
    assert words in picture_conditions(picture)[0]
    at_end = {"mean": 2.5, "forward": 3.0, "backward": 2.0, "difference": 1.0}
    assert picture.field.error_um[-1, 0, 0, 1] == pytest.approx(at_end[way])
    back, _ = open_text(state_to_toml(state), "two_ways", "x.toml")
    assert back.scene.model.direction == way
    assert conventions.with_own_conventions(state).scene == TWO_WAYS


def test_readings_and_uncertainties_are_saved_with_what_is_changed():
    changed = TWO.with_amplitude("EYX", 6.0)
    back, _ = open_text(state_to_toml(changed), "two_ways", "x.toml")
    assert back.scene.measured == TWO_WAYS.measured
    assert back.scene.uncertainty == TWO_WAYS.uncertainty
    assert changed.reset().scene == TWO_WAYS


WORDS = "placement of the workpiece fitted out"
SECOND = load_scene("dvf5000_second")
PLACED = replace(replace(start_state(SECOND), placed=True, nodes=5), loop=Loop("relative"))


@pytest.mark.parametrize("at", [{}, {"C": "90", "B": "-40"}])
def test_the_drawn_field_is_that_of_the_command_wherever_the_axes_stand(at):
    state = PLACED.with_amplitude("EXX", 7.0).with_amplitude("EAY", 10.0)
    for axis, angle in at.items():
        state = put(state, f"positions.{axis}", angle)
    picture = LIVE.evaluate(state)
    wanted = evaluate(state.resulting_scene(), grid=5, loop="relative", placed=True)
    np.testing.assert_allclose(picture.field.error_um, wanted.error_um, atol=1e-9)
    loose = LIVE.evaluate(replace(state, placed=False))
    assert picture.statistics.rms_um < 0.5 * loose.statistics.rms_um
    assert WORDS in picture_conditions(picture)
    assert WORDS not in picture_conditions(LIVE.evaluate(replace(state, loop=Loop("tool"))))


def test_the_heading_and_files_say_when_the_first_order_is_not_enough():
    assert order_conditions(LIVE.evaluate(START)) == ()
    large = start_state(apply_adjustments(START.scene, {"EC0Y": 3000.0, "EA0Z": 3000.0}))
    picture = LIVE.evaluate(large)
    (words,) = order_conditions(picture)
    assert words.startswith("first order; the exact chain differs by up to")
    assert words in picture_conditions(picture)
    # what is excluded does not count
    assert order_conditions(LIVE.evaluate(put(large, "exclusions.excluded", "EC0Y,EA0Z"))) == ()


# --- What data in a wrong convention would cost ---------------------------------------------------

SPAN = (-100.0, 100.0)
VOLUME = Workspace({"X": SPAN, "Y": (0.0, 0.0), "Z": (0.0, 0.0)})


@pytest.mark.parametrize(
    ("key", "curve", "cost", "free"),
    [
        ("EBX", Constant(SPAN, 10.0), {"measuring_line": 3.0}, "squareness=over_90"),
        # a sign counts twice
        ("EB0Z", Constant(SPAN, 10.0), {"squareness=over_90": 6.0}, "squareness=under_90"),
        ("EA0Z", Constant(SPAN, 10.0), {"squareness=under_90": 6.0}, "squareness=over_90"),
        # a tilt is lost with the reference line
        ("EYX", TableCurve(SPAN, ((-100.0, 0.0), (100.0, 8.0))),
         dict.fromkeys(("end_point", "least_squares", "minimum_zone"), 4.0), "measuring_line"),
        ("EXX", Ramp(SPAN, 6.0), {"zero_at": 3.0}, "end_point"),
    ],
)  # fmt: skip
def test_costs_by_hand(key, curve, cost, free):
    machine = build_machine("wFXYZt", offset_mm={"t": (0.0, 0.0, -300.0)})
    scene = Scene("own", "", Model(machine), VOLUME, ErrorSet({key: curve}))
    found = convention_costs(scene, View())
    largest = 2.0 if key == "EYX" else 1.0  # a tilt about the middle is largest at the ends
    for name, mean in cost.items():
        assert found[name] == pytest.approx((mean, largest * mean))
    assert found[free] == pytest.approx((0.0, 0.0))
