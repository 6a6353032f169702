"""Meshes of users: read as bodies from all formats, and counted before they are built."""

import base64
import copy
import io
import json
import os
import re
import struct
import time
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest
import trimesh

from warpspace.bodies.mesh import _merge_stl, open_meshes
from warpspace.bodies.mesh_files import FORMATS, check_meshes, frame_meshes, load_mesh, read_mesh
from warpspace.exceptions import OptionError, SceneError, WarpspaceError
from warpspace.scene.library import load_scene
from warpspace.scene.urdf import place_robot, read_robot

SIZE = np.array([300.0, 200.0, 100.0])


def box(size=SIZE):
    mesh = trimesh.creation.box(extents=size)
    mesh.apply_translation(np.asarray(size) / 2.0)
    return mesh


def written(path, mesh):
    mesh.export(path)
    return path


def volume(body):
    a, b, c = (body.vertices_mm[body.triangles[:, i]] for i in range(3))
    return float(np.sum(a * np.cross(b, c)) / 6.0)


@pytest.mark.parametrize("ending", FORMATS)
def test_box_comes_out_in_mm_with_its_twelve_edges(ending, tmp_path):
    mesh = box()
    if ending == ".glb":  # metres, Y up
        mesh.vertices = mesh.vertices[:, [0, 2, 1]] * (1e-3, 1e-3, -1e-3)
    body = load_mesh(written(tmp_path / f"gripper{ending}", mesh), "C")
    assert (body.name, body.frame, body.warnings) == ("gripper", "C", ())
    ends = body.vertices_mm.min(axis=0), body.vertices_mm.max(axis=0)
    np.testing.assert_allclose(ends, [np.zeros(3), SIZE], atol=1e-4)
    assert (body.triangles.shape, body.edges_mm.shape) == ((12, 3), (12, 2, 3))
    assert volume(body) == pytest.approx(SIZE.prod(), rel=1e-6)
    lengths = np.linalg.norm(np.diff(body.edges_mm, axis=1)[:, 0], axis=1)
    np.testing.assert_allclose(sorted(lengths), np.repeat(sorted(SIZE), 4), rtol=1e-6)


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1.0), ("cm", 10.0), ("m", 1e3), ("in", 25.4)])
@pytest.mark.parametrize("ending", FORMATS)
def test_a_given_unit_holds_for_every_format(ending, unit, factor, tmp_path):
    path = written(tmp_path / f"a{ending}", box())
    body = load_mesh(path, "R", unit=unit)
    extent = SIZE[[0, 2, 1]] if ending == ".glb" else SIZE
    np.testing.assert_allclose(np.ptp(body.vertices_mm, axis=0), extent * factor, rtol=1e-6)
    assert volume(body) > 0.0


