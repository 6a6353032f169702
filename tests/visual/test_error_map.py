"""Semantic tests of the error map: what is read off the picture is what the model says."""

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from products import pairwise
from visual.reading import invert_colours, read_map
from warpspace import load_scene
from warpspace.geometry.colour import component_values
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.figure_files import figure_bytes
from warpspace.outputs.figures.registry import draw_figure
from warpspace.picture.model import evaluate_picture
from warpspace.units import MM_PER_UM

pytestmark = [pytest.mark.render, pytest.mark.usefixtures("renderer")]
SCENES = ("dvf5000_first", "dvf5000_second", "teach_squareness", "teach_pitching_axis")


@pytest.fixture(scope="module")
def truth():
    return evaluate_picture(load_scene("dvf5000_first"))


def expected(picture, exaggeration):
    return picture.grid.nominal_mm + exaggeration * MM_PER_UM * picture.field.error_um


def read(picture, settings, *, exaggeration=None, **options):
    scene = options.pop("drawn_scene", picture.scene)
    drawn = draw_figure("error-map", [scene], settings).maps[0]
    known = component_values(picture.field.error_um, settings.component)
    factor = drawn.picture.exaggeration if exaggeration is None else exaggeration
    return read_map(drawn, expected(picture, factor), known, settings.view, **options)


@pytest.mark.parametrize("name", SCENES)
def test_colours_and_shape_are_the_models(name):
    picture = evaluate_picture(load_scene(name))
    reading = read(picture, FigureSettings())
    assert len(reading.known) > 300
    assert reading.agrees(), (reading.slope, np.abs(reading.depth_mm).max())


@pytest.mark.parametrize(
    ("view", "component"), pairwise(["iso", "front", "right", "top"], ["norm", "x", "y", "z"])
)
def test_every_view_and_component(truth, view, component):
    reading = read(truth, FigureSettings(component=component, view=view))
    assert len(reading.known) > 60
    if (view, component) == ("top", "x"):
        # the face is nearly one colour: 26 of 256 levels are too few for a slope of half a percent
        assert np.abs(reading.read - reading.known).max() < 1.2 * 30.0 / 255.0
        assert np.abs(reading.depth_mm).max() < 1.0
        return
    assert reading.agrees(), (reading.slope, np.abs(reading.depth_mm).max())


@pytest.mark.parametrize("size", [(400, 300), (1000, 1600), (3200, 2400)])
def test_every_size(truth, size):
    reading = read(truth, FigureSettings(size=size))
    assert abs(reading.slope - 1.0) < 0.01 if size[0] < 800 else reading.agrees()


def scaled(scene, factor):
    functions = {key: f.scaled(factor) for key, f in scene.errors.functions.items()}
    return replace(scene, errors=replace(scene.errors, functions=functions))


# Each of these draws something wrong on purpose; the test above must notice.


@pytest.mark.parametrize("factor", [1.02, 0.98])
def test_an_error_change_of_two_percent_is_noticed(truth, factor):
    wrong = scaled(truth.scene, factor)
    reading = read(truth, FigureSettings(exaggeration=1000.0), drawn_scene=wrong)
    assert reading.slope == pytest.approx(factor, abs=0.006)
    assert not reading.agrees()


@pytest.mark.parametrize("factor", [1.03, 0.97])
def test_an_exaggeration_change_of_three_percent_is_noticed(truth, factor):
    reading = read(truth, FigureSettings(exaggeration=1000.0 * factor), exaggeration=1000.0)
    assert np.abs(reading.depth_mm).max() > 1.0
    assert not reading.agrees()


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_flipped_axis_is_noticed(truth, axis):
    flipped = replace(truth.field, error_um=np.flip(truth.field.error_um, axis=axis))
    assert not read(replace(truth, field=flipped), FigureSettings()).agrees()


@pytest.mark.parametrize("component", ["norm", "y"])
def test_a_wrong_colour_map_is_noticed(truth, component):
    settings = FigureSettings(component=component)
    assert not read(truth, settings, diverging=component == "norm").agrees()


def test_the_png_holds_the_very_pixels(truth):
    """Where nothing is drawn over the body, the file has the renderer's colours."""
    drawing = draw_figure("error-map", [truth.scene], FigureSettings())
    drawn = drawing.maps[0]
    pixels = np.asarray(Image.open(io.BytesIO(figure_bytes(drawing, "png"))))
    left, bottom, right, top = (int(value) for value in drawn.raster.rect)
    height = pixels.shape[0]
    shown = pixels[height - top : height - bottom, left:right]
    body = drawn.raster.reduced()
    same = (shown == body[..., :3]).all(axis=-1) & (body[..., 3] == 255)
    assert same.sum() > 0.55 * (body[..., 3] == 255).sum()


def test_the_surface_is_hatched_above_the_limit_only(truth):
    limit = 40.0
    plain, hatched = (
        draw_figure("error-map", [scene], FigureSettings())
        for scene in (truth.scene, replace(truth.scene, limit_um=limit))
    )
    before, after = (
        np.asarray(Image.open(io.BytesIO(figure_bytes(drawing, "png"))).convert("RGB")).astype(int)
        for drawing in (plain, hatched)
    )
    raster, scale = plain.maps[0].raster, plain.maps[0].picture.scale
    left, _, _, top = (round(value) for value in raster.rect)
    body = raster.reduced()
    rows, columns = (
        slice(len(before) - top, len(before) - top + len(body)),
        slice(left, left + body.shape[1]),
    )
    changed = (np.abs(after - before)[rows, columns] > 60).any(axis=-1) & (body[..., 3] == 255)
    values = invert_colours(body[changed][:, :3].astype(float), scale)
    assert len(values) > 2000
    assert values.min() > limit - 2.0  # the width of the line
    assert values.max() > 50.0
