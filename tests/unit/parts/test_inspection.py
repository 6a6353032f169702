"""Shapes found in meshes, and measures of a part as cut: against independent fits, closed forms,
the bench and their own budgets.
"""

import re

import numpy as np
import pytest
import trimesh
from scipy.optimize import least_squares

from bench_scenes import scene_with
from warpspace import load_scene
from warpspace.bench.kinds.ball_plate import BallPlate, plate_residuals
from warpspace.bench.plan import simulate
from warpspace.exceptions import SceneError
from warpspace.kinematics.relative_motion import relative_point
from warpspace.parts.inspection import (
    FeatureShape,
    features_table,
    find_features,
    fit_shape,
    inspect,
)
from warpspace.parts.workpiece import Workpiece, evaluate_points, place_workpiece, subtract_best_fit

make = trimesh.creation
CUBE = make.box((100.0, 100.0, 100.0))


def part_of(mesh):
    mesh.merge_vertices()
    return Workpiece("x", np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32))


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
    kinds = [one.shape.kind for one in find_features(part_of(mesh)).values()]
    assert {kind: kinds.count(kind) for kind in kinds} == found


def test_names_go_by_size_and_by_place():
    plate = find_features(part_of(plate_of_holes()))
    holes = [plate[f"cylinder {number}"] for number in range(1, 10)]
    assert [one.shape.centre_mm[0] for one in holes] == pytest.approx(np.repeat([-60, 0, 60], 3))
    assert all(one.shape.radius_mm == pytest.approx(8.0) for one in holes)
    assert next(iter(plate)) == "plane 1"
    assert plate["plane 1"].shape.axis == pytest.approx([0.0, 0.0, -1.0])


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
    fitted = fit_shape(FeatureShape("cylinder", place + 1.0, frame[:, 2], 19.0), points)
    other = best(cylinder_distance, [*place, *frame[:, 2], 20.0], points)
    assert fitted.radius_mm == pytest.approx(other.x[6], abs=1e-7)
    assert np.sum(fitted.respond(points)[0] ** 2) == pytest.approx(2.0 * other.cost)

    points = cloud(60.0 + height * np.tan(0.3) + noise, height)
    fitted = fit_shape(FeatureShape("cone", place + 1.0, frame[:, 2], 59.0, 0.25), points)
    apex = place - frame[:, 2] * 60.0 / np.tan(0.3)
    other = best(cone_distance, [*apex, *frame[:, 2], 0.3], points)
    assert fitted.angle_rad == pytest.approx(other.x[6], abs=1e-7)
    assert np.sum(fitted.respond(points)[0] ** 2) == pytest.approx(2.0 * other.cost)

    tilt = height / 30.0
    points = cloud((40.0 + noise) * np.cos(tilt), (40.0 + noise) * np.sin(tilt))
    fitted = fit_shape(FeatureShape("sphere", place + 1.0, np.zeros(3), 39.0), points)
    other = best(sphere_distance, [*place, 40.0], points)
    assert [*fitted.centre_mm, fitted.radius_mm] == pytest.approx(other.x, abs=1e-7)

    points = cloud(height, noise)
    fitted = fit_shape(FeatureShape("plane", place + 1.0, frame[:, 2], 0.0, -np.pi / 2.0), points)
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
    fitted = fit_shape(FeatureShape("cylinder", points.mean(axis=0), frame[:, 2], 19.0), points)
    rest = fitted.respond(points)[0]
    assert fitted.radius_mm == pytest.approx(19.16, abs=0.005)
    assert np.sqrt(np.sum(rest**2) / 3.0) == pytest.approx(0.03, abs=0.01)


# --- Measures -------------------------------------------------------------------------------------


def inspected(scene, mesh, tolerances="", place=None):
    part = part_of(mesh.copy())
    made = evaluate_points(scene, place_workpiece(part, scene, place).vertices_mm)
    found = inspect(scene, part, made, ("tolerances.toml", tolerances) if tolerances else None)
    return {one.name: one for one in found}


