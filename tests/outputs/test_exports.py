"""Exports read back by other libraries: trimesh and PyVista."""

import numpy as np
import pytest
import pyvista as pv
import trimesh

from glb import opened, values
from products import pairwise
from warpspace import load_scene
from warpspace.bodies.placed import load_bodies
from warpspace.geometry.surfaces import deform, outer_surface
from warpspace.outputs.exports.fields import build_vts, write_vts
from warpspace.outputs.exports.meshes import build_glb, write_glb
from warpspace.picture.model import evaluate_picture
from warpspace.picture.traces import trace_lines

SCENES = ("dvf5000_first", "teach_wobbling_table", "dvf5000_nominal")


def close(read, expected):
    """Equal to 1e-6 of the largest magnitude there is."""
    expected = np.asarray(expected, dtype=float)
    np.testing.assert_allclose(read, expected, rtol=0, atol=1e-6 * max(np.abs(expected).max(), 1.0))


@pytest.mark.parametrize(("name", "loop"), pairwise(SCENES, ["tool", "relative"]))
def test_glb_holds_geometry_and_errors(name, loop, tmp_path):
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


def test_glb_nodes_are_named_and_its_morph_target_leads_back():
    """A viewer that applies the sRGB curve to COLOR_0 shows the colours of the scale."""
    drawing = evaluate_picture(load_scene("dvf5000_first"), grid=5, exaggeration=500, component="x")
    data = build_glb(drawing)
    stream = trimesh.util.wrap_as_stream(data)
    scene = trimesh.load_scene(stream, file_type="glb", process=False)
    assert scene.geometry["deformed_surface"].volume > 0.05  # its faces turn outwards
    document, _ = opened(data)
    names = {node["name"] for node in document["nodes"]}
    assert {"deformed_surface", "deformed_grid", "deformed_edges", "ghost", "traces"} <= names
    assert "warpspace dvf5000_first ×500" in names
    traces = trace_lines(drawing.traces)
    assert sum(name.startswith("trace actual") for name in names) == len(traces)
    assert {body.name for body in load_bodies(drawing.scene.machine)} <= names
    extras = document["asset"]["extras"]
    assert document["asset"]["generator"].startswith("warpspace ")
    assert (extras["settings"]["exaggeration"], extras["settings"]["component"]) == (500, "x")
    assert extras["scene"] == "dvf5000_first"
    assert extras["parameters"]["EC0Y"] == {"amplitude": 23.1, "unit": "µrad"}
    assert all("KHR_materials_unlit" in m["extensions"] for m in document["materials"])
    assert document["extensionsUsed"] == ["KHR_materials_unlit"]
    primitive = document["meshes"][0]["primitives"][0]
    linear = values(data, primitive["attributes"]["COLOR_0"])
    shown = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    at = outer_surface(drawing.grid.shape).nodes
    wanted = drawing.scale.colours(drawing.values.reshape(-1)[at])
    np.testing.assert_allclose(shown * 255.0, wanted, atol=0.01)
    moved, target = primitive["attributes"]["POSITION"], primitive["targets"][0]["POSITION"]
    x, y, z = (drawing.grid.nominal_mm.reshape(-1, 3)[at] / 1000.0).T
    close(values(data, moved) + values(data, target), np.stack([x, z, -y], -1))
    assert build_glb(drawing) == data


@pytest.mark.parametrize("name", SCENES)
def test_vts_read_by_vtk(name, tmp_path):
    drawing = evaluate_picture(load_scene(name), grid=5, exaggeration=200)
    write_vts(drawing, tmp_path / "a.vts")
    mesh = pv.read(tmp_path / "a.vts")
    field, shape = drawing.field, drawing.grid.shape
    assert mesh.dimensions == shape

    def node(array):
        return np.asarray(array).reshape(*reversed(shape), 3).swapaxes(0, 2)

    close(node(mesh.points), field.nominal_mm)
    close(node(mesh["error_um"]), field.error_um)
    close(node(mesh["orientation_urad"]), field.orientation_urad)
    close(node(mesh["deformed_mm"]), deform(field.nominal_mm, field.error_um, 200))
    close(mesh.warp_by_vector("displacement_mm").points, mesh["deformed_mm"])
    assert mesh.field_data["exaggeration"] == [200]
    assert build_vts(drawing) == (tmp_path / "a.vts").read_bytes()
