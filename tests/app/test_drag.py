"""A drag keeps exaggeration and colour range; both are chosen again at its end."""

from dataclasses import replace

import numpy as np
import pytest

from app.parts import LIVE
from app.wire import opened
from warpspace.app.browser import actions as do
from warpspace.app.documents import legend
from warpspace.app.drawing.camera import CameraMemory, is_in_view
from warpspace.app.evaluation.compare import with_pin
from warpspace.app.evaluation.live_model import DrawnScale
from warpspace.app.panels.improve import RESIDUAL, with_box
from warpspace.app.server.session import same_scales
from warpspace.app.state import store
from warpspace.app.state.app_state import start_state
from warpspace.app.state.tree import put
from warpspace.formats.compensation.compensate import Compensate, compensate
from warpspace.formats.compensation.controller import CorrectedPoints
from warpspace.machine.axes import parameter
from warpspace.machine.errors import Constant, ErrorSet, Ramp
from warpspace.scene.library import load_scene
from warpspace.scene.model import evaluate

FIRST = load_scene("dvf5000_first")
START = start_state(FIRST, nodes=5)


def drag(wire, key, *values):
    wire.say(do.Signal.HOLD)
    for value in values:
        wire.say(do.SetError(key, value))


def test_a_drag_keeps_exaggeration_and_colours_until_its_end():
    with opened(FIRST) as (wire, session):
        before = session.context.picture
        drag(wire, "EA0Z", "200", "400")
        assert wire.read_until(lambda: session.context.picture.state.amplitudes["EA0Z"] == 400.0)
        held = session.context.picture
        assert held.exaggeration == before.exaggeration
        assert held.scale == before.scale
        assert held.state.exaggeration is None  # nothing that is saved
        assert np.abs(held.drawn_mm - before.drawn_mm).max() > 100.0  # the increase is drawn
        end = f"&gt; {before.scale.high:g}<"
        assert wire.read_until(lambda: end in wire.pieces["legend"])
        wire.say(do.Signal.RELEASE)
        assert wire.read_until(lambda: session.context.picture.exaggeration < held.exaggeration)
        after = session.context.picture
        chosen = LIVE.evaluate(session.state)
        assert (after.exaggeration, after.scale) == (chosen.exaggeration, chosen.scale)
        assert wire.read_until(lambda: end not in wire.pieces["legend"])


def test_a_drag_is_one_step_of_undo_however_long_it_takes(monkeypatch):
    monkeypatch.setattr(store, "SAME_STEP_S", 1e-9)
    with opened(FIRST) as (wire, session):
        steps = session.context.store.past
        for held, values, count in ((True, ("200", "300", "400"), 1), (False, ("500", "600"), 3)):
            wire.say(do.Signal.HOLD if held else do.Signal.RELEASE)
            for value in values:
                wire.say(do.SetError("EA0Z", value))
                at = float(value)
                assert wire.read_until(lambda at=at: session.state.amplitudes["EA0Z"] == at)
            assert len(steps) == count


def test_a_typed_number_rescales_at_once():
    with opened(FIRST) as (wire, session):
        wire.say(do.SetError("EA0Z", "400"))
        assert wire.read_until(lambda: session.context.picture.state.amplitudes["EA0Z"] == 400.0)
        assert session.context.picture.exaggeration == LIVE.evaluate(session.state).exaggeration


@pytest.mark.parametrize(
    "state",
    [
        START,
        put(START, "look.drawing", "rotary").with_amplitude("EB0C", 20.0),
        put(with_pin(START).with_amplitude("EA0Z", 60.0), "comparison.shown", "a"),
        put(with_pin(START).with_amplitude("EA0Z", 60.0), "comparison.shown", "difference"),
        put(START, "look.surface", "slices"),
    ],
    ids=["volume", "rotary axes", "comparison", "difference", "slices"],
)
def test_every_drawing_keeps_the_scales_of_a_drag(state):
    before = LIVE.evaluate(state)
    after = state.with_amplitude("EA0Z", 500.0).with_amplitude("EB0C", 500.0)
    assert same_scales(state, after)
    held = LIVE.evaluate(after, DrawnScale(before.exaggeration, before.scale))
    assert (held.exaggeration, held.scale) == (before.exaggeration, before.scale)
    assert {piece.exaggeration for piece in held.slices} <= {before.exaggeration}
    assert {piece.scale for piece in held.slices} <= {before.scale}
    assert {of.exaggeration for of in held.traces} <= {before.exaggeration}
    chosen = LIVE.evaluate(after)
    assert held.state is after
    assert np.array_equal(held.shown_values, chosen.shown_values)
    assert chosen.exaggeration < held.exaggeration


def test_another_drawing_ends_the_scales_of_a_drag():
    for changed in (
        put(START, "component", "x"),
        put(START, "exaggeration", "100"),
        put(START, "look.surface", "slices"),
        put(START, "specification.limit_um", "10"),
        with_pin(START),
        replace(START, scene=load_scene("dvf5000_second")),
    ):
        assert not same_scales(START, changed)


def test_both_ends_of_a_range_that_is_exceeded_say_so():
    state = put(START, "component", "z")
    picture = LIVE.evaluate(state)
    low, high = picture.values.min() / 2.0, picture.values.max() / 2.0
    assert low < 0.0 < high
    narrow = DrawnScale(100.0, replace(picture.scale, low=low, high=high))
    drawn = LIVE.evaluate(state, narrow)
    texts = [text for text, _ in legend.ticks(drawn.scale, drawn.shown_values)]
    assert [texts[0][:2], texts[-1][:2]] == ["< ", "> "]
    ends = [mark.text for mark in legend.marks(picture) if not mark.name]
    assert all(text[0] not in "<>" for text in ends)