def rounded(mesh):
    mesh.vertices = np.round(mesh.vertices, 3)
    return mesh


def entry(**keys):
    return "[[features]]\n" + "".join(f"{key} = {value!r}\n" for key, value in keys.items())


BESIDE = entry(**{"is": "plane", "near": [0, 50, 0], "name": "back"})


def test_the_squareness_of_a_cube_is_that_of_the_machine():
    asked = entry(**{"is": "plane", "near": [50, 0, 0], "measure": "squareness", "to": ["back"],
                     "tolerance_urad": 30})  # fmt: skip
    found = inspected(scene_with(EC0Y=40.0), CUBE, BESIDE + asked)
    (one,) = (row for part in found.values() for name, row in part.measures.items() if "to" in name)
    assert one["nominal_deg"] == pytest.approx(90.0)
    assert one["placed_difference_urad"] == pytest.approx(40.0, abs=1e-3)
    assert one["budget"] == {"EC0Y": pytest.approx(40.0, abs=1e-3)}
    assert one["verdict"] == "fail"


def test_a_scale_is_a_distance_and_a_location_is_no_error_of_a_part():
    asked = entry(**{"is": "plane", "near": [0, -50, 0], "measure": "distance", "to": ["back"],
                     "tolerance_um": [0, 20.5]})  # fmt: skip
    scene = scene_with(EYY=(0.0, 90.0), EX0C=30.0)  # 90 µm over 450 mm
    found = inspected(scene, CUBE, BESIDE + asked)
    (one,) = (row for part in found.values() for name, row in part.measures.items() if "to" in name)
    assert (one["nominal_mm"], one["difference_um"]) == pytest.approx((100.0, 20.0), abs=1e-6)
    assert one["verdict"] == "pass"
    side = next(part for part in found.values() if "to" not in str([*part.measures]))
    assert set(side.measures) == {"flatness", "position"}
    located = inspected(scene_with(EX0C=30.0, EY0C=10.0), CUBE)
    rows = [part.measures["position"] for part in located.values()]
    assert max(row["difference_um"] for row in rows) == pytest.approx(30.0, abs=1e-6)
    assert max(row["placed_difference_um"] for row in rows) < 1e-6


def test_a_scale_opens_holes_and_cones_and_moves_them():
    scale = 2e-4
    scene = scene_with(EXX=(0.0, 550e3 * scale), EYY=(0.0, 450e3 * scale))
    hole = inspected(scene, plate_of_holes())["cylinder 1"].measures
    assert hole["diameter"]["placed_difference_um"] == pytest.approx(16e3 * scale, abs=1e-3)
    assert hole["cylindricity"]["placed_difference_um"] == pytest.approx(0.0, abs=1e-3)
    away = 60e3 * np.sqrt(2.0) * scale
    assert hole["position"]["placed_difference_um"] == pytest.approx(away, abs=1e-3)
    assert hole["position"]["budget"]["EXX"] == pytest.approx(away / 2.0, abs=1e-3)
    cone = inspected(scene, trimesh.creation.revolve(FRUSTUM, sections=90))["cone 1"]
    opened = cone.measures["half_angle"]
    slope = 0.4 * scale * 1e6  # sin φ cos φ for tan φ = 30 / 60
    assert abs(opened["placed_difference_urad"]) == pytest.approx(slope, abs=0.1)
    assert opened["nominal_deg"] == pytest.approx(26.56505118)


def test_a_verdict_within_the_linearisation_error_is_undecided():
    scene = scene_with(EXX=5000.0, EC0Y=4000.0, ECZ=3000.0, EAX=(0.0, 9000.0))
    plain = inspected(scene, plate_of_holes())["cylinder 1"].measures["position"]
    band = [0, plain["placed_difference_um"] + 1e-6]
    asked = entry(**{"is": "cylinder 1", "measure": "position", "tolerance_um": band})
    found = inspected(scene, plate_of_holes(), asked)["cylinder 1"]
    assert found.measures["position"]["verdict"] == "undecided"
    assert found.measures["position"]["doubt_um"] > 1e-3


