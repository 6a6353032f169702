"""Hidden parts of lines, on a made-up depth picture."""

import numpy as np
import pytest

from warpspace.outputs.drawing.lines import split_visible
from warpspace.outputs.drawing.projection import Projection
from warpspace.outputs.drawing.render import Raster

FRONT = Projection(
    np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0]),
    1.0, np.zeros(3), np.array([100.0, 100.0]),
)  # fmt: skip


def wall(from_column: int, depth: float) -> Raster:
    """A wall over the right part of a picture of 200 px."""
    depths = np.full((200, 200), np.inf, dtype=np.float32)
    depths[:, from_column:] = depth
    rgba = np.zeros((200, 200, 4), dtype=np.uint8)
    return Raster(rgba, depths, depths, (0.0, 0.0, 200.0, 200.0))


def test_without_bodies_all_is_visible() -> None:
    line = np.array([[-50.0, 0.0, 0.0], [50.0, 0.0, 0.0]])
    seen, hidden = split_visible(line, FRONT, None)
    assert np.allclose(seen[0], [[50.0, 100.0], [150.0, 100.0]])
    assert hidden == []


def test_a_wall_hides_what_is_behind_it() -> None:
    line = np.array([[-50.0, 20.0, 0.0], [50.0, 20.0, 0.0]])
    seen, hidden = split_visible(line, FRONT, wall(100, 0.0))
    assert len(seen) == 1
    assert len(hidden) == 1
    assert seen[0][-1, 0] == pytest.approx(100.0, abs=2.0)
    assert hidden[0][0, 0] == pytest.approx(100.0, abs=2.0)


def test_a_wall_hides_nothing_in_front_of_it_or_on_it() -> None:
    for y in (-20.0, 0.0):
        line = np.array([[-50.0, y, 0.0], [50.0, y, 0.0]])
        seen, hidden = split_visible(line, FRONT, wall(100, 0.0))
        assert len(seen) == 1
        assert hidden == []
        assert len(seen[0]) == 2
