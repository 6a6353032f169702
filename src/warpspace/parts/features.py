"""Planes, cylinders, cones and spheres of a part: found in its mesh, fitted by least squares.

A shape is a surface of revolution about an axis: from a point at the height h along it and the
distance ρ from it, (ρ − radius) · cos φ − h · sin φ is the way to the surface. φ is 0 for a
cylinder and the half angle of a cone; −90° makes it a plane whose axis is its normal. Fits are
Gauss-Newton steps on these distances, over the vertices that belong to the feature.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpspace.kinematics.transforms import vector_rotation
from warpspace.parts.part import PartMesh
from warpspace.units import Array

SMOOTH_DEG = 30.5  # triangles meeting at less may belong to one curved surface: 12 around a hole
FLAT_RAD = 1e-3  # triangles meeting at less lie in one facet
FINE = 5e-6  # share of the largest coordinate that vertices are rounded by: files of six digits
CLOSE = 2e-5  # share of its extent that a feature's vertices may be off its shape, beside rounding
NEAR_DEG = 12.0  # angle between triangles and the first guess of the shape, at most
FACETS = 4  # of a curved surface, at least: fewer lie on many shapes
ALIKE = 4.0  # facets within this ratio may belong to one surface that runs into others
ODD = 0.01  # share of its area that may lean otherwise: slivers
MAX_FEATURES = 500  # the largest surfaces of a mesh; what lies behind is left
STEPS, STILL_MM = 40, 1e-11  # steps of a fit, and the change of a distance that ends it
FAR = 1e6  # a step so large leads away from all parts

# what a fit may change of a shape: shifts along its u, v and axis, turns about them, radius, angle
FREE = {
    "plane": (2, 3, 4),
    "cylinder": (0, 1, 3, 4, 6),
    "cone": (0, 1, 3, 4, 6, 7),
    "sphere": (0, 1, 2, 6),  # behind the cone: two circles lie on both
}
FREEDOMS = 8
Indices = NDArray[np.intp]


class Response(NamedTuple):
    """How far points are from a shape, and what moves that."""

    distance_mm: Array  # [n], outwards
    normal: Array  # [n, 3], unit vectors; what the distance grows with
    design: Array  # [n, 8], growth per unit of each freedom of the shape


@dataclass(frozen=True, eq=False)
class Shape:
    """A plane, sphere, cylinder or cone."""

    kind: str
    centre_mm: Array  # [3]; on the plane or axis, amid the points that it was fitted to
    frame: Array  # [3, 3], right-handed columns u, v, axis; that of a plane is its outward normal
    radius_mm: float = 0.0  # at the centre
    angle_rad: float = 0.0  # half angle of a cone, along whose axis the radius grows

    @property
    def axis(self) -> Array:
        """Unit vector, [3]: normal of a plane, axis of a cylinder or cone."""
        return self.frame[:, 2]

    @property
    def across(self) -> Array:
        """Directions in which it has a place, [3, n]: a plane only along its normal."""
        return self.frame[:, [at for at in FREE[self.kind] if at < 3]]

    def respond(self, point_mm: Array) -> Response:
        """Measure points, [n, 3], against the shape."""
        arm = (point_mm - self.centre_mm) @ self.frame
        sine, cosine = np.sin(self.angle_rad), np.cos(self.angle_rad)
        x, y, z = arm.T
        height, radial = (0.0 * z, arm) if self.kind == "sphere" else (z, arm * [1.0, 1.0, 0.0])
        length = np.sqrt(np.sum(radial * radial, axis=1))
        normal = radial * (cosine / np.maximum(length, 1e-300))[:, None] - [0.0, 0.0, sine]
        u, v, w = normal.T
        beyond = length - self.radius_mm
        turned = y * w - z * v, z * u - x * w, x * v - y * u
        opening = beyond * sine + height * cosine
        design = -np.column_stack([normal, *turned, np.full(len(arm), cosine), opening])
        return Response(beyond * cosine - height * sine, normal @ self.frame.T, design)

    def moved(self, step: Array) -> "Shape":
        """Give the shape after a step, [8], mm and rad, of its freedoms."""
        return replace(
            self,
            centre_mm=self.centre_mm + self.frame @ step[:3],
            frame=vector_rotation(self.frame @ step[3:6]) @ self.frame,
            radius_mm=self.radius_mm + step[6],
            angle_rad=self.angle_rad + step[7],
        )


def fit_shape(start: Shape, point_mm: Array) -> Shape:
    """Fit a shape to points, [n, 3], by least squares of their distances, from a near one."""
    shape, free = start, list(FREE[start.kind])
    for _ in range(STEPS):
        found = shape.respond(point_mm)
        step = np.zeros(FREEDOMS)
        design = found.design[:, free]
        step[free] = -np.linalg.lstsq(design.T @ design, design.T @ found.distance_mm, 1e-13)[0]
        if not np.abs(step).max() < FAR:
            break
        shape = shape.moved(step)
        if np.abs(design @ step[free]).max() < STILL_MM:
            break
    step, still = np.zeros(FREEDOMS), [at for at in range(3) if at not in free]
    # along itself the shape stays amid the points
    step[still] = ((point_mm.mean(axis=0) - shape.centre_mm) @ shape.frame)[still]
    step[6] = step[2] * np.tan(shape.angle_rad)
    return shape.moved(step)


@dataclass(frozen=True, eq=False)
class Feature:
    """One surface of a part."""

    name: str
    shape: Shape  # in the frame of the mesh
    vertices: NDArray[np.int32]  # [n], of the mesh
    triangles: Indices  # [m], of the mesh
    area_mm2: float
    away_mm: Array  # [n], distances of its vertices in the file


def find_features(mesh: PartMesh) -> tuple[Feature, ...]:
    """Find the shapes that the surface of a part consists of, the largest first in each kind.

    Equally large ones are in the order of their places, x before y before z. A surface that is none
    of them, within `CLOSE` of its extent, is no feature.
    """

    def order(feature: Feature) -> tuple[float, ...]:
        place = np.round(feature.shape.centre_mm, 3) + 0.0  # −0 becomes 0
        return (float(f"{-feature.area_mm2:.5g}"), *place.tolist())

    counts = dict.fromkeys(FREE, 0)
    named: list[Feature] = []
    for feature in sorted(_Surfaces(mesh).features(), key=order)[:MAX_FEATURES]:
        counts[kind := feature.shape.kind] += 1
        named.append(replace(feature, name=f"{kind} {counts[kind]}"))
    return tuple(named)


class _Surfaces:
    """The surfaces of a mesh between its creases."""

    def __init__(self, mesh: PartMesh) -> None:
        self.mesh = mesh
        self.area, self.normals = mesh.surface.area_faces, mesh.surface.face_normals
        self.rounding_mm = FINE * float(np.abs(mesh.vertices_mm).max())
        one, other = mesh.surface.face_adjacency.T
        cosine = np.einsum("ec,ec->e", self.normals[one], self.normals[other])
        is_smooth = cosine > np.cos(np.deg2rad(SMOOTH_DEG))
        self.pairs = np.stack([one[is_smooth], other[is_smooth]], axis=-1)
        self.facet_of = self._joined(self.pairs[cosine[is_smooth] > np.cos(FLAT_RAD)])

    def features(self) -> Iterator[Feature]:
        """Classify what lies between creases; then what is left of it by the size of its facets."""
        is_left = np.ones(len(self.area), dtype=bool)
        for part in self._largest(self._joined(self.pairs), is_left):
            if feature := self._classify(part):
                is_left[part] = False
                yield feature
        one, other = self.pairs.T
        facet = np.bincount(self.facet_of, self.area)[self.facet_of]
        is_like = np.maximum(facet[one], facet[other]) < ALIKE * np.minimum(
            facet[one], facet[other]
        )
        links = self._joined(self.pairs[is_like & is_left[one] & is_left[other]])
        yield from filter(None, map(self._classify, self._largest(links, is_left)))

    def _joined(self, pairs: Indices) -> Indices:
        """Give the same number, [T], to triangles that pairs of them connect."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        links = np.ones(len(pairs), dtype=bool), (pairs[:, 0], pairs[:, 1])
        matrix = coo_array(links, shape=(len(self.area), len(self.area)))
        return connected_components(matrix, directed=False)[1]

    def _largest(self, label: Indices, chosen: NDArray[np.bool_]) -> list[Indices]:
        """Part chosen triangles by their labels: the largest surfaces of several triangles."""
        part = np.flatnonzero(chosen)
        part = part[np.argsort(label[part], kind="stable")]
        parts = np.split(part, np.flatnonzero(np.diff(label[part])) + 1)
        several = [one for one in parts if len(one) > 1]  # one is flat whatever the machine does
        return sorted(several, key=lambda one: -self.area[one].sum())[:MAX_FEATURES]

    def _classify(self, part: Indices) -> Feature | None:
        """Take the first kind that fits."""
        is_curved = len(np.unique(self.facet_of[part])) >= FACETS
        tried = (self._fitted(self._start(kind, part), part) for kind in FREE)
        return next(filter(None, islice(tried, None if is_curved else 1)), None)

    def _start(self, kind: str, part: Indices) -> Shape:
        """Guess a shape from its triangles: their normals meet in its axis or its centre."""
        normal, weight = self.normals[part], self.area[part] / self.area[part].sum()
        place = self.mesh.vertices_mm[self.mesh.triangles[part]].mean(axis=1)
        centre, mean = weight @ place, weight @ normal
        # normals are square to the axis of a cylinder, and on a circle about that of a cone
        same, spread = np.outer(mean, mean), (weight * normal.T) @ normal
        apart = {"plane": same, "cone": same - spread}.get(kind, -spread)
        frame = np.linalg.eigh(apart)[1]
        frame[:, 0] *= np.linalg.det(frame)  # right-handed
        lean = float(mean @ frame[:, 2])
        if kind == "plane":
            return Shape(
                kind, centre, frame * np.copysign(1.0, [1.0, lean, lean]), 0.0, -np.pi / 2.0
            )
        across = frame[:, : 3 if kind == "sphere" else 2]
        flat = normal @ across
        flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
        ways = np.eye(across.shape[1]) - flat[:, :, None] * flat[:, None, :]
        beside = np.einsum("t,tij,tj->i", weight, ways, (place - centre) @ across)
        centre = centre + across @ np.linalg.pinv(np.einsum("t,tij->ij", weight, ways)) @ beside
        radius = float(weight @ np.sum((place - centre) @ across * flat, axis=1))
        angle = float(np.arcsin(min(abs(lean), 1.0))) if kind == "cone" else 0.0
        # normals of a hole point inwards
        widens = np.copysign(1.0, [1.0, -lean * radius, -lean * radius])
        return Shape(kind, centre, frame * widens, abs(radius), angle)

    def _fitted(self, start: Shape, part: Indices) -> Feature | None:
        """Fit a shape; None where normals of the triangles or vertices are off it."""
        triangles, area = self.mesh.triangles[part], self.area[part]
        below = start.respond(self.mesh.vertices_mm[triangles].mean(axis=1)).normal
        turned = np.sum(below * self.normals[part], axis=1)
        odd = turned * np.sign(area @ turned) < np.cos(np.deg2rad(NEAR_DEG))
        if area @ odd > ODD * area.sum():
            return None
        vertices = np.unique(triangles)
        points = self.mesh.vertices_mm[vertices]
        shape = fit_shape(start, points)
        away = shape.respond(points).distance_mm
        most = CLOSE * float(np.linalg.norm(np.ptp(points, axis=0))) + self.rounding_mm
        if np.abs(away).max() > most:
            return None
        return Feature("", shape, vertices, part, float(area.sum()), away)
