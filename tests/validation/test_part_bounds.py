"""Bounds of measurands of a part: closed forms, sampled machines, the regular inspection."""

import re
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from trimesh import creation as make

from bench_scenes import THREE_AXES
from doc_pages import DOCS
from warpspace.acceptance_tests.acceptance import Acceptance, find_worst_machine
from warpspace.acceptance_tests.error_curves import ErrorCurves
from warpspace.acceptance_tests.measurands import (
    PartModel,
    find_largest_span,
    find_remainders,
)
from warpspace.acceptance_tests.next_tests import build_constraint
from warpspace.acceptance_tests.plans import default_plan, load_plan, parse_plan
from warpspace.acceptance_tests.polytope import Constraint, Polytope
from warpspace.analysis.description import ignore_progress
from warpspace.bench.linear_form import absolute
from warpspace.exceptions import OptionError
from warpspace.parts.inspection import find_features, linearise_measures
from warpspace.parts.part import Part
from warpspace.parts.workpiece import load_workpiece
from warpspace.scene.library import load_scene

SCENE = f"""{THREE_AXES}[part]
file = "plate.stl"
{{features}}
[tolerances]
"""
SQUARENESS = "default = { translation = 0, rotation = 0, squareness = 0 }\nEC0Y = 25\n"
ALL = "default = { translation = 10, rotation = 20, squareness = 25 }\n"
BORES = (-60.0, -50.0), (60.0, 30.0)  # mm, centres
ENTRY = '[[features]]\nname = "{name}"\nis = "{kind}"\nnear = {near}\n'


def entry(name, kind, near, measure, band="", to="", fit=""):
    text = ENTRY.format(name=name, kind=kind, near=list(near)) + f'measure = "{measure}"\n'
    text += f"to = [{to!r}]\n" if to else ""
    text += f'fit = "{fit}"\n' if fit else ""
    return text + (f"tolerance_{band}\n" if band else "")


FIRST = entry("first", "cylinder", (*BORES[0], 0.0), "diameter")
APART = entry("second", "cylinder", (*BORES[1], 0.0), "distance", "um = {}", "first")
SIDES = [
    entry("right", "plane", (100, 0, 0), "flatness", "um = 5"),
    entry("top", "plane", (0, 0, 10), "squareness", "urad = 30", "right"),
    entry("left", "plane", (-100, 0, 0), "parallelism", "urad = 30", "right"),
    entry("left", "plane", (-100, 0, 0), "distance", "um = [-5, 9]", "right"),
    entry("first", "cylinder", (*BORES[0], 0.0), "cylindricity", "um = 5"),
    entry("first", "cylinder", (*BORES[0], 0.0), "diameter", "um = 20"),
    entry("first", "cylinder", (*BORES[0], 0.0), "parallelism", "urad = 30", "right"),
    entry("second", "cylinder", (*BORES[1], 0.0), "position", "um = 8"),
    entry("second", "cylinder", (*BORES[1], 0.0), "distance", "um = 9", "first"),
    entry("second", "cylinder", (*BORES[1], 0.0), "squareness", "urad = 30", "top"),
    entry("second", "cylinder", (*BORES[1], 0.0), "parallelism", "urad = 30", "first"),
]
CIRCLES = [
    f'test = "circular"\nplane = "{plane}"\nradius_mm = 100\nlimit_um = 8'
    for plane in ("XY", "XZ", "YZ")
]
LINES = [f'test = "positioning"\naxis = "{axis}"\nlimit_um = 8' for axis in "XYZ"]


def scene_of(tmp_path, tolerances, features=""):
    bores = [make.cylinder(12.0, 40.0, sections=24) for _ in BORES]
    for bore, place in zip(bores, BORES, strict=True):
        bore.apply_translation([*place, 0.0])
    plate = trimesh.boolean.difference([make.box((200.0, 160.0, 20.0)), *bores])
    plate.export(tmp_path / "plate.stl")
    (tmp_path / "features.toml").write_text(features, encoding="utf-8")
    path = tmp_path / "scene.toml"
    line = 'features = "features.toml"' if features else ""
    path.write_text(SCENE.format(features=line) + tolerances, encoding="utf-8")
    return load_scene(str(path))


def plan_of(scene, entries):
    text = "\n".join(f"[[acceptance]]\n{each}" for each in entries)
    return parse_plan(text, "plan.toml", scene) if entries else ()