@pytest.mark.parametrize("drawing", ["volume", "rotary"])
def test_a_drag_moves_residual_errors_by_the_first_order_and_ends_exact(monkeypatch, drawing):
    plan = Compensate(formats=("iso-text",), points=3)
    table = compensate(FIRST, plan, 3).controller
    before = LIVE.evaluate(put(with_box(START, RESIDUAL, table), "look.drawing", drawing))
    drag_start = DrawnScale(before.exaggeration, before.scale, before.state.amplitudes)
    assert np.array_equal(LIVE.evaluate(before.state, drag_start).shown_values, before.shown_values)
    after = before.state.with_amplitude("EA0Z", 60.0).with_amplitude("EB0C", 60.0)
    exact = LIVE.evaluate(after)
    assert np.abs(exact.shown_values - before.shown_values).max() > 5.0
    monkeypatch.delattr(CorrectedPoints, "field")  # the exact chain of every node
    held = LIVE.evaluate(after, drag_start)
    assert np.allclose(held.shown_values, exact.shown_values, atol=0.01)


# --- The camera keeps the box in its picture ------------------------------------------------------


def set_factor(wire, session, factor):
    wire.say(do.SetLeaf("exaggeration", factor))
    assert wire.read_until(lambda: f"{session.context.picture.exaggeration:g}" == factor)


def flights(wire):
    return wire.calls["Page.fly"]


def test_the_camera_moves_back_for_a_larger_box_and_to_the_box_of_before():
    with opened(FIRST) as (wire, session):
        camera = session.context.camera
        near = camera.remember()
        set_factor(wire, session, "2000")  # still in the picture
        assert camera.remember() == near
        wire.say(do.SetLeaf("exaggeration", "100000"))
        assert wire.read_until(lambda: flights(wire) == 1)
        picture, aspect = session.context.picture, camera.room.aspect
        assert not is_in_view(near, picture.drawn_mm, aspect)
        (view,) = wire.latest["Page.fly"][:1]
        moved = CameraMemory(**{k: tuple(v) if k != "fov_rad" else v for k, v in view.items()})
        assert is_in_view(moved, picture.drawn_mm, aspect)
        camera._stand_at(moved)  # as the page does
        wire.say(do.SetLeaf("exaggeration", "1000"))
        assert wire.read_until(lambda: flights(wire) == 2)


def test_a_camera_set_by_hand_stays_and_a_message_offers_to_fit_the_view():
    with opened(FIRST) as (wire, session):
        camera = session.context.camera
        place = camera.remember()
        x, y, z = place.position
        camera._stand_at(replace(place, position=(x + 0.5, y, z)))
        set_factor(wire, session, "100000")
        assert wire.read_until(lambda: bool(wire.toasts))
        assert wire.toasts[-1][-1] == ["Fit view", "fit_view"]
        assert flights(wire) == 0
        wire.toasts.clear()
        set_factor(wire, session, "90000")  # it is out of the view already
        assert not wire.read_until(lambda: bool(wire.toasts), seconds=0.5)
        wire.say(do.Signal.FIT_VIEW)
        assert wire.read_until(
            lambda: is_in_view(
                camera.remember(), session.context.picture.drawn_mm, camera.room.aspect
            )
        )


def test_the_camera_stays_during_a_drag():
    with opened(FIRST) as (wire, session):
        drag(wire, "EA0Z", "20000")
        assert wire.read_until(lambda: session.context.picture.state.amplitudes["EA0Z"] == 20000.0)
        camera = session.context.camera
        drawn = session.context.picture.drawn_mm
        assert not is_in_view(camera.remember(), drawn, camera.room.aspect)
        wire.say(do.Signal.RELEASE)  # the box is small again
        assert wire.read_until(lambda: session.context.picture.drawn_mm is not drawn)
        assert flights(wire) == 0
        assert wire.toasts == []


def test_scenes_that_differ_in_amplitudes_share_their_responses():
    """A proposal is evaluated after every change; its responses are those of the scene."""
    errors = FIRST.errors
    key = next(key for key in errors if isinstance(errors.functions[key], Ramp))
    span = FIRST.axis_span(parameter(key).axis)
    shown = LIVE.evaluate(START)
    other = replace(FIRST, errors=errors.with_amplitude(key, 7.0, span), title="other amplitude")
    shared = LIVE.evaluate(start_state(other, nodes=5))
    assert shared.grid is shown.grid
    exact = evaluate(other, grid=5)
    np.testing.assert_allclose(shared.field.error_um, exact.error_um, rtol=0.0, atol=1e-9)
    assert not np.allclose(shared.field.error_um, shown.field.error_um)
    bent = ErrorSet({**errors.functions, key: Constant(span, 7.0)})
    for changed in (
        replace(FIRST, errors=bent),
        replace(FIRST, reference={"X": 0.0, "Y": 0.0, "Z": -300.0}),
        replace(FIRST, workspace=FIRST.workspace.moved({"C": 30.0})),
    ):
        own = LIVE.evaluate(start_state(changed, nodes=5))
        assert own.grid is not shown.grid
        np.testing.assert_allclose(
            own.field.error_um, evaluate(changed, grid=5).error_um, rtol=0.0, atol=1e-9
        )
