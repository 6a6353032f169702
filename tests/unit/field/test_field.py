"""Fields over points, grids, slices and workpieces."""

import itertools
import tracemalloc

import numpy as np
import pytest

import warpspace
from products import first
from warpspace import evaluate, load_scene
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.field.evaluate import (
    View,
    amplitudes_of,
    build_basis,
    evaluate_exact,
    evaluate_first_order,
    find_placement,
    placement_effect,
)
from warpspace.field.grid import PLANES, Workspace, build_grid, build_slice, node_counts
from warpspace.geometry.surfaces import outer_faces
from warpspace.kinematics.model import Loop, Model, complete_coordinates
from warpspace.machine.definition import build_machine
from warpspace.machine.errors import Constant, ErrorSet, Ramp, TableCurve
from warpspace.scene.library import parse_scene
from warpspace.scene.model import choose_view, evaluate_grid, grid_basis, with_placement

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
        "EBZ": TableCurve(SPAN, ((-200.0, 5.0), (0.0, -9.0), (200.0, 2.0))),
        "EAC": Constant(SPAN, 12.0),
    }
)
SOLVERS = (evaluate_exact, evaluate_first_order)


def test_contributions_of_a_node_add_up_to_its_error():
    keys = MACHINE.parameter_keys
    basis = build_basis(MODEL, ERRORS, keys, GRID.coordinates)
    amplitudes = amplitudes_of(ERRORS, keys)
    shares = basis.contributions(amplitudes, (1, 2, 3))
    assert shares.shape == (41, 3)
    np.testing.assert_allclose(shares.sum(axis=0), basis.evaluate(amplitudes).error_um[1, 2, 3])
    assert shares[keys.index("EXX")].tolist() == [3.0, 0.0, 0.0]


@pytest.mark.parametrize("solve", SOLVERS)
@pytest.mark.parametrize("loop", Loop)
def test_reference_point_is_held_still(solve, loop):
    held = {"X": 10.0, "Y": -20.0, "Z": 30.0}
    coordinates = complete_coordinates(MACHINE, held)
    point = build_grid(MODEL, VOLUME.moved(held)).nominal_mm[0, 0, 0]
    absolute = solve(MODEL, ERRORS, coordinates, View(loop), point)
    relative = solve(MODEL, ERRORS, coordinates, View(loop, "machine", held), point)
    assert absolute.norm_um > 1.0
    np.testing.assert_allclose(relative.error_um, 0.0, atol=1e-9)
    np.testing.assert_array_equal(relative.orientation_urad, absolute.orientation_urad)
    # the same vector is taken from every point
    free, bound = (solve(MODEL, ERRORS, GRID.coordinates, View(loop, reference=r)).error_um
                   for r in (None, held))  # fmt: skip
    np.testing.assert_allclose(free - bound, np.broadcast_to(absolute.error_um, free.shape))


@pytest.mark.parametrize("most", first(5, 1, 16, 40, 64))
@pytest.mark.parametrize("solve", SOLVERS)
def test_large_batch_is_evaluated_in_pieces_with_the_same_result(most, solve, monkeypatch):
    for loop, reference in itertools.product(Loop, (None, {"X": 0.0})):
        view = View(loop, "workpiece", reference)
        whole = solve(MODEL, ERRORS, GRID.coordinates, view)
        with monkeypatch.context() as patched:
            patched.setattr("warpspace.field.grid.NODES", most)
            parts = solve(MODEL, ERRORS, GRID.coordinates, view)
        np.testing.assert_allclose(parts.error_um, whole.error_um, rtol=0, atol=1e-10)
        np.testing.assert_allclose(
            parts.orientation_urad, whole.orientation_urad, rtol=0, atol=1e-10
        )


@pytest.mark.parametrize("solve", SOLVERS)
def test_a_million_nodes_take_four_times_the_memory_of_their_errors(solve):
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
def test_no_errors_and_no_points_are_fields_too(solve):
    assert not solve(MODEL, ErrorSet(), GRID.coordinates).error_um.any()
    nowhere = complete_coordinates(MACHINE, {"X": np.zeros(0)})
    assert solve(MODEL, ERRORS, nowhere).error_um.shape == (0, 3)


GRID_MODEL = Model(build_machine("wCFXYZt", offset_mm={"Z": (0.0, 0.0, 500.0)}))
GRID_VOLUME = Workspace(
    {"X": (-10.0, 10.0), "Y": (0.0, 30.0), "Z": (-50.0, 50.0), "C": (90.0, 90.0)}
)


def test_grid_has_a_node_for_every_combination_of_positions():
    grid = build_grid(GRID_MODEL, GRID_VOLUME, (2, 3, 5))
    assert (*grid.shape, 3) == grid.nominal_mm.shape == (2, 3, 5, 3)
    assert grid.nominal_mm[1, 1, 0].tolist() == [10.0, 15.0, 450.0]
    assert [*grid.extent_mm, grid.longest_edge_mm] == [20.0, 30.0, 100.0, 100.0]
    assert float(grid.coordinates["C"]) == 90.0
    assert np.broadcast_arrays(*grid.coordinates.values())[0].shape == grid.shape