@pytest.mark.parametrize(
    ("band", "is_kept"), [("[-0.9, 0.9]", True), ("[-0.2, 0.9]", False), ("[-1, 0.2]", False)]
)
def test_distance_of_two_bores_on_a_diagonal(tmp_path, band, is_kept):
    """A squareness γ moves y by γ·y in x: the distance changes by γ·Δx·Δy / L."""
    across, along = np.subtract(*BORES[::-1])
    per_urad = across * along / np.hypot(across, along) * 1e-3  # µm
    scene = scene_of(tmp_path, SQUARENESS, FIRST + APART.format(band))
    circle = 'test = "circular"\nplane = "XY"\nradius_mm = 100\npoints = 72\nlimit_um = 1'
    result = find_worst_machine(scene, plan_of(scene, [circle]), Acceptance(part=True))
    (distance,) = result.measurands  # the diameter has no tolerance
    assert (distance.name, distance.measure, distance.unit) == ("second", "distance to first", "um")
    gamma = 1.0 / 0.1  # µm over a radius of 0.1 m
    assert distance.bound == pytest.approx((gamma * per_urad,) * 2, rel=2e-3)
    assert distance.without_tests == pytest.approx(25.0 * per_urad, rel=1e-4)
    assert distance.is_kept is is_kept
    assert distance.verdict == ("pass" if is_kept else "undecided")


@pytest.mark.parametrize("knots", [2, pytest.param(5, marks=pytest.mark.nightly)])
def test_no_machine_exceeds_the_bounds_and_the_worst_ones_attain_them(tmp_path, knots):
    scene = scene_of(tmp_path, ALL, "".join(SIDES))
    tests = plan_of(scene, CIRCLES + LINES)
    curves = ErrorCurves(scene, knots)
    result = find_worst_machine(scene, tests, Acceptance(part=True, knots=knots))
    assert len(result.measurands) == len(SIDES)
    constraints = [build_constraint(curves, test, ignore_progress) for test in tests]
    polytope, rng = curves.polytope(constraints), np.random.default_rng(4)
    vertices = [polytope.maximise(cost).point for cost in rng.normal(size=(40, len(curves.upper)))]
    machines = np.concatenate([vertices, rng.dirichlet(np.full(40, 0.1), 260) @ vertices])
    model = PartModel(curves, ignore_progress)
    for each, linear in zip(result.measurands, model.linear.values(), strict=True):
        values = linear.rows @ machines.T
        span = np.ptp if len(values) > 3 else np.linalg.norm
        sizes = span(values, axis=0)
        assert sizes.max() <= each.bound[1] * (1.0 + 1e-6), each
        assert sizes.max() > 0.2 * each.bound[1], each
        if each.measure != "cylindricity":
            assert each.bound[1] <= 1.02 * each.bound[0] + 1e-9, each
        assert each.bound[1] <= each.without_tests * 1.02 + 1e-9

        # the regular inspection of the worst machine, on a mesh refined for it
        numbers = inspect_machine(curves.build_scene(each.machine), each)
        deviation = numbers[f"placed_difference_{each.unit}"]
        assert abs(deviation) == pytest.approx(each.bound[0], rel=0.01, abs=0.02), each
        verdicts = {True: "pass", False: "fail"}
        if each.is_kept is not None and numbers["verdict"] != "undecided":
            assert numbers["verdict"] == verdicts[each.is_kept], each
    assert {each.is_kept for each in result.measurands} >= {True, False}


def inspect_machine(machine, measurand):
    (feature,) = [
        feature
        for feature in Part().run(machine, ignore_progress).features
        if feature.name == measurand.name
    ]
    return feature.measures[measurand.measure]


def test_all_measures_without_tolerances_and_a_wider_limit_gives_no_smaller_bound(tmp_path):
    scene = scene_of(tmp_path, SQUARENESS)
    circle = 'test = "circular"\nplane = "XY"\nradius_mm = 100\nlimit_um = '
    narrow, wide = (
        find_worst_machine(
            scene, plan_of(scene, [circle + um]), Acceptance(part=True, knots=2)
        ).measurands
        for um in ("0.5", "1")
    )
    assert {(each.name, each.measure) for each in narrow} >= {
        ("plane 1", "flatness"), ("cylinder 2", "diameter"), ("cylinder 2", "position"),
    }  # fmt: skip
    for small, large in zip(narrow, wide, strict=True):
        assert small.bound[1] <= large.bound[1] + 1e-9
        assert (small.tolerance, small.is_kept, small.verdict) == (None, None, "")