@pytest.mark.parametrize("name", ["dvf5000_first", "dvf5000_second"])
@pytest.mark.parametrize("place", [None, (60.0, -40.0, 250.0, 0.0, 0.0, 90.0)])
@pytest.mark.parametrize(
    "mesh",
    [
        plate_of_holes(),
        rounded(plate_of_holes()),
        trimesh.creation.icosphere(3, 80.0),
        trimesh.creation.revolve(FRUSTUM, sections=90),
        trimesh.creation.cone(40.0, 60.0, sections=90),
    ],
    ids=["plate", "rounded plate", "ball", "frustum", "tip"],
)
def test_budgets_close(name, place, mesh):
    asked = entry(**{"is": "cylinder 3", "measure": "position",
                     "to": ["plane 1", "plane 3", "plane 4"]})  # fmt: skip
    asked = asked if len(mesh.faces) == 1200 else ""
    found = inspected(load_scene(name), mesh, asked, place)
    assert found
    for feature in found.values():
        for row in feature.measures.values():
            unit = "urad" if "nominal_deg" in row else "um"
            whole = row[f"placed_difference_{unit}"]
            assert sum(row["budget"].values()) == pytest.approx(whole, rel=0.01, abs=0.01)
        assert feature.budget == feature.measures[feature.budget_of]["budget"]
    count = sum(len(feature.measures) for feature in found.values())
    assert len(features_table([*found.values()]).rows) == count


def test_a_plate_of_holes_is_the_ball_plate_of_the_bench():
    scene = load_scene("dvf5000_first")
    test = BallPlate(balls=3, pitch_mm=60.0, positions=1)
    plan = test.plan(scene)
    sites = {name: np.broadcast_to(at, 9) for name, at in plan.coordinates.items()}
    made = evaluate_points(scene, relative_point(scene.model, sites))
    balls = plate_residuals(plan, simulate(scene, plan, exact=False))
    assert np.abs(subtract_best_fit(made.point_mm, made.error_um) - balls).max() < 1e-6


@pytest.mark.parametrize(
    ("toml", "said"),
    [
        ("[[feature]]\n", "feature: unknown key: did you mean 'features'"),
        (entry(**{"is": "plain 1"}), "unknown feature: did you mean 'plane 1'"),
        (entry(**{"is": "plane 1", "mesure": "flatness"}), "did you mean 'measure'"),
        (entry(**{"is": "plane 1", "measure": "diameter"}), "diameter of a plane; expected a"),
        (entry(**{"is": "plane 1", "measure": "angle"}), "angle to 0 features; expected 1"),
        (entry(**{"is": "plane 1", "measure": "angle", "to": ["plane 2"], "tolerance_um": 1}),
         "tolerance_um of angle; expected tolerance_urad"),
        (entry(**{"is": "plane 1", "measure": "squareness", "to": ["plane 1"]}),
         "squareness at a nominal angle of 180°"),
        (entry(**{"is": "plane 1", "tolerance_um": 1}), "expected a measure"),
        (entry(**{"is": "plane 1", "name": "plane 2"}), "another feature has it"),
        (entry(**{"is": "plane 1", "measure": "flatness", "tolerance_um": -1}), "at least 0"),
        (entry(**{"is": "cone", "near": [0, 0, 0]}), "unknown feature"),
        (2 * entry(**{"is": "plane 1", "measure": "flatness", "tolerance_um": 5}),
         "features[1]: an entry before has the same measure"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_tolerances_is_said(toml, said):
    with pytest.raises(SceneError, match=rf"(?s)tolerances\.toml.*{re.escape(said)}"):
        inspected(scene_with(), CUBE, toml)
