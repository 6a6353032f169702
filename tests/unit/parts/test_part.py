"""The part as it is made, against closed forms; its mesh, merged and split at creases."""

import numpy as np
import pytest
import trimesh

from bench_scenes import scene_with
from warpspace import load_scene
from warpspace.analysis.description import ignore_progress
from warpspace.exceptions import OptionError, SceneError
from warpspace.kinematics.model import Loop
from warpspace.parts.part import Part
from warpspace.parts.program import Program
from warpspace.parts.workpiece import (
    Workpiece,
    count_crossings,
    evaluate_points,
    load_workpiece,
    place_workpiece,
    point_basis,
    subtract_best_fit,
)
from warpspace.scene.library import parse_scene
from warpspace.scene.model import evaluate
from warpspace.scene.scene_writer import scene_to_toml


def mesh_of(mesh, ending="ply"):
    return load_workpiece(f"x.{ending}", "mm", mesh.export(file_type=ending))


BOX = trimesh.creation.box([100.0, 60.0, 40.0])
BALL = trimesh.creation.icosphere(subdivisions=3, radius=50.0)


@pytest.mark.parametrize("ending", ["stl", "ply"])
def test_vertices_are_merged_and_creases_are_split(ending):
    box, ball = mesh_of(BOX, ending), mesh_of(BALL, ending)
    assert (len(box.vertices_mm), len(box.corners.corner_of)) == (8, 24)
    assert (len(ball.vertices_mm), len(ball.corners.corner_of)) == (642, 642)
    outwards = ball.vertices_mm[ball.corners.corner_of] / 50.0
    assert np.abs(ball.corners.normals - outwards).max() < 0.02
    assert np.array_equal(box.corners.corner_of[box.corners.triangles], box.triangles)
    across = box.surface.face_normals[:, None] - box.corners.normals[box.corners.triangles]
    assert np.abs(across).max() < 1e-12
    assert not box.warnings


def test_what_is_wrong_with_a_surface_is_said(tmp_path):
    inside = BOX.copy()
    inside.invert()
    found = mesh_of(inside)
    assert "faced inwards" in found.warnings[0]
    assert found.surface.volume == pytest.approx(240_000.0)
    hollow = BOX + BOX.copy().apply_scale(0.5)
    hollow.faces[12:] = hollow.faces[12:, ::-1]
    assert not mesh_of(hollow).warnings
    assert mesh_of(hollow).surface.volume == pytest.approx(240_000.0 * 7.0 / 8.0)
    apart = BOX + inside.apply_scale(0.9).apply_translation([200.0, 0.0, 0.0])
    assert "some of its shells face inwards" in mesh_of(apart).warnings[0]
    lid = trimesh.Trimesh(BOX.vertices, BOX.faces[2:], process=False)
    assert "not closed" in mesh_of(lid).warnings[0]
    with pytest.raises(OptionError, match="probably in m"):
        load_workpiece("x.stl", data=trimesh.creation.box([0.1] * 3).export(file_type="stl"))
    with pytest.raises(OptionError, match="in another unit; give"):  # 160 mm in inches
        load_workpiece("x.stl", data=trimesh.creation.box([6.299] * 3).export(file_type="stl"))
    with pytest.raises(OptionError, match="no such file"):
        load_workpiece(tmp_path / "none.stl")


def prism(*corners):
    """Stand a polygon up, 20 mm high, without a lid."""
    low = np.array([[x, y, 0.0] for x, y in corners])
    around = np.arange(len(low))
    ahead, above = np.roll(around, -1), around + len(low)
    walls = np.concatenate([np.stack(three, axis=-1) for three in
                            ((around, ahead, above), (ahead, above[ahead], above))])  # fmt: skip
    points = np.concatenate([low, np.add(low, [0.0, 0.0, 20.0])])
    return trimesh.Trimesh(points, walls, process=False)


def beside(mesh, *shift):
    return mesh + mesh.copy().apply_translation(shift)


FIN = trimesh.creation.cylinder(radius=50.0, height=300.0, sections=400)  # all sides long


@pytest.mark.parametrize("turned", [0.0, 0.3, 1.0, 2.5])
def test_a_surface_that_passes_through_itself_has_a_warning(turned):
    turn = trimesh.transformations.rotation_matrix(turned, (1.0, 2.0, 3.0), (9.0, 0.0, 0.0))

    def said(mesh):
        warnings = mesh_of(mesh.copy().apply_transform(turn), "stl").warnings
        return [text for text in warnings if "passes through itself" in text]

    (text,) = said(beside(BOX, 30.0, 20.0, 10.0))
    assert "(15 pairs of triangles); used as is" in text
    assert said(prism((0, 0), (40, 0), (0, 40), (40, 40)))  # walls cross midway
    assert said(prism((0, 0), (40, 0), (40, 30), (10, -10), (5, 20)))
    assert said(beside(BALL, 40.0, 3.0, 5.0))
    for good in (BOX, BALL, FIN, prism((0, 0), (40, 0), (40, 40), (20, 5))):
        assert not said(good)
    for shift in ((100.0, 0.0, 0.0), (30.0, 7.0, 40.0), (100.0, 60.0, 0.0), (100.0, 60.0, 40.0)):
        assert not said(beside(BOX, *shift))


