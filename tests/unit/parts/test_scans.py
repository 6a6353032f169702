"""Features of scanned meshes, and fits other than least squares, against independent ones."""

import numpy as np
import pytest
import trimesh
from scipy.optimize import least_squares, minimize

from warpspace import load_scene
from warpspace.analysis.description import ignore_progress
from warpspace.exceptions import SceneError
from warpspace.parts.inspection import FeatureShape, find_features, fit_extreme
from warpspace.parts.part import Part
from warpspace.parts.workpiece import Workpiece

make = trimesh.creation
AXIS = np.array([0.0, 0.0, 1.0])


def part_of(mesh):
    return Workpiece("x", np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32))


def revolve(corners, sections, step):
    """A surface of revolution whose profile is divided."""
    profile = [
        begin + (end - begin) * share
        for begin, end in zip(corners, np.roll(corners, -1, axis=0), strict=True)
        for share in np.arange(0.0, 1.0, step / max(np.linalg.norm(end - begin), step))
    ]
    mesh = make.revolve(np.array([*profile, corners[0]]), sections=sections)
    mesh.merge_vertices()
    return mesh


RING = revolve(np.array([(50.0, -10.0), (50.0, 10.0), (40.0, 10.0), (40.0, -10.0)]), 128, 2.0)
FRUSTUM = revolve(np.array([(20.0, 0.0), (50.0, 0.0), (25.0, 60.0), (20.0, 60.0)]), 120, 2.0)
BALL = make.icosphere(4, 40.0)
BLOCK = make.box((60.0, 40.0, 20.0)).subdivide().subdivide().subdivide().subdivide()
SHAPES = {"cylinder": RING, "cone": FRUSTUM, "sphere": BALL, "plane": BLOCK}
COUNTS = {
    "cylinder": (2, 2, 0, 0),
    "cone": (2, 1, 1, 0),
    "sphere": (0, 0, 0, 1),
    "plane": (6, 0, 0, 0),
}


def scan(mesh, seed, noise_um=20.0, outliers=0):
    rng, scanned = np.random.default_rng(seed), mesh.copy()
    scanned.vertices = mesh.vertices + rng.normal(0.0, noise_um * 1e-3, mesh.vertices.shape)
    rows = rng.choice(len(mesh.vertices), outliers, replace=False)
    scanned.vertices[rows] += 0.4 * mesh.vertex_normals[rows]
    return scanned


def distances(kind, numbers, point):
    """Distances from a shape of 7 numbers: centre, direction of the axis near z, two sizes."""
    arm = point - numbers[:3]
    axis = np.array([numbers[3], numbers[4], 1.0])
    axis /= np.linalg.norm(axis)
    height = arm @ axis
    if kind == "plane":
        return height
    if kind == "sphere":
        return np.linalg.norm(arm, axis=1) - numbers[5]
    radial = np.linalg.norm(arm - np.outer(height, axis), axis=1)
    angle = numbers[6] if kind == "cone" else 0.0
    return (radial - numbers[5]) * np.cos(angle) + height * np.sin(angle)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("kind", SHAPES)
def test_features_of_a_scan_are_least_squares_fits(kind, seed):
    mesh = scan(SHAPES[kind], seed)
    features = find_features(part_of(mesh))
    counts = tuple(
        sum(name.startswith(kind) for name in features)
        for kind in ("plane", "cylinder", "cone", "sphere")
    )
    assert counts == COUNTS[kind]
    feature = features[f"{kind} 1"]
    point, shape = mesh.vertices[feature.vertices], feature.shape
    assert feature.residual_um == pytest.approx(20.0, rel=0.15)
    root = np.sqrt(feature.shares)
    axis = shape.axis / (shape.axis[np.abs(shape.axis).argmax()] or 1.0)
    turned = np.roll(np.eye(3), 2 - np.abs(shape.axis).argmax(), axis=0)  # its axis near z
    sizes = [shape.radius_mm, abs(shape.angle_rad) * np.sign(-axis[2])]
    start = [*turned @ shape.centre_mm, *(turned @ axis)[:2], *sizes]
    fit = least_squares(
        lambda x: root * distances(kind, x, point @ turned.T), start, x_scale="jac", xtol=1e-14
    )
    residual, *_ = shape.respond(point)
    assert np.sum((root * residual) ** 2) == pytest.approx(2.0 * fit.cost, rel=1e-4)
    # within four standard uncertainties of the shape without noise
    near = 4.0 * 0.02 * np.sqrt(9.0 / len(point))
    if kind in ("cylinder", "sphere"):
        assert shape.radius_mm == pytest.approx({"cylinder": 50.0, "sphere": 40.0}[kind], abs=near)
    if kind == "cone":
        assert shape.angle_rad == pytest.approx(np.arctan2(25.0, 60.0), abs=near / 15.0)


