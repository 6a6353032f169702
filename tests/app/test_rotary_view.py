"""The drawing of the rotary axes: what it shows, against closed forms, and its playback."""

import time
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from app.parts import LIVE, Alone, lone_part
from warpspace.app.browser import actions as do
from warpspace.app.documents import legend
from warpspace.app.drawing.around import draw_surroundings
from warpspace.app.drawing.box import box
from warpspace.app.drawing.labels import axis_labels, point_labels
from warpspace.app.drawing.moving import MovingLayer
from warpspace.app.evaluation.compare import with_pin
from warpspace.app.evaluation.machine_bodies import played_angle, played_position
from warpspace.app.panels.error_list import _gains
from warpspace.app.panels.overlay import ControlsPanel, HeadPanel, OrderPanel
from warpspace.app.panels.playback import PlaybackPanel
from warpspace.app.state.app_state import start_state
from warpspace.app.state.tree import put
from warpspace.machine.axes import parameter
from warpspace.scene.library import load_scene

FIRST = load_scene("dvf5000_first")
START = start_state(FIRST, nodes=5)
ROTARY = put(START.zeroed(), "look.drawing", "rotary")


class Stage:
    """A stage that records what the bar asks of it."""

    def __init__(self):
        self.followers, self.position, self.playing, self.axis = {}, {}, False, None
        self.speed_deg_s, self.asked, self.sample = 30.0, [], None

    def play(self, on, axis=None):
        self.asked.append(("play", on, axis))
        self.playing, self.axis = bool(on), axis

    def scrub_program(self, sample):
        self.asked.append(("program", sample))
        self.sample = sample

    def scrub(self, axis, at_deg):
        self.asked.append(("scrub", axis, at_deg))
        self.position = {**self.position, axis: at_deg}


def test_a_tilt_of_c_moves_the_traces_by_its_angle_and_their_height():
    """A rotation of 20 µrad about y moves (x, y, z) by 20e-6 · (z, 0, −x), seen in its table."""
    picture = LIVE.evaluate(ROTARY.with_amplitude("EB0C", 20.0))
    (point,) = [p for p, name in picture.traced_points.items() if name == "P1"]
    of = picture.traces[0]
    number = next(
        i for i, t in enumerate(of.group.traces) if t.axis == "C" and t.point_mm == point
        and t.at["B"] == 0.0
    )  # fmt: skip
    x, _, z = of.group.nominal_mm[number].T
    assert np.ptp(z) < 1e-9
    assert np.allclose(of.error_um[number][:, 2], -0.020 * x, atol=1e-9)
    assert np.allclose(of.error_um[number][:, 0], of.error_um[number][0, 0], atol=1e-9)


def test_the_heading_the_legend_and_the_colours_are_those_of_the_traces():
    picture = LIVE.evaluate(ROTARY.with_amplitude("EB0C", 20.0))
    norms = np.concatenate(
        [np.linalg.norm(of.error_um, axis=-1).reshape(-1) for of in picture.traces]
    )
    assert legend.largest_words(picture) == f"Rotary errors up to {norms.max():.1f} µm"
    words = f"traces: mean {norms.mean():.1f} µm · max {norms.max():.1f} µm"
    assert legend.numbers_words(picture) == words
    assert legend.marked(picture) == pytest.approx({"mean": norms.mean(), "max": norms.max()})
    assert picture.scale.high >= norms.max() > 0.4 * picture.scale.high
    assert "P2 over C at B −30°" in legend.place_words(picture)
    assert "P1 (275, 0, 0) mm, P2 (0, 275, 450) mm" in legend.place_words(picture)
    part = lone_part(OrderPanel)
    assert part.render(picture)["head.cause"] == (
        ", mostly because of the orientation of C about y"
    )


def test_it_has_its_own_exaggeration():
    loud = replace(START, amplitudes={**START.amplitudes, "EB0C": 2.0})
    volume, rotary = (
        LIVE.evaluate(put(loud, "look.drawing", drawing)) for drawing in ("volume", "rotary")
    )
    assert rotary.exaggeration > volume.exaggeration
    fixed = put(put(loud, "exaggeration", "700"), "look.drawing", "rotary")
    assert LIVE.evaluate(fixed).exaggeration == 700.0


