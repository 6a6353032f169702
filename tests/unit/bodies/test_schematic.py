import numpy as np
import pytest

from warpspace.bodies.body_file import read_bodies, write_bodies
from warpspace.bodies.mesh import DARK, METAL
from warpspace.bodies.schematic import box, cone, cylinder, join_shapes
from warpspace.exceptions import OptionError
from warpspace.resources import assets_dir

HERE = np.array([10.0, 20.0, 30.0])


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize("inner", [0.0, 30.0])
def test_cylinder_lies_along_its_axis_between_its_ends(axis, inner):
    mesh = cylinder(50.0, (100.0, 180.0), (7.0, -9.0), axis, inner)
    along = "xyz".index(axis)
    low, high = mesh.bounds
    assert (low[along], high[along]) == (pytest.approx(100.0), pytest.approx(180.0))
    across = [i for i in range(3) if i != along]
    assert (low + high)[across] / 2.0 == pytest.approx([7.0, -9.0])
    assert (high - low)[across] == pytest.approx([100.0, 100.0])
    full = np.pi * (50.0**2 - inner**2) * 80.0
    assert mesh.volume == pytest.approx(full, rel=5e-3)


def test_cone_has_its_two_radii():
    mesh = cone(40.0, 60.0, (10.0, 50.0))
    radius = np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1])
    for z, r in ((10.0, 40.0), (50.0, 60.0)):
        assert radius[np.isclose(mesh.vertices[:, 2], z)].max() == pytest.approx(r)
    assert mesh.volume > 0.0


def test_shapes_are_joined_in_the_frame_of_the_body():
    shapes = [box((10, 20), (20, 30), (30, 40)), cylinder(5.0, (40.0, 60.0), (15.0, 25.0))]
    body = join_shapes("X_saddle", DARK, shapes, HERE)
    assert (body.name, body.frame, body.colour) == ("X_saddle", "X", DARK)
    assert body.vertices_mm.min(axis=0) == pytest.approx([0.0, 0.0, 0.0])
    assert len(body.edges_mm) == 12 + 2 * 40


def test_open_shape_and_shape_turned_inside_out_are_refused():
    inside = box((0, 1), (0, 1), (0, 1))
    inside.invert()
    opened = box((0, 1), (0, 1), (0, 1))
    opened.update_faces(np.arange(12) > 0)
    for shape in (inside, opened):
        with pytest.raises(ValueError, match="X_saddle: a shape of volume"):
            join_shapes("X_saddle", DARK, [shape], HERE)


def test_written_bodies_are_read_back_with_their_edges_lines_and_colours(tmp_path):
    bodies = [
        join_shapes("X_saddle", DARK, [box((0, 1000), (0, 20), (0, 30))], HERE),
        join_shapes("C_table", METAL, [cylinder(50.0, (0.0, 20.0), inner=10.0)], HERE),
    ]
    line = np.array([[[0.0, 0.0, 20.5], [50.0, 0.0, 20.5]], [[0.0, 0.0, 20.5], [0.0, 50.0, 20.5]]])
    write_bodies(tmp_path / "bodies.glb", bodies, {"C_table": line})
    found = read_bodies(tmp_path / "bodies.glb")
    assert [body.name for body in found] == ["X_saddle", "C_table"]
    for read, body in zip(found, bodies, strict=True):
        assert (read.frame, read.colour) == (body.frame, body.colour)
        np.testing.assert_allclose(read.vertices_mm, body.vertices_mm, atol=1e-4)
        np.testing.assert_array_equal(read.triangles, body.triangles)
        edges = body.edges_mm
        if body.name == "C_table":
            edges = np.concatenate([edges, line])
        np.testing.assert_allclose(read.edges_mm, edges, atol=1e-4)


def test_broken_file_is_named(tmp_path):
    (tmp_path / "bodies.glb").write_bytes(b"glTF and nothing else")
    with pytest.raises(OptionError, match=r"bodies\.glb: no file of machine bodies"):
        read_bodies(tmp_path / "bodies.glb")
    assert read_bodies(tmp_path / "none.glb") == ()


def test_every_machine_stores_its_bodies_once():
    for folder in (assets_dir() / "machines").iterdir():
        stored = {path.suffix for path in folder.iterdir()} - {".toml", ".py", ".png", ""}
        assert stored <= {".glb"}, folder.name
