"""Meshes made by trimesh, written in all four formats, and read as bodies."""

import os
import re
import struct

import numpy as np
import pytest
import trimesh

from warpspace.bodies import mesh as opening
from warpspace.bodies.user_mesh import FORMATS, load_mesh
from warpspace.exceptions import OptionError

SIZE = np.array([300.0, 200.0, 100.0])


def box(size=SIZE):
    mesh = trimesh.creation.box(extents=size)
    mesh.apply_translation(np.asarray(size) / 2.0)
    return mesh


def written(path, mesh):
    path.write_bytes(data if isinstance(data := mesh.export(file_type=path.suffix[1:]), bytes)
                     else data.encode())  # fmt: skip
    return path


def volume(body):
    a, b, c = (body.vertices_mm[body.triangles[:, i]] for i in range(3))
    return float(np.sum(a * np.cross(b, c)) / 6.0)


@pytest.mark.parametrize("ending", FORMATS)
def test_box_comes_out_in_mm_with_its_twelve_edges(ending, tmp_path):
    mesh = box()
    if ending == ".glb":  # metres, Y up
        mesh.vertices = np.stack([mesh.vertices[:, 0], mesh.vertices[:, 2], -mesh.vertices[:, 1]],
                                 -1) / 1000.0  # fmt: skip
    found = load_mesh(written(tmp_path / f"gripper{ending}", mesh), "C")
    body = found.body
    assert found.warnings == ()
    assert (body.name, body.frame) == ("gripper", "C")
    np.testing.assert_allclose(body.vertices_mm.min(axis=0), 0.0, atol=1e-4)
    np.testing.assert_allclose(body.vertices_mm.max(axis=0), SIZE, atol=1e-4)
    assert body.triangles.shape == (12, 3)
    assert volume(body) == pytest.approx(SIZE.prod(), rel=1e-6)
    assert body.edges_mm.shape == (12, 2, 3)
    lengths = np.linalg.norm(np.diff(body.edges_mm, axis=1)[:, 0], axis=1)
    np.testing.assert_allclose(sorted(lengths), np.repeat(sorted(SIZE), 4), rtol=1e-6)


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1.0), ("cm", 10.0), ("m", 1e3), ("in", 25.4)])
@pytest.mark.parametrize("ending", FORMATS)
def test_a_given_unit_and_upward_axis_hold_for_every_format(ending, unit, factor, tmp_path):
    path = written(tmp_path / f"a{ending}", box())
    straight = load_mesh(path, "R", unit=unit, up="z").body.vertices_mm
    np.testing.assert_allclose(np.ptp(straight, axis=0), SIZE * factor, rtol=1e-6)
    turned = load_mesh(path, "R", unit=unit, up="y").body
    np.testing.assert_allclose(np.ptp(turned.vertices_mm, axis=0), SIZE[[0, 2, 1]] * factor)
    assert volume(turned) > 0.0