def test_the_volume_is_hidden_and_all_traces_are_drawn():
    picture = LIVE.evaluate(ROTARY.with_amplitude("EXC", 5.0))
    assert box(picture) == {}
    assert axis_labels(picture) == []
    shapes = draw_surroundings(picture)
    assert set(shapes) == {"/rotary/nominal", "/rotary/actual"}
    assert len(point_labels(picture)) == len(picture.moved_traces) > 0
    plain = LIVE.evaluate(put(ROTARY, "look.drawing", "volume"))
    assert box(plain)


def test_without_rotary_errors_the_nominal_circles_are_drawn_and_it_says_why():
    picture = LIVE.evaluate(ROTARY)
    assert set(draw_surroundings(picture)) == {"/rotary/nominal"}
    html = lone_part(HeadPanel).render(picture)["head"]
    assert "No rotary errors" in html
    assert "the dashed circles are nominal" in html


def test_a_machine_without_rotary_axes_has_no_switch():
    mill = start_state(load_scene("machine_gantry_mill"), nodes=5)
    state = put(mill, "look.drawing", "rotary")
    assert not state.shows_rotary
    assert box(LIVE.evaluate(state))


def test_the_switch_opens_the_polar_plots():
    part = Alone(ControlsPanel, START).part
    state = part.handle(START, do.ShowDrawing("rotary"))
    assert state.shows_rotary
    assert state.page.task == "machine"
    assert "rotary" in state.page.open
    assert not part.handle(state, do.ShowDrawing("volume")).shows_rotary


def test_a_change_of_a_rotary_error_offers_the_drawing():
    part = lone_part(HeadPanel)
    changed = put(START, "page.row", "EB0C")
    assert "C is a rotary axis" in part.render(LIVE.evaluate(changed))["head"]
    for other in (put(START, "page.row", "EAX"), put(changed, "look.drawing", "rotary")):
        assert "is a rotary axis" not in part.render(LIVE.evaluate(other))["head"]


def test_the_effect_of_a_rotary_error_is_that_over_the_range_of_its_axis():
    """An error that turns with the table is as large at each of its positions."""
    picture = LIVE.evaluate(START)
    gains = _gains(picture)
    assert gains["EXC"] == pytest.approx(1.0, rel=1e-6)
    one = LIVE.evaluate(ROTARY.with_amplitude("EB0C", 1.0))
    volume = LIVE.evaluate(START.zeroed().with_amplitude("EB0C", 1.0))
    traced = np.sqrt((one.traced_um**2).sum(axis=1).mean())
    assert gains["EB0C"] == pytest.approx(max(traced, volume.statistics.rms_um), rel=1e-9)
    assert gains["EB0C"] >= traced > 0.1


@pytest.mark.parametrize(("axis", "at"), [("C", 140.0), ("B", -25.0), ("C", 0.0), ("B", 30.0)])
def test_play_begins_where_the_axis_was_scrubbed_to(axis, at):
    angle = played_angle(START, axis, at)
    assert played_position(START, angle, axis)[axis] == pytest.approx(at)


def test_the_bar_plays_pauses_scrubs_and_ignores_what_is_no_position():
    stage = Stage()
    bar = Alone(PlaybackPanel, ROTARY, stage=stage)
    bar.do(do.Input.PLAY("B"))
    bar.do(do.Input.PLAY("B"))
    bar.do(do.Input.PLAY())
    bar.do(do.Scrub("C", "140"))
    bar.do(do.Scrub("B", "1e9"))
    for hostile in ("nan", "<b>", "", "9" * 400):
        bar.do(do.Scrub("C", hostile))
    bar.do(do.Scrub("X", "5"))
    bar.do(do.Input.SET_SPEED("90"))
    bar.do(do.Input.SET_SPEED("inf"))
    bar.do(do.Signal.STOP_PLAYBACK)
    high = FIRST.machine.axes["B"].travel[1]
    top = FIRST.machine.axes["C"].travel[1]
    assert stage.asked == [
        ("play", True, "B"), ("play", False, "B"), ("play", True, "B"), ("scrub", "C", 140.0),
        ("scrub", "B", high), ("scrub", "C", top), ("play", None, None),
    ]  # fmt: skip
    assert stage.speed_deg_s == 90.0
    html = bar.part.render(LIVE.evaluate(ROTARY))["playback"]
    assert 'aria-label="Position of C"' in html
    volume = LIVE.evaluate(put(ROTARY, "look.drawing", "volume"))
    assert bar.part.render(volume)["playback"] == ""