def test_outliers_of_a_scan_are_ignored():
    mesh = scan(RING, 1, 5.0, outliers=8)
    features = find_features(part_of(mesh))
    assert [*features] == ["plane 1", "plane 2", "cylinder 1", "cylinder 2"]
    for name, radius in (("cylinder 1", 50.0), ("cylinder 2", 40.0)):
        assert features[name].shape.radius_mm == pytest.approx(radius, abs=1e-3)
        assert features[name].residual_um == pytest.approx(5.0, rel=0.1)


def test_noise_above_the_stated_level_is_no_feature():
    mesh = part_of(scan(BALL, 1, 40.0))
    assert find_features(mesh) == {}
    assert [*find_features(mesh, noise_um=40.0)] == ["sphere 1"]
    assert find_features(mesh, noise_um=0.0) == {}
    assert find_features(part_of(make.torus(60.0, 20.0, 96, 64))) == {}


FEATURES = """[[features]]
name = "bore"
is = "cylinder 2"
fit = "{}"
measure = "diameter"
tolerance_um = 10
"""


def cut(mesh, text=""):
    tolerances = ("f.toml", text) if text else None
    return Part(mesh=part_of(mesh), tolerances=tolerances).run(
        load_scene("dvf5000_first"), ignore_progress
    )


def test_a_scanned_ring_has_its_diameter_and_its_form_error():
    """The ring of a bug report: 128 sections, 3 µm; `part` recognised nothing."""
    mesh = scan(revolve(np.array([(50.0, -10), (50, 10), (40, 10), (40, -10)]), 64, 30.0), 1, 3.0)
    made = cut(mesh)
    (outer,) = (feature for feature in made.features if feature.name == "cylinder 1")
    diameter, form = outer.measures["diameter"], outer.measures["cylindricity"]
    assert diameter["nominal_mm"] == pytest.approx(100.0, abs=2e-3)
    point = mesh.vertices[np.hypot(*mesh.vertices.T[:2]) > 45.0]
    by_hand = least_squares(lambda x: distances("cylinder", x, point), [0, 0, 0, 0, 0, 50.0, 0])
    assert form["nominal_mm"] == pytest.approx(np.ptp(by_hand.fun), rel=0.02)
    assert "4 features of a scan" in " ".join(made.caveats())


def circle(radius, height=20.0):
    """Points of a cylinder around z, and the design matrix of its fit at a radius of 30 mm."""
    turn = np.arange(len(radius)) * 2.0 * np.pi / len(radius)
    x, y = radius * np.cos(turn), radius * np.sin(turn)
    point = np.concatenate([np.stack([x, y, 0.0 * x + z], axis=1) for z in (-height, 0.0, height)])
    shape = FeatureShape("cylinder", np.zeros(3), AXIS, 30.0)
    distance, _, design = shape.respond(point)
    return distance, design


TURN = np.arange(720) * 2.0 * np.pi / 720
HEXAGON = 30.0 * np.cos(np.pi / 6.0) / np.cos((TURN + np.pi / 6.0) % (np.pi / 3.0) - np.pi / 6.0)
LOBES = 30.0 + 0.01 * np.cos(3.0 * TURN)


