"""Machines whose volume is a line or a point: figures, exports and reports of them."""

import re

import numpy as np
import pytest
import pyvista as pv
from matplotlib.backends.backend_agg import FigureCanvasAgg

from products import pairwise
from still_scenes import TEXTS, still_scene
from warpspace import to_pyvista
from warpspace.cli.services import write_page
from warpspace.exceptions import WarpspaceError
from warpspace.outputs.exports.formats import write_export
from warpspace.outputs.figures.registry import draw_figure, figure_names
from warpspace.outputs.report import write_report
from warpspace.picture.model import evaluate_picture

REFUSED = {
    "slices": "does not extend along X, Y and Z; draw the error-map",
    "traces": "has no traces; expected a machine with a rotary axis",
    "rotary": "has no traces; expected a machine with a rotary axis",
    "gains": "has no axis in it",
    "montecarlo": r"has no tolerances to sample machines from|has no axis in it",
    "ballbar": r"has no axis [XY]|the circle leaves the working volume",
}
"""What a figure may say instead: what it shows is not there."""
DRAWN = ("wFXt", "wXFt", "wCFt, traces", "only X moves", "nothing moves")
"""Drawing takes a second each: a line and a point carried by either side, with traces."""
FEW = ("wFXt", "wCFt, traces", "nothing moves")
ALWAYS = {"error-map", "orientation-map", "error-curves", "machine", "adjust"}


def test_every_kind_of_figure_is_looked_at():
    assert set(figure_names()) == ALWAYS | set(REFUSED)


@pytest.mark.render
@pytest.mark.parametrize(("name", "figure"), pairwise(DRAWN, figure_names()))
def test_figures_are_drawn_or_say_why_not(name, figure, renderer):
    said = None
    try:
        drawing = draw_figure(figure, [still_scene(name)])
        assert drawing.maps or figure not in {"error-map", "orientation-map", "machine"}
    except WarpspaceError as refused:
        said = str(refused)
    assert said is None or re.fullmatch(f".*({REFUSED.get(figure, 'never')}).*", said), said


@pytest.mark.render
@pytest.mark.parametrize("name", FEW)
def test_a_comparison_with_itself(name, renderer):
    scene = still_scene(name)
    assert len(draw_figure("comparison", [scene, scene]).maps) == 3


@pytest.mark.render
@pytest.mark.parametrize(("name", "figure"), pairwise(FEW, ["error-map", "machine"]))
def test_maps_have_their_colours(name, figure, renderer):
    drawing = draw_figure(figure, [still_scene(name)])
    (drawn,) = (part.picture for part in drawing.maps)
    canvas = FigureCanvasAgg(drawing.figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    worst = np.argmax(np.abs(drawn.values))
    wanted = drawn.scale.colours(drawn.values.ravel()[worst])
    # the bar beside the map has them too
    map_only = pixels[:, : int(0.78 * pixels.shape[1])].astype(int)
    assert (np.abs(map_only - wanted).max(axis=-1) < 25).sum() > 50


@pytest.mark.parametrize("name", TEXTS)
def test_every_export(name, tmp_path):
    picture = evaluate_picture(still_scene(name), grid=5)
    for ending in ("glb", "vts", "csv"):
        write_export(picture, tmp_path / f"out.{ending}")
    write_page(picture, tmp_path / "out.html", overwrite=False)
    read = np.asarray(pv.read(tmp_path / "out.vts")["error_um"])
    errors = read.reshape(*picture.grid.shape[::-1], 3).swapaxes(0, 2)
    np.testing.assert_allclose(errors, picture.field.error_um, atol=1e-9)
    rows = (tmp_path / "out.csv").read_text().splitlines()
    assert sum(not row.startswith("#") for row in rows) == 1 + picture.values.size


@pytest.mark.parametrize(("name", "cells"), [("wFXt", 1), ("wCFt", 1), ("only X stands still", 32)])
def test_the_surface_in_pyvista_is_a_line_or_a_vertex(name, cells):
    scene = still_scene(name)
    surface = to_pyvista(scene, grid=5, parts=True)["surface"]
    assert surface.n_cells == cells
    values = evaluate_picture(scene, grid=5).values.reshape(-1)
    np.testing.assert_allclose(np.sort(surface.point_data["norm_um"]), np.sort(values))


@pytest.mark.render
@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "ending"), [("nothing moves", "html"), ("wFXt", "html"), ("wCFt, traces", "pdf")]
)
def test_reports(name, ending, renderer, tmp_path):
    path = tmp_path / f"report.{ending}"
    write_report([still_scene(name)], path)
    assert path.stat().st_size > 10_000
