"""`[bodies]` of a scene: a user's meshes per frame, their place, and what is wrong with them."""

import numpy as np
import pytest
from trimesh import Trimesh, creation

from warpspace import SceneError, load_scene
from warpspace.bodies.own_meshes import check_meshes
from warpspace.bodies.placed import load_bodies
from warpspace.exceptions import OptionError
from warpspace.kinematics.model import Loop
from warpspace.picture.bodies import place_bodies, scene_motions
from warpspace.scene.library import parse_scene
from warpspace.scene.save import scene_to_toml

HEAD = 'title = "Mine"\nmachine = "c_frame_mill"\n'
INLINE = 'title = "Mine"\n[machine]\nchain = "wXYFZt"\n'


def box(path, size=(100.0, 60.0, 40.0)):
    creation.box(extents=size).export(path)


@pytest.fixture
def folder(tmp_path):
    home = tmp_path / "mine"
    (home / "parts").mkdir(parents=True)
    box(home / "column.stl")
    box(home / "parts" / "ram.ply", (0.1, 0.06, 0.04))
    return home


def scene_of(folder, bodies, head=HEAD):
    (folder / "mine.toml").write_text(f"{head}[bodies]\n{bodies}\n")
    return load_scene(folder / "mine.toml")


@pytest.mark.parametrize("head", [HEAD, INLINE])
@pytest.mark.parametrize("ending", [".stl", ".obj", ".ply"])
def test_a_mesh_takes_the_place_of_the_generated_bodies_of_its_frame(folder, head, ending):
    box(folder / f"own{ending}")
    scene = scene_of(folder, f'Z = "own{ending}"', head)
    bodies = {body.name: body for body in load_bodies(scene.machine)}
    assert [name for name in bodies if name.startswith("Z_")] == ["Z_own"]
    assert {"R_bed", "X_table", "t_tool"} <= set(bodies)
    assert np.ptp(bodies["Z_own"].vertices_mm, axis=0) == pytest.approx([100, 60, 40])


def test_a_mesh_has_its_unit_and_its_place_and_rides_on_its_axis(folder):
    scene = scene_of(
        folder,
        'Z = { file = "parts/ram.ply", unit = "m", offset_mm = [10, 20, 30],'
        " rotation_deg = [0, 0, 90] }",
    )
    body = next(body for body in load_bodies(scene.machine) if body.frame == "Z")
    assert np.ptp(body.vertices_mm, axis=0) == pytest.approx([60, 100, 40], abs=1e-4)
    assert body.vertices_mm.mean(axis=0) == pytest.approx([10, 20, 30], abs=1e-4)
    heights = []
    for z in (-500.0, 0.0):
        motions = scene_motions(scene, scene.view(), positions={"Z": z})
        placed = next(p for p in place_bodies(scene, motions, 0.0) if p.body.frame == "Z")
        heights.append(placed.vertices_mm[:, 2].mean())
    assert heights[1] - heights[0] == pytest.approx(500.0)


def test_a_mesh_bends_with_the_errors(folder):
    scene = scene_of(folder, 'Z = "column.stl"\n[errors]\nEXX = 20')
    motions = scene_motions(scene, scene.view(Loop.RELATIVE))
    part = next(p for p in place_bodies(scene, motions, 1000.0) if p.body.frame == "Z")
    shift = part.vertices_mm - part.nominal_mm
    np.testing.assert_allclose(shift, np.tile([-20.0, 0.0, 0.0], (len(shift), 1)), atol=1e-9)


def test_a_saved_scene_names_its_meshes_again(folder):
    for head in (HEAD, INLINE):
        scene = scene_of(
            folder, 'X = "column.stl"\nt = { shape = "probe" }\n'
            'Z = { file = "parts/ram.ply", unit = "m", offset_mm = [0, 0, 5] }', head,
        )  # fmt: skip
        text = scene_to_toml(scene)
        assert parse_scene(text, "mine", folder=folder) == scene
        assert ('machine = "c_frame_mill"' in text) == (head == HEAD)