@pytest.mark.parametrize(
    ("radius", "inner", "outer"),
    [(HEXAGON, 30.0 * np.cos(np.pi / 6.0), 30.0), (LOBES, 29.99, 30.01)],
    ids=["hexagon", "three lobes"],
)
def test_extreme_fits_against_closed_forms(radius, inner, outer):
    distance, design = circle(radius)
    for fit, expected in (("inscribed", inner), ("circumscribed", outer)):
        step = fit_extreme(design, distance, fit)
        assert 30.0 + step[6] == pytest.approx(expected, abs=1e-9)
        np.testing.assert_allclose(step[:6], 0.0, atol=1e-6)
    step = fit_extreme(design, distance, "minimum zone")
    assert np.ptp(distance + design @ step) == pytest.approx(outer - inner, abs=1e-9)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_minimum_zone_of_noise_is_that_of_a_search(seed):
    rng = np.random.default_rng(seed)
    distance, design = circle(30.0 + rng.normal(0.0, 0.02, 60))
    step = fit_extreme(design, distance, "minimum zone")
    columns = [0, 1, 6]  # the points are equal at all heights
    away = minimize(
        lambda x: np.ptp(distance + design[:, columns[:2]] @ x), [0.0, 0.0], method="Nelder-Mead",
        options={"xatol": 1e-9, "fatol": 1e-9},
    )  # fmt: skip
    assert np.ptp(distance + design @ step) == pytest.approx(away.fun, rel=1e-4)
    assert np.ptp(distance + design @ step) < np.ptp(distance)


def test_named_features_are_fitted_as_stated():
    mesh = scan(RING, 2, 5.0)
    sizes = {}
    for fit in ("least squares", "inscribed", "circumscribed", "minimum zone"):
        made = cut(mesh, FEATURES.format(fit))
        (bore,) = (feature for feature in made.features if feature.name == "bore")
        assert bore.fit == fit
        sizes[fit] = bore.measures["diameter"]["nominal_mm"]
        assert bore.measures["position"]["nominal_mm"] == pytest.approx(0.0, abs=1e-9)
        assert sum(bore.budget.values()) == pytest.approx(
            bore.measures["diameter"]["placed_difference_um"], abs=1.0
        )
    radius = np.hypot(*(mesh.vertices.T[:2]))
    bore = radius[radius < 45.0]
    bore = bore[bore < 40.0 + 0.03]
    assert 2.0 * bore.min() <= sizes["inscribed"] < sizes["least squares"] < sizes["circumscribed"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('is = "plane 1"\nfit = "inscribed"', "inscribed fit of a plane; expected a cylinder or"),
        ('is = "cylinder 1"\nfit = "gauss"', "fit"),
        (
            (
                'is = "cylinder 1"\nfit = "inscribed"\n[[features]]\nis = "cylinder 1"\n'
                'fit = "circumscribed"'
            ),
            "an entry before states 'inscribed'",
        ),
    ],
)
def test_fits_that_do_not_exist_are_refused(text, message):
    with pytest.raises(SceneError, match=message):
        cut(RING, f"[[features]]\n{text}\n")


BOX = make.box((100.0, 60.0, 20.0))
DIALECTS = {
    "solid.stl": b"solid".ljust(80) + BOX.export(file_type="stl")[80:],
    "upper.stl": BOX.export(file_type="stl_ascii").upper().encode(),
    "big.ply": BOX.export(file_type="ply"),
    "quad.obj": BOX.export(file_type="obj").encode(),
    "spare.stl": BOX.export(file_type="stl") + b"17 spare bytes...",
}


@pytest.mark.parametrize("name", DIALECTS)
def test_one_box_has_one_deviation_in_all_dialects(name, tmp_path):
    (tmp_path / name).write_bytes(DIALECTS[name])
    made = Part(file=str(tmp_path / name)).run(load_scene("dvf5000_first"), ignore_progress)
    assert made.deviation.max_um == pytest.approx(27.9942, abs=1e-4)
    assert any("17 bytes after" in text for text in made.caveats()) == (name == "spare.stl")