def test_triangles_of_a_heap_are_not_all_examined():
    points = 100.0 * np.random.default_rng(0).standard_normal((60_000, 3))
    heap = trimesh.Trimesh(points, np.arange(60_000).reshape(-1, 3), process=False)
    assert any("not checked whether its surface passes" in text for text in mesh_of(heap).warnings)


def test_a_part_stands_in_the_middle_or_where_it_is_put():
    scene = scene_with()
    part = place_workpiece(mesh_of(BOX), scene, None)
    middle = evaluate_points(scene, np.array([part.vertices_mm.mean(axis=0)])).coordinates
    for name, (low, high) in scene.workspace.ranges.items():
        assert float(np.mean(middle[name])) == pytest.approx((low + high) / 2.0)
    turned = place_workpiece(mesh_of(BOX), scene, (10.0, 20.0, 30.0, 0.0, 0.0, 90.0))
    assert np.ptp(turned.vertices_mm, axis=0) == pytest.approx([60.0, 100.0, 40.0])
    assert turned.vertices_mm.mean(axis=0) == pytest.approx([10.0, 20.0, 30.0])


def test_a_part_is_what_the_field_says():
    scene = load_scene("dvf5000_first")
    part = place_workpiece(mesh_of(BALL), scene, None)
    made = evaluate_points(scene, part.vertices_mm)
    field = evaluate(scene, at=made.coordinates, loop=Loop.RELATIVE, frame="workpiece")
    assert np.array_equal(field.error_um, made.error_um)
    basis = point_basis(scene, made)
    amplitudes = np.array([scene.errors.amplitude(key) for key in basis.keys])
    assert np.abs(basis.evaluate(amplitudes).error_um - made.error_um).max() < 1e-9
    assert not made.outside.any()
    far = evaluate_points(scene, part.vertices_mm + np.array([400.0, 0.0, 0.0]))
    assert 0 < far.outside.sum() <= len(far.outside)


def test_a_location_error_is_fitted_out_and_a_squareness_is_not():
    part = place_workpiece(mesh_of(BALL), scene_with(), None)
    located = evaluate_points(scene_with(EX0C=20.0, EY0C=-7.0, EA0C=30.0), part.vertices_mm)
    assert np.linalg.norm(located.error_um, axis=1).max() > 20.0
    assert np.abs(subtract_best_fit(located.point_mm, located.error_um)).max() < 1e-9
    square = evaluate_points(scene_with(EC0Y=100.0), part.vertices_mm)
    left = subtract_best_fit(square.point_mm, square.error_um)
    # 100 µrad over ±50 mm: half of it is a rotation, the other half a shear of ±2.5 µm
    assert np.linalg.norm(left, axis=1).max() == pytest.approx(2.5, rel=0.01)


def cut(mesh, place, **errors):
    return Part(mesh=mesh_of(mesh), place=place).run(scene_with(**errors), ignore_progress)


def test_what_is_off_is_told_by_closed_forms():
    located = cut(BOX, (0.0, 0.0, 0.0), EZ0C=10.0, EA0C=100.0)  # the workpiece rises and tilts
    # y: 0.1 z, z: −(10 + 0.1 y), to the top and bottom along the normal
    assert located.deviation.max_um == pytest.approx(np.hypot(13.0, 2.0))
    assert tuple(located.normal.values()) == pytest.approx((-13.0, 13.0))
    assert located.placed.deviation.max_um < 1e-9
    assert located.placed.normal["max_um"] < 1e-9
    square = cut(BALL, None, EC0Y=100.0).placed  # −0.1 y along x: half a turn, half a shear
    assert tuple(square.normal.values()) == pytest.approx((-2.5, 2.5), abs=0.1)
    # 0.1 µm for each mm of X, along the normal 0.1 x² / 50 mm
    scale = cut(BALL, None, EXX=(0.0, 55.0)).placed
    assert tuple(scale.normal.values()) == pytest.approx((0.0, 5.0), abs=0.1)


def test_a_pitch_over_the_travel_shears_what_is_high():
    made = cut(BOX, None, EBX=(0.0, 550.0)).actual  # 1 µrad for each mm
    sides = np.sign(made.point_mm[:8] - made.point_mm[:8].mean(axis=0))
    assert np.sum(sides[:, 0] * sides[:, 2] * made.error_um[:8, 0]) / 2 == pytest.approx(4.0)


WAVE = """[machine]
chain = "wFXYZt"
[workspace]
X = [-150, 150]
Y = [-120, 120]
Z = [-100, 100]
[errors]
EXX = { harmonics = [[%s, 5.0, 0.0]] }
"""
KEEPS = """[[features]]
is = "plane"
near = [0.0, 0.0, 20.0]
measure = "flatness"
tolerance_um = %s
"""


