"""Faces, isolines, arrows, marks and bodies of what has no area."""

from itertools import pairwise

import numpy as np
import pytest

from warpspace.geometry.colour import build_scale
from warpspace.geometry.rays import pick_point, pick_surface
from warpspace.geometry.surfaces import (
    above_limit,
    box_edges,
    crease_lines,
    cut_faces,
    face_lines,
    is_thin,
    isoline_levels,
    isolines,
    outer_faces,
    outer_surface,
    thicken,
    triangulate,
)

SHAPE = (5, 7, 9)


def grid_points(shape):
    return np.stack(np.unravel_index(np.arange(np.prod(shape)), shape), -1).astype(float)


def volume_of_faces(faces, shape):
    surface = triangulate(faces)
    a, b, c = (grid_points(shape)[surface.nodes[surface.triangles[:, k]]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def segments(lines):
    return [(min(a, b), max(a, b)) for line in lines for a, b in pairwise(line.tolist())]


@pytest.mark.parametrize("corner", [(0, 0, 0), (1, 0, 1), (1, 1, 1), (0, 1, 0)])
def test_a_cut_takes_an_eighth_away(corner):
    assert volume_of_faces(cut_faces(SHAPE, corner), SHAPE) == pytest.approx(4 * 6 * 8 * 7 / 8)
    whole = outer_faces(SHAPE)
    assert volume_of_faces(whole, SHAPE) == pytest.approx(4 * 6 * 8)
    edges = sorted(segments(box_edges(SHAPE)))
    assert sorted(segments(crease_lines(whole, SHAPE))) == edges


def test_lines_are_drawn_once_and_never_on_creases():
    faces = cut_faces(SHAPE, (1, 0, 1))
    lines = segments(face_lines(faces, SHAPE, (1, 2, 2)))
    creases = segments(crease_lines(faces, SHAPE))
    assert len(lines) == len(set(lines))
    assert len(creases) == len(set(creases))
    assert not set(lines) & set(creases)


def test_the_seam_of_a_cut_face_is_no_crease():
    shape = (5, 5, 5)
    creases = segments(crease_lines(cut_faces(shape, (1, 0, 1)), shape))
    points = grid_points(shape)
    # the face y = 0 is cut at x = 2 and z = 2; below z = 2 the line x = 2 lies within it
    x, y, z = np.moveaxis(points[np.array(creases)], -1, 0)
    assert not ((y == 0) & (x == 2) & (z <= 2)).all(axis=1).any()


@pytest.mark.parametrize(
    ("shape", "faces", "creases"),
    [
        ((5, 5, 1), 1, 4),
        ((5, 1, 5), 1, 4),
        ((5, 1, 1), 0, 0),
        ((1, 1, 1), 0, 0),
        ((2, 2, 2), 6, 12),
    ],
)
def test_flat_volumes(shape, faces, creases):
    found = cut_faces(shape, (1, 0, 1))
    assert len(found) == faces
    assert len(crease_lines(found, shape)) == creases
    assert is_thin(shape) == (faces == 0) == (len(outer_surface(shape).triangles) == 0)


def test_the_surface_is_hatched_above_a_limit_only_and_evenly():
    shape, spacing = (7, 5, 3), 0.25
    nodes = np.moveaxis(np.indices(shape, dtype=float), 0, -1).reshape(-1, 3)
    surface = outer_surface(shape)
    triangles = surface.nodes[surface.triangles]
    above = nodes[:, 0] - 2.6
    (line, of_line), (hatching, of) = above_limit(nodes, above, triangles, spacing)
    assert np.ptp(line[..., 0]) < 1e-12
    assert line[0, 0, 0] == pytest.approx(2.6)
    # around the box, once
    assert np.linalg.norm(np.diff(line, axis=1), axis=-1).sum() == pytest.approx(2 * (4 + 2))
    assert hatching[..., 0].min() == pytest.approx(2.6)
    assert hatching[..., 0].max() == 6.0
    levels = hatching.sum(axis=-1) / spacing
    assert np.abs(levels - np.rint(levels)).max() < 1e-9
    assert {*np.rint(levels).ravel()} == {*range(11, 49)}
    for ends, triangle in ((line, of_line), (hatching, of)):  # in the planes of their triangles
        corners = nodes[triangles[triangle]]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        away = np.einsum("nek,nk->ne", ends - corners[:, :1], normals)
        assert np.abs(away).max() < 1e-12
    none = above_limit(nodes, above - 9.0, triangles, spacing)
    assert [len(ends) for ends, _ in none] == [0, 0]


def test_levels_are_the_ticks_inside_the_scale():
    scale = build_scale(47.0, "norm")
    assert isoline_levels(scale) == scale.ticks[1:-1]
    signed = isoline_levels(build_scale(7.0, "x"))
    assert 0.0 in signed
    assert signed == tuple(-value for value in reversed(signed))


@pytest.mark.parametrize("faces", [outer_faces(SHAPE), cut_faces(SHAPE, (1, 0, 1))])
def test_points_of_a_line_have_its_value(faces):
    nodes = grid_points(SHAPE)
    values = nodes @ (1.0, 0.5, 0.25)
    count = 0
    for face in faces:
        for level, line in isolines(face, nodes, values, (1.3, 3.0, 4.7)):
            assert line @ (1.0, 0.5, 0.25) == pytest.approx(level, abs=1e-9)
            count += len(line)
    assert count > 20


def line(axis, direction, count=5):
    shape = [1, 1, 1]
    shape[axis] = count
    return (np.linspace(-10.0, 10.0, count)[:, None] * direction).reshape(*shape, 3)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("along", [*np.eye(3), -np.eye(3)[1], np.array([0.6, -0.8, 0.0])])
def test_a_bar_has_the_line_as_its_middle_and_volume(axis, along):
    nodes = line(axis, along)
    bar = thicken(nodes, 2.0)
    assert bar.shape == (*(n if n > 1 else 2 for n in nodes.shape[:3]), 3)
    still = tuple(other for other in range(3) if other != axis)
    np.testing.assert_allclose(bar.mean(axis=still), nodes.reshape(-1, 3), atol=1e-12)
    corner = bar[0, 0, 0]
    edges = np.stack([bar[-1, 0, 0], bar[0, -1, 0], bar[0, 0, -1]]) - corner
    assert abs(np.linalg.det(edges)) > 20.0 * 2.0 * 2.0 * 0.5


def test_a_point_becomes_a_cube_around_it():
    cube = thicken(np.full((1, 1, 1, 3), 7.0), 2.0)
    assert cube.shape == (2, 2, 2, 3)
    np.testing.assert_array_equal(np.ptp(cube.reshape(-1, 3), axis=0), (2.0, 2.0, 2.0))
    np.testing.assert_array_equal(cube.reshape(-1, 3).mean(axis=0), (7.0, 7.0, 7.0))


def test_a_ray_hits_the_near_face_of_a_box_or_the_nearest_point():
    surface, origin = outer_surface((4, 4, 4)), np.array([0.3, -5.0, 0.6])
    vertices = grid_points((4, 4, 4))[surface.nodes] / 3.0
    direction = np.array([0.0, 1.0, 0.0])
    at, weights, distance = pick_surface(origin, direction, vertices, surface.triangles)
    np.testing.assert_allclose(weights @ vertices[at], [0.3, 0.0, 0.6], atol=1e-12)
    assert distance == pytest.approx(5.0)
    for beside in ([0.0, -1.0, 0.0], [1.0, 1.0, 0.0]):
        assert pick_surface(origin, np.array(beside), vertices, surface.triangles) is None
    points, ray = np.array([[0.0, 10.0, 0.0], [0.0, 10.0, 1.0]]), np.array([0.0, 1.0, 0.01])
    assert pick_point(np.zeros(3), ray, points, 0.05) == (0, pytest.approx(10.0, rel=1e-3))
    assert pick_point(np.zeros(3), ray, points, 0.005) is None
    assert pick_point(np.zeros(3), -ray, points, 0.05) is None
