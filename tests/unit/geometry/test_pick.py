"""Rays against a box whose hits are known."""

import numpy as np
import pytest

from warpspace.geometry.pick import pick_point, pick_surface
from warpspace.geometry.surfaces import outer_surface

AXES = [np.linspace(0.0, 1.0, 4)] * 3
NODES = np.stack(np.meshgrid(*AXES, indexing="ij"), -1).reshape(-1, 3)
SURFACE = outer_surface((4, 4, 4))
VERTICES = NODES[SURFACE.nodes]


def test_ray_hits_the_near_face_at_the_point_aimed_at():
    hit = pick_surface(
        np.array([0.3, -5.0, 0.6]), np.array([0.0, 1.0, 0.0]), VERTICES, SURFACE.triangles
    )
    assert hit is not None
    np.testing.assert_allclose(hit.weights @ VERTICES[hit.vertices], [0.3, 0.0, 0.6], atol=1e-12)
    assert hit.distance == pytest.approx(5.0)


def test_ray_that_points_away_or_beside_misses():
    origin = np.array([0.3, -5.0, 0.6])
    assert pick_surface(origin, np.array([0.0, -1.0, 0.0]), VERTICES, SURFACE.triangles) is None
    assert pick_surface(origin, np.array([1.0, 1.0, 0.0]), VERTICES, SURFACE.triangles) is None


def test_nearest_point_within_the_tolerance_is_picked():
    points = np.array([[0.0, 10.0, 0.0], [0.0, 10.0, 1.0]])
    ray = np.array([0.0, 1.0, 0.01])
    assert pick_point(np.zeros(3), ray, points, 0.05) == (0, pytest.approx(10.0, rel=1e-3))
    assert pick_point(np.zeros(3), ray, points, 0.005) is None
    assert pick_point(np.zeros(3), -ray, points, 0.05) is None
