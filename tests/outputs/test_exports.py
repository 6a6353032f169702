"""Exports read back by other libraries: trimesh, PyVista, pandas."""

import base64
import json
import os
import resource
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import pyvista as pv
import trimesh

from warpspace import SceneError, evaluate, load_scene
from warpspace.bodies.placed import load_bodies
from warpspace.exceptions import OptionError, OutputError
from warpspace.geometry.deform import deform
from warpspace.geometry.surfaces import outer_surface
from warpspace.outputs.exports import (
    load_stored_field,
    write_csv,
    write_glb,
    write_vts,
)
from warpspace.outputs.exports.glb import build_glb
from warpspace.outputs.files import check_target
from warpspace.picture.bodies import place_bodies, scene_motions
from warpspace.picture.scene_picture import evaluate_picture
from warpspace.picture.traces import trace_lines

SCENES = ("dvf5000_first", "teach_wobbling_table", "dvf5000_nominal")


def warpspace(*arguments: str, limit_bytes: int | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command as a user does, with the size of files limited where asked."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes))

    return subprocess.run(
        [sys.executable, "-m", "warpspace", *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        preexec_fn=limit if limit_bytes is not None else None,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )


def close(read, expected) -> None:
    """Equal to 1e-6 of the largest magnitude there is."""
    expected = np.asarray(expected, dtype=float)
    np.testing.assert_allclose(read, expected, rtol=0, atol=1e-6 * max(np.abs(expected).max(), 1.0))


def gltf_document(data: bytes) -> dict:
    """The JSON chunk of a GLB."""
    magic, version, total = struct.unpack_from("<III", data)
    assert (magic, version, total) == (0x46546C67, 2, len(data))
    length, _ = struct.unpack_from("<II", data, 12)
    return json.loads(data[20 : 20 + length])


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("loop", ["tool", "relative"])
def test_glb_holds_geometry_and_errors(name, loop, tmp_path) -> None:
    drawing = evaluate_picture(load_scene(name), grid=7, loop=loop)
    write_glb(drawing, tmp_path / "a.glb")
    scene = trimesh.load_scene(tmp_path / "a.glb", process=False)
    mesh = scene.geometry["deformed_surface"]
    at = outer_surface(drawing.grid.shape).nodes
    field = drawing.field
    x, y, z = (drawing.drawn_mm.reshape(-1, 3)[at] / 1000.0).T
    close(mesh.vertices, np.stack([x, z, -y], -1))
    close(mesh.vertex_attributes["_ERROR_UM"], field.error_um.reshape(-1, 3)[at])
    close(mesh.vertex_attributes["_ORIENTATION_URAD"], field.orientation_urad.reshape(-1, 3)[at])
    ghost = scene.geometry["ghost"].vertices
    extent = drawing.grid.extent_mm / 1000.0
    close(np.ptp(ghost, axis=0), extent[[0, 2, 1]])


def test_glb_surface_faces_outwards_and_names_its_nodes() -> None:
    drawing = evaluate_picture(load_scene("dvf5000_first"), grid=5)
    scene = trimesh.load_scene(
        trimesh.util.wrap_as_stream(build_glb(drawing)), file_type="glb", process=False
    )
    assert scene.geometry["deformed_surface"].volume > 0.05
    names = {node["name"] for node in gltf_document(build_glb(drawing))["nodes"]}
    assert {"deformed_surface", "deformed_grid", "deformed_edges", "ghost", "traces"} <= names
    assert f"warpspace dvf5000_first ×{drawing.exaggeration:g}" in names
    traces = trace_lines(drawing.traces)
    assert sum(name.startswith("trace actual") for name in names) == len(traces)
    assert {body.name for body in load_bodies(drawing.scene.machine)} <= names


def test_glb_tool_stands_in_the_deformed_grid() -> None:
    """The tool body is bent by the same factor as the grid it works in."""
    drawing = evaluate_picture(load_scene("dvf5000_first"), grid=3)
    motions = scene_motions(drawing.scene, drawing.view)
    (tool,) = place_bodies(drawing.scene, motions, 1e3, only=["t"])
    moved = (tool.vertices_mm - tool.nominal_mm)[np.argmin(tool.nominal_mm[:, 2])]
    middle = drawing.field.error_um[1, 1, 1]
    close(moved, middle)


def test_glb_colours_are_linear_and_unlit() -> None:
    """A viewer that applies the sRGB curve to COLOR_0 shows the colours of the scale."""
    drawing = evaluate_picture(load_scene("dvf5000_first"), grid=5)
    document = gltf_document(build_glb(drawing))
    assert all("KHR_materials_unlit" in m["extensions"] for m in document["materials"])
    assert document["extensionsUsed"] == ["KHR_materials_unlit"]
    data = build_glb(drawing)
    accessor = document["accessors"][
        document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]
    ]
    view = document["bufferViews"][accessor["bufferView"]]
    start = 28 + struct.unpack_from("<I", data, 12)[0] + view["byteOffset"]
    linear = np.frombuffer(data, "<f4", accessor["count"] * 3, start).reshape(-1, 3)
    shown = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    at = outer_surface(drawing.grid.shape).nodes
    wanted = drawing.scale.colours(drawing.values.reshape(-1)[at])
    np.testing.assert_allclose(shown * 255.0, wanted, atol=0.01)


def test_glb_morph_target_leads_back_to_the_nominal_place() -> None:
    drawing = evaluate_picture(load_scene("dvf5000_first"), grid=3)
    data = build_glb(drawing)
    document = gltf_document(data)
    primitive = document["meshes"][0]["primitives"][0]
    start = 28 + struct.unpack_from("<I", data, 12)[0]

    def read(index: int) -> np.ndarray:
        accessor = document["accessors"][index]
        offset = start + document["bufferViews"][accessor["bufferView"]]["byteOffset"]
        return np.frombuffer(data, "<f4", accessor["count"] * 3, offset).reshape(-1, 3)

    back = read(primitive["attributes"]["POSITION"]) + read(primitive["targets"][0]["POSITION"])
    at = outer_surface(drawing.grid.shape).nodes
    x, y, z = (drawing.grid.nominal_mm.reshape(-1, 3)[at] / 1000.0).T
    close(back, np.stack([x, z, -y], -1))


def test_glb_carries_scene_settings_and_version() -> None:
    drawing = evaluate_picture(load_scene("dvf5000_first"), exaggeration=500, grid=3, component="x")
    asset = gltf_document(build_glb(drawing))["asset"]
    assert asset["generator"].startswith("warpspace ")
    assert asset["extras"]["settings"]["exaggeration"] == 500
    assert asset["extras"]["settings"]["component"] == "x"
    assert asset["extras"]["scene"] == "dvf5000_first"
    assert asset["extras"]["parameters"]["EC0Y"] == {"amplitude": 23.1, "unit": "µrad"}


@pytest.mark.parametrize("name", SCENES)
def test_vts_read_by_vtk(name, tmp_path) -> None:
    drawing = evaluate_picture(load_scene(name), grid=5, exaggeration=200)
    write_vts(drawing, tmp_path / "a.vts")
    mesh = pv.read(tmp_path / "a.vts")
    field, shape = drawing.field, drawing.grid.shape
    assert mesh.dimensions == shape

    def node(array: np.ndarray) -> np.ndarray:
        return np.asarray(array).reshape(*reversed(shape), 3).swapaxes(0, 2)

    close(node(mesh.points), field.nominal_mm)
    close(node(mesh["error_um"]), field.error_um)
    close(node(mesh["orientation_urad"]), field.orientation_urad)
    close(node(mesh["deformed_mm"]), deform(field.nominal_mm, field.error_um, 200))
    close(mesh.warp_by_vector("displacement_mm").points, mesh["deformed_mm"])
    assert mesh.field_data["exaggeration"] == [200]


def test_vts_is_shown_again_as_the_identical_scene(tmp_path) -> None:
    scene = load_scene("dvf5000_second")
    drawing = evaluate_picture(scene, grid=4, loop="relative", component="z", exaggeration=300)
    write_vts(drawing, tmp_path / "a.vts")
    stored = load_stored_field(tmp_path / "a.vts")
    assert stored.scene == scene
    assert stored.picture.settings == drawing.settings
    np.testing.assert_array_equal(stored.field.error_um, drawing.field.error_um)


def test_vts_saved_again_by_another_program_is_still_read(tmp_path) -> None:
    write_vts(evaluate_picture(load_scene("dvf5000_first"), grid=3), tmp_path / "a.vts")
    pv.read(tmp_path / "a.vts").save(tmp_path / "b.vts")
    assert load_stored_field(tmp_path / "b.vts").scene == load_scene("dvf5000_first")


def test_vts_with_other_errors_than_its_scene_gives_is_refused(tmp_path) -> None:
    write_vts(evaluate_picture(load_scene("dvf5000_first"), grid=3), tmp_path / "a.vts")
    mesh = pv.read(tmp_path / "a.vts")
    mesh["error_um"] = mesh["error_um"] * 1.001
    mesh.save(tmp_path / "b.vts")
    with pytest.raises(SceneError, match="differ by up to"):
        load_stored_field(tmp_path / "b.vts")


def test_damaged_vts_gives_one_message(tmp_path, capfd) -> None:
    write_vts(evaluate_picture(load_scene("dvf5000_first"), grid=5), tmp_path / "a.vts")
    good = (tmp_path / "a.vts").read_bytes()
    bad = {
        "half": good[: len(good) // 2],
        "empty": b"",
        "text": b"hello",
        "garbled": good.replace(b"AAAA", b"!!!!"),
        "other": pv.ImageData(dimensions=(2, 2, 2)).cast_to_structured_grid(),
    }
    for name, content in bad.items():
        path = tmp_path / f"{name}.vts"
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            content.save(path)
        with pytest.raises(SceneError, match=f"{name}.vts"):
            load_stored_field(path)
    with pytest.raises(SceneError, match="no such file"):
        load_stored_field(tmp_path / "missing.vts")
    assert capfd.readouterr().err == ""


def test_array_of_no_blocks_that_has_a_last_one_is_refused(tmp_path) -> None:
    """VTK ends the whole program on it."""
    path = tmp_path / "a.vts"
    write_vts(evaluate_picture(load_scene("dvf5000_first"), grid=3), path)
    good = path.read_bytes()
    begin = base64.b64encode(struct.pack("<4I", 1, 32768, 8, 14))[:20]
    bad = base64.b64encode(struct.pack("<4I", 0, 32768, 8, 14))[:20]
    assert begin in good
    path.write_bytes(good.replace(begin, bad, 1))
    with pytest.raises(SceneError, match=r"a\.vts: is no VTK structured grid"):
        load_stored_field(path)


@pytest.mark.parametrize("name", SCENES)
def test_csv_read_by_pandas(name, tmp_path) -> None:
    scene = load_scene(name)
    write_csv(evaluate_picture(scene, grid=5), tmp_path / "a.csv")
    table = pd.read_csv(tmp_path / "a.csv")
    field = evaluate(scene, grid=5)
    close(table[["R_x_mm", "R_y_mm", "R_z_mm"]], field.nominal_mm.reshape(-1, 3))
    errors = ["error_x_um", "error_y_um", "error_z_um"]
    np.testing.assert_allclose(table[errors], field.error_um.reshape(-1, 3), rtol=1e-6, atol=1e-9)
    close(table["norm_um"], field.norm_um.reshape(-1))
    tilts = ["orientation_x_urad", "orientation_y_urad", "orientation_z_urad"]
    close(table[tilts], field.orientation_urad.reshape(-1, 3))
    again = evaluate(scene, at={axis: table[f"axis_{axis}_mm"].to_numpy() for axis in "XYZ"})
    close(table[errors], again.error_um)
    assert set(table["scene"]) == {name}
    assert table["program"].str.startswith("warpspace ").all()


def test_files_are_the_same_when_written_again(tmp_path) -> None:
    for write, ending in ((write_glb, "glb"), (write_vts, "vts"), (write_csv, "csv")):
        for name in ("a", "b"):
            write(
                evaluate_picture(load_scene("dvf5000_first"), grid=5), tmp_path / f"{name}.{ending}"
            )
        first, second = ((tmp_path / f"{name}.{ending}").read_bytes() for name in ("a", "b"))
        assert first == second


def test_a_flat_volume_is_exported(tmp_path) -> None:
    path = tmp_path / "flat.toml"
    path.write_text(
        'title = "flat"\n[machine]\nchain = "wFXYt"\n[workspace]\nX = [0, 100]\nY = [0, 50]\n'
        "[errors]\nEC0Y = 10.0\n"
    )
    drawing = evaluate_picture(load_scene(path), grid=4)
    for write, ending in ((write_glb, "glb"), (write_vts, "vts"), (write_csv, "csv")):
        write(drawing, tmp_path / f"a.{ending}")
    assert pv.read(tmp_path / "a.vts").dimensions == (4, 4, 1)
    assert load_stored_field(tmp_path / "a.vts").scene.title == "flat"


@pytest.mark.parametrize("exaggeration", [0.0, -1.0, np.nan, np.inf, 1e9])
def test_impossible_exaggeration(exaggeration) -> None:
    with pytest.raises(OptionError, match="exaggeration"):
        evaluate_picture(load_scene("dvf5000_first"), exaggeration=exaggeration, grid=3)


def test_targets_that_must_not_be_written(tmp_path) -> None:
    (tmp_path / "there.glb").write_text("mine")
    (tmp_path / "folder.glb").mkdir()
    for name, words in {
        "there.glb": "exists already",
        "folder.glb": "is a folder",
        "no/such.glb": "does not exist",
        "a.gltf": "unknown ending",
        "a": "no ending",
        "nul\0.glb": "cannot be written",
        "x" * 300 + ".glb": "cannot be written|too long",
    }.items():
        with pytest.raises(OutputError, match=words):
            check_target(tmp_path / name, (".glb",), overwrite=False)
    with pytest.raises(OutputError, match="no regular file"):
        check_target("/dev/null")
    assert (tmp_path / "there.glb").read_text() == "mine"


@pytest.mark.parametrize("ending", ["glb", "vts", "csv", "html"])
def test_command_writes_and_refuses_to_overwrite(ending, tmp_path) -> None:
    target = tmp_path / f"a.{ending}"
    assert warpspace("export", "dvf5000_first", "-o", str(target), "--grid", "5").returncode == 0
    before = target.read_bytes()
    again = warpspace("export", "dvf5000_second", "-o", str(target), "--grid", "5")
    assert again.returncode == 2
    assert "exists already" in again.stderr
    assert "Traceback" not in again.stderr
    assert target.read_bytes() == before
    forced = warpspace("export", "dvf5000_second", "-o", str(target), "--grid", "5", "--force")
    assert forced.returncode == 0
    assert target.read_bytes() != before


@pytest.mark.parametrize("ending", ["glb", "vts", "csv", "html"])
def test_full_disk_gives_one_message_and_no_partial_file(ending, tmp_path) -> None:
    target = tmp_path / f"a.{ending}"
    run = warpspace("export", "dvf5000_first", "-o", str(target), "--grid", "9", limit_bytes=20_000)
    assert run.returncode == 2
    assert len(run.stderr.strip().splitlines()) == 1
    assert "cannot be written" in run.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arguments",
    [
        ("-o", "a.stl"),
        ("-o", "a.glb", "--exaggeration", "big"),
        ("-o", "a.glb", "--exaggeration", "-3"),
        ("-o", "a.glb", "--exaggeration", "nan"),
        ("-o", "a.glb", "--grid", "1"),
        ("-o", "a.glb", "--grid", "1000"),
        ("-o", "a.glb", "--loop", "spindle"),
        ("-o", "no/such/folder/a.glb"),
        (),
    ],
)
def test_bad_options_give_one_message(arguments, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    run = warpspace("export", "dvf5000_first", *arguments)
    assert run.returncode == 2
    assert "Traceback" not in run.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_command_takes_any_scene_path(tmp_path) -> None:
    scene = Path(tmp_path / "mine.toml")
    scene.write_text('machine = "dvf5000"\ntitle = "mine"\n[errors]\nEXX = 3.0\n')
    run = warpspace("export", str(scene), "-o", str(tmp_path / "a.csv"), "--grid", "2")
    assert run.returncode == 0
    assert "mine" in run.stdout