def test_an_upload_keeps_the_names_says_so_and_draws_generated_bodies():
    scene = parse_scene(f'{HEAD}[bodies]\nX = "column.stl"\n', "mine")
    assert "column.stl cannot be read from here" in " ".join(scene.notes)
    assert "X_table" in {body.name for body in load_bodies(scene.machine)}
    assert 'X = "column.stl"' in scene_to_toml(scene)
    assert parse_scene(scene_to_toml(scene), "mine") == scene


@pytest.mark.parametrize(
    ("bodies", "expected"),
    [
        ('X = "none.stl"', 'bodies.X = "none.stl": there is no such file beside this one'),
        ('X = "../out.stl"', 'bodies.X = "../out.stl": leads out of the folder'),
        ('X = "/etc/out.stl"', "leads out of the folder"),
        ('X = "parts/../../out.stl"', "leads out of the folder"),
        (
            'X = "column.step"',
            "unknown ending; expected a mesh that ends in .stl, .obj, .ply, .glb",
        ),
        ('Y2 = "column.stl"', "bodies.Y2: unknown frame of this machine"),
        ("X = 3", "bodies.X = 3: expected a table"),
        ('X = { file = "column.stl", unit = "ft" }', 'expected one of "mm", "cm", "m", "in"'),
        ('X = { file = "column.stl", offset_mm = [0, 0] }', "expected [x, y, z]"),
        ('X = { file = "column.stl", size = 3 }', "bodies.X.size: unknown key"),
        ('X = { shape = "probe" }', "only the tool t has one"),
        ('t = { shape = "saw" }', 'expected one of "cutter"'),
        ("X = { }", "expected a file, or the shape of a tool"),
        ('t = { file = "column.stl", shape = "probe" }', "expected a file, or the shape"),
    ],
)
def test_a_wrong_entry_gives_one_message(folder, bodies, expected):
    (folder.parent / "out.stl").write_bytes((folder / "column.stl").read_bytes())
    with pytest.raises(SceneError) as caught:
        scene_of(folder, bodies)
    assert len(caught.value.problems) == 1
    assert expected in caught.value.problems[0]


def test_a_link_out_of_the_folder_is_refused(folder):
    box(folder.parent / "out.stl")
    (folder / "link.stl").symlink_to(folder.parent / "out.stl")
    with pytest.raises(SceneError, match="leads out of the folder"):
        scene_of(folder, 'X = "link.stl"')


def empty(path):
    path.write_bytes(b"")


def metres(path):
    box(path, (0.5, 0.3, 0.2))


def huge(path):
    with path.open("wb") as file:
        file.truncate(200_000_000)


@pytest.mark.parametrize(
    ("write", "expected"),
    [
        (empty, "the file is empty"),
        (metres, "It is probably in m; give its unit"),
        (huge, "200 MB; a STL file may have up to 50 MB"),
    ],
)
def test_a_mesh_that_cannot_be_drawn_gives_one_message(folder, write, expected):
    write(folder / "bad.stl")
    scene = scene_of(folder, 'X = "bad.stl"')
    for ask in (check_meshes, load_bodies):
        with pytest.raises(OptionError, match=expected) as caught:
            ask(scene.machine)
        assert str(caught.value).startswith("bodies.X: ")


def test_an_open_mesh_is_drawn_and_remarked_on(folder):
    whole = creation.box(extents=(100.0, 60.0, 40.0))
    Trimesh(whole.vertices, whole.faces[:-1]).export(folder / "open.stl")
    scene = scene_of(folder, 'X = "open.stl"')
    (warning,) = check_meshes(scene.machine)
    assert "bodies.X: " in warning
    assert "not closed" in warning
    assert "X_open" in {body.name for body in load_bodies(scene.machine)}