@pytest.mark.parametrize("ending", FORMATS)
def test_missing_empty_and_damaged_files_are_named(ending, tmp_path):
    whole = written(tmp_path / f"whole{ending}", box()).read_bytes()
    noise = np.random.default_rng(1).bytes(5000)
    contents = {"empty": b"", "noise": noise, "half": whole[: len(whole) // 3]}
    for name, content in contents.items():
        (tmp_path / f"{name}{ending}").write_bytes(content)
    (tmp_path / f"folder{ending}").mkdir()
    reasons = {"none": "no such file", "empty": "the file is empty", "folder": "is a folder"}
    for name in (*contents, *reasons):
        with pytest.raises(OptionError, match=rf"{name}\{ending}: {reasons.get(name, '')}"):
            load_mesh(tmp_path / f"{name}{ending}", "R")


@pytest.fixture(scope="module")
def corrupted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("corrupted")
    points = trimesh.PointCloud([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    written(folder / "points.ply", points)
    written(folder / "points.glb", points.scene())
    (folder / "points.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    (folder / "edge.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n")
    (folder / "point.obj").write_text("v -10.0\n", "utf-8")
    (folder / "flat.obj").write_text("v 0 0 0\nv 100 0 0\nv 200 0 0\nf 1 2 3\n")
    for value in (np.nan, np.inf, 2.0**40):
        data = bytearray(written(folder / "a.stl", box()).read_bytes())
        struct.pack_into("<f", data, 84 + 12, value)
        (folder / f"{value}.stl").write_bytes(data)
    turned = trimesh.Scene()
    turned.add_geometry(box(), transform=trimesh.transformations.rotation_matrix(1.0, (1, 2, 3)))
    content = turned.export(file_type="glb")
    largest = struct.pack("<f", box().vertices.max())
    (folder / "inf.glb").write_bytes(content.replace(largest, struct.pack("<f", np.inf)))
    content = trimesh.creation.box((20.0, 30.0, 40.0)).export(file_type="ply", encoding="ascii")
    head, faces = content.split(b"end_header\n")
    far = re.sub(rb"(?m)^3 7 ", b"3 70 ", faces)
    assert far != faces
    (folder / "box.ply").write_bytes(head + b"end_header\n" + far)
    return folder


@pytest.mark.parametrize(
    ("name", "said", "options"),
    [
        ("points.ply", "there are no triangles", {}),
        ("points.glb", "there are no triangles", {}),
        ("points.obj", "there are no triangles", {}),
        ("edge.obj", "there are no triangles", {}),
        ("point.obj", ".*without three coordinates", {}),
        ("flat.obj", "all of its triangles", {}),
        ("nan.stl", "a vertex is not finite", {}),
        ("inf.stl", "a vertex is not finite", {}),
        ("inf.glb", "a vertex is not finite", {}),
        ("1099511627776.0.stl", "a vertex is at 1.1e.12; expected at most 1e.09", {}),
        ("box.ply", "no PLY file .* refers to a missing vertex", {}),
        ("a.iges", r"unknown ending; expected one of \.stl", {}),
        ("a.stl", "'feet'; expected one of mm, cm, m, in", {"unit": "feet"}),
    ],
)
def test_what_is_no_mesh_is_refused(name, said, options, corrupted):
    with pytest.raises(OptionError, match=f"{name}: {said}"):
        load_mesh(corrupted / name, "R", **options)


def test_a_size_that_suggests_another_unit(tmp_path):
    small = written(tmp_path / "small.stl", box(SIZE / 1000.0))
    with pytest.raises(OptionError, match=r"small\.stl: in mm, its longest edge is 0\.3 mm"):
        load_mesh(small, "R")
    assert np.ptp(load_mesh(small, "R", unit="m").vertices_mm[:, 0]) == pytest.approx(300.0)
    assert np.ptp(load_mesh(small, "R", unit="mm").vertices_mm[:, 0]) == pytest.approx(0.3)
    large = written(tmp_path / "large.glb", box())
    with pytest.raises(OptionError, match=r"large\.glb: in m, .* probably in mm"):
        load_mesh(large, "R")


def test_an_open_surface_is_a_warning(tmp_path):
    mesh = box()
    mesh.update_faces(np.arange(12) > 0)
    body = load_mesh(written(tmp_path / "open.stl", mesh), "R")
    assert len(body.triangles) == 11
    (warning,) = body.warnings
    assert re.search(r"open\.stl: the surface is not closed.*\(3 open edges\)", warning)


def test_a_surface_turned_inside_out_is_turned_back(tmp_path):
    mesh = box()
    mesh.invert()
    body = load_mesh(written(tmp_path / "inside.stl", mesh), "R")
    assert volume(body) == pytest.approx(SIZE.prod(), rel=1e-6)


def test_meshes_of_a_file_are_joined_where_their_nodes_place_them(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(box(), node_name="a")
    aside = trimesh.transformations.translation_matrix([500, 0, 0])
    scene.add_geometry(box(), node_name="b", transform=aside)
    body = load_mesh(written(tmp_path / "two.glb", scene), "R", unit="mm")
    assert len(body.triangles) == 24
    assert np.ptp(body.vertices_mm, axis=0) == pytest.approx([800, 100, 200])
    assert len(body.edges_mm) == 24


def test_obj_does_not_open_the_files_it_names(tmp_path):
    path = written(tmp_path / "a.obj", box())
    path.write_text("mtllib secret.mtl\n" + path.read_text())
    (tmp_path / "secret.mtl").mkdir()
    assert len(load_mesh(path, "R").triangles) == 12


def test_a_closed_surface_without_volume_warns_of_nothing(tmp_path):
    corners = "-10 -15 -20|-10 -15 20|-10 15 -20|-10 15 20|-10 15 20"
    corners += "|10 -15 -20|10 -15 20|10 15 -20|-10 15 20|10 15 20"
    faces = "2 4 1|5 2 1|1 4 3|3 5 1|2 8 4|6 2 5|6 8 2|4 8 3|7 5 3|3 8 7|7 6 5|8 6 7"
    lines = [f"v {corner}" for corner in corners.split("|")]
    lines += [f"f {face}" for face in faces.split("|")]
    (tmp_path / "x.obj").write_text("\n".join(lines), "utf-8")
    assert len(load_mesh(tmp_path / "x.obj", "X").triangles) > 0


POINTS = np.array([[0, 0, 0], [50, 0, 0], [0, 50, 0]], np.float32).tobytes()
TRIANGLE = POINTS + np.array([0, 1, 2, 0], np.uint16).tobytes()
ONE: dict[str, Any] = {
    "asset": {"version": "2.0"},
    "scene": 0,
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
    ],
    "bufferViews": [
        {"buffer": 0, "byteOffset": 0, "byteLength": 36},
        {"buffer": 0, "byteOffset": 36, "byteLength": 6},
    ],
    "buffers": [{"byteLength": 44}],
}
CORNERS = "".join(f"v {i % 7} {i // 7} {i % 3}\n" for i in range(300))


def glb(**changes):
    held = json.dumps({**copy.deepcopy(ONE), **changes}).encode()
    held += b" " * (-len(held) % 4)
    chunks = struct.pack("<II", len(held), 0x4E4F534A) + held
    chunks += struct.pack("<II", len(TRIANGLE), 0x004E4942) + TRIANGLE
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def diamond(levels):
    pairs = [{"children": [2 * level + 2, 2 * level + 3]} for level in range(levels) for _ in "ab"]
    return {"nodes": [*pairs, {"mesh": 0}, {"mesh": 0}], "scenes": [{"nodes": [0, 1]}]}


def chain(length):
    return [*({"children": [i + 1]} for i in range(length - 1)), {"mesh": 0}]


primitive = ONE["meshes"][0]["primitives"][0]
view, points = ONE["bufferViews"][0], ONE["accessors"][0]
GLB = {
    "nodes": (
        {"nodes": [{"mesh": 0}] * 6000, "scenes": [{"nodes": list(range(6000))}]}, "6,000 nodes"
    ),
    "primitives": ({"meshes": [{"primitives": [primitive] * 6000}]}, "6,000 primitives"),
    "placed": (
        {
            "meshes": [{"primitives": [primitive] * 100}],
            "nodes": [{"mesh": 0}] * 100,
            "scenes": [{"nodes": list(range(100))}],
        },
        "10,000 primitives, each placing counted",
    ),
    "each other's children": (
        {"nodes": [{"children": [1]}, {"children": [0], "mesh": 0}]}, "node 0 twice"
    ),
    "its own child": ({"nodes": [{"children": [0], "mesh": 0}]}, "node 0 twice"),
    "two parents, thirty levels": (diamond(30), "twice in its scene; expected a tree"),
    "named twice": ({"scenes": [{"nodes": [0, 0]}]}, "node 0 twice"),
    "deep": ({"nodes": chain(200)}, "51 nodes below each other; expected at most 50"),
    "materials": ({"materials": [{}] * 6000}, "6,000 materials"),
    "overlapping views": (
        {"bufferViews": [{**view, "byteLength": 44_000_000}] * 2}, "88,000,000 bytes in views"
    ),
    "accessors": ({"accessors": [{**points, "count": 2_000_000}] * 2}, "4,000,000 points and ind"),
    "accessors without data": (
        {"accessors": [
            *ONE["accessors"], {"componentType": 5126, "count": 1_000_000, "type": "MAT4"}
        ]},
        "64,000,042 bytes of points and indices; expected at most 50,000,000",
    ),
    "negative": (
        {"accessors": [{**points, "count": 4_000_000}, {**points, "count": -9_000_000}]},
        "4,000,000 points and indices",
    ),
}  # fmt: skip


def test_a_glb_file_within_the_limits_is_built(tmp_path):
    path = tmp_path / "a.glb"
    path.write_bytes(glb(nodes=chain(50)))
    assert len(load_mesh(path, "X", unit="mm").triangles) == 1
    path.write_bytes(glb() + struct.pack("<II", 0, 0x12345678) * 6000)
    with pytest.raises(OptionError, match="5,001 chunks; expected at most 5,000"):
        open_meshes(path, "GLB file")


@pytest.mark.parametrize("word", ["usemtl m{}", "g g{}", "o o{}", "  usemtl m {}", "s {}"])
def test_groups_and_materials_of_an_obj_file_are_one_body(tmp_path, word):
    # 30,000 materials took more than 25 s: trimesh goes through all vertices for each
    path = tmp_path / "a.obj"
    faces = (
        f"{word.format(i)}\nf {i % 290 + 1} {i % 290 + 2} {i % 290 + 8}\n" for i in range(30_000)
    )
    path.write_text(CORNERS + "mtllib a.mtl\n" + "".join(faces))
    scene = open_meshes(path, "OBJ file")
    assert [len(mesh.faces) for mesh in scene.geometry.values()] == [30_000]


def test_solids_of_an_stl_file_are_one_body(tmp_path):
    facet = "facet normal 0 0 1\nouter loop\nvertex {0} 0 0\nvertex {0} 9 0\nvertex {0} 0 9\n"
    solid = "solid s{0}\n" + facet + "endloop\nendfacet\nendsolid s{0}\n"
    path = tmp_path / "a.stl"
    path.write_text("".join(solid.format(i) for i in range(3000)))
    scene = open_meshes(path, "STL file")
    assert [len(mesh.faces) for mesh in scene.geometry.values()] == [3000]
    path.write_text("".join(solid.format(i) + "between\n" for i in range(3000)))
    with pytest.raises(OptionError, match="3,000 solids; expected at most 1,000"):
        open_meshes(path, "STL file")


XYZ = "property float x\nproperty float y\nproperty float z\n"
FACES = "element face {}\nproperty list uchar {} vertex_indices\nend_header\n"
TEXTS = {
    "polygon.obj": (CORNERS + "f" + " 1 2 3" * 90_000 + "\n", "269,998 triangles"),
    "polygons.obj": (CORNERS + ("f" + " 1 2 3" * 50 + "\nf 1 2 3\n") * 2000, "298,000 triangles"),
    "odd_blanks.obj": (CORNERS + "f 1" + "\x1c2" * 260_000 + "\n", "259,999 triangles"),
    "lines.obj": (CORNERS + "\n" * 3_000_000, "3,000,300 lines; expected at most 3,000,000"),
    "triangles.stl": ("solid a\n" + "vertex 0 0 1\n" * 750_003 + "endsolid\n", "250,001 triangles"),
    "numbers.stl": ("solid a\nvertex" + " 1" * 10_000_000 + "\nendsolid\n", "10,000,004 words"),
    "header.ply": ("ply\nformat ascii 1.0\n" + "comment a\n" * 7000 + "end_header\n", "of header"),
    "elements.ply": (
        "ply\nformat ascii 1.0\n" + "".join(f"element e{i} 1\n" for i in range(6000)), "of header"
    ),
    "rows.ply": (
        "ply\nformat ascii 1.0\nelement vertex 3000000000\n" + XYZ + FACES.format(1, "int"),
        "3,000,000,000 rows of 'vertex'; expected at most 750,000",
    ),
    "polygon.ply": (
        "ply\nformat ascii 1.0\nelement vertex 3\n" + XYZ + FACES.format(1, "int")
        + "0 0 0\n5 0 0\n0 5 0\n" + "9" + " 1" * 3_000_000,
        "3,000,001 numbers in lists",
    ),
    "binary.ply": (
        "ply\nformat binary_little_endian 1.0\nelement vertex 0\n" + XYZ + FACES.format(1, "uchar")
        + "1" * 3_000_001,
        "3,000,001 numbers in lists",
    ),
    "lines.ply": (
        "ply\nformat ascii 1.0\nelement vertex 0\n" + XYZ + FACES.format(0, "int") + "\n" * 101,
        "lines; expected at most 100",
    ),
}  # fmt: skip


FILES = [("a.glb", glb(**changes), expected) for changes, expected in GLB.values()]
FILES += [(name, text.encode(), expected) for name, (text, expected) in TEXTS.items()]
BINARY = bytes(80) + struct.pack("<I", 250_001) + bytes(50 * 250_001)
FILES += [("a.stl", BINARY, "250,001 triangles; expected at most 250,000")]


@pytest.mark.parametrize(("name", "content", "expected"), FILES, ids=[*GLB, *TEXTS, "binary stl"])
def test_a_file_is_counted_before_it_is_built(tmp_path, name, content, expected):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(OptionError, match=f"{name}: it holds .*; expected .*") as caught:
        open_meshes(tmp_path / name, "mesh")
    assert expected in str(caught.value)


def urdf(path, links, visual="", further=""):
    text = "".join(f'<link name="l{i}">{visual if i == 1 else ""}</link>' for i in range(links))
    ends = '<parent link="l{0}"/><child link="l{1}"/>'
    moving = '<axis xyz="1 0 0"/><origin xyz="0 0 1"/><limit lower="0" upper="1"/>'
    fixed = '<origin xyz="0.001 0 0" rpy="0 0 0"/>'
    for i in range(1, links):
        kind, rest = ("prismatic", moving) if i == 1 else ("fixed", fixed)
        text += f'<joint name="j{i}" type="{kind}">{ends.format(i - 1, i)}{rest}</joint>'
    path.write_text(f'<robot name="r">{text}{further}</robot>')
    return path


URDF = {
    "links": ({"links": 2001}, "has 2,001 links; expected at most 2,000"),
    "shapes": ({"links": 2, "visual": "<visual/>" * 501}, "has 501 shapes"),
    "elements": (
        {"links": 2, "further": "<gazebo/>" * 50_001},
        "elements; expected at most 50,000",
    ),
}


@pytest.mark.parametrize(("values", "expected"), URDF.values(), ids=URDF)
def test_a_urdf_file_is_counted_before_it_is_read(tmp_path, values, expected):
    with pytest.raises(SceneError, match=expected):
        read_robot(urdf(tmp_path / "a.urdf", **values))


def test_a_chain_of_links_is_gone_through_once(tmp_path):
    robot, _ = read_robot(urdf(tmp_path / "a.urdf", 2000))
    began = time.process_time()
    found = place_robot(robot, "a.urdf")
    assert time.process_time() - began < 10.0  # 2,000,000 joints were gone through, 40 s
    frame, last = found.frame_of["l1999"]
    assert frame == "X"
    np.testing.assert_allclose(last[:3, 3], (1998.0, 0.0, 0.0), atol=1e-9)


def test_a_mesh_of_many_shapes_is_read_once_and_their_triangles_are_limited(tmp_path, monkeypatch):
    loads: list[Path] = []
    monkeypatch.setattr(
        "warpspace.bodies.mesh_files.open_meshes",
        lambda path, what: loads.append(path) or open_meshes(path, what),
    )
    (tmp_path / "one.obj").write_text(CORNERS + "f 1 2 8\n" * 40_000)
    (tmp_path / "bad.obj").write_text(CORNERS + "f" + " 1" * 260_000)
    shape = '<visual><geometry><mesh filename="{}.obj"/></geometry></visual>'
    robot, _ = read_robot(urdf(tmp_path / "a.urdf", 2, shape.format("bad") * 20))
    _, notes, _ = frame_meshes(robot, place_robot(robot, "a.urdf").frame_of, tmp_path)
    assert len(notes) == 20
    assert "259,998 triangles; expected at most 250,000" in notes[0]
    robot, _ = read_robot(urdf(tmp_path / "a.urdf", 2, shape.format("one") * 26))
    with pytest.raises(WarpspaceError, match="more than 1,000,000 triangles"):
        frame_meshes(robot, place_robot(robot, "a.urdf").frame_of, tmp_path)
    assert [path.name for path in loads] == ["bad.obj", "one.obj"]


def corners_of(mesh):
    """Spell triangles by their corners, wherever they begin and in whatever order they come."""
    rows = np.asarray(mesh.vertices)[np.asarray(mesh.faces)]
    return sorted(min(np.roll(row, k, axis=0).tolist() for k in range(3)) for row in rows)


@pytest.mark.parametrize("opened", [False, True])
def test_a_binary_stl_is_what_trimesh_makes_of_it(opened, tmp_path):
    mesh = trimesh.creation.icosphere(3, 70.0)
    mesh.update_faces(np.arange(len(mesh.faces)) >= 5 * opened)
    data = bytearray(mesh.export(file_type="stl"))
    rows = np.frombuffer(data, "<f4,<f4,<f4,(3,3)<f4,<u2", offset=84)["f3"]
    assert (rows == 0.0).any()
    rows[rows == 0.0] = np.resize(np.float32([0.0, -0.0]), (rows == 0.0).sum())
    (tmp_path / "ball.stl").write_bytes(data)
    found, said = read_mesh(tmp_path / "ball.stl", "mm")
    wanted = trimesh.load_mesh(io.BytesIO(data), file_type="stl", process=False)
    wanted.merge_vertices()
    assert len(found.vertices) == len(wanted.vertices) == 642
    assert corners_of(found) == corners_of(wanted)
    assert bool(said) == opened


def test_corners_that_share_a_key_are_left_to_trimesh(tmp_path, monkeypatch):
    monkeypatch.setattr("warpspace.bodies.mesh._MIXERS", (0, 0, 1))  # x and y do not count
    (tmp_path / "box.stl").write_bytes(trimesh.creation.box([30.0] * 3).export(file_type="stl"))
    found, _ = read_mesh(tmp_path / "box.stl", "mm")
    assert (len(found.vertices), found.volume) == (8, pytest.approx(27_000.0))


@pytest.mark.parametrize(
    ("stated", "said"), [(7, "7 triangles; 5 triangles follow"), (0, "no triangles")]
)
def test_a_binary_stl_of_other_length_than_it_says_is_refused(stated, said, tmp_path):
    rows = b"\0" * 50 * (5 if stated else 0)
    (tmp_path / "a.stl").write_bytes(b"\0" * 80 + stated.to_bytes(4, "little") + rows)
    with pytest.raises(OptionError, match=said):
        read_mesh(tmp_path / "a.stl", "mm")


def test_pictures_of_a_glb_file_are_not_opened(tmp_path, monkeypatch):
    # 400 kB of PNG may be 12 GB of pixels
    picture = base64.b64encode(b"no picture").decode()
    held = {
        "images": [{"uri": f"data:image/png;base64,{picture}"}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "meshes": [{"primitives": [{**primitive, "material": 0}]}],
    }
    (tmp_path / "a.glb").write_bytes(glb(**held))
    opened = list[Any]()
    monkeypatch.setattr(PIL.Image, "open", opened.append)
    assert len(load_mesh(tmp_path / "a.glb", "X", unit="mm").triangles) == 1
    assert opened == []


def test_a_mesh_that_is_a_pipe_or_a_device_is_refused_unread(tmp_path):
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "device.stl").symlink_to("/dev/zero")
    for name in ("pipe.stl", "device.stl"):
        with pytest.raises(OptionError, match=rf"{name}: is no regular file"):
            load_mesh(tmp_path / name, "X")


def test_shells_within_shells_are_examined_once_each():
    # of 72,000 cavities it took 160 s
    box = trimesh.creation.box([1.0] * 3)
    box.invert()
    place = 2.0 * np.stack(np.meshgrid(*[np.arange(27)] * 3), axis=-1).reshape(-1, 3)
    vertices = (box.vertices + place[:, None]).reshape(-1, 3)
    faces = (box.faces + 8 * np.arange(len(place))[:, None, None]).reshape(-1, 3)
    around = trimesh.creation.box(bounds=[[-9.0] * 3, [60.0] * 3])
    hollow = trimesh.Trimesh(vertices, faces, process=False) + around
    data = hollow.export(file_type="stl")
    began = time.process_time()
    _, warnings = read_mesh(Path("a.stl"), "mm", data=data)
    assert time.process_time() - began < 8.0
    assert warnings == ()


TEXT_STL = "solid x\n" + "".join(
    "facet normal 0 0 0\nouter loop\n"
    + "".join(f"vertex {x:.3f} {y:.3f} {z:.3f}\n" for x, y, z in triangle)
    + "endloop\nendfacet\n"
    for triangle in box(SIZE).triangles
)
BINARY_STL = box(SIZE).export(file_type="stl")
COUNTED = BINARY_STL[:80] + b"%b" + BINARY_STL[84:]
IMPERFECT = {
    "commas": (
        TEXT_STL.replace(".", ",") + "endsolid x\n",
        "line 4: decimal commas are read as decimal points",
    ),
    "no end": (TEXT_STL, "endsolid is missing at its end; all its facets are read"),
    "spare": (BINARY_STL + b"\r\n spare bytes", "14 bytes after its last triangle are ignored"),
    "count": (COUNTED % bytes(4), "its header states 0 triangles; all 12 stored are read"),
}


@pytest.mark.parametrize("name", IMPERFECT)
def test_an_imperfect_stl_is_read_with_a_message(name, tmp_path):
    content, note = IMPERFECT[name]
    path = tmp_path / "a.stl"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    body = load_mesh(path, "R")
    assert body.warnings == (f"{path}: {note}",)
    assert np.ptp(body.vertices_mm, axis=0) == pytest.approx(SIZE)
    assert len(body.triangles) == 12


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (TEXT_STL[:-20], "line 83: the file ends within a facet; expected endfacet"),
        (TEXT_STL.replace(".", ",", 1) + "endsolid x\n", "line 4: decimal commas and decimal"),
        (COUNTED % b"\7\0\0\0", "its header states 7 triangles; 12 triangles follow"),
        (BINARY_STL + bytes(60), "its header states 12 triangles; 13 triangles and 10 bytes"),
        (BINARY_STL[:-7], "its header states 12 triangles; 11 triangles and 43 bytes follow"),
    ],
)
def test_an_ambiguous_stl_is_refused(content, message, tmp_path):
    path = tmp_path / "a.stl"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(OptionError, match=message):
        load_mesh(path, "R")


def test_a_repaired_stl_of_a_robot_is_reported(tmp_path):
    (tmp_path / "link.stl").write_bytes(BINARY_STL + b"spare")
    shape = '<visual><geometry><mesh filename="link.stl"/></geometry></visual>'
    robot, _ = read_robot(urdf(tmp_path / "a.urdf", 2, shape * 2))
    meshes, notes, _ = frame_meshes(robot, place_robot(robot, "a.urdf").frame_of, tmp_path)
    assert notes == [f"{tmp_path / 'link.stl'}: 5 bytes after its last triangle are ignored"]
    assert sum(len(mesh.faces) for mesh in meshes.values()) == 12 * 2


def test_a_repaired_stl_of_a_machine_is_reported(tmp_path):
    (tmp_path / "bed.stl").write_bytes(BINARY_STL + b"spare")
    text = (
        '[machine]\nchain = "wFXYZt"\n[bodies]\nR = "bed.stl"\n'
        "[workspace]\nX = [0, 1]\nY = 0\nZ = 0\n"
    )
    (tmp_path / "m.toml").write_text(text)
    (remark,) = check_meshes(load_scene(tmp_path / "m.toml").machine)
    assert remark.endswith("bed.stl: 5 bytes after its last triangle are ignored")


def package_3mf(unit, mesh):
    """A 3MF package of one object, which is placed 5 units along x."""
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in mesh.vertices)
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in mesh.faces)
    model = (
        f'<model {unit} xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
        f'<resources><object id="1"><mesh><vertices>{vertices}</vertices>'
        f"<triangles>{triangles}</triangles></mesh></object></resources>"
        '<build><item objectid="1" transform="1 0 0 0 1 0 0 0 1 5 0 0"/></build></model>'
    )
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", model)
    return data.getvalue()


@pytest.mark.parametrize(
    ("unit", "mm"),
    [("", 1.0), ('unit="millimeter"', 1.0), ('unit="inch"', 25.4), ('unit="micron"', 1e-3)],
)
def test_a_3mf_file_has_its_own_unit(unit, mm):
    mesh, notes = read_mesh(Path("a.3mf"), None, data=package_3mf(unit, box()))
    assert notes == ()
    shift = np.array([5.0, 0.0, 0.0])
    np.testing.assert_allclose(mesh.bounds, [mm * shift, mm * (SIZE + shift)])
    with pytest.raises(OptionError, match="unit 'in'; expected none, the file states it"):
        read_mesh(Path("a.3mf"), "in", data=package_3mf(unit, box()))


def test_a_3mf_file_that_is_damaged_or_too_large_is_refused():
    data = package_3mf("", box())
    with pytest.raises(OptionError, match="no 3MF file that can be read"):
        read_mesh(Path("a.3mf"), None, data=data[:-30])
    with pytest.raises(OptionError, match="unit 'league'; expected one of micron"):
        read_mesh(Path("a.3mf"), None, data=package_3mf('unit="league"', box()))
    with pytest.raises(OptionError, match="12 triangle tags; expected at most 5"):
        read_mesh(Path("a.3mf"), None, 5, data=package_3mf("", box()))


def step_box(x, y, z, unit):
    """A box as STEP, AP214: corners, edges, planes and a shell, written by hand."""
    lines: list[str] = []

    def add(entity):
        lines.append(f"#{len(lines) + 1}={entity};")
        return f"#{len(lines)}"

    def vector(values):
        return "({:.1f},{:.1f},{:.1f})".format(*values)

    corners = np.array([(i, j, k) for i in (0, x) for j in (0, y) for k in (0, z)], float)
    points = [add(f"CARTESIAN_POINT('',{vector(corner)})") for corner in corners]
    ends = [add(f"VERTEX_POINT('',{point})") for point in points]
    edges: dict[tuple[int, int], str] = {}
    faces: list[str] = []
    for loop in (
        (0, 1, 3, 2),
        (4, 6, 7, 5),
        (0, 4, 5, 1),
        (2, 3, 7, 6),
        (0, 2, 6, 4),
        (1, 5, 7, 3),
    ):
        oriented: list[str] = []
        for i, j in zip(loop, np.roll(loop, -1).tolist(), strict=True):
            if (j, i) not in edges:
                step = corners[j] - corners[i]
                along = add(f"DIRECTION('',{vector(step / np.linalg.norm(step))})")
                length = add(f"VECTOR('',{along},1.0)")
                line = add(f"LINE('',{points[i]},{length})")
                edges[i, j] = add(f"EDGE_CURVE('',{ends[i]},{ends[j]},{line},.T.)")
            edge, sense = edges.get((i, j)) or edges[j, i], ".T." if (i, j) in edges else ".F."
            oriented.append(add(f"ORIENTED_EDGE('',*,*,{edge},{sense})"))
        bound = add(f"EDGE_LOOP('',({','.join(oriented)}))")
        bound = add(f"FACE_OUTER_BOUND('',{bound},.T.)")
        first, second = corners[loop[1]] - corners[loop[0]], corners[loop[2]] - corners[loop[1]]
        normal = np.cross(first, second)
        normal = add(f"DIRECTION('',{vector(normal / np.linalg.norm(normal))})")
        first = add(f"DIRECTION('',{vector(first / np.linalg.norm(first))})")
        axes = add(f"AXIS2_PLACEMENT_3D('',{points[loop[0]]},{normal},{first})")
        plane = add(f"PLANE('',{axes})")
        faces.append(add(f"ADVANCED_FACE('',({bound}),{plane},.T.)"))
    shell = add(f"CLOSED_SHELL('',({','.join(faces)}))")
    solid = add(f"MANIFOLD_SOLID_BREP('',{shell})")
    length = add(f"(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT({unit},.METRE.))")
    angle = add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
    context = add(
        "(GEOMETRIC_REPRESENTATION_CONTEXT(3)"
        f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle}))REPRESENTATION_CONTEXT('',''))"
    )
    origin = add("CARTESIAN_POINT('',(0.,0.,0.))")
    axes = add(f"AXIS2_PLACEMENT_3D('',{origin},$,$)")
    shape = add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('',({axes},{solid}),{context})")
    application = add("APPLICATION_CONTEXT('')")
    surroundings = add(f"PRODUCT_CONTEXT('',{application},'')")
    product = add(f"PRODUCT('box','box','',({surroundings}))")
    formation = add(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
    design = add(f"PRODUCT_DEFINITION_CONTEXT('',{application},'')")
    definition = add(f"PRODUCT_DEFINITION('','',{formation},{design})")
    definition = add(f"PRODUCT_DEFINITION_SHAPE('','',{definition})")
    add(f"SHAPE_DEFINITION_REPRESENTATION({definition},{shape})")
    header = "FILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n"
    header += "FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\n"
    body = "\n".join(lines)
    return (
        f"ISO-10303-21;\nHEADER;\n{header}ENDSEC;\nDATA;\n{body}\nENDSEC;\nEND-ISO-10303-21;\n"
    ).encode()


@pytest.mark.parametrize(("unit", "mm"), [(".MILLI.", 1.0), ("$", 1000.0), (".CENTI.", 10.0)])
@pytest.mark.parametrize("ending", ["step", "stp"])
def test_a_step_file_has_its_own_unit(unit, mm, ending):
    mesh, notes = read_mesh(Path(f"a.{ending}"), None, data=step_box(30, 20, 10, unit))
    assert (notes, len(mesh.faces)) == ((), 12)
    np.testing.assert_allclose(mesh.bounds, mm * np.array([(0, 0, 0), (30, 20, 10)]), rtol=1e-6)


def test_a_step_file_that_is_damaged_is_refused():
    data = step_box(30, 20, 10, ".MILLI.")
    with pytest.raises(OptionError, match=r"line \d+: the file is cut off; expected END-ISO"):
        read_mesh(Path("a.step"), None, data=data[:-100])
    with pytest.raises(OptionError, match="line 1: expected ISO-10303-21;"):
        read_mesh(Path("a.step"), None, data=b"solid x\n")


def test_a_missing_package_is_named_with_its_extra(monkeypatch):
    def load(*_args, **_keywords):
        raise ModuleNotFoundError(name="cascadio")

    monkeypatch.setattr(trimesh, "load_scene", load)
    with pytest.raises(OptionError, match=r"needs cascadio: pip install 'warpspace\[step\]'"):
        read_mesh(Path("a.step"), None, data=step_box(30, 20, 10, ".MILLI."))


def test_vertices_of_an_stl_are_in_the_order_of_the_file():
    """On every processor: a sort that is not stable would choose among equal corners."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    scene = _merge_stl(ball.export(file_type="stl"))
    (merged,) = scene.geometry.values()
    corner, place = np.unique(merged.faces, return_index=True)
    assert len(merged.vertices) == len(ball.vertices)
    assert (np.diff(place) > 0).all()
    assert (corner == np.arange(len(corner))).all()
