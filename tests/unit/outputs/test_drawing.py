"""Drawing: places of labels, hidden parts of lines, projections, numbers as figures spell them."""

from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from warpspace.exceptions import OptionError
from warpspace.outputs.charts.result_charts import result_chart
from warpspace.outputs.drawing.canvas import Occupancy, place_label
from warpspace.outputs.drawing.off_screen import (
    Projection,
    Raster,
    fit_projection,
    split_visible,
    view_axes,
)
from warpspace.picture.model import VIEWS

FRAME, SIZE = (0.0, 0.0, 400.0, 300.0), (60.0, 14.0)


def test_labels_stay_in_the_frame():
    taken = Occupancy(400, 300, 2.0)
    for corner in ((0.0, 0.0), (400.0, 300.0), (0.0, 300.0), (400.0, 0.0)):
        left, bottom, right, top = place_label([corner], SIZE, FRAME, taken, 1.0).rect
        assert 0.0 <= left < right <= 400.0
        assert 0.0 <= bottom < top <= 300.0


def test_labels_of_one_point_keep_apart():
    taken = Occupancy(400, 300, 2.0)
    rects = [place_label([(200.0, 150.0)], SIZE, FRAME, taken, 1.0).rect for _ in range(6)]
    for a, b in combinations(rects, 2):
        assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1], (a, b)


def test_labels_avoid_lines():
    taken = Occupancy(400, 300, 2.0)
    free = place_label([(200.0, 150.0)], SIZE, FRAME, Occupancy(400, 300, 2.0), 1.0)
    assert free.cost == 0.0
    assert free.distance < 10.0
    assert place_label([(200.0, 150.0)], (500.0, 14.0), FRAME, taken, 1.0) is None  # too wide
    taken.add_lines([np.array([[200.0, 0.0], [200.0, 300.0]])])
    placed = place_label([(200.0, 150.0)], SIZE, FRAME, taken, 1.0)
    assert placed.rect[0] >= 200.0 or placed.rect[2] <= 200.0


FRONT = Projection(
    np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0]),
    1.0, np.zeros(3), np.array([100.0, 100.0]),
)  # fmt: skip


def wall(from_column, depth):
    """A wall over the right part of a picture of 200 px."""
    depths = np.full((200, 200), np.inf, dtype=np.float32)
    depths[:, from_column:] = depth
    rgba = np.zeros((200, 200, 4), dtype=np.uint8)
    return Raster(rgba, depths, depths, (0.0, 0.0, 200.0, 200.0))


def test_without_bodies_all_is_visible():
    line = np.array([[-50.0, 0.0, 0.0], [50.0, 0.0, 0.0]])
    seen, hidden = split_visible([line], FRONT, None)
    assert np.allclose(seen[0], [[50.0, 100.0], [150.0, 100.0]])
    assert hidden == []


@pytest.mark.parametrize(("y", "ends"), [(20.0, [100.0]), (0.0, []), (-20.0, [])])
def test_a_wall_hides_what_is_behind_it_and_nothing_in_front_of_it_or_on_it(y, ends):
    line = np.array([[-50.0, y, 0.0], [50.0, y, 0.0]])
    (seen,), hidden = split_visible([line], FRONT, wall(100, 0.0))
    assert seen[-1, 0] == pytest.approx(*(ends or [150.0]), abs=2.0)
    assert [part[0, 0] for part in hidden] == pytest.approx(ends, abs=2.0)


RECT = (100.0, 50.0, 900.0, 650.0)
POINTS = np.array([(x, y, z) for x in (0.0, 550.0) for y in (0.0, 450.0) for z in (0.0, 400.0)])


@pytest.mark.parametrize("view", VIEWS)
def test_points_fill_the_box_along_right_handed_axes(view):
    frame = np.stack(view_axes(view))
    assert np.allclose(frame @ frame.T, np.eye(3))
    assert np.linalg.det(frame) == pytest.approx(1.0)
    spots = fit_projection(view, POINTS, RECT).project(POINTS)
    low, high = spots.min(axis=0), spots.max(axis=0)
    assert np.allclose((low + high) / 2.0, [500.0, 350.0])
    assert np.max((high - low) / (800.0, 600.0)) == pytest.approx(1.0)  # none stands out


def test_the_operator_sees_x_to_the_right_and_z_upwards():
    projection = fit_projection("front", POINTS, RECT)
    origin, x, y, z = projection.project(np.vstack([np.zeros(3), 100.0 * np.eye(3)]))
    assert x[0] > origin[0]
    assert x[1] == pytest.approx(origin[1])
    assert z[1] > origin[1]
    assert np.allclose(y, origin)
    depth = projection.depth_mm(np.array([[0.0, 0.0, 0.0], [0.0, 100.0, 0.0]]))
    assert depth[1] - depth[0] == pytest.approx(100.0)


def test_one_point_is_drawn_in_the_middle():
    projection = fit_projection("iso", np.array([[3.0, 4.0, 5.0]]), RECT)
    assert np.allclose(projection.project(np.array([3.0, 4.0, 5.0])), [500.0, 350.0])


def test_a_result_without_charts_is_refused_by_its_title():
    with pytest.raises(OptionError, match="Nothing moves: no chart is defined"):
        result_chart(SimpleNamespace(blocks=lambda: ["Nothing moves"]))