@pytest.mark.parametrize(
    ("chain", "ranges", "shape", "longest_mm"),
    [
        ("wCFXYZt", {**GRID_VOLUME.ranges, "Y": (7.0, 7.0)}, (4, 1, 4), 100.0),
        ("wCFXZt", {"X": (0.0, 1.0), "Z": (0.0, 1.0)}, (4, 1, 4), 1.0),
        ("wCBFt", {"B": (30.0, 30.0)}, (1, 1, 1), 0.0),
    ],
)
def test_an_axis_that_stands_still_or_is_not_there_has_one_node(chain, ranges, shape, longest_mm):
    grid = build_grid(Model(build_machine(chain)), Workspace(ranges), 4)
    assert (grid.shape, grid.longest_edge_mm) == (shape, longest_mm)
    assert np.ptp(grid.nominal_mm[..., 1]) == 0.0


@pytest.mark.parametrize("chain", ["wXYFZt", "wYFXZt", "wXYZFt", "wCXFYZt", "wXCFYZt", "wFXYZt"])
def test_volume_keeps_its_shape_whichever_side_its_axes_are_on(chain):
    model = Model(build_machine(chain, direction=dict.fromkeys(chain[1 : chain.index("F")], -1)))
    grid = build_grid(model, GRID_VOLUME.moved({"C": 0.0}), 3)
    assert grid.extent_mm.tolist() == [20.0, 30.0, 100.0]
    along_x = grid.nominal_mm[2, 0, 0] - grid.nominal_mm[0, 0, 0]
    assert along_x.tolist() == [20.0, 0.0, 0.0]
    tool_side = [axis for axis in "XYZ" if axis in model.machine.chain.tool]
    moved = np.ptp(grid.point_mm.reshape(-1, 3), axis=0)
    assert [axis for axis, length in zip("XYZ", moved, strict=True) if length] == tool_side


def test_volume_on_a_turned_table_turns_with_it():
    model = Model(build_machine("wXCFYZt"))
    grid = build_grid(model, GRID_VOLUME, 2)
    edge = grid.nominal_mm[1, 0, 0] - grid.nominal_mm[0, 0, 0]
    np.testing.assert_allclose(edge, [0.0, -20.0, 0.0], atol=1e-12)


def test_positions_are_the_middles_and_moving_leaves_the_original_alone():
    assert GRID_VOLUME.moved({"C": 0.0}).positions["C"] == 0.0
    assert GRID_VOLUME.positions == {"X": 0.0, "Y": 15.0, "Z": 0.0, "C": 90.0}


@pytest.mark.parametrize(
    ("nodes", "said"),
    [
        *[(n, "2 to 101 per axis") for n in (1, -3, 102, (2, 2), (2, 2, 1), (2, 2, 2, 2), True)],
        *[(n, "whole numbers") for n in (5.5, "21", None, (2, 3, 4.0))],
    ],
)
def test_counts_beyond_the_limits_are_refused(nodes, said):
    assert node_counts(np.int64(5)) == (5, 5, 5)
    assert node_counts([2, 3, 4]) == (2, 3, 4)
    with pytest.raises(OptionError, match=f"expected {said}"):
        node_counts(nodes)


SCENE = """
title = "placed"
[machine]
chain = "wCBFXYZt"
[machine.offset_mm]
C = [0, 20, -100]
[machine.travel]
X = [-200, 200]
Y = [-150, 150]
Z = [-300, 0]
B = [-90, 90]
C = [0, 360]
[workspace]
X = [-200, 200]
Y = [-150, 150]
Z = [-300, -100]
B = 30
C = {c}
[errors]
"""


def _scene(errors, c="40", head=""):
    return parse_scene(SCENE.replace("{c}", c) + errors + head, "placed")


def test_a_workpiece_that_lies_elsewhere_is_fitted_out_at_every_rotary_position():
    lies = "EXC = { poly = [12.0] }\nEYC = { poly = [-7.0] }\nECC = { poly = [31.0] }\n"
    scene = _scene(lies + "EAC = { poly = [9.0] }\n")
    for at in (None, {"X": 80, "B": [-60, 10], "C": [300, 100]}):
        plain = evaluate(scene, at=at, loop="relative")
        found = evaluate(scene, at=at, loop="relative", placed=True)
        assert plain.norm_um.min() > 1.0
        assert found.norm_um.max() < 1e-9
        # a turn about the tool axis itself is no orientation error
        assert np.abs(found.orientation_urad).max() < 1e-9


def test_an_axis_that_stands_elsewhere_is_fitted_out_where_it_stands_only():
    scene = _scene("EX0C = 12.0\nEA0C = 20.0\n")
    there = evaluate(scene, loop="relative", placed=True)
    turned = evaluate(scene, at={"C": 220}, loop="relative", placed=True)
    assert there.norm_um.max() < 1e-9
    assert turned.norm_um.max() > 10.0


