"""The working volume and the grid over it."""

import numpy as np
import pytest

from warpspace.exceptions import OptionError
from warpspace.field.grid import MAX_NODES, MIN_NODES, Workspace, build_grid, node_counts
from warpspace.kinematics.model import Model
from warpspace.machine.description import build_machine

MODEL = Model(build_machine("wCFXYZt", offset_mm={"Z": (0.0, 0.0, 500.0)}))
VOLUME = Workspace({"X": (-10.0, 10.0), "Y": (0.0, 30.0), "Z": (-50.0, 50.0), "C": (90.0, 90.0)})


def test_grid_has_a_node_for_every_combination_of_positions() -> None:
    grid = build_grid(MODEL, VOLUME, (2, 3, 5))
    assert grid.shape == (2, 3, 5)
    assert grid.nominal_mm.shape == (2, 3, 5, 3)
    assert grid.nominal_mm[1, 1, 0].tolist() == [10.0, 15.0, 450.0]
    assert grid.extent_mm.tolist() == [20.0, 30.0, 100.0]
    assert grid.longest_edge_mm == 100.0
    assert float(grid.coordinates["C"]) == 90.0
    full = np.broadcast_arrays(*grid.coordinates.values())
    assert full[0].shape == grid.shape


def test_axis_that_stands_still_has_one_node() -> None:
    grid = build_grid(MODEL, VOLUME.moved({"Y": 7.0}), 4)
    assert grid.shape == (4, 1, 4)
    assert np.unique(grid.nominal_mm[..., 1]).tolist() == [7.0]


def test_machine_without_an_axis_has_one_node_along_it() -> None:
    lathe = Model(build_machine("wCFXZt"))
    grid = build_grid(lathe, Workspace({"X": (0.0, 1.0), "Z": (0.0, 1.0)}), 3)
    assert grid.shape == (3, 1, 3)


def test_machine_of_rotary_axes_only_has_one_node() -> None:
    table = Model(build_machine("wCBFt"))
    grid = build_grid(table, Workspace({"B": (30.0, 30.0)}), 5)
    assert grid.shape == (1, 1, 1)
    assert grid.longest_edge_mm == 0.0


@pytest.mark.parametrize("chain", ["wXYFZt", "wYFXZt", "wXYZFt", "wCXFYZt", "wXCFYZt", "wFXYZt"])
def test_volume_keeps_its_shape_whichever_side_its_axes_are_on(chain: str) -> None:
    model = Model(build_machine(chain, direction=dict.fromkeys(chain[1 : chain.index("F")], -1)))
    grid = build_grid(model, VOLUME.moved({"C": 0.0}), 3)
    assert grid.extent_mm.tolist() == [20.0, 30.0, 100.0]
    along_x = grid.nominal_mm[2, 0, 0] - grid.nominal_mm[0, 0, 0]
    assert along_x.tolist() == [20.0, 0.0, 0.0]
    tool_side = [axis for axis in "XYZ" if axis in model.machine.chain.tool]
    moved = np.ptp(grid.point_mm.reshape(-1, 3), axis=0)
    assert [axis for axis, length in zip("XYZ", moved, strict=True) if length] == tool_side


def test_volume_on_a_turned_table_turns_with_it() -> None:
    model = Model(build_machine("wXCFYZt"))
    grid = build_grid(model, VOLUME, 2)
    edge = grid.nominal_mm[1, 0, 0] - grid.nominal_mm[0, 0, 0]
    np.testing.assert_allclose(edge, [0.0, -20.0, 0.0], atol=1e-12)


def test_positions_are_the_middles_and_moving_leaves_the_original_alone() -> None:
    assert VOLUME.positions == {"X": 0.0, "Y": 15.0, "Z": 0.0, "C": 90.0}
    moved = VOLUME.moved({"C": 0.0})
    assert (moved.positions["C"], VOLUME.positions["C"]) == (0.0, 90.0)


@pytest.mark.parametrize("nodes", [MIN_NODES, MAX_NODES, np.int64(5), (2, 3, 4), [2, 3, 4]])
def test_counts_within_the_limits_are_taken(nodes) -> None:
    counts = node_counts(nodes)
    assert len(counts) == 3
    assert all(type(count) is int for count in counts)


@pytest.mark.parametrize("nodes", [1, 0, -3, MAX_NODES + 1, (2, 2), (2, 2, 1), (2, 2, 2, 2), True])
def test_counts_beyond_the_limits_are_refused(nodes) -> None:
    with pytest.raises(OptionError, match="expected 2 to 101 per axis"):
        node_counts(nodes)


@pytest.mark.parametrize("nodes", [5.5, "21", None, (2, 3, 4.0)])
def test_counts_that_are_no_whole_numbers_are_refused(nodes) -> None:
    with pytest.raises(OptionError, match="expected whole numbers"):
        node_counts(nodes)
