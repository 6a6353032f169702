"""How sure a map is, as a page shows it: numbers, colours, ellipsoids, what was never measured."""

import math
from dataclasses import replace

import numpy as np
import pytest
from viser.transforms import SO3

from app.parts import lone_part
from warpspace.app.documents import legend
from warpspace.app.documents.legend import faded_words, numbers_words
from warpspace.app.drawing.around import draw_surroundings
from warpspace.app.drawing.box import box
from warpspace.app.drawing.labels import point_labels
from warpspace.app.drawing.shapes import SCENE_PER_MM, ellipsoid
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.panels.overlay import OrderPanel
from warpspace.app.state.app_state import Picked, start_state
from warpspace.app.state.tree import put
from warpspace.picture.map_mesh import map_mesh
from warpspace.picture.model import evaluate_picture
from warpspace.scene.library import parse_scene

# EXX moves the point along x by 10 µm, EA0Z turns Z about x: −y by 20 nm on each mm of the lever
SCENE = """[machine]
chain = "wFXYZt"
[machine.offset_mm]
t = [0, 0, -300]
[workspace]
X = [-100, 100]
Y = [-100, 100]
Z = [-100, 100]
[errors]
EXX = 10
EA0Z = 20
[uncertainty.covariance]
keys = ["EXX", "EA0Z"]
matrix = [[4.0], [3.0, 9.0]]
measured_range = { X = [-100, 100], Z = [-50, 100] }
"""
LIVE = LiveModel()


def state_of(text=SCENE, **changes):
    state = replace(start_state(parse_scene(text, "s")), nodes=5)
    for path, value in changes.items():
        state = put(state, path.replace("__", "."), value)
    return state


def by_hand(z):
    """Give U95 of |E|, and |E|, where the tool tip stands at z of R, from the two gains."""
    arm = -0.001 * z  # µm per µrad, towards y
    error = np.array([10.0, 20.0 * arm])
    way = error / np.hypot(*error)
    along = np.array([way[0], way[1] * arm])  # growth of |E| per µm of EXX and per µrad of EA0Z
    return 2.0 * math.sqrt(along @ [[4.0, 3.0], [3.0, 9.0]] @ along), np.hypot(*error)


def test_u95_of_nodes_is_that_of_two_gains_by_hand():
    picture = LIVE.evaluate(state_of(look__quantity="uncertainty"))
    expected = [by_hand(z) for z in picture.grid.point_mm[0, 0, :, 2]]
    np.testing.assert_allclose(picture.field.norm_um[0, 0], [one[1] for one in expected])
    np.testing.assert_allclose(picture.values[0, 0], [one[0] for one in expected])
    assert (picture.scale.label, picture.scale.diverging) == ("U95 |E|", False)
    u95, mean = picture.values, (picture.values * picture.grid.weights).sum()
    expected = {"min": u95.min(), "mean": mean, "max": u95.max()}
    assert legend.marked(picture) == pytest.approx(expected)
    # one component alone: EXX along x, everywhere
    along = LIVE.evaluate(state_of(look__quantity="uncertainty", component="x"))
    np.testing.assert_allclose(along.values, 4.0)
    assert "U95 E<sub>x</sub> [µm]" in legend.legend_html(along)
    # a figure has the same numbers
    scene = picture.state.active_scene()
    drawn = evaluate_picture(scene, grid=5, quantity="uncertainty")
    np.testing.assert_allclose(drawn.values, picture.values)


def test_numbers_have_their_uncertainty_beside_them():
    picture = LIVE.evaluate(state_of())
    worst, length = by_hand(-400.0)
    said = numbers_words(picture)
    assert said.endswith(f"max {length:.1f} ± {worst:.1f} µm (k = 2)")
    assert point_labels(picture)[0].text == f"max {length:.1f} ± {worst:.1f} µm"
    # few degrees of freedom: Student's t for 95.45 % and 4 of them is 2.87 (GUM, table G.2)
    few = LIVE.evaluate(state_of(SCENE + "dof = 4\n"))
    assert numbers_words(few).endswith(f"± {worst / 2.0 * 2.869:.1f} µm (k = 2.87)")


def test_a_slider_keeps_its_covariance_and_the_grid_its_response():
    state = state_of()
    before, after = LIVE.evaluate(state), LIVE.evaluate(state.with_amplitude("EXX", -30.0))
    assert after.uncertainty.response is before.uncertainty.response
    np.testing.assert_allclose(after.uncertainty.covariance_um2, before.uncertainty.covariance_um2)
    assert not np.allclose(after.u95_um, before.u95_um)  # |E| has turned


