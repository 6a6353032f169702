import numpy as np
import pytest

from warpspace.geometry.arrows import build_arrows


def volume(vertices, triangles):
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    return float(np.sum(a * np.cross(b, c)) / 6.0)


@pytest.mark.parametrize("end", [(30, 0, 0), (0, -30, 0), (0, 0, 30), (10, 20, -5), (0.1, 0, 0)])
def test_arrow_runs_from_start_to_end_right_side_out(end):
    start = np.array([[1.0, 2.0, 3.0]])
    tip = start + np.array([end], dtype=float)
    vertices, triangles = build_arrows(start, tip, 1.0, 10.0)
    along = (tip - start)[0] / np.linalg.norm(tip - start)
    reach = (vertices - start) @ along
    assert reach.min() == pytest.approx(0.0, abs=1e-12)
    assert reach.max() == pytest.approx(np.linalg.norm(tip - start))
    assert volume(vertices - start, triangles) > 0.0


def test_edges_are_closed():
    _, triangles = build_arrows(np.zeros((2, 3)), np.eye(3)[:2] * 20, 1.0, 10.0)
    directed = {(int(t[i]), int(t[(i + 1) % 3])) for t in triangles for i in range(3)}
    assert len(directed) == 3 * len(triangles)
    assert directed == {(b, a) for a, b in directed}


def test_arrow_without_length_is_a_point():
    vertices, _ = build_arrows(np.ones((1, 3)), np.ones((1, 3)), 1.0, 10.0)
    assert vertices == pytest.approx(np.ones_like(vertices))