PROGRAM_TEXT = "G21 G90 G54\nG0 X-200 Y0 Z-100\nG1 X200 F500\nG1 Y200\nM30\n"


def with_program():
    part = replace(START.part, program=PROGRAM_TEXT, program_name="a.nc")
    return replace(START, part=part)


def test_a_program_is_played_to_its_worst_block_with_line_error_and_cause():
    state, stage = with_program(), Stage()
    picture = LIVE.evaluate(state)
    assert picture.path is not None
    bar = Alone(PlaybackPanel, state, stage=stage)
    assert 'aria-label="Position in the program"' in bar.part.render(picture)["playback"]
    bar.do(do.Signal.SHOW_WORST_BLOCK)
    lengths = np.linalg.norm(picture.path.error_um, axis=1)
    assert stage.asked == [("play", False, None), ("program", int(np.argmax(lengths)))]
    html = bar.part.render(picture)["playback"]
    line = int(picture.path.of.line[np.argmax(lengths)])
    assert f"line {line}</span>" in html
    assert PROGRAM_TEXT.splitlines()[line - 1] in html
    assert f"{lengths.max():.1f} µm, " in html
    assert " because " in html
    bar.do(do.Scrub("program", "3"))
    bar.do(do.Scrub("program", "99999999"))
    bar.do(do.Scrub("program", "<b>"))
    bar.do(do.Input.PLAY("program"))
    assert stage.asked[2:] == [("program", 3), ("play", True, "program")]


def test_the_cause_of_a_sample_is_that_of_the_explanation_of_its_point():
    state = with_program()
    picture = LIVE.evaluate(state)
    path = picture.path
    sample = int(np.argmax(np.linalg.norm(path.error_um, axis=1)))
    values = state.amplitudes
    effects = {}
    for key, value in values.items():
        without = LIVE.evaluate(replace(state, amplitudes={**values, key: 0.0})).path
        effects[key] = float(
            (path.error_um[sample] - without.error_um[sample]) @ path.error_um[sample]
        )
        assert value or not effects[key]
    first = max(effects, key=lambda key: abs(effects[key]))
    bar = Alone(PlaybackPanel, state, stage=Stage())
    bar.do(do.Signal.SHOW_WORST_BLOCK)
    assert f"because {parameter(first).cause}" in bar.part.render(picture)["playback"]


def test_the_stage_moves_the_machine_along_the_program():
    """The layer with a client that draws nothing."""
    state = with_program()
    picture = LIVE.evaluate(state)
    stage = MovingLayer.__new__(MovingLayer)
    stage._picture, stage.followers, stage.sample, stage._turned_at = picture, {}, None, None
    stage.axis, stage.speed_deg_s, stage.position, stage._turned_deg = None, 30.0, {}, 0.0
    stage._client = SimpleNamespace(atomic=nullcontext)
    stage._turning = SimpleNamespace(draw=lambda shapes: None)
    stage.play(True, "program")
    stage._turned_at -= 0.4  # of the 20 s of a program
    stage.turn()
    count = len(picture.path.of.line)
    assert 0.01 * count < stage.sample < 0.05 * count + 1.0
    assert stage.position == picture.path.of.axes_at(int(stage.sample))
    stage.scrub_program(1e9)
    assert stage.sample == count - 1
    stage._turned_at = time.monotonic() - 0.4
    stage.turn()
    assert not stage.playing
    stage.play(None)
    assert (stage.sample, stage.position) == (None, {})


def test_a_comparison_of_rotary_errors_shows_their_change():
    before = with_pin(ROTARY.with_amplitude("EXC", 4.0))
    state = put(before.with_amplitude("EXC", 10.0), "comparison.shown", "difference")
    picture = LIVE.evaluate(state)
    assert picture.is_difference
    assert np.linalg.norm(picture.traced_um, axis=1).max() == pytest.approx(6.0)
    assert legend.largest_words(picture) == "Change of rotary errors up to 6.0 µm"
    assert picture.scale.high == pytest.approx(6.0, abs=2.0)
    assert set(draw_surroundings(picture)) == {"/rotary/nominal", "/rotary/actual"}
    a, b = (LIVE.evaluate(put(state, "comparison.shown", side)) for side in "ab")
    assert a.scale == b.scale
    assert a.exaggeration == b.exaggeration == picture.exaggeration
