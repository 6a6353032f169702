"""The basis and the field it gives, and how they are looked at."""

import itertools
import tracemalloc

import numpy as np
import pytest

from warpspace.field.evaluate import (
    View,
    amplitudes_of,
    build_basis,
    error_values,
    evaluate_exact,
    evaluate_first_order,
)
from warpspace.field.grid import Workspace, build_grid
from warpspace.kinematics.model import Loop, Model, complete_coordinates
from warpspace.machine.description import build_machine
from warpspace.machine.errors import Constant, ErrorSet, Ramp, Table

MACHINE = build_machine(
    "wCBFXYZt",
    offset_mm={"X": (0.0, 700.0, 400.0), "Z": (0.0, -800.0, 700.0), "t": (0.0, 0.0, -900.0)},
)
MODEL = Model(MACHINE, workpiece_point_mm=(0.0, 275.0, 450.0))
SPAN = (-200.0, 200.0)
VOLUME = Workspace(dict.fromkeys("XYZ", SPAN) | dict.fromkeys("BC", (0.0, 0.0)))
GRID = build_grid(MODEL, VOLUME, 4)
ERRORS = ErrorSet(
    {
        "EXX": Constant(SPAN, 3.0),
        "EAY": Ramp(SPAN, -40.0),
        "EC0Y": Constant(SPAN, 25.0),
        "EBZ": Table(SPAN, ((-200.0, 5.0), (0.0, -9.0), (200.0, 2.0))),
        "EAC": Constant(SPAN, 12.0),
    }
)
SOLVERS = (evaluate_exact, evaluate_first_order)


@pytest.mark.parametrize("loop", Loop)
@pytest.mark.parametrize("frame", ["machine", "workpiece"])
@pytest.mark.parametrize("reference", [None, {"X": 0.0, "Y": 50.0, "Z": -100.0}])
def test_basis_times_amplitudes_is_the_first_order_field(loop, frame, reference) -> None:
    view = View(loop, frame, reference)
    coordinates = GRID.coordinates | {"B": np.asarray(30.0), "C": np.asarray(45.0)}
    keys = MACHINE.parameter_keys
    basis = build_basis(MODEL, ERRORS, keys, coordinates, view, GRID.nominal_mm)
    field = basis.evaluate(amplitudes_of(ERRORS, keys))
    direct = evaluate_first_order(MODEL, ERRORS, coordinates, view, GRID.nominal_mm)
    exact = evaluate_exact(MODEL, ERRORS, coordinates, view, GRID.nominal_mm)
    np.testing.assert_allclose(field.error_um, direct.error_um, atol=1e-10)
    np.testing.assert_allclose(field.orientation_urad, direct.orientation_urad, atol=1e-10)
    np.testing.assert_allclose(field.error_um, exact.error_um, atol=0.02)
    np.testing.assert_allclose(field.orientation_urad, exact.orientation_urad, atol=0.02)
    assert np.abs(field.error_um).max() > 1.0
    assert field.norm_um.shape == GRID.shape


def test_changed_amplitude_moves_the_field_without_a_new_basis() -> None:
    keys = MACHINE.parameter_keys
    basis = build_basis(MODEL, ERRORS, keys, GRID.coordinates)
    changed = ERRORS.with_amplitude("EAY", 17.0, SPAN).with_amplitude("EYX", 6.0, SPAN)
    field = basis.evaluate(amplitudes_of(changed, keys))
    expected = evaluate_first_order(MODEL, changed, GRID.coordinates)
    np.testing.assert_allclose(field.error_um, expected.error_um, atol=1e-10)


def test_contributions_of_a_node_add_up_to_its_error() -> None:
    keys = MACHINE.parameter_keys
    basis = build_basis(MODEL, ERRORS, keys, GRID.coordinates)
    amplitudes = amplitudes_of(ERRORS, keys)
    shares = basis.contributions(amplitudes, (1, 2, 3))
    assert shares.shape == (41, 3)
    np.testing.assert_allclose(shares.sum(axis=0), basis.evaluate(amplitudes).error_um[1, 2, 3])
    assert shares[keys.index("EXX")].tolist() == [3.0, 0.0, 0.0]


