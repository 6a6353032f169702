"""Fields in pieces, in batches, of errors of two arguments and by direction, in any chain."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chains import models, positions, vectors
from products import first
from random_scenes import scenes
from warpspace import evaluate, load_scene
from warpspace.field.evaluate import (
    View,
    amplitudes_of,
    build_basis,
    error_values,
    evaluate_exact,
    evaluate_first_order,
)
from warpspace.field.grid import build_grid
from warpspace.kinematics.chain import loop_error
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import TravelDirection, axis_parameters
from warpspace.machine.errors import Constant, Directional, ErrorSet, Ramp, TableCurve, TwoArguments
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


@pytest.mark.parametrize("name", first(*scene_names()))
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
            at = {axis: np.broadcast_to(q, shape)[index] for axis, q in coordinates.items()}
            single = solve(model, errors, at, view)
            np.testing.assert_allclose(field.nominal_mm[index], single.nominal_mm, atol=1e-9)
            np.testing.assert_allclose(field.error_um[index], single.error_um, **close)
            tilts = field.orientation_urad[index], single.orientation_urad
            np.testing.assert_allclose(*tilts, **close)


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


SPAN = (-500.0, 500.0)
STEP = 10.0
"""µm or µrad of a central difference."""
VALUES = st.integers(1, 40).map(float)


@st.composite
def functions(draw, model, axis):
    others = [name for name in model.machine.axes if name != axis]

    def one():
        if not others or draw(st.booleans()):
            return TableCurve(SPAN, ((-400.0, draw(VALUES)), (10.0, draw(VALUES)), (300.0, 3.0)))
        rows = tuple(tuple(draw(VALUES) for _ in range(3)) for _ in range(2))
        axes = (axis, draw(st.sampled_from(others)))
        return TwoArguments(SPAN, axes, ((-300.0, 200.0), (-150.0, 0.0, 100.0)), rows)

    if draw(st.booleans()):
        return Directional(SPAN, one(), draw(st.sampled_from((one(), Constant(SPAN, 5.0)))))
    return one()


@st.composite
def cases(draw):
    model = draw(models())
    axis = draw(st.sampled_from([*model.machine.axes]))
    keys = [row.key for row in axis_parameters(axis) if not row.is_constant]
    chosen = draw(st.lists(st.sampled_from(keys), min_size=1, max_size=3, unique=True))
    errors = {key: draw(functions(model, axis)) for key in chosen}
    return replace(model, direction=draw(st.sampled_from(TravelDirection))), ErrorSet(errors)


@given(data=st.data())
def test_the_response_is_the_derivative_of_the_exact_field_by_the_amplitude(data):
    model, errors = data.draw(cases())
    view = View(data.draw(st.sampled_from(Loop)))
    at = data.draw(positions(model, (4,)))
    point = np.array([data.draw(vectors()) for _ in range(4)])
    for key in errors:
        basis = build_basis(model, errors, (key,), at, view, point)
        curves = [errors.with_amplitude(key, step, SPAN).functions[key] for step in (STEP, -STEP)]
        ends = [evaluate_exact(model, ErrorSet({key: curve}), at, view, point) for curve in curves]
        slope = (ends[0].error_um - ends[1].error_um) / (2.0 * STEP)
        np.testing.assert_allclose(basis.position[0], slope, rtol=0, atol=1e-6)


@pytest.mark.parametrize("curve", [Constant(SPAN, 3.0), Ramp(SPAN, 3.0)])
@settings(max_examples=10)
@given(data=st.data())
def test_errors_without_a_direction_have_no_reversal(curve, data):
    model = replace(data.draw(models()), direction=TravelDirection.DIFFERENCE)
    errors = ErrorSet(dict.fromkeys(model.machine.allowed_keys, curve))
    at = data.draw(positions(model))
    assert not evaluate_first_order(model, errors, at).error_um.any()
    np.testing.assert_allclose(evaluate_exact(model, errors, at).error_um, 0.0, atol=1e-9)