def test_what_is_not_stated_is_unknown_and_what_a_scene_says_nothing_of_is_not_said():
    moved = state_of(look__quantity="uncertainty", look__significant="1", look__ellipsoids="1")
    unknown = LIVE.evaluate(moved.with_amplitude("EYY", 1.0))
    assert "max 13.5 ± ? µm" in numbers_words(unknown)
    below = lone_part(OrderPanel).render(unknown)["head.order"]
    assert "uncertainty of EYY is unknown" in below
    assert "State it in [uncertainty] of the scene" in below
    assert legend.unknown_words(LIVE.evaluate(moved)) == ""
    assert (unknown.quantity, unknown.faded) == ("position", None)
    assert "/uncertainty/ellipsoid0" not in draw_surroundings(unknown)
    silent = LIVE.evaluate(state_of(SCENE.partition("[uncertainty")[0], look__significant="1"))
    assert "±" not in numbers_words(silent)
    assert silent.faded is None


def test_colours_fade_where_the_error_is_within_its_uncertainty():
    state = state_of(SCENE.replace("4.0]", "16.0]").replace("EXX = 10", "EXX = 5"))
    faded = LIVE.evaluate(put(state, "look.significant", "1"))
    wanted = faded.field.norm_um <= faded.u95_um
    assert 0 < wanted.sum() < wanted.size
    mesh, plain = map_mesh(faded), LIVE.evaluate(state)
    np.testing.assert_array_equal(mesh.faded, wanted.reshape(-1)[faded.topology.surface.nodes])
    percent = round(100.0 * (faded.grid.weights * wanted).sum())
    assert faded_words(faded) == (f"grey: |E| ≤ U95, {percent} % of the volume",)
    assert faded_words(faded)[0] in legend.legend_html(faded)
    assert faded_words(plain) == ()
    assert box(faded)["/box/surface"].assigned != box(plain)["/box/surface"].assigned
    # slices fade by their own numbers
    cut = LIVE.evaluate(put(faded.state, "look.surface", "slices"))
    assert all(one.faded is not None and one.faded.shape == one.shape for one in cut.slices)


def test_pass_or_fail_fades_where_it_cannot_be_told():
    state = state_of(look__pass_fail="1", specification__limit_um="15")
    picture = LIVE.evaluate(state)
    away = np.abs(picture.field.norm_um - 15.0) / (picture.u95_um / 2.0)  # 95 % is at 1.645
    assert {*picture.faded[away < 1.5]} == {True}
    assert {*picture.faded[away > 1.8]} == {False}
    percent = round(100.0 * (picture.grid.weights * picture.faded).sum())
    assert faded_words(picture) == (f"grey: undecided at 95 %, {percent} % of the volume",)
    assert LIVE.evaluate(put(state, "look.pass_fail", "0")).faded is None


def drawn_mm(shape, ways):
    """Give where directions of a ball, [n, 3], are once it is scaled, turned and moved, mm."""
    ball = ways / np.linalg.norm(ways, axis=-1, keepdims=True)
    told = shape.assigned
    points = SO3(told["wxyz"]).apply(ball * told["scale"]) + told["position"]
    return points / SCENE_PER_MM


def test_ellipsoids_reach_along_each_direction_as_far_as_u95():
    square = np.array([[4.0, 1.0, 0.0], [1.0, 9.0, 0.5], [0.0, 0.5, 1.0]])
    way = np.random.default_rng(0).standard_normal((20_000, 3))
    points = drawn_mm(ellipsoid(np.zeros(3), square, (0, 0, 0), 0.5), way)
    np.testing.assert_allclose(np.einsum("ni,ij,nj->n", points, np.linalg.inv(square), points), 1.0)
    picked = replace(state_of(look__ellipsoids="1"), picked=Picked({"X": 0.0, "Y": 0.0, "Z": 0.0}))
    picture = LIVE.evaluate(picked)
    shapes = [one for name, one in draw_surroundings(picture).items() if "ellipsoid" in name]
    assert len(shapes) == 9
    one = drawn_mm(shapes[0], way)
    assert np.ptp(one, axis=0)[0] == pytest.approx(2 * 4.0e-3 * picture.exaggeration, rel=1e-2)


def test_what_was_never_measured_is_said_and_dotted():
    picture = LIVE.evaluate(state_of())
    assert "outside the measured range: Z below −50" in legend.subject_words(picture)
    dotted = draw_surroundings(picture)["/uncertainty/unmeasured"].assigned["points"]
    assert len(dotted) == 25  # the nodes at Z −100; those at −50 were reached
    off = LIVE.evaluate(state_of(look__unmeasured="0"))
    assert "/uncertainty/unmeasured" not in draw_surroundings(off)
    assert "</span> never measured" in legend.legend_html(picture)
    assert "never measured" not in legend.legend_html(off)