@pytest.mark.parametrize("machine", ["bent", "dvf5000_second", "printer"])
def test_what_is_left_is_the_least_and_the_same_by_every_way(machine):
    printer = 'title = "p"\nmachine = "printer_3d"\n[errors]\nEC0Y = 500\nEAX = { ramp = 30 }\n'
    scene = {
        "bent": _scene("EXX = { poly = [0, 0.1, 1e-4] }\nEC0Y = 40.0\nEB0C = 11.0\n"),
        "dvf5000_second": load_scene("dvf5000_second"),
        "printer": parse_scene(printer, "p"),
    }[machine]
    grid = build_grid(scene.model, scene.workspace)
    scene = with_placement(scene, "relative")
    view = choose_view(scene, "relative")
    field = evaluate_grid(scene, grid, view)
    response = placement_effect(scene.model, np.eye(6), grid.coordinates, grid.point_mm)[0]
    slopes = np.einsum("xyz,kxyzc,xyzc->k", grid.weights, response, field.error_um)
    assert np.abs(slopes).max() < 1e-9 * np.abs(response).max()
    basis = grid_basis(scene, grid, view)
    same = basis.evaluate(amplitudes_of(scene.errors, basis.keys))
    assert np.allclose(same.error_um, field.error_um, atol=1e-9)
    assert np.allclose(same.orientation_urad, field.orientation_urad, atol=1e-9)
    exact = evaluate_grid(scene, grid, view, exact=True)
    assert np.allclose(exact.error_um, field.error_um, atol=0.05)
    workpiece = evaluate(scene, loop="relative", placed=True, frame="workpiece")
    assert np.allclose(workpiece.norm_um, field.norm_um, atol=1e-9)


def test_a_reference_point_is_held_still_after_the_fit():
    held = "[view]\nreference = { X = 10, Y = 20, Z = -150 }\n"
    errors = "EXX = { poly = [0, 0.1, 1e-4] }\nEC0Y = 40.0\n"
    free, bound = _scene(errors), _scene(errors, head=held)
    at = {"X": [10, 150], "Y": [20, -40], "Z": [-150, -250]}
    loose, still = (evaluate(scene, at=at, loop="relative", placed=True) for scene in (free, bound))
    assert np.allclose(still.error_um, loose.error_um - loose.error_um[0])
    view = choose_view(with_placement(bound, "relative"), "relative")
    assert np.abs(find_placement(bound.model, bound.errors, view)).max() > 1.0


def test_a_volume_along_one_axis_tells_fewer_numbers():
    scene = _scene("EXX = { poly = [3.0, 0.1] }\nEYX = { poly = [1.0, 0.2, 1e-3] }\n")
    flat = scene.workspace.moved({"Y": 0.0, "Z": -200.0})
    view = View(Loop.RELATIVE, placed_over=flat)
    assert np.abs(find_placement(scene.model, scene.errors, view)).max() < 1000.0


@pytest.fixture(scope="module")
def scene():
    return warpspace.load_scene("dvf5000_first")


@pytest.mark.parametrize("axis", PLANES)
def test_slice_is_a_plane_of_nodes_at_its_position(scene, axis):
    position = -100.5
    grid = build_slice(scene.model, scene.workspace, axis, position, 7)
    index = "XYZ".index(axis)
    assert grid.shape == tuple(1 if i == index else 7 for i in range(3))
    assert np.ptp(grid.nominal_mm[..., index]) == 0.0
    assert float(grid.coordinates[axis]) == position
    assert len(outer_faces(grid.shape)) == 1


@pytest.mark.parametrize(
    ("axis", "position", "kind", "said"),
    [
        ("X", 300.0, OptionError, "X = 300 mm; expected -275 to 275 mm"),
        ("X", float("nan"), OptionError, "X = nan mm"),
        ("B", 0.0, UnknownNameError, "axis of a slice"),
    ],
)
def test_slice_outside_the_volume_is_refused(scene, axis, position, kind, said):
    with pytest.raises(kind, match=said):
        build_slice(scene.model, scene.workspace, axis, position)


@pytest.mark.parametrize("chain", ["wXYFZt", "wYFXZt", "wCXFZYt"])
def test_slice_of_a_moving_table_lies_in_the_volume(chain):
    model = Model(build_machine(chain))
    workspace = Workspace({"X": (-100.0, 200.0), "Y": (-50.0, 60.0), "Z": (10.0, 90.0)})
    whole = build_grid(model, workspace, 5)
    for axis, at in (("X", 3), ("Y", 1), ("Z", 0)):
        index = "XYZ".index(axis)
        position = float(np.ravel(whole.coordinates[axis])[at])
        part = build_slice(model, workspace, axis, position, 5)
        expected = np.take(whole.nominal_mm, [at], axis=index)
        assert part.nominal_mm == pytest.approx(expected, abs=1e-9)
