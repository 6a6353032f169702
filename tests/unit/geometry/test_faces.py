"""Patches of the gridded volume, and the lines on them."""

from itertools import pairwise

import numpy as np
import pytest

from warpspace.geometry.faces import crease_lines, cut_faces, face_lines, outer_faces
from warpspace.geometry.surfaces import (
    Index,
    Shape,
    box_edges,
    cut_octant,
    outer_surface,
    triangulate,
)

SHAPE = (5, 7, 9)


def grid_points(shape: Shape) -> np.ndarray:
    return np.stack(np.unravel_index(np.arange(np.prod(shape)), shape), -1).astype(float)


def volume(faces: list[Index], shape: Shape) -> float:
    """Volume inside a closed surface; positive where it faces outwards."""
    surface = triangulate(faces)
    a, b, c = (grid_points(shape)[surface.nodes[surface.triangles[:, k]]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def segments(lines: list[Index]) -> list[tuple[int, int]]:
    return [(min(a, b), max(a, b)) for line in lines for a, b in pairwise(line.tolist())]


def test_outer_faces_are_the_outer_surface() -> None:
    ours, theirs = triangulate(outer_faces(SHAPE)), outer_surface(SHAPE)
    assert np.array_equal(ours.nodes, theirs.nodes)
    assert volume(outer_faces(SHAPE), SHAPE) == pytest.approx(4 * 6 * 8)


@pytest.mark.parametrize("corner", [(0, 0, 0), (1, 0, 1), (1, 1, 1), (0, 1, 0)])
def test_a_cut_takes_an_eighth_away(corner: tuple[int, int, int]) -> None:
    assert volume(cut_faces(SHAPE, corner), SHAPE) == pytest.approx(4 * 6 * 8 * 7 / 8)
    ours = {tuple(sorted(t)) for t in np.sort(triangulate(cut_faces(SHAPE, corner)).triangles)}
    theirs = {tuple(sorted(t)) for t in np.sort(cut_octant(SHAPE, corner).triangles)}
    assert ours == theirs


def test_creases_of_a_box_are_its_edges() -> None:
    found = crease_lines(outer_faces(SHAPE), SHAPE)
    assert sorted(segments(found)) == sorted(segments(box_edges(SHAPE)))


def test_lines_are_drawn_once_and_never_on_creases() -> None:
    faces = cut_faces(SHAPE, (1, 0, 1))
    lines = segments(face_lines(faces, SHAPE, (1, 2, 2)))
    creases = segments(crease_lines(faces, SHAPE))
    assert len(lines) == len(set(lines))
    assert len(creases) == len(set(creases))
    assert not set(lines) & set(creases)


def test_the_seam_of_a_cut_face_is_no_crease() -> None:
    shape = (5, 5, 5)
    creases = segments(crease_lines(cut_faces(shape, (1, 0, 1)), shape))
    points = grid_points(shape)
    # the face y = 0 is cut at x = 2 and z = 2; below z = 2 the line x = 2 lies within it
    inside = [
        (a, b)
        for a, b in creases
        if (points[[a, b], 1] == 0).all()
        and (points[[a, b], 0] == 2).all()
        and points[[a, b], 2].max() <= 2
    ]
    assert inside == []


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
def test_flat_volumes(shape: Shape, faces: int, creases: int) -> None:
    found = cut_faces(shape, (1, 0, 1))
    assert len(found) == faces
    assert len(crease_lines(found, shape)) == creases