@pytest.mark.parametrize("solve", SOLVERS)
@pytest.mark.parametrize("loop", Loop)
def test_reference_point_is_held_still(solve, loop: Loop) -> None:
    held = {"X": 10.0, "Y": -20.0, "Z": 30.0}
    coordinates = complete_coordinates(MACHINE, held)
    point = build_grid(MODEL, VOLUME.moved(held)).nominal_mm[0, 0, 0]
    absolute = solve(MODEL, ERRORS, coordinates, View(loop), point)
    relative = solve(MODEL, ERRORS, coordinates, View(loop, "machine", held), point)
    assert absolute.norm_um > 1.0
    np.testing.assert_allclose(relative.error_um, 0.0, atol=1e-9)
    np.testing.assert_array_equal(relative.orientation_urad, absolute.orientation_urad)


@pytest.mark.parametrize("solve", SOLVERS)
def test_reference_takes_the_same_vector_from_every_point(solve) -> None:
    view = View(reference={"X": 0.0, "Y": 0.0, "Z": 0.0})
    absolute = solve(MODEL, ERRORS, GRID.coordinates).error_um
    difference = absolute - solve(MODEL, ERRORS, GRID.coordinates, view).error_um
    np.testing.assert_allclose(difference, np.broadcast_to(difference[0, 0, 0], (4, 4, 4, 3)))


@pytest.mark.parametrize("solve", SOLVERS)
@pytest.mark.parametrize("loop", Loop)
def test_field_has_the_batch_of_all_axes_even_of_those_outside_the_loop(solve, loop) -> None:
    coordinates = complete_coordinates(MACHINE, {"X": np.zeros((3, 1)), "C": np.zeros(2)})
    field = solve(MODEL, ERRORS, coordinates, View(loop))
    assert field.nominal_mm.shape == (3, 2, 3)
    assert field.error_um.shape == (3, 2, 3)
    assert field.orientation_urad.shape == (3, 2, 3)


def test_errors_of_axes_the_machine_does_not_have_are_left_out() -> None:
    model = Model(build_machine("wFXt"))
    coordinates = complete_coordinates(model.machine, {"X": 100.0})
    assert set(error_values(model, ERRORS, coordinates)) == {"EXX"}
    for solve in SOLVERS:
        assert solve(model, ERRORS, coordinates).error_um == pytest.approx([3.0, 0.0, 0.0])


@pytest.mark.parametrize("most", [1, 5, 16, 40, 64])
@pytest.mark.parametrize("solve", SOLVERS)
def test_large_batch_is_evaluated_in_pieces_with_the_same_result(
    most: int, solve, monkeypatch: pytest.MonkeyPatch
) -> None:
    for loop, reference in itertools.product(Loop, (None, {"X": 0.0})):
        view = View(loop, "workpiece", reference)
        whole = solve(MODEL, ERRORS, GRID.coordinates, view)
        with monkeypatch.context() as patched:
            patched.setattr("warpspace.field.pieces.NODES", most)
            parts = solve(MODEL, ERRORS, GRID.coordinates, view)
        np.testing.assert_allclose(parts.error_um, whole.error_um, rtol=0, atol=1e-10)
        np.testing.assert_allclose(
            parts.orientation_urad, whole.orientation_urad, rtol=0, atol=1e-10
        )


@pytest.mark.parametrize("solve", SOLVERS)
def test_a_million_nodes_take_four_times_the_memory_of_their_errors(solve) -> None:
    counts = 101
    solve(MODEL, ERRORS, build_grid(MODEL, VOLUME, 2).coordinates)
    tracemalloc.start()
    try:
        grid = build_grid(MODEL, VOLUME, counts)
        field = solve(MODEL, ERRORS, grid.coordinates, View(), grid.point_mm)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert field.error_um.shape == (counts, counts, counts, 3)
    assert peak <= 4.0 * field.error_um.nbytes


@pytest.mark.parametrize("solve", SOLVERS)
def test_no_errors_and_no_points_are_fields_too(solve) -> None:
    assert not solve(MODEL, ErrorSet(), GRID.coordinates).error_um.any()
    nowhere = complete_coordinates(MACHINE, {"X": np.zeros(0)})
    assert solve(MODEL, ERRORS, nowhere).error_um.shape == (0, 3)
