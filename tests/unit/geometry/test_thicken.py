"""A line becomes a bar, a point a cube; the nodes they belong to are known."""

import numpy as np
import pytest

from warpspace.geometry.surfaces import outer_surface
from warpspace.geometry.thicken import is_thin, spread, spread_nodes, thicken


def line(axis: int, direction: np.ndarray, count: int = 5) -> np.ndarray:
    shape = [1, 1, 1]
    shape[axis] = count
    return (np.linspace(-10.0, 10.0, count)[:, None] * direction).reshape(*shape, 3)


@pytest.mark.parametrize(
    ("shape", "thin"),
    [((5, 1, 1), True), ((1, 1, 1), True), ((1, 5, 5), False), ((2, 3, 4), False)],
)
def test_thin_is_what_has_no_area(shape: tuple[int, int, int], thin: bool) -> None:
    assert is_thin(shape) is thin
    assert thin is (len(outer_surface(shape).triangles) == 0)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("along", [*np.eye(3), -np.eye(3)[1], np.array([0.6, -0.8, 0.0])])
def test_a_bar_has_the_line_as_its_middle_and_volume(axis: int, along: np.ndarray) -> None:
    nodes = line(axis, along)
    bar = thicken(nodes, 2.0)
    assert bar.shape == (*(n if n > 1 else 2 for n in nodes.shape[:3]), 3)
    still = tuple(other for other in range(3) if other != axis)
    np.testing.assert_allclose(bar.mean(axis=still), nodes.reshape(-1, 3), atol=1e-12)
    corner = bar[0, 0, 0]
    edges = np.stack([bar[-1, 0, 0], bar[0, -1, 0], bar[0, 0, -1]]) - corner
    assert abs(np.linalg.det(edges)) > 20.0 * 2.0 * 2.0 * 0.5


def test_a_point_becomes_a_cube_around_it() -> None:
    cube = thicken(np.full((1, 1, 1, 3), 7.0), 2.0)
    assert cube.shape == (2, 2, 2, 3)
    np.testing.assert_array_equal(np.ptp(cube.reshape(-1, 3), axis=0), (2.0, 2.0, 2.0))
    np.testing.assert_array_equal(cube.reshape(-1, 3).mean(axis=0), (7.0, 7.0, 7.0))


def test_values_and_nodes_are_spread_alike() -> None:
    values = np.arange(5.0).reshape(1, 5, 1)
    nodes = spread_nodes((1, 5, 1))
    np.testing.assert_array_equal(spread(values).reshape(-1), values.reshape(-1)[nodes])
