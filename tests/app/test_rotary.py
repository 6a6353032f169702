"""Positions of the axes, and how traced points run round rotary ones."""

from dataclasses import replace
from types import SimpleNamespace

from app.parts import LIVE, body_of, lone_part
from warpspace.app.state.app_state import start_state
from warpspace.app.state.edits import with_curve
from warpspace.app.state.tree import put
from warpspace.app.tasks.machine import PositionsSection, RotarySection
from warpspace.machine.errors import Constant, Ramp
from warpspace.scene.library import load_scene

STATE = start_state(load_scene("dvf5000_first"), nodes=5)


def test_every_axis_has_a_slider_whose_event_moves_it():
    moved = put(put(STATE, "positions.B", "-30"), "machine.linear_mm.X", "100")
    text = body_of(PositionsSection, moved)
    assert text.count('type="range"') == 5
    assert 'value="-30"' in text
    assert "Tool point: axes X 100 " in text


def test_traces_are_drawn_in_numbers_where_an_error_moves_them():
    assert "No error moves the traced points" in body_of(RotarySection, STATE)
    rising = Ramp(STATE.axis_span("EZC"), 8.0)  # by hand: 8 µm higher after a turn
    state = with_curve(STATE, "EZC", rising)
    text = body_of(RotarySection, state)
    assert text.count("<svg") == 3
    assert "8.00 µm" in text
    located = with_curve(STATE, "EX0C", Constant(rising.span, 6.0))
    text = body_of(RotarySection, located.with_amplitude("EA0C", 20.0))
    for head, unit in (("displaced", "µm"), ("inclined", "µrad"), ("radial", "µm")):
        assert f"<th>{head} <small>{unit}</small></th>" in text
    # by hand: 450 mm above the table, 20 µrad add 9 µm across to 6 µm
    row = ("275.0", "10.82", "20.00", "21.63 /\u00a00.00", "0.00 /\u00a00.00", "40.00 /\u00a00.00")
    name = "C at B 0°, point (0, 275, 450) mm"
    assert f"{name}</td></tr><tr><td>{'</td><td>'.join(row)}</td>" in text
    hidden = body_of(RotarySection, put(state, "shown.traces", "0"))
    assert "Draw the traces" in hidden
    assert "<svg" not in hidden
    mill = start_state(load_scene("machine_c_frame_mill"))
    assert "no rotary axis" in body_of(RotarySection, mill)


def test_a_table_that_is_paused_can_stand_there_and_axes_be_held_at_quarters():
    section = lone_part(RotarySection)
    state = replace(STATE, page=replace(STATE.page, task="machine", open=frozenset({"rotary"})))
    section.context.stage = SimpleNamespace(playing=False, position={"C": 89.7})
    text = section.body(LIVE.evaluate(state))
    assert 'data-do="state:set.positions.C" data-value="90"' in text
    assert 'data-do="state:set.rotary.held.C" data-value="0,90,180,270"' in text
    assert 'data-do="state:set.rotary.off" data-value="+1"' in text
