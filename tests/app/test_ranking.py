"""The gain chart's numbers: those of the printed table, and contributions that add up."""

import numpy as np
import pytest

from warpspace import load_scene
from warpspace.app.evaluation.sensitivities import node_coordinates, rank_gains
from warpspace.field.grid import build_grid
from warpspace.kinematics.model import Loop
from warpspace.scene.pipeline import grid_basis


@pytest.fixture(scope="module")
def ranked():
    scene = load_scene("dvf5000_first")
    grid = build_grid(scene.model, scene.workspace, 5)
    basis = grid_basis(scene, grid)
    amplitudes = {key: scene.errors.amplitude(key) for key in scene.parameter_keys}
    field = basis.evaluate(np.array(list(amplitudes.values())))
    node = np.unravel_index(int(np.argmax(field.norm_um)), grid.shape)
    at = node_coordinates(grid.coordinates, node, grid.shape)
    bars = rank_gains(scene.model, Loop.TOOL, basis, amplitudes, node, at)
    return bars, field, node


def test_sorted_by_gain_without_the_table(ranked):
    bars, _, _ = ranked
    gains = [bar.gain for bar in bars]
    assert gains == sorted(gains, reverse=True)
    assert {bar.parameter.axis for bar in bars} == {"X", "Y", "Z"}
    assert all(bar.gain == pytest.approx(1.0) for bar in bars if not bar.parameter.is_rotation)


def test_parts_along_the_error_add_up_to_its_length(ranked):
    bars, field, node = ranked
    assert sum(bar.along_um for bar in bars) == pytest.approx(field.norm_um[node])
    assert max(bars, key=lambda bar: bar.moved_um).moved_um > 1.0
