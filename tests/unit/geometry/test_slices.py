import numpy as np
import pytest

import warpspace
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.field.evaluate import evaluate_first_order
from warpspace.field.grid import Workspace, build_grid
from warpspace.geometry.faces import outer_faces
from warpspace.geometry.slices import PLANES, build_slice, slice_ranges
from warpspace.kinematics.model import Model
from warpspace.machine.description import build_machine
from warpspace.scene.pipeline import grid_basis


@pytest.fixture(scope="module")
def scene():
    return warpspace.load_scene("dvf5000_first")


def test_ranges_are_those_of_the_workspace(scene):
    assert slice_ranges(scene.model, scene.workspace) == {
        "X": (-275.0, 275.0),
        "Y": (-225.0, 225.0),
        "Z": (-480.0, -80.0),
    }
    flat = scene.workspace.moved({"Y": 0.0})
    assert slice_ranges(scene.model, flat) == {}


@pytest.mark.parametrize("axis", PLANES)
def test_slice_is_a_plane_of_nodes_at_its_position(scene, axis):
    position = -100.5
    grid = build_slice(scene.model, scene.workspace, axis, position, 7)
    index = "XYZ".index(axis)
    assert grid.shape == tuple(1 if i == index else 7 for i in range(3))
    assert np.ptp(grid.nominal_mm[..., index]) == 0.0
    assert float(grid.coordinates[axis]) == position
    assert len(outer_faces(grid.shape)) == 1


@pytest.mark.parametrize("axis", PLANES)
def test_slice_has_the_errors_of_the_model_at_its_own_nodes(scene, axis):
    grid = build_slice(scene.model, scene.workspace, axis, -133.3, 5)
    basis = grid_basis(scene, grid)
    found = basis.evaluate(np.array([scene.errors.amplitude(key) for key in basis.keys]))
    full = {name: np.broadcast_to(v, grid.shape) for name, v in grid.coordinates.items()}
    direct = evaluate_first_order(scene.model, scene.errors, full, scene.view())
    assert found.error_um == pytest.approx(direct.error_um, abs=1e-9)


def test_slice_outside_the_volume_is_refused(scene):
    with pytest.raises(OptionError, match="X = 300 mm; expected -275 to 275 mm"):
        build_slice(scene.model, scene.workspace, "X", 300.0)
    with pytest.raises(OptionError):
        build_slice(scene.model, scene.workspace, "X", float("nan"))
    with pytest.raises(UnknownNameError):
        build_slice(scene.model, scene.workspace, "B", 0.0)


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
