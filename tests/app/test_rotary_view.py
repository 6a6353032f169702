"""The drawing of the rotary axes: what it shows, against closed forms, and its playback."""

from dataclasses import replace

import numpy as np
import pytest

from app.parts import LIVE, Alone, lone_part
from warpspace.app.browser import actions as do
from warpspace.app.browser.html import attributes
from warpspace.app.documents import legend
from warpspace.app.drawing.around import draw_surroundings
from warpspace.app.drawing.box import box
from warpspace.app.drawing.labels import axis_labels, point_labels
from warpspace.app.evaluation.compare import TRACES_DIFFER, with_pin
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


def test_the_bar_plays_pauses_scrubs_and_ignores_what_is_no_position():
    bar = Alone(PlaybackPanel, ROTARY)
    player = bar.context.player
    bar.do(do.Input.PLAY("B"))
    assert player.playing == "B"
    bar.do(do.Input.PLAY("B"))
    assert player.playing == ""
    bar.do(do.Input.PLAY())
    assert player.playing == "B"
    bar.do(do.Scrub("C", "140"))
    assert player.playing == ""
    assert player.at["C"] == 140.0
    bar.do(do.Scrub("B", "1e9"))
    assert player.at["B"] == FIRST.machine.axes["B"].travel[1]
    at = dict(player.at)
    for hostile in ("nan", "<b>", "", "9" * 400):
        bar.do(do.Scrub("B", hostile))
    for action in (do.Scrub("X", "5"), do.Input.SET_SPEED("inf"), do.Input.CHOOSE_TRACK("<b>")):
        bar.do(action)
    bar.do(do.Input.CHOOSE_TRACK("story"))
    assert player.at == {**at, "B": FIRST.machine.axes["B"].travel[1]}
    assert player.speed == 1.0
    bar.do(do.Input.SET_SPEED("3"))
    assert player.speed == 3.0
    html = bar.part.render(LIVE.evaluate(ROTARY))["playback"]
    assert 'aria-label="Position of C"' in html
    assert ">90 °/s</option>" in html
    bar.do(do.Signal.STOP_PLAYBACK)
    assert (player.at, player.playing) == ({}, "")
    volume = Alone(PlaybackPanel, put(ROTARY, "look.drawing", "volume"))
    assert volume.part.render(volume.context.picture)["playback"] == ""


def test_a_paused_axis_can_be_moved_to_its_position():
    bar = Alone(PlaybackPanel, ROTARY)
    for name, at in (("C", "89.7"), ("B", "-25")):
        assert f"positions.{name}" not in bar.part.render(bar.context.picture)["playback"]
        bar.do(do.Scrub(name, at))
    html = bar.part.render(bar.context.picture)["playback"]
    for name, at in (("C", "90"), ("B", "-25")):
        assert attributes(data_do=do.SetLeaf(f"positions.{name}", at)) in html
    bar.do(do.Input.PLAY("C"))
    assert "Move axes here" not in bar.part.render(bar.context.picture)["playback"]


def test_the_exaggeration_is_played_where_nothing_else_is_drawn_that_plays():
    bar = Alone(PlaybackPanel, START)
    player, factor = bar.context.player, bar.context.picture.exaggeration
    bar.do(do.Input.PLAY())  # P
    assert player.playing == "exaggeration"
    assert player.at["exaggeration"] == 1.0  # from true scale
    bar.do(do.Scrub("exaggeration", "1"))  # the slider is logarithmic
    assert player.at["exaggeration"] == pytest.approx(10.0)
    html = bar.part.render(bar.context.picture)["playback"]
    assert "<span>×10</span>" in html
    assert f'max="{np.log10(factor):g}"' in html
    assert '<option value="C">' in html
    assert attributes(data_do=do.SaveAnimation("exaggeration")) in html
    assert attributes(data_do=do.SaveAnimation("exaggeration", ".mp4")) in html
    bar.do(do.Input.CHOOSE_TRACK("C"))
    html = bar.part.render(bar.context.picture)["playback"]
    assert 'aria-label="Position of C"' in html
    assert 'aria-label="Position of the exaggeration"' not in html
    assert attributes(data_do=do.SaveAnimation("rotation")) in html
    traces = Alone(PlaybackPanel, ROTARY.with_amplitude("EB0C", 20.0))
    traces.do(do.Input.CHOOSE_TRACK("exaggeration"))  # an animation of it shows the volume
    assert "SaveAnimation" not in traces.part.render(traces.context.picture)["playback"]
    zero = Alone(PlaybackPanel, START.zeroed())
    zero.do(do.Input.PLAY())
    assert zero.context.player.playing == ""


PROGRAM_TEXT = "G21 G90 G54\nG0 X-200 Y0 Z-100\nG1 X200 F500\nG1 Y200\nM30\n"


def with_program():
    part = replace(START.part, program=PROGRAM_TEXT, program_name="a.nc")
    return replace(START, part=part)


def test_a_program_is_played_to_its_worst_block_with_line_error_and_cause():
    bar = Alone(PlaybackPanel, with_program())
    picture, player = bar.context.picture, bar.context.player
    assert picture.path is not None
    assert 'aria-label="Position of the program"' in bar.part.render(picture)["playback"]
    bar.do(do.Signal.SHOW_WORST_BLOCK)
    lengths = np.linalg.norm(picture.path.error_um, axis=1)
    assert player.step_of("program") == int(np.argmax(lengths))
    html = bar.part.render(picture)["playback"]
    assert attributes(data_do=do.SaveAnimation("program")) in html
    line = int(picture.path.of.line[np.argmax(lengths)])
    assert f"line {line}</span>" in html
    assert PROGRAM_TEXT.splitlines()[line - 1] in html
    assert f"{lengths.max():.1f} µm, " in html
    assert " because " in html
    bar.do(do.Scrub("program", "3"))
    assert player.step_of("program") == 3
    bar.do(do.Scrub("program", "99999999"))
    assert player.step_of("program") == len(lengths) - 1
    bar.do(do.Scrub("program", "<b>"))
    bar.do(do.Input.PLAY("program"))
    assert (player.playing, player.step_of("program")) == ("program", 0)  # again from the start


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
    bar = Alone(PlaybackPanel, state)
    bar.do(do.Signal.SHOW_WORST_BLOCK)
    assert f"because {parameter(first).cause}" in bar.part.render(picture)["playback"]


def test_traces_at_other_positions_have_no_difference_and_it_says_why():
    state = replace(with_pin(ROTARY.with_amplitude("EB0C", 20.0)), positions={"B": 30.0, "C": 10.0})
    picture = LIVE.evaluate(put(state, "comparison.shown", "difference"))
    assert picture.compared.refused == TRACES_DIFFER
    assert (picture.compared.view, picture.is_difference) == ("b", False)


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
