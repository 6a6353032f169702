"""The player, with a clock of the test: its tracks, their ends, and what stops them."""

from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import pytest

from app.parts import LIVE
from warpspace.app.drawing import moving
from warpspace.app.drawing.moving import MovingLayer
from warpspace.app.drawing.player import Player, find_tracks, whole_factor
from warpspace.app.evaluation.compare import with_pin
from warpspace.app.state.app_state import start_state
from warpspace.app.state.tree import put
from warpspace.scene.library import load_scene

FIRST = load_scene("dvf5000_first")
START = start_state(FIRST, nodes=5)
TEXT = "G21 G90 G54\nG0 X-200 Y0 Z-100\nG1 X200 F500\nG1 Y200\nM30\n"
PROGRAM = replace(START, part=replace(START.part, program=TEXT, program_name="a.nc"))


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


def player_of(state, n_steps=0):
    picture, clock = LIVE.evaluate(state), Clock()
    player = Player(lambda: find_tracks(picture, n_steps), clock)
    return player, clock


def after(player, clock, *seconds):
    for step in seconds:
        clock.now += step
        player.turn()
    return player.at


@pytest.mark.parametrize("start", [0.0, 140.0, 350.0])
def test_a_table_turns_from_where_it_is_at_its_speed(start):
    player, clock = player_of(START)
    player.move("C", start)
    player.play("C")
    assert player.at == {"C": start}
    assert after(player, clock, 0.25, 0.25)["C"] == pytest.approx((start + 15.0) % 360.0)
    player.speed = 3.0
    assert after(player, clock, 0.5)["C"] == pytest.approx((start + 60.0) % 360.0)
    player.pause()
    assert player.wait_s is None
    assert player.at["C"] == pytest.approx((start + 60.0) % 360.0)


def test_an_axis_without_full_rotation_swings_between_its_ends():
    low, high = FIRST.machine.axes["B"].travel
    player, clock = player_of(START)
    player.move("B", high - 5.0)
    player.play("B")
    assert after(player, clock, 0.5)["B"] == pytest.approx(high - 10.0)
    assert after(player, clock, 0.5)["B"] == pytest.approx(high - 25.0)
    player.move("B", high)
    player.play("B")  # not from its other end
    assert after(player, clock, 0.5)["B"] == pytest.approx(high - 15.0)
    seen = [after(player, clock, 0.5)["B"] for _ in range(40)]
    assert low <= min(seen) < low + 15.0
    assert high - 15.0 < max(seen) <= high


def test_the_exaggeration_goes_from_true_scale_to_its_factor_and_back():
    player, clock = player_of(START)
    top = LIVE.evaluate(START).exaggeration
    player.play("exaggeration")
    assert player.at == {"exaggeration": 1.0}
    seen = [after(player, clock, 0.5)["exaggeration"] for _ in range(8)]
    share = [round((factor - 1.0) / (top - 1.0), 9) for factor in seen]
    assert share == [0.25, 0.5, 0.75, 1.0, 0.75, 0.5, 0.25, 0.0]
    assert player.playing == "exaggeration"


def test_a_program_and_a_story_stop_at_their_ends():
    player, clock = player_of(PROGRAM, 3)
    count = len(LIVE.evaluate(PROGRAM).path.of.line)
    player.play("program")
    assert after(player, clock, 0.4)["program"] == pytest.approx(count * 0.02)
    player.move("program", 1e9)
    assert player.at["program"] == count - 1
    player.play("program")
    assert player.at["program"] == 0.0
    after(player, clock, *[0.5] * 40)
    assert (player.playing, player.at["program"]) == ("", count - 1)
    player.play("story")
    steps = [player.step_of("story")]
    while player.playing:
        after(player, clock, 0.5)
        steps.append(player.step_of("story"))
    assert steps == sorted(steps)
    assert [steps.count(0), steps.count(1)] == pytest.approx([12, 12], abs=1)
    assert steps[-1] == 2
    assert player.at["program"] == count - 1  # the drawing stays


def test_the_machine_follows_the_axes_or_the_program():
    player, _ = player_of(PROGRAM)
    player.move("C", 20.0)
    player.move("B", -5.0)
    assert player.angles_deg == {"C": 20.0, "B": -5.0}
    player.move("program", 2.0)
    assert player.at == {"program": 2.0}
    player.move("exaggeration", 10.0)
    player.move("C", 30.0)
    assert player.at == {"exaggeration": 10.0, "C": 30.0}
    player.move("nothing", 1.0)
    player.play("nothing")
    assert player.at == {"exaggeration": 10.0, "C": 30.0}


def test_another_state_drops_the_positions_that_are_not_of_it():
    for after_state, stays in (
        (replace(PROGRAM, page=replace(PROGRAM.page, task="machine")), ("C", "exaggeration")),
        (PROGRAM.with_amplitude("EXX", 3.0), ("C",)),
        (put(PROGRAM, "positions.C", "20"), ("exaggeration",)),
        (put(PROGRAM, "look.drawing", "rotary"), ()),
        (put(PROGRAM, "exaggeration", "50"), ("C",)),
    ):
        player, _ = player_of(PROGRAM)
        player.move("C", 20.0)
        player.play("exaggeration")
        player.follow(PROGRAM, after_state)
        assert tuple(player.at) == stays
        assert (player.playing == "exaggeration") == ("exaggeration" in stays)


def test_the_bar_of_another_drawing_begins_with_its_own_track():
    for after, chosen in ((put(PROGRAM, "look.drawing", "rotary"), ""), (START, ""),
                          (put(PROGRAM, "positions.C", "20"), "C")):  # fmt: skip
        player, _ = player_of(PROGRAM)
        player.move("C", 20.0)
        player.follow(PROGRAM, after)
        assert player.chosen == chosen


def test_a_page_without_animations_gets_one_picture_a_second():
    player, clock = player_of(START)
    player.is_still = True
    player.play("C")
    assert player.wait_s == 1.0
    assert after(player, clock, 1.0)["C"] == pytest.approx(30.0)


def test_the_factor_that_is_played_up_to_is_that_of_the_drawing():
    rotary = put(START, "look.drawing", "rotary").with_amplitude("EB0C", 20.0)
    compared = with_pin(START).with_amplitude("EA0Z", 200.0)
    for state in (START, rotary, put(START, "exaggeration", "300"), compared):
        picture = LIVE.evaluate(state)
        assert whole_factor(picture) == picture.exaggeration
    true_scale = put(START, "exaggeration", "1")
    assert whole_factor(LIVE.evaluate(true_scale)) == LIVE.evaluate(START).exaggeration


def test_the_layer_draws_the_machine_where_the_player_stands(monkeypatch):
    """With a client that draws nothing."""
    drawn, picture = [], LIVE.evaluate(PROGRAM)
    player, _ = player_of(PROGRAM)
    monkeypatch.setattr(moving, "machine", lambda _, positions: drawn.append(positions) or {})
    layer = MovingLayer.__new__(MovingLayer)
    layer._picture, layer._player, layer._drawn_at = picture, player, ({}, None)
    layer._client, shapes = SimpleNamespace(atomic=nullcontext), []
    layer._moved = SimpleNamespace(draw=shapes.append)
    player.followers["machine"] = layer._follow
    player.move("C", 20.0)
    player.move("program", 2.0)
    player.move("exaggeration", 10.0)  # not by this layer
    player.stop()
    assert drawn == [{"C": 20.0}, picture.path.of.axes_at(2), {}]
    assert [*shapes[1]] == ["/rotation/program"]
