"""Compare: shared colours and factor, the difference node by node, and why there is none."""

from dataclasses import replace

import numpy as np
import pytest

from warpspace.app.evaluation.compare import pinned_side, scene_side, with_pin, with_sides
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.readouts.comparison import comparison_html
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.comparison import Side
from warpspace.app.state.ranges import Span
from warpspace.geometry.colour import component_values
from warpspace.geometry.deform import deform
from warpspace.picture.mesh import map_mesh
from warpspace.picture.topology import topology
from warpspace.scene.library import load_scene

LIVE = LiveModel()
FIRST, SECOND = (load_scene(f"dvf5000_{name}") for name in ("first", "second"))
START = start_state(FIRST, nodes=9)


def picture_of(state: AppState, shown: str) -> LivePicture:
    return LIVE.evaluate(replace(state, comparison=state.comparison.with_shown(shown)))


def test_a_b_and_difference_share_colours_factor_and_numbers() -> None:
    state = with_sides(START, Side(), scene_side(SECOND))
    a, b, difference = (picture_of(state, shown) for shown in ("a", "b", "difference"))
    alone = [LIVE.evaluate(start_state(scene, nodes=9)) for scene in (FIRST, SECOND)]
    np.testing.assert_array_equal(a.field.error_um, alone[0].field.error_um)
    np.testing.assert_array_equal(b.field.error_um, alone[1].field.error_um)
    np.testing.assert_allclose(
        difference.field.error_um, b.field.error_um - a.field.error_um, atol=1e-12
    )
    assert a.scale == b.scale == difference.scale
    assert a.exaggeration == b.exaggeration == difference.exaggeration
    assert a.compared is not None
    assert a.compared.a == alone[0].statistics
    assert a.compared.b == alone[1].statistics
    assert a.compared.difference == difference.statistics
    np.testing.assert_array_equal(a.compared.other_mm, b.drawn_mm)


def test_what_is_steered_moves_while_the_state_before_stays() -> None:
    state = with_pin(START).with_amplitude("EXX", 8.0)
    difference = picture_of(state, "difference")
    alone = LIVE.evaluate(
        start_state(load_scene("dvf5000_nominal"), nodes=9).with_amplitude("EXX", 8.0)
    )
    np.testing.assert_allclose(difference.field.error_um, alone.field.error_um, atol=1e-9)
    assert picture_of(with_pin(START), "difference").statistics.max_um == 0.0


def test_other_volumes_have_no_difference_but_both_sides() -> None:
    other = replace(SECOND, workspace=SECOND.workspace.moved({}), name="other")
    ranges = {**other.workspace.ranges, "X": (-100.0, 100.0)}
    other = replace(other, workspace=type(other.workspace)(ranges))
    picture = picture_of(with_sides(START, Side(), scene_side(other)), "difference")
    assert picture.compared is not None
    assert picture.compared.refused
    assert picture.compared.difference is None
    assert picture.compared.shown == "b"


def test_titles_are_escaped() -> None:
    evil = replace(SECOND, title="<img src=x onerror=alert(1)>")
    text = comparison_html(LIVE.evaluate(with_sides(START, Side(), scene_side(evil))))
    assert "<img" not in text
    assert "&lt;img" in text


def test_a_pinned_state_of_a_comparison_holds_no_comparison() -> None:
    once = with_pin(START)
    twice = pinned_side(once).state
    assert twice is not None
    assert twice.comparison.b is None
    assert twice.comparison.pinned is None


@pytest.mark.parametrize("word", ["", "c", "<script>"])
def test_unknown_words_draw_nothing_else(word: str) -> None:
    state = with_pin(START)
    assert state.comparison.with_shown(word) is state.comparison


def test_the_difference_is_cut_into_slices_evaluated_where_they_lie() -> None:
    look = START.look.with_choice(surface="slices").with_slice("X", 31.0, Span(-275.0, 275.0, 1.0))
    for component, quantity in (("norm", "position"), ("y", "position"), ("norm", "orientation")):
        state = replace(
            START, look=look.with_choice(quantity=quantity), component=component
        ).with_amplitude("EAX", 9.0)
        state = with_sides(state, Side(), scene_side(SECOND))
        a, b, difference = (picture_of(state, shown) for shown in ("a", "b", "difference"))
        assert [part.axis for part in difference.slices] == [part.axis for part in a.slices]
        assert difference.slices[0].position_mm == 31.0
        for one, two, part in zip(a.slices, b.slices, difference.slices, strict=True):
            np.testing.assert_array_equal(one.grid.nominal_mm, two.grid.nominal_mm)
            error = two.field.error_um - one.field.error_um
            np.testing.assert_allclose(part.field.error_um, error, atol=1e-12)
            drawn = deform(one.grid.nominal_mm, error, difference.exaggeration)
            np.testing.assert_allclose(part.drawn_mm, drawn, atol=1e-9)
            coloured = error
            if quantity == "orientation":
                coloured = two.field.orientation_urad - one.field.orientation_urad
            np.testing.assert_allclose(
                part.values, component_values(coloured, component), atol=1e-12
            )
        # what is drawn are the slices, on the shared scale
        mesh = map_mesh(difference)
        assert len(mesh.values) == sum(part.values.size for part in difference.slices)


def test_slices_of_both_sides_follow_the_tool_point_of_now() -> None:
    look = START.look.with_choice(surface="slices").switched(follow=True)
    machine = START.machine.with_linear("Y", 50.0, Span(-225.0, 225.0, 1.0))
    state = with_sides(replace(START, look=look, machine=machine), Side(), scene_side(SECOND))
    for shown in ("a", "b", "difference"):
        at = {part.axis: part.position_mm for part in picture_of(state, shown).slices}
        assert at["Y"] == 50.0


def test_the_difference_is_cut_open() -> None:
    state = replace(START, look=START.look.with_choice(surface="cut"))
    difference = picture_of(with_sides(state, Side(), scene_side(SECOND)), "difference")
    assert difference.topology is topology(difference.grid.shape, cut=True)
