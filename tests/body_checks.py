"""What every body of a machine has to be: closed, right side out, and clear of the volume."""

import numpy as np
from trimesh import Trimesh

from warpspace.bodies.mesh import Body
from warpspace.kinematics.bodies import BASE

HEAD = ("S", "t")
"""Frames whose bodies reach into the volume, since the tool does."""


def components(body: Body, vertices_mm: np.ndarray) -> list[Trimesh]:
    """Give the closed shapes that a body is joined from."""
    mesh = Trimesh(vertices_mm, body.triangles, process=False)
    return list(mesh.split(only_watertight=False))


def assert_closed(body: Body) -> None:
    """Every shape of a body is closed and right side out, and no triangle is lost."""
    found = components(body, body.vertices_mm)
    assert sum(len(shape.faces) for shape in found) == len(body.triangles), body.name
    for shape in found:
        assert shape.is_watertight, body.name
        assert shape.volume > 0.0, body.name


def nodes_inside(body: Body, vertices_mm: np.ndarray, nodes_mm: np.ndarray) -> int:
    """Count the points that lie in the convex hull of a shape of a body."""
    inside = np.zeros(len(nodes_mm), dtype=bool)
    for shape in components(body, vertices_mm):
        low, high = shape.bounds
        near = np.flatnonzero(((nodes_mm > low) & (nodes_mm < high)).all(axis=1))
        if len(near):
            normals = shape.face_normals
            behind = np.einsum("fi,fi->f", normals, shape.triangles[:, 0])
            inside[near[((nodes_mm[near] @ normals.T) < behind - 1e-6).all(axis=1)]] = True
    return int(inside.sum())


def of_head(machine, body: Body) -> bool:
    """Whether a body belongs to what carries the tool beyond the last linear axis, or is a neck."""
    names = machine.chain.tool
    linear = [place for place, name in enumerate(names) if machine.axes[name].is_linear]
    behind = names[linear[-1] + 1 :] if linear else names
    what = body.name.partition("_")[2]
    return body.frame in (*HEAD, *behind) or what in ("fork", "wedge", "neck")


__all__ = ["BASE", "assert_closed", "components", "nodes_inside", "of_head"]
