"""`[bodies]` of a scene: a user's meshes per frame, their place, and what is wrong with them."""

import numpy as np
import pytest
from trimesh import creation

from warpspace import SceneError, load_scene
from warpspace.bodies.placed import load_bodies, place_bodies
from warpspace.kinematics.model import Loop
from warpspace.scene.library import parse_scene
from warpspace.scene.scene_writer import scene_to_toml

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
        (placed,) = place_bodies(scene, scene.view(), 0.0, ["Z"], positions={"Z": z})
        heights.append(placed.vertices_mm[:, 2].mean())
    assert heights[1] - heights[0] == pytest.approx(500.0)


def test_a_mesh_bends_with_the_errors(folder):
    scene = scene_of(folder, 'Z = "column.stl"\n[errors]\nEXX = 20')
    (part,) = place_bodies(scene, scene.view(Loop.RELATIVE), 1000.0, ["Z"])
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


def test_a_link_out_of_the_folder_is_refused(folder):
    box(folder.parent / "out.stl")
    (folder / "link.stl").symlink_to(folder.parent / "out.stl")
    with pytest.raises(SceneError, match="leads out of the folder"):
        scene_of(folder, 'X = "link.stl"')
