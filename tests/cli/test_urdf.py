"""URDF in and out on the command line: what comes back, what is said, what is never replaced."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from warpspace import load_scene

ROBOT = """<robot name="mill"><link name="base"><visual><geometry><box size="1 1 0.1"/></geometry>
</visual></link><link name="tool"><visual><geometry><mesh filename="package://mill/{mesh}"
scale="0.001 0.001 0.001"/></geometry></visual></link><joint name="slide" type="prismatic">
<parent link="base"/><child link="tool"/><axis xyz="0 0 1"/><origin xyz="0 0 0.5"/>
<limit lower="-0.2" upper="0.1" effort="1" velocity="1"/></joint></robot>"""


def test_a_machine_goes_out_and_comes_back(warpspace, tmp_path: Path) -> None:
    robot, back = tmp_path / "dvf.urdf", tmp_path / "back.toml"
    result = warpspace("export", "dvf5000_first", "-o", robot, "--grid", "3")
    assert result.status == 0, result.err
    assert "have no place in a URDF file" in " ".join(result.out.split())
    result = warpspace("import-machine", robot, "-o", back)
    assert result.status == 0, result.err
    assert "wCBFXYZt, 5 axes" in result.out
    own, found = load_scene("dvf5000_first").machine, load_scene(back).machine
    for name, axis in own.axes.items():
        assert found.axes[name].offset_mm == pytest.approx(axis.offset_mm, abs=1e-9)
        assert found.axes[name].travel == pytest.approx(axis.travel, abs=1e-9)
    saddle = trimesh.load(tmp_path / "back_X.stl", force="mesh")
    written = trimesh.load(tmp_path / "dvf_X.stl", force="mesh")
    assert saddle.bounds == pytest.approx(written.bounds, abs=1e-3)
    before = back.read_bytes()
    warpspace("import-machine", robot, "-o", back).refused("--force")
    assert back.read_bytes() == before


def test_meshes_come_in_millimetres_and_missing_ones_are_named(warpspace, tmp_path: Path) -> None:
    trimesh.creation.box(extents=(20.0, 30.0, 40.0)).export(tmp_path / "tool.stl")
    robot = tmp_path / "mill.urdf"
    robot.write_text(ROBOT.format(mesh="tool.stl"), encoding="utf-8")
    result = warpspace("import-machine", robot, "-o", tmp_path / "mill.toml")
    assert result.status == 0, result.err
    assert "joint 'slide' is axis Z" in result.out
    mesh = trimesh.load(tmp_path / "mill_Z.stl", force="mesh")
    assert mesh.extents == pytest.approx([20.0, 30.0, 40.0], abs=1e-3)
    base = trimesh.load(tmp_path / "mill_R.stl", force="mesh")
    assert base.extents == pytest.approx([1000.0, 1000.0, 100.0], abs=1e-2)
    scene = load_scene(tmp_path / "mill.toml")
    assert scene.machine.axes["Z"].travel == (-200.0, 100.0)
    assert np.any([scene.errors.amplitude(key) for key in scene.errors])
    robot.write_text(ROBOT.format(mesh="gone.stl"), encoding="utf-8")
    result = warpspace("import-machine", robot, "-o", tmp_path / "other.toml")
    assert "mesh 'package://mill/gone.stl' is missing" in " ".join(result.out.split())
    assert "gone.stl" in (tmp_path / "other.toml").read_text(encoding="utf-8")


def test_a_mesh_that_is_read_is_never_replaced(warpspace, tmp_path: Path) -> None:
    trimesh.creation.box(extents=(20.0, 30.0, 40.0)).export(tmp_path / "mill_Z.stl")
    before = (tmp_path / "mill_Z.stl").read_bytes()
    robot = tmp_path / "mill.urdf"
    robot.write_text(ROBOT.format(mesh="mill_Z.stl"), encoding="utf-8")
    warpspace("import-machine", robot, "-o", tmp_path / "mill.toml", "--force").refused("is read")
    assert (tmp_path / "mill_Z.stl").read_bytes() == before
    assert not (tmp_path / "mill.toml").exists()


def test_an_export_never_replaces_a_mesh_of_its_scene(warpspace, tmp_path: Path) -> None:
    mesh = tmp_path / "mill_Z.stl"
    trimesh.creation.box(extents=(20.0, 30.0, 40.0)).export(mesh)
    before, scene = mesh.read_bytes(), tmp_path / "own.toml"
    assert warpspace("new-machine", "wFXZt", "-o", scene).status == 0
    scene.write_text(f'{scene.read_text(encoding="utf-8")}\n[bodies]\nZ = "mill_Z.stl"\n', "utf-8")
    robot = tmp_path / "mill.urdf"
    warpspace("export", scene, "-o", robot, "--grid", "3", "--force").refused("is read")
    assert mesh.read_bytes() == before
    assert {file.name for file in tmp_path.iterdir()} == {"own.toml", "mill_Z.stl"}
    assert warpspace("export", scene, "-o", tmp_path / "other.urdf", "--grid", "3").status == 0


@pytest.mark.parametrize(
    ("content", "said"),
    [(None, "no such file"), (b"\xff\xfe", "UTF-8"), (b"", "XML"), (b"<a/>", "expected <robot>")],
)
def test_bad_files_are_refused(warpspace, tmp_path: Path, content, said) -> None:
    robot = tmp_path / "bad.urdf"
    if content is not None:
        robot.write_bytes(content)
    warpspace("import-machine", robot, "-o", tmp_path / "new.toml").refused(said)
    assert not (tmp_path / "new.toml").exists()