def test_a_minimum_zone_is_named_and_has_no_number(tmp_path):
    zone = entry("top", "plane", (0, 0, 10), "flatness", "um = 5", fit="minimum zone")
    scene = scene_of(tmp_path, SQUARENESS, zone + FIRST + APART.format("5"))
    result = find_worst_machine(scene, (), Acceptance(part=True))
    assert [each.name for each in result.measurands] == ["second"]
    assert "no bound, not linear in the errors: top · flatness" in [*result.caveats()]


def test_forms_of_scans_and_small_angles_are_not_linear(tmp_path):
    scene_of(tmp_path, SQUARENESS)
    mesh = load_workpiece(tmp_path / "plate.stl")
    first, same, *_ = find_features(mesh).values()  # top and bottom
    moves = np.random.default_rng(1).normal(size=(2, len(mesh.vertices_mm), 3))
    scan = replace(first, residual_mm=1e-3 * np.arange(len(first.vertices)))
    measures = [("flatness", (0,)), ("position", (0,))]
    forms = linearise_measures([first], measures, moves)
    scans = linearise_measures([scan], measures, moves)
    assert forms[0].rows.shape == (len(first.vertices), 2)
    assert scans[0] is None
    np.testing.assert_allclose(scans[1].rows, forms[1].rows)
    for angle, count in ((0.0, 3), (5e-3, None), (0.1, 1)):
        turned = same.shape.move(np.array([0, 0, 0, angle, 0, 0, 0, 0]))
        pair = [first, replace(same, shape=turned)]
        (parallel,) = linearise_measures(pair, [("angle", (1, 0))], moves)
        assert (parallel and len(parallel.rows)) == count


def test_span_of_the_corners_of_a_box_is_that_of_all_pairs():
    """Rows of points in a plane: the largest of all pairs, each the sum of its absolute numbers."""
    rng = np.random.default_rng(2)
    rows = rng.normal(size=(60, 3))
    polytope = Polytope(-np.ones(3), np.ones(3), [Constraint("far", absolute(np.eye(3)), 1e3)])
    pairs = np.abs(rows[:, None] - rows).sum(axis=-1)
    span = find_largest_span(polytope, rows, ignore_progress)
    assert span.low <= pairs.max() * (1.0 + 1e-9)
    assert pairs.max() <= span.high * (1.0 + 1e-9)
    assert span.high <= 1.02 * span.low


def test_remainders_are_those_of_points_outside_the_hull():
    points = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0], [1.0, 1.0], [2.0, 3.0], [-1.0, 0.0]])
    remainders = find_remainders(points, np.arange(3))
    np.testing.assert_allclose(remainders[:5], [0.0, 0.0, 0.0, 0.0, 1.0], atol=1e-3)
    assert remainders[5] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.nightly
def test_table_of_the_contour_piece():
    scene = load_scene("part_on_dvf5000")
    result = find_worst_machine(scene, load_plan(default_plan(scene), scene), Acceptance(part=True))
    page = (DOCS / "acceptance.md").read_text("utf-8")
    heading = f"| contour piece, 160 × 160 mm, after {len(result.tests)} tests |"
    rows = page.split(heading, 1)[1].split("\n\n", 1)[0].splitlines()[2:]
    shown = {row.split("|")[1].split(",")[0].strip(): row for row in rows}
    assert sorted(shown) == sorted(each.name for each in result.measurands)
    for each in result.measurands:
        numbers = [float(text) for text in re.findall(r"([\d.]+) µ", shown[each.name])]
        expected = each.tolerance[1], *each.bound, each.without_tests
        assert numbers == [round(number, 1) for number in expected], each
        assert each.is_kept is (each.name != "back")
    assert f"leave {result.bound_um[0]:.0f} µm in the volume guarantee three of the four" in page
    open_without = [each for each in result.measurands if each.without_tests > each.tolerance[1]]
    assert len(open_without) == 3
    assert "Without the tests, three of the four would be open" in page


def test_cancelled_and_too_large(tmp_path, monkeypatch):
    scene = scene_of(tmp_path, SQUARENESS, FIRST + APART.format("5"))
    shares = []

    def cancel(share):
        shares.append(share)
        if share > 0.3:
            raise KeyboardInterrupt

    two = replace(scene, part=replace(scene.part, features=""))
    with pytest.raises(KeyboardInterrupt):
        find_worst_machine(two, (), Acceptance(part=True), cancel)
    assert shares[-1] < 1.0
    monkeypatch.setattr("warpspace.acceptance_tests.measurands.MAX_FEATURE_TRIANGLES", 10)
    with pytest.raises(OptionError, match=r"part: \d+ triangles; features are .* up to 10$"):
        find_worst_machine(scene, (), Acceptance(part=True))
