"""Two meshes of one shape have the same deviations, features and verdicts."""

import numpy as np
import pytest
import trimesh

import warpspace
from warpspace import load_scene
from warpspace.analysis.description import ignore_progress
from warpspace.parts.part import Part
from warpspace.parts.workpiece import Workpiece, evaluate_points, place_workpiece

make = trimesh.creation
LIMITS = """[[features]]
is = "plane 3"
measure = "position"
tolerance_um = 5.2
"""


def part_of(mesh):
    mesh = mesh.copy()
    mesh.merge_vertices()
    return Workpiece("x", np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32))


def drilled(facets, size=(200.0, 150.0, 40.0), radius=10.0, at=(70.0, 45.0)):
    """A plate with a hole, whose top and bottom are long triangles."""
    hole = make.cylinder(radius, 2.0 * size[2], sections=facets).apply_translation([*at, 0.0])
    return trimesh.boolean.difference([make.box(size), hole])


def divided(mesh, edge):
    return trimesh.Trimesh(*trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, edge))


def dense_at_a_corner(size):
    """A box with small triangles at one corner and long ones elsewhere."""
    mesh = make.box((1.0, 1.0, 1.0)).subdivide().subdivide().subdivide().subdivide()
    mesh.vertices = ((mesh.vertices + 0.5) ** 4 - 0.5) * size
    return mesh


def tessellate(shape, *facets):
    return [shape(count) for count in facets]


BOX = make.box((200.0, 150.0, 40.0))
PROFILES = {
    "frustum": [[0, 0], [80, 0], [50, 60], [0, 60]],
    "stepped shaft": [[0, 0], [40, 0], [40, 50], [25, 50], [25, 120], [0, 120]],
    "flanged bush": [[15, 0], [45, 0], [45, 8], [25, 8], [25, 60], [15, 60], [15, 0]],
}
ROD = make.cylinder(6.0, 250.0, sections=96)
WEDGE = make.extrude_polygon(
    trimesh.path.polygons.Polygon([(0, 0), (150, 0), (40, 80), (0, 80)]), 50.0
)
BALLS = make.icosphere(4, 70.0), make.uv_sphere(70.0, count=[120, 200])
SHAPES = {
    "hole": tessellate(drilled, 64, 512),
    "large hole": tessellate(lambda n: drilled(n, radius=45.0, at=(40.0, 20.0)), 48, 360),
    "thin plate": tessellate(
        lambda n: drilled(n, (240.0, 160.0, 6.0), 30.0, (40.0, 30.0)), 64, 300
    ),
    "eccentric hole": tessellate(lambda n: drilled(n, radius=15.0, at=(-75.0, -50.0)), 40, 400),
    "box": (BOX, divided(BOX, 10.0)),
    "dense corner": (BOX, dense_at_a_corner((200.0, 150.0, 40.0))),
    "cube": (make.box((90.0,) * 3), dense_at_a_corner((90.0,) * 3)),
    "bar": (make.box((260.0, 12.0, 12.0)), dense_at_a_corner((260.0, 12.0, 12.0))),
    "wedge": (WEDGE, divided(WEDGE, 6.0)),
    "cylinder": tessellate(lambda n: make.cylinder(50.0, 120.0, sections=n), 96, 700),
    "rod": (make.cylinder(6.0, 250.0, sections=64), divided(ROD, 9.0)),
    "disc": tessellate(lambda n: make.cylinder(90.0, 8.0, sections=n), 90, 600),
    "ring": tessellate(lambda n: make.annulus(60.0, 90.0, 30.0, sections=n), 100, 640),
    "tube": tessellate(lambda n: make.annulus(20.0, 26.0, 180.0, sections=n), 80, 500),
    "cone": tessellate(lambda n: make.cone(60.0, 90.0, sections=n), 90, 700),
    "ball": BALLS,
    "ellipsoid": [ball.copy().apply_scale([1.0, 0.7, 0.4]) for ball in BALLS],
    "torus": (make.torus(60.0, 20.0, 96, 64), make.torus(60.0, 20.0, 190, 64)),
}
for shape, profile in PROFILES.items():
    SHAPES[shape] = [make.revolve(np.array(profile, float), sections=n) for n in (90, 410)]
DAILY = "hole", "dense corner", "rod", "frustum"


def cut(mesh, **asked):
    return Part(mesh=part_of(mesh), **asked).run(load_scene("dvf5000_first"), ignore_progress)


SLANTED = 30.0, -20.0, 150.0, 25.0, -40.0, 70.0
PLACES = [None, pytest.param(SLANTED, marks=pytest.mark.nightly)]


