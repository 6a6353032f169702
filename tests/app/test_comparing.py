"""Compare: two states beside each other."""

from dataclasses import replace

import numpy as np
import pytest

from warpspace.app.evaluation.compare import pinned_side, scene_side, with_pin, with_sides
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.state.app_state import Side, start_state
from warpspace.app.state.tree import put
from warpspace.geometry.colour import component_values
from warpspace.geometry.surfaces import deform
from warpspace.picture.mesh import map_mesh
from warpspace.scene.library import load_scene

LIVE = LiveModel()
FIRST, SECOND = (load_scene(f"dvf5000_{name}") for name in ("first", "second"))
START = start_state(FIRST, nodes=9)


def picture_of(state, shown):
    return LIVE.evaluate(put(state, "comparison.shown", shown))


def test_a_and_b_share_colours_and_all_three_factor_and_numbers():
    state = with_sides(START, Side(), scene_side(SECOND))
    a, b, difference = (picture_of(state, shown) for shown in ("a", "b", "difference"))
    alone = [LIVE.evaluate(start_state(scene, nodes=9)) for scene in (FIRST, SECOND)]
    np.testing.assert_array_equal(a.field.error_um, alone[0].field.error_um)
    np.testing.assert_array_equal(b.field.error_um, alone[1].field.error_um)
    np.testing.assert_allclose(
        difference.field.error_um, b.field.error_um - a.field.error_um, atol=1e-12
    )
    assert a.scale == b.scale
    assert a.exaggeration == b.exaggeration == difference.exaggeration
    assert a.compared.a == alone[0].statistics
    assert a.compared.b == alone[1].statistics
    assert a.compared.difference == difference.statistics
    np.testing.assert_array_equal(a.compared.other_mm, b.drawn_mm)


@pytest.mark.parametrize(("component", "label"), [("norm", "|E_B − E_A|"), ("y", "E_y, B − A")])
def test_a_change_has_colours_of_its_own(component, label):
    state = with_pin(replace(START, component=component))
    for key in ("EXX", "EYY"):
        state = state.with_amplitude(key, state.amplitudes[key] + 0.3)
    change = picture_of(state, "difference")
    largest = float(np.abs(change.values).max())
    assert change.scale.label == label
    assert largest <= change.scale.high + 1e-9
    assert change.scale.high <= 2.5 * largest < 0.1 * picture_of(state, "b").scale.high
    fixed = put(state, "look.range_top", "7.5")
    assert picture_of(fixed, "difference").scale.high == 7.5


def test_what_is_steered_moves_while_the_state_before_stays():
    state = with_pin(START).with_amplitude("EXX", 8.0)
    difference = picture_of(state, "difference")
    alone = LIVE.evaluate(
        start_state(load_scene("dvf5000_nominal"), nodes=9).with_amplitude("EXX", 8.0)
    )
    np.testing.assert_allclose(difference.field.error_um, alone.field.error_um, atol=1e-9)
    assert picture_of(with_pin(START), "difference").statistics.max_um == 0.0


def test_a_pinned_state_holds_no_comparison_and_unknown_words_draw_nothing_else():
    state = with_pin(START)
    twice = pinned_side(state).state
    assert twice.comparison.b is None
    assert twice.comparison.pinned is None
    for word in ("", "c", "<script>"):
        assert put(state, "comparison.shown", word).without_notes() == state


def test_the_difference_is_cut_into_slices_evaluated_where_they_lie():
    look = replace(START.look, surface="slices", slices_mm={"X": 31.0})
    for component, quantity in (("norm", "position"), ("y", "position"), ("norm", "orientation")):
        state = replace(START, look=replace(look, quantity=quantity), component=component)
        state = with_sides(state.with_amplitude("EAX", 9.0), Side(), scene_side(SECOND))
        a, b, difference = (picture_of(state, shown) for shown in ("a", "b", "difference"))
        assert [part.axis for part in difference.slices] == [part.axis for part in a.slices]
        assert difference.slices[0].position_mm == 31.0
        for one, two, part in zip(a.slices, b.slices, difference.slices, strict=True):
            np.testing.assert_array_equal(one.grid.nominal_mm, two.grid.nominal_mm)
            error = two.field.error_um - one.field.error_um
            np.testing.assert_allclose(part.field.error_um, error, atol=1e-12)
            drawn = deform(one.grid.nominal_mm, error, difference.exaggeration)
            np.testing.assert_allclose(part.drawn_mm, drawn, atol=1e-9)
            tilts = two.field.orientation_urad - one.field.orientation_urad
            values = component_values(error if quantity == "position" else tilts, component)
            np.testing.assert_allclose(part.values, values, atol=1e-12)
        # what is drawn are the slices, on the shared scale
        mesh = map_mesh(difference)
        assert len(mesh.values) == sum(part.values.size for part in difference.slices)
