"""Orthographic projection."""

import numpy as np
import pytest

from warpspace.outputs.drawing.projection import fit_projection, view_axes
from warpspace.picture.views import VIEWS

RECT = (100.0, 50.0, 900.0, 650.0)
POINTS = np.array([(x, y, z) for x in (0.0, 550.0) for y in (0.0, 450.0) for z in (0.0, 400.0)])


@pytest.mark.parametrize("view", VIEWS)
def test_axes_are_a_right_handed_frame(view: str) -> None:
    frame = np.stack(view_axes(view))
    assert np.allclose(frame @ frame.T, np.eye(3))
    assert np.linalg.det(frame) == pytest.approx(1.0)


@pytest.mark.parametrize("view", VIEWS)
def test_points_fill_the_box_and_stay_in_it(view: str) -> None:
    spots = fit_projection(view, POINTS, RECT).project(POINTS)
    low, high = spots.min(axis=0), spots.max(axis=0)
    assert (low >= np.array(RECT[:2]) - 1e-6).all()
    assert (high <= np.array(RECT[2:]) + 1e-6).all()
    assert np.allclose((low + high) / 2.0, [500.0, 350.0])
    assert (high - low)[0] == pytest.approx(800.0) or (high - low)[1] == pytest.approx(600.0)


def test_the_operator_sees_x_to_the_right_and_z_upwards() -> None:
    projection = fit_projection("front", POINTS, RECT)
    origin, x, y, z = projection.project(np.vstack([np.zeros(3), 100.0 * np.eye(3)]))
    assert x[0] > origin[0]
    assert x[1] == pytest.approx(origin[1])
    assert z[1] > origin[1]
    assert np.allclose(y, origin)
    depth = projection.depth_mm(np.array([[0.0, 0.0, 0.0], [0.0, 100.0, 0.0]]))
    assert depth[1] - depth[0] == pytest.approx(100.0)


def test_one_point_is_drawn_in_the_middle() -> None:
    projection = fit_projection("iso", np.array([[3.0, 4.0, 5.0]]), RECT)
    assert np.allclose(projection.project(np.array([3.0, 4.0, 5.0])), [500.0, 350.0])


def test_moving_a_projection_moves_its_pixels() -> None:
    projection = fit_projection("iso", POINTS, RECT)
    shift = np.array([30.0, -20.0])
    moved = projection.moved(shift)
    assert np.allclose(moved.project(POINTS), projection.project(POINTS) + shift)
