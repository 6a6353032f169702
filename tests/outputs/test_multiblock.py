"""A scene as PyVista blocks: the numbers of the model, and all that is drawn."""

import re
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

import warpspace
from warpspace.bodies.placed import load_bodies
from warpspace.geometry.surfaces import deform
from warpspace.picture.model import evaluate_picture
from warpspace.picture.traces import trace_lines

ROOT = Path(__file__).parents[2]
FIRST = warpspace.load_scene("dvf5000_first")
SCENES = ("dvf5000_first", "teach_wobbling_table", "dvf5000_nominal")


def nodes(mesh, values):
    return np.swapaxes(
        np.asarray(values).reshape(*reversed(mesh.dimensions), *values.shape[1:]), 0, 2
    )


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("loop", ["tool", "relative"])
def test_numbers_are_those_of_evaluate(name, loop):
    scene = warpspace.load_scene(name)
    field = warpspace.evaluate(scene, grid=5, loop=loop)
    blocks = warpspace.to_pyvista(scene, grid=5, loop=loop, exaggeration=700)
    nominal, deformed = blocks["nominal"], blocks["deformed"]
    assert np.array_equal(nodes(nominal, nominal.points), field.nominal_mm)
    expected = deform(field.nominal_mm, field.error_um, 700.0)
    assert nodes(deformed, deformed.points) == pytest.approx(expected, abs=1e-9)
    tilt = np.linalg.norm(field.orientation_urad, axis=-1)
    for mesh in (nominal, deformed):
        for name in ("error_um", "norm_um", "orientation_urad"):
            assert np.array_equal(nodes(mesh, mesh.point_data[name]), getattr(field, name))
        assert nodes(mesh, mesh.point_data["tilt_urad"]) == pytest.approx(tilt, abs=1e-9)


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("loop", ["tool", "workpiece", "relative"])
def test_the_parts_add_up_to_the_error(name, loop):
    scene = warpspace.load_scene(name)
    blocks = warpspace.to_pyvista(scene, grid=4, loop=loop, parts=True)
    keys = [key for key in scene.errors if scene.errors.amplitude(key) != 0.0]
    for block in ("deformed", "nominal", "surface"):
        found = blocks[block].point_data
        parts = {key: found[key] for key in found if key.startswith("part_")}
        assert sorted(parts) == sorted(f"part_{key}_um" for key in keys)
        total = np.sum(list(parts.values()), axis=0)
        assert np.abs(total - found["error_um"]).max() < 1e-9


def test_the_surface_is_the_outside_of_the_deformed_volume_without_parts():
    blocks = warpspace.to_pyvista(FIRST, grid=5)
    surface, volume = blocks["surface"], blocks["deformed"]
    assert [key for key in volume.point_data if key.startswith("part_")] == []
    assert surface.n_points == 5**3 - 3**3
    assert surface.volume == pytest.approx(volume.volume, rel=1e-3)
    at = [volume.find_closest_point(point) for point in surface.points]
    assert np.array_equal(surface.points, volume.points[at])
    assert np.array_equal(surface.point_data["error_um"], volume.point_data["error_um"][at])


def test_traces_bodies_and_field_data_are_there():
    drawing = evaluate_picture(FIRST, exaggeration="auto")
    blocks = warpspace.to_pyvista(FIRST, grid=3)
    assert blocks.field_data["exaggeration"][0] == drawing.exaggeration
    assert blocks.field_data["scene"][0] == "dvf5000_first"
    assert blocks.field_data["program"][0] == f"warpspace {warpspace.__version__}"
    traces, lines = blocks["traces"], trace_lines(drawing.traces)
    assert len(traces) == 2 * len(lines) > 0
    for number, drawn in enumerate(lines):
        nominal, actual = traces[2 * number], traces[2 * number + 1]
        names = traces.keys()[2 * number : 2 * number + 2]
        assert [name.split()[0] for name in names] == ["nominal", "actual"]
        assert all(name.endswith(drawn.trace.label) for name in names)
        assert np.allclose(nominal.points, drawn.nominal_mm)
        assert np.array_equal(actual.point_data["error_um"], drawn.error_um)
        shift = deform(drawn.nominal_mm, drawn.error_um, drawing.exaggeration)
        assert np.allclose(actual.points, shift)
    bodies = load_bodies(FIRST.machine)
    assert blocks["bodies"].keys() == [body.name for body in bodies]
    for body, mesh in zip(bodies, blocks["bodies"], strict=True):
        assert mesh.n_cells == len(body.triangles)
        assert (mesh.cell_data["colour"] == body.colour).all()


@pytest.mark.render
@pytest.mark.usefixtures("renderer")
def test_the_documented_lines_draw(monkeypatch):
    pictures: list[np.ndarray] = []

    def show(plotter):
        pictures.append(plotter.screenshot(return_img=True))
        plotter.close()

    monkeypatch.setattr(pv, "OFF_SCREEN", True)
    monkeypatch.setattr(pv.Plotter, "show", show)
    page = (ROOT / "docs" / "pyvista.md").read_text("utf-8")
    lines = re.findall(r"```python\n(.*?)```", page, re.DOTALL)[0]
    exec(lines, {})
    (picture,) = pictures
    assert np.ptp(picture) > 50
