"""Shapes found in meshes, and their fits against an independent implementation."""

import numpy as np
import pytest
import trimesh
from scipy.optimize import least_squares

from warpspace.parts.features import Shape, find_features, fit_shape
from warpspace.parts.part import PartMesh

make = trimesh.creation


def part_of(mesh):
    mesh.merge_vertices()
    return PartMesh("x", np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32))


def plate_of_holes():
    holes = [make.cylinder(8.0, 40.0) for _ in range(9)]
    for index, hole in enumerate(holes):
        hole.apply_translation([60.0 * (index % 3 - 1), 60.0 * (index // 3 - 1), 0.0])
    return trimesh.boolean.difference([make.box((200.0, 190.0, 20.0)), *holes])


def boss_with_fillet():
    angle = np.linspace(0.0, np.pi / 2.0, 9)
    fillet = np.stack([18.0 - 3.0 * np.sin(angle), 13.0 - 3.0 * np.cos(angle)], axis=-1)
    return make.revolve([[0, 0], [30, 0], [30, 10], *fillet, [15, 40], [0, 40]], sections=60)


FRUSTUM = np.array([[0.0, 0.0], [100.0, 0.0], [70.0, 60.0], [0.0, 60.0]])


@pytest.mark.parametrize(
    ("mesh", "found"),
    [
        (make.box((100.0, 80.0, 60.0)), {"plane": 6}),
        (plate_of_holes(), {"plane": 6, "cylinder": 9}),
        (make.annulus(10.0, 20.0, 30.0), {"plane": 2, "cylinder": 2}),
        (make.revolve(FRUSTUM, sections=90), {"plane": 2, "cone": 1}),
        (make.cone(20.0, 50.0), {"plane": 1, "cone": 1}),
        (make.icosphere(3, 20.0), {"sphere": 1}),
        (make.torus(30.0, 5.0), {}),
        (make.icosphere(4, 20.0).apply_scale([1.0, 1.01, 1.02]), {}),
        (make.capsule(30.0, 10.0), {"cylinder": 1, "sphere": 2}),
        (boss_with_fillet(), {"plane": 3, "cylinder": 2}),
    ],
)
@pytest.mark.parametrize("digits", [None, 3])
def test_surfaces_are_found_wherever_they_lie(mesh, found, digits):
    mesh = mesh.copy()
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1, 2, 3], [50, 0, 0]))
    if digits:  # as in files that round
        mesh.vertices = np.round(mesh.vertices, digits)
    kinds = [one.shape.kind for one in find_features(part_of(mesh))]
    assert {kind: kinds.count(kind) for kind in kinds} == found


def test_names_go_by_size_and_by_place():
    plate = find_features(part_of(plate_of_holes()))
    holes = [one for one in plate if one.shape.kind == "cylinder"]
    assert [one.name for one in holes] == [f"cylinder {number}" for number in range(1, 10)]
    assert [one.shape.centre_mm[0] for one in holes] == pytest.approx(np.repeat([-60, 0, 60], 3))
    assert all(one.shape.radius_mm == pytest.approx(8.0) for one in holes)
    top = plate[0]
    assert top.name == "plane 1"
    assert top.shape.axis == pytest.approx([0.0, 0.0, -1.0])


def cylinder_distance(numbers, points):
    place, way, radius = numbers[:3], numbers[3:6], numbers[6]
    way = way / np.linalg.norm(way)
    return np.linalg.norm(np.cross(points - place, way), axis=1) - radius


def cone_distance(numbers, points):
    apex, way = numbers[:3], numbers[3:6] / np.linalg.norm(numbers[3:6])
    along = (points - apex) @ way
    radial = np.linalg.norm(np.cross(points - apex, way), axis=1)
    return radial * np.cos(numbers[6]) - along * np.sin(numbers[6])


def sphere_distance(numbers, points):
    return np.linalg.norm(points - numbers[:3], axis=1) - numbers[3]


@pytest.mark.parametrize("seed", range(5))
def test_fits_are_those_of_another_least_squares(seed):
    rng = np.random.default_rng(seed)
    angle, height = rng.uniform(0.0, 4.0, 400), rng.uniform(-30.0, 30.0, 400)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    frame *= np.linalg.det(frame)
    place = rng.uniform(-200.0, 200.0, 3)
    noise = 0.01 * rng.normal(size=400)

    def cloud(radius, up):
        return place + np.stack([radius * np.cos(angle), radius * np.sin(angle), up], 1) @ frame.T

    def best(distance, start, points):
        return least_squares(distance, start, args=(points,), xtol=1e-15, ftol=1e-15, gtol=1e-15)

    points = cloud(20.0 + noise, height)
    fitted = fit_shape(Shape("cylinder", place + 1.0, frame, 19.0), points)
    other = best(cylinder_distance, [*place, *frame[:, 2], 20.0], points)
    assert fitted.radius_mm == pytest.approx(other.x[6], abs=1e-7)
    assert np.sum(fitted.respond(points).distance_mm ** 2) == pytest.approx(2.0 * other.cost)

    points = cloud(60.0 + height * np.tan(0.3) + noise, height)
    fitted = fit_shape(Shape("cone", place + 1.0, frame, 59.0, 0.25), points)
    apex = place - frame[:, 2] * 60.0 / np.tan(0.3)
    other = best(cone_distance, [*apex, *frame[:, 2], 0.3], points)
    assert fitted.angle_rad == pytest.approx(other.x[6], abs=1e-7)
    assert np.sum(fitted.respond(points).distance_mm ** 2) == pytest.approx(2.0 * other.cost)

    tilt = height / 30.0
    points = cloud((40.0 + noise) * np.cos(tilt), (40.0 + noise) * np.sin(tilt))
    fitted = fit_shape(Shape("sphere", place + 1.0, frame, 39.0), points)
    other = best(sphere_distance, [*place, 40.0], points)
    assert [*fitted.centre_mm, fitted.radius_mm] == pytest.approx(other.x, abs=1e-7)

    points = cloud(height, noise)
    fitted = fit_shape(Shape("plane", place + 1.0, frame, 0.0, -np.pi / 2.0), points)
    normal = np.linalg.svd(points - points.mean(axis=0))[2][2]
    assert abs(fitted.axis @ normal) == pytest.approx(1.0, abs=1e-14)


def test_a_published_cylinder():
    """Eight points measured on a target, of the tests of OpenIndy (OI-298): radius 19.16 ± 0.03."""
    points = np.array([
        [256.39, 1460.15, 1326.66], [264.47, 1449.69, 1335.19], [256.13, 1477.83, 1328.50],
        [237.81, 1477.93, 1345.91], [237.02, 1461.86, 1342.85], [251.36, 1462.91, 1329.84],
        [259.58, 1483.65, 1332.64], [247.51, 1484.00, 1345.92],
    ])  # fmt: skip
    frame = np.array([[0.0, 1.0, 1.0], [np.sqrt(2.0), 0.0, 0.0], [0.0, 1.0, -1.0]]) / np.sqrt(2.0)
    fitted = fit_shape(Shape("cylinder", points.mean(axis=0), frame, 19.0), points)
    rest = fitted.respond(points).distance_mm
    assert fitted.radius_mm == pytest.approx(19.16, abs=0.005)
    assert np.sqrt(np.sum(rest**2) / 3.0) == pytest.approx(0.03, abs=0.01)
