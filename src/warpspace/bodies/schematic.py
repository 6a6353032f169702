"""Schematic bodies from simple closed shapes: boxes, cylinders, rings and cones, built by trimesh.

All sizes are mm. A body is described where it stands with every axis at zero, in R, and then moved
into the frame it rides on.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from warpspace.bodies.body_file import frame_of
from warpspace.bodies.mesh import Body, build_body
from warpspace.units import Array

SIDES = 40
"""Flat sides by which a circle is drawn."""
Range = tuple[float, float]
Shape = Any
"""A closed mesh of trimesh."""


def box(x: Range, y: Range, z: Range) -> Shape:
    """Build a box between two positions along each axis, mm."""
    from trimesh import creation

    ends = np.array([x, y, z], dtype=float)
    mesh = creation.box(extents=np.ptp(ends, axis=1))
    mesh.apply_translation(ends.mean(axis=1))
    return mesh


def cylinder(
    radius: float, ends: Range, at: Range = (0.0, 0.0), axis: str = "z", inner: float = 0.0
) -> Shape:
    """Build a cylinder, or a ring, about a line parallel to an axis.

    Parameters
    ----------
    radius : float, mm
    ends : tuple of float, (2,), mm
        Positions of its ends along the axis.
    at : tuple of float, (2,), mm, optional
        The other two coordinates of its line, in the order x, y, z.
    axis : str, optional
        "x", "y" or "z".
    inner : float, mm, optional
        Radius of a bore.

    Returns
    -------
    trimesh.Trimesh
    """
    from trimesh import creation, transformations

    height = ends[1] - ends[0]
    mesh = (
        creation.annulus(r_min=inner, r_max=radius, height=height, sections=SIDES)
        if inner
        else creation.cylinder(radius=radius, height=height, sections=SIDES)
    )
    if axis != "z":
        about, angle = ([0, 1, 0], np.pi / 2) if axis == "x" else ([1, 0, 0], np.pi / 2)
        mesh.apply_transform(transformations.rotation_matrix(angle, about))
    mesh.apply_translation(np.insert(np.asarray(at, dtype=float), "xyz".index(axis), sum(ends) / 2))
    return mesh


def cone(lower: float, upper: float, ends: Range) -> Shape:
    """Build a frustum about z with two radii between two heights, mm."""
    from trimesh import creation

    outline = np.array([(0.0, ends[0]), (lower, ends[0]), (upper, ends[1]), (0.0, ends[1])])
    return creation.revolve(outline, sections=SIDES)


def join_shapes(
    name: str, colour: tuple[int, int, int], shapes: Sequence[Shape], origin_mm: Array
) -> Body:
    """Join closed shapes to a body in its own frame.

    Parameters
    ----------
    name : str
        Frame it rides on, an underscore, and what it is.
    colour : tuple of int, (3,)
        sRGB.
    shapes : sequence of trimesh.Trimesh
        In R, with every axis at zero.
    origin_mm : ndarray, [3], mm
        Where the origin of its frame then stands in R; the frame is parallel to R.

    Returns
    -------
    Body

    Raises
    ------
    ValueError
        If a shape is open or inside out.
    """
    from trimesh import util

    for shape in shapes:
        if not shape.is_watertight or shape.volume <= 0.0:
            raise ValueError(f"{name}: a shape of volume {shape.volume} is open or inside out")
    mesh: Any = util.concatenate(list(shapes))
    mesh.apply_translation(-origin_mm)
    return build_body(mesh, name, frame_of(name), colour)