@pytest.mark.parametrize("ending", FORMATS)
def test_missing_empty_and_damaged_files_are_named(ending, tmp_path):
    with pytest.raises(OptionError, match=rf"none\{ending}: there is no such file"):
        load_mesh(tmp_path / f"none{ending}", "R")
    (tmp_path / f"empty{ending}").touch()
    with pytest.raises(OptionError, match=rf"empty\{ending}: the file is empty"):
        load_mesh(tmp_path / f"empty{ending}", "R")
    rng = np.random.default_rng(1)
    (tmp_path / f"noise{ending}").write_bytes(rng.bytes(5000))
    with pytest.raises(OptionError, match=rf"noise\{ending}: "):
        load_mesh(tmp_path / f"noise{ending}", "R")
    whole = written(tmp_path / f"whole{ending}", box()).read_bytes()
    half = tmp_path / f"half{ending}"
    half.write_bytes(whole[: len(whole) // 3])
    with pytest.raises(OptionError, match=rf"half\{ending}: "):
        load_mesh(half, "R")
    (tmp_path / f"folder{ending}").mkdir()
    with pytest.raises(OptionError, match=rf"folder\{ending}: cannot be read"):
        load_mesh(tmp_path / f"folder{ending}", "R")


@pytest.mark.parametrize("name", ["points.ply", "points.glb", "points.obj"])
def test_file_without_triangles(name, tmp_path):
    if name.endswith("obj"):
        (tmp_path / name).write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    else:
        written(tmp_path / name, trimesh.PointCloud([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]).scene()
                if name.endswith("glb")
                else trimesh.PointCloud([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]))  # fmt: skip
    with pytest.raises(OptionError, match=rf"{name}: there are no triangles"):
        load_mesh(tmp_path / name, "R")


def test_triangles_without_area_are_no_surface(tmp_path):
    flat = tmp_path / "flat.obj"
    flat.write_text("v 0 0 0\nv 100 0 0\nv 200 0 0\nf 1 2 3\n")
    with pytest.raises(OptionError, match=r"flat\.obj: all of its triangles"):
        load_mesh(flat, "R")


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_vertex_that_is_not_finite(value, tmp_path):
    data = bytearray(written(tmp_path / "a.stl", box()).read_bytes())
    struct.pack_into("<f", data, 84 + 12, value)
    (tmp_path / "bad.stl").write_bytes(data)
    with pytest.raises(OptionError, match=r"bad\.stl: a vertex is not finite"):
        load_mesh(tmp_path / "bad.stl", "R")


def test_too_large_a_file_is_not_opened(tmp_path, monkeypatch):
    monkeypatch.setattr(opening, "LIMIT_MB", 0.0001)
    path = written(tmp_path / "large.stl", box())
    with pytest.raises(OptionError, match=r"large\.stl: .* may have up to"):
        load_mesh(path, "R")


def test_a_size_that_suggests_another_unit(tmp_path):
    small = written(tmp_path / "small.stl", box(SIZE / 1000.0))
    with pytest.raises(OptionError, match=r"small\.stl: taken as mm, its longest edge is 0\.3 mm"):
        load_mesh(small, "R")
    assert np.ptp(load_mesh(small, "R", unit="m").body.vertices_mm[:, 0]) == pytest.approx(300.0)
    assert np.ptp(load_mesh(small, "R", unit="mm").body.vertices_mm[:, 0]) == pytest.approx(0.3)
    large = written(tmp_path / "large.glb", box())
    with pytest.raises(OptionError, match=r"large\.glb: taken as m, .* probably in mm"):
        load_mesh(large, "R")


def test_an_open_surface_is_a_warning(tmp_path):
    mesh = box()
    mesh.update_faces(np.arange(12) > 0)
    found = load_mesh(written(tmp_path / "open.stl", mesh), "R")
    assert len(found.body.triangles) == 11
    (warning,) = found.warnings
    assert "open.stl: the surface is not closed (3 open edges)" in warning


def test_a_surface_turned_inside_out_is_turned_back(tmp_path):
    mesh = box()
    mesh.invert()
    found = load_mesh(written(tmp_path / "inside.stl", mesh), "R")
    assert volume(found.body) == pytest.approx(SIZE.prod(), rel=1e-6)


def test_meshes_of_a_file_are_joined_where_their_nodes_place_them(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(box(), node_name="a")
    aside = trimesh.transformations.translation_matrix([500, 0, 0])
    scene.add_geometry(box(), node_name="b", transform=aside)
    body = load_mesh(written(tmp_path / "two.glb", scene), "R", unit="mm", up="z").body
    assert len(body.triangles) == 24
    assert np.ptp(body.vertices_mm, axis=0) == pytest.approx([800, 200, 100])
    assert len(body.edges_mm) == 24


def test_unknown_endings_units_and_axes(tmp_path):
    with pytest.raises(OptionError, match=r"a\.step: unknown ending; expected one of \.stl"):
        load_mesh(tmp_path / "a.step", "R")
    with pytest.raises(OptionError, match=r"a\.stl: 'feet'; expected one of mm, cm, m, in"):
        load_mesh(tmp_path / "a.stl", "R", unit="feet")
    with pytest.raises(OptionError, match=r"a\.stl: 'x'; expected one of y, z"):
        load_mesh(tmp_path / "a.stl", "R", up="x")


def test_a_file_is_read_once_until_it_changes(tmp_path):
    path = written(tmp_path / "a.stl", box())
    first = load_mesh(path, "R")
    assert load_mesh(path, "R") is first
    written(path, box(SIZE * 2.0))
    os.utime(path, ns=(1, 1))
    assert np.ptp(load_mesh(path, "R").body.vertices_mm[:, 0]) == pytest.approx(600.0)


def test_obj_does_not_open_the_files_it_names(tmp_path):
    path = written(tmp_path / "a.obj", box())
    path.write_text("mtllib secret.mtl\n" + path.read_text())
    (tmp_path / "secret.mtl").mkdir()
    assert len(load_mesh(path, "R").body.triangles) == 12


def test_a_triangle_of_a_vertex_that_is_not_there(tmp_path):
    content = trimesh.creation.box((20.0, 30.0, 40.0)).export(file_type="ply", encoding="ascii")
    head, faces = content.split(b"end_header\n")
    path = tmp_path / "box.ply"
    path.write_bytes(head + b"end_header\n" + re.sub(rb"(?m)^3 7 ", b"3 70 ", faces))
    assert b"\n3 70 " in path.read_bytes()
    with pytest.raises(OptionError, match=r"box\.ply: no PLY file .* vertex that is not there"):
        load_mesh(path, "X")


def test_points_with_one_coordinate(tmp_path):
    path = tmp_path / "point.obj"
    path.write_text("v -10.0\n", "utf-8")
    with pytest.raises(OptionError, match="without three coordinates"):
        load_mesh(path, "X")


def test_a_closed_surface_without_volume_warns_of_nothing(tmp_path):
    path = tmp_path / "x.obj"
    corners = "-10 -15 -20|-10 -15 20|-10 15 -20|-10 15 20|-10 15 20"
    corners += "|10 -15 -20|10 -15 20|10 15 -20|-10 15 20|10 15 20"
    faces = "2 4 1|5 2 1|1 4 3|3 5 1|2 8 4|6 2 5|6 8 2|4 8 3|7 5 3|3 8 7|7 6 5|8 6 7"
    lines = [f"v {corner}" for corner in corners.split("|")]
    lines += [f"f {face}" for face in faces.split("|")]
    path.write_text("\n".join(lines), "utf-8")
    assert len(load_mesh(path, "X").body.triangles) > 0