def limit_positions(made, share):
    """Tolerances that are a share of the placed positions of features."""
    rows = ((x.name, x.measures["position"]["placed_difference_um"]) for x in made.features)
    limits = {name: f"{share * abs(um):.4f}" for name, um in rows if abs(um) > 0.5}
    return [LIMITS.replace("plane 3", name).replace("5.2", um) for name, um in limits.items()]


def verdicts_of(made):
    rows = (row for feature in made.features for row in feature.measures.values())
    return [row["verdict"] for row in rows if "verdict" in row]


@pytest.mark.parametrize("place", PLACES, ids=["middle", "slanted"])
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[] if n in DAILY else pytest.mark.nightly) for n in SHAPES]
)
def test_two_tessellations_agree(name, place):
    first, second = (cut(mesh, place=place) for mesh in SHAPES[name])
    for one, other in ((first, second), (first.placed, second.placed)):
        assert one.deviation.four == pytest.approx(other.deviation.four, rel=0.02, abs=0.01)
    features = [{feature.name: feature for feature in made.features} for made in (first, second)]
    assert [*features[0]] == [*features[1]]
    for feature in features[0]:
        rows = (of[feature].measures for of in features)
        for one, other in zip(*(row.values() for row in rows), strict=True):
            key = next(key for key in one if key.startswith("placed_difference"))
            assert one[key] == pytest.approx(other[key], rel=0.02, abs=0.02)
    limits = limit_positions(first, 0.95 if place else 1.05)
    if limits:
        tolerances = "f.toml", "".join(limits)
        verdicts = [
            verdicts_of(cut(mesh, place=place, tolerances=tolerances)) for mesh in SHAPES[name]
        ]
        assert verdicts == [["fail" if place else "pass"] * len(limits)] * 2


def test_deviations_are_integrals_over_the_surface():
    """The placed RMS of a plate with a hole is that of its densely and evenly divided surface."""
    plate, scene = drilled(64), load_scene("dvf5000_first")
    points, face = trimesh.sample.sample_surface(plate, 200_000, seed=1)
    assert len(face) == len(points)
    made = evaluate_points(scene, place_workpiece(part_of(plate), scene).vertices_mm)
    shift = made.point_mm[0] - part_of(plate).vertices_mm[0]
    error = evaluate_points(scene, points + shift).error_um
    arm = points - points.mean(axis=0)
    design = np.zeros((len(points), 3, 6))
    design[:, :, :3] = np.eye(3)
    for axis in range(3):
        design[:, :, 3 + axis] = np.cross(np.eye(3)[axis], arm)
    design = design.reshape(-1, 6)
    rest = error.reshape(-1) - design @ np.linalg.lstsq(design, error.reshape(-1))[0]
    norm = np.linalg.norm(rest.reshape(-1, 3), axis=1)
    mean, rms, p95, _ = cut(plate).placed.deviation.four
    expected = norm.mean(), np.sqrt(np.mean(norm**2)), np.quantile(norm, 0.95)
    assert (mean, rms, p95) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("limit", [3.3, 5.2])
def test_verdicts_do_not_depend_on_the_facets_of_a_hole(limit):
    """The plate of a bug report: by vertices, its RMS was 1.23 or 0.69 µm, its verdict varied."""
    tolerances = "f.toml", LIMITS.replace("5.2", str(limit))
    for facets in (64, 512):
        made = cut(drilled(facets), tolerances=tolerances)
        assert verdicts_of(made) == ["pass" if limit > 4.0 else "fail"]
        assert made.deviation.four == pytest.approx((27.12, 27.17, 29.95, 30.61), abs=0.01)
        assert made.placed.deviation.four == pytest.approx((2.13, 2.415, 3.905, 4.27), abs=0.01)
        (position,) = (x.measures["position"] for x in made.features if x.name == "plane 3")
        assert position["placed_difference_um"] == pytest.approx(3.46, abs=0.01)


@pytest.mark.parametrize("facets", [64, 512])
def test_clamp_states_one_value_for_a_position(facets, tmp_path):
    file = tmp_path / "plate.stl"
    drilled(facets).export(file)
    scene = load_scene("dvf5000_first")
    made = warpspace.clamp(scene, file=str(file), placed=True, grid=3)
    assert made.best == min([made.present, *made.places], key=lambda at: at.placed_um)
    assert made.present.placed_um == pytest.approx(4.27, rel=0.01)
    assert made.best.placed_um == pytest.approx(4.00, rel=0.01)  # stated 5.80 and 4.39
    for at in made.places:
        if at.place == made.present.place:
            assert at == made.present
    part = warpspace.part(scene, file=str(file), place=made.best.place)
    assert part.placed.deviation.max_um == pytest.approx(made.best.placed_um, rel=0.01)