@pytest.mark.parametrize(("order", "verdict"), [(1, "pass"), (300, "undecided")])
def test_errors_between_vertices_are_evaluated_or_leave_verdicts_undecided(order, verdict):
    scene = parse_scene(WAVE % order, "s")
    asked = Part(mesh=mesh_of(BOX), place=(0.0, 0.0, 0.0), tolerances=("f", KEEPS % 2))
    found = asked.run(scene, ignore_progress)
    assert any("between evaluated points" in text for text in found.caveats()) == (order > 1)
    (one,) = [m for f in found.features for m in f.measures.values() if "verdict" in m]
    assert one["verdict"] == verdict
    assert found.deviation.max_um == pytest.approx(5.0, rel=0.01)  # amid the box


def test_a_part_beyond_the_travel_is_counted_and_said():
    far = cut(BOX, (270.0, 0.0, 120.0))
    assert 0 < far.outside < far.vertices
    assert any("beyond the travel" in said for said in far.caveats())
    with pytest.raises(OptionError, match="expected a mesh"):
        Part().run(scene_with(), ignore_progress)


def test_a_scene_names_its_part(tmp_path):
    BOX.export(tmp_path / "box.stl")
    (tmp_path / "moves.ngc").write_text("G1 X10\n")
    section = '[part]\nfile = "box.stl"\nplace = [0.0, 0.0, 120.0, 0.0, 0.0, 90.0]\nunit = "cm"\n'
    text = section + 'program = "moves.ngc"\ntcp = "never"\n'
    scene_file = tmp_path / "scene.toml"
    scene_file.write_text(f'machine = "dvf5000"\n{text}')
    scene = load_scene(scene_file)
    found = Part().run(scene, ignore_progress)
    assert found.workpiece.place == scene.part.place
    assert np.ptp(found.workpiece.vertices_mm, axis=0) == pytest.approx([600.0, 1000.0, 400.0])
    assert Program().run(scene, ignore_progress).program.blocks == 1
    saved = scene_to_toml(scene)
    assert text in saved
    assert parse_scene(saved, "scene", folder=tmp_path) == scene
    assert parse_scene(saved, "scene").part.path("file") is None  # an upload has no folder
    wrong = {"tcp =": "tpc =", "box.": "none.", "[0.0, 0.0, 120": "[120", "moves.ngc": "../a.ngc"}
    said = "did you mean 'tcp'", "no such file", r"expected \[x, y, z, a", "leads out of the folder"
    for (old, new), words in zip(wrong.items(), said, strict=True):
        scene_file.write_text(text.replace(old, new))
        with pytest.raises(SceneError, match=words):
            load_scene(scene_file)


@pytest.mark.parametrize("ending", [".stl", ".obj", ".ply", ".glb"])
def test_a_bent_file_is_as_cut_and_a_predistorted_one_is_cut_nominal(ending, tmp_path):
    scene, place = load_scene("dvf5000_first"), (10.0, 20.0, 120.0, 30.0, 0.0, 90.0)
    data = BALL.export(file_type=ending[1:])
    file = tmp_path / f"ball{ending}"
    file.write_bytes(data.encode() if isinstance(data, str) else data)
    ways = [Part(file=str(file), place=place, unit="mm", predistorted=way) for way in (False, True)]
    found, other = (way.run(scene, ignore_progress) for way in ways)
    texts = [one.output_files(ending)[""] for one in (found, other)]
    bent, asked = (
        load_workpiece(f"bent{ending}", "mm", text.encode() if isinstance(text, str) else text)
        for text in texts
    )
    assert bent.warnings == asked.warnings == ()  # as closed as it was
    moved = place_workpiece(bent, scene, place)
    nearest = np.linalg.norm(moved.vertices_mm[:, None] - found.actual.point_mm, axis=-1).argmin(1)
    error = 1e3 * (moved.vertices_mm - found.actual.point_mm[nearest])
    assert np.abs(error - found.actual.error_um[nearest]).max() < 0.02  # of numbers in 4 bytes
    made = evaluate_points(scene, place_workpiece(asked, scene, place).vertices_mm)
    off = made.point_mm[:, None] + 1e-3 * made.error_um[:, None] - found.actual.point_mm
    assert np.linalg.norm(off, axis=-1).min(axis=1).max() < 2e-5


def test_triangles_that_lie_close_without_meeting_are_counted_as_looked_at():
    # their pairs were not, so that it took 11 s before it was given up
    stack = np.tile([[0.0, 0.0, 0.0], [100.0, 0.0, 100.0], [0.0, 100.0, 0.0]], (100_000, 1, 1))
    stack[:, :, 2] += np.arange(len(stack))[:, None] / 3.0
    triangles = np.arange(3 * len(stack), dtype=np.int32).reshape(-1, 3)
    assert count_crossings(Workpiece("stack", stack.reshape(-1, 3), triangles)) is None
