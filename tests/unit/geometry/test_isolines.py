import numpy as np
import pytest

from warpspace.geometry.colour import build_scale
from warpspace.geometry.faces import cut_faces, outer_faces
from warpspace.geometry.isolines import isoline_levels, isoline_segments, isolines

SHAPE = (5, 7, 9)


def plane(shape=SHAPE):
    """Nodes of a unit-spaced grid and a value that rises linearly."""
    nodes = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1).astype(float)
    return nodes.reshape(-1, 3), nodes.reshape(-1, 3) @ (1.0, 0.5, 0.25)


def test_levels_are_the_ticks_inside_the_scale():
    scale = build_scale(47.0, "norm")
    assert isoline_levels(scale) == scale.ticks[1:-1]
    signed = isoline_levels(build_scale(7.0, "x"))
    assert 0.0 in signed
    assert signed == tuple(-value for value in reversed(signed))


@pytest.mark.parametrize("faces", [outer_faces(SHAPE), cut_faces(SHAPE, (1, 0, 1))])
def test_points_of_a_line_have_its_value(faces):
    nodes, values = plane()
    count = 0
    for face in faces:
        for level, line in isolines(face, nodes, values, (1.3, 3.0, 4.7)):
            assert line @ (1.0, 0.5, 0.25) == pytest.approx(level, abs=1e-9)
            count += len(line)
    assert count > 20


def test_segments_are_lifted_face_by_face():
    nodes, values = plane()
    faces = outer_faces(SHAPE)
    lift = np.arange(18.0).reshape(6, 3)
    plain = isoline_segments(faces, nodes, values, (2.2,))
    lifted = isoline_segments(faces, nodes, values, (2.2,), lift)
    moved = np.unique((lifted - plain).reshape(-1, 3), axis=0)
    assert {tuple(row) for row in np.round(moved, 9)} <= {tuple(row) for row in lift}
    assert plain.shape[1:] == (2, 3)


def test_nothing_where_all_is_equal():
    nodes, _ = plane()
    flat = np.zeros(len(nodes))
    assert isoline_segments(outer_faces(SHAPE), nodes, flat, (0.0, 1.0)).shape == (0, 2, 3)
