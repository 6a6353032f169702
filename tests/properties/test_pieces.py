"""Fields evaluated axis by axis and in pieces are those of one response and of one chain."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from random_scenes import scenes
from warpspace import evaluate, load_scene
from warpspace.field.evaluate import (
    View,
    amplitudes_of,
    error_values,
    evaluate_exact,
    evaluate_first_order,
)
from warpspace.field.grid import build_grid
from warpspace.kinematics.chain import loop_error
from warpspace.kinematics.model import Loop
from warpspace.scene.library import scene_names
from warpspace.scene.model import choose_view, grid_basis

NODES = (3, 2, 3)
FRAMES = ("machine", "workpiece")
AGREE_UM = 1e-9
ROUNDING = 32 * np.finfo(float).eps


def reach_mm(scene, point_mm):
    offsets = sum(float(np.abs(axis.offset_mm).sum()) for axis in scene.machine.axes.values())
    ends = float(np.abs([scene.model.tool_point_mm, scene.model.workpiece_point_mm]).sum())
    return offsets + ends + float(np.abs(point_mm).max())


def check(scene, loop, frame):
    grid = build_grid(scene.model, scene.workspace, NODES)
    view = choose_view(scene, loop, frame)
    basis = grid_basis(scene, grid, view)
    plain = basis.evaluate(amplitudes_of(scene.errors, basis.keys))
    found = evaluate(scene, grid=NODES, loop=loop, frame=frame)
    size = max(1.0, float(np.abs(plain.error_um).max()), float(np.abs(found.error_um).max()))
    close = {"rtol": 0, "atol": AGREE_UM + ROUNDING * size}
    np.testing.assert_allclose(found.error_um, plain.error_um, **close)
    np.testing.assert_allclose(found.orientation_urad, plain.orientation_urad, **close)
    exact_found = evaluate(replace(scene, reference=None), grid=NODES, loop=loop, exact=True)
    values = error_values(scene.model, scene.errors, grid.coordinates)
    exact = loop_error(scene.model, loop, grid.coordinates, values, grid.point_mm)
    # whole poses round with the lengths in them, 1 mm being 1000 µm
    close["atol"] += ROUNDING * reach_mm(scene, grid.point_mm) * 1e3
    np.testing.assert_allclose(exact_found.error_um, exact[0], **close)
    np.testing.assert_allclose(exact_found.orientation_urad, exact[1], **close)


@given(data=st.data())
def test_fields_of_random_scenes_are_those_of_a_response_and_of_a_chain(data):
    scene = data.draw(scenes(everything=True))
    check(scene, data.draw(st.sampled_from(Loop)), data.draw(st.sampled_from(FRAMES)))


@pytest.mark.parametrize("name", scene_names())
def test_fields_of_bundled_scenes_are_those_of_a_response_and_of_a_chain(name):
    scene = load_scene(name)
    for loop, frame in itertools.product(Loop, FRAMES):
        check(scene, loop, frame)


@given(data=st.data())
def test_batch_gives_what_a_loop_over_its_points_gives(data):
    scene = data.draw(scenes(everything=True))
    model, errors = scene.model, scene.errors
    rng = np.random.default_rng(data.draw(st.integers(0, 99)))
    shapes = [(), (2, 1, 1), (1, 3, 1), (1, 2), (2, 3, 2)]
    coordinates = {
        axis: rng.uniform(-100.0, 100.0, shapes[rng.integers(len(shapes))])
        for axis in model.machine.axes
    }
    view = View(data.draw(st.sampled_from(Loop)), data.draw(st.sampled_from(FRAMES)))
    for solve in (evaluate_first_order, evaluate_exact):
        field = solve(model, errors, coordinates, view)
        shape = field.error_um.shape[:-1]
        size = max(1.0, float(np.abs(field.error_um).max()), reach_mm(scene, field.nominal_mm))
        close = {"rtol": 0, "atol": AGREE_UM + ROUNDING * 1e3 * size}
        for index in np.ndindex(shape):
            at = {
                axis: np.broadcast_to(values, shape)[index] for axis, values in coordinates.items()
            }
            single = solve(model, errors, at, view)
            np.testing.assert_allclose(field.nominal_mm[index], single.nominal_mm, atol=1e-9)
            np.testing.assert_allclose(field.error_um[index], single.error_um, **close)
            np.testing.assert_allclose(
                field.orientation_urad[index], single.orientation_urad, **close
            )


def test_an_error_of_several_axes_is_a_field_too(monkeypatch):
    """Values that no axis has for itself: the evaluation only sees arrays over several axes."""
    scene = load_scene("dvf5000_first")
    grid = build_grid(scene.model, scene.workspace, (3, 4, 5))

    def together(model, errors, coordinates):
        x, z = coordinates["X"], coordinates["Z"]
        return {"EYX": 1e-4 * x * z, "EAX": 0.02 * np.abs(x + z)}

    monkeypatch.setattr("warpspace.field.evaluate.error_values", together)
    values = together(scene.model, scene.errors, grid.coordinates)
    plain, _ = loop_error(scene.model, Loop.TOOL, grid.coordinates, values, grid.point_mm)
    for most in (1, 4, 10_000):
        monkeypatch.setattr("warpspace.field.grid.NODES", most)
        exact = evaluate(scene, grid=(3, 4, 5), exact=True).error_um
        first = evaluate(scene, grid=(3, 4, 5)).error_um
        np.testing.assert_allclose(exact, plain, rtol=0, atol=1e-8)
        np.testing.assert_allclose(first, plain, rtol=0, atol=0.05)
        assert np.ptp(first[:, 0, :, 1]) > 1.0
