"""Semantic tests of the slices, the orientation map and the comparison."""

import numpy as np
import pytest

from visual.reading import read_map
from warpspace import evaluate, load_scene
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.figures.registry import draw_figure
from warpspace.picture.model import evaluate_picture
from warpspace.units import MM_PER_UM

pytestmark = [pytest.mark.render, pytest.mark.usefixtures("renderer")]


def test_slices_show_the_middle_planes():
    scene = load_scene("dvf5000_first")
    maps = draw_figure("slices", [scene]).maps
    assert len({drawn.projection.px_per_mm for drawn in maps}) == 1
    axes = {axis: np.linspace(*scene.workspace.ranges[axis], 21) for axis in "XYZ"}
    for drawn, held, view in zip(maps, ("Z", "Y", "X"), ("top", "front", "right"), strict=True):
        at = {axis: values for axis, values in axes.items() if axis != held}
        first, second = at
        grid = np.meshgrid(at[first], at[second], indexing="ij")
        middle = float(np.mean(scene.workspace.ranges[held]))
        field = evaluate(scene, at={first: grid[0], second: grid[1], held: middle})
        known = field.norm_um.reshape(drawn.picture.values.shape)
        nodes = field.nominal_mm + drawn.picture.exaggeration * MM_PER_UM * field.error_um
        nodes = nodes.reshape(*known.shape, 3)
        reading = read_map(drawn, nodes, known, view)
        assert len(reading.known) > 250
        assert reading.agrees(), (held, reading.slope)
        assert not read_map(drawn, nodes, 1.02 * known, view).agrees()


@pytest.mark.parametrize("component", ["norm", "x"])
def test_orientation_map_shows_the_tilt(component):
    picture = evaluate_picture(load_scene("dvf5000_first"))
    turn = picture.field.orientation_urad
    known = np.linalg.norm(turn, axis=-1) if component == "norm" else turn[..., 0]
    settings = FigureSettings(component=component)
    drawn = draw_figure("orientation-map", [picture.scene], settings).maps[0]
    reading = read_map(drawn, picture.grid.nominal_mm, known)
    assert drawn.picture.scale.unit == "µrad"
    assert reading.agrees(), reading.slope
    assert not read_map(drawn, picture.grid.nominal_mm, np.flip(known, axis=2)).agrees()


def test_comparison_shares_scale_exaggeration_and_projection():
    scenes = [load_scene("dvf5000_first"), load_scene("dvf5000_second")]
    # large enough that a pixel of the three small maps is finer than the tolerance on the depth
    settings = FigureSettings(size=(2400, 1800))
    first, second, difference = draw_figure("comparison", scenes, settings).maps
    assert first.picture.scale == second.picture.scale
    assert (difference.picture.scale.high, difference.picture.scale.label) == (50.0, "|E_B − E_A|")
    assert len({drawn.picture.exaggeration for drawn in (first, second, difference)}) == 1
    assert first.projection.px_per_mm == difference.projection.px_per_mm
    a, b = (evaluate_picture(scene) for scene in scenes)
    for drawn, error in (
        (first, a.field.error_um),
        (second, b.field.error_um),
        (difference, b.field.error_um - a.field.error_um),
    ):
        nodes = a.grid.nominal_mm + drawn.picture.exaggeration * MM_PER_UM * error
        reading = read_map(drawn, nodes, np.linalg.norm(error, axis=-1))
        assert abs(reading.slope - 1.0) < 0.01
        assert np.abs(reading.depth_mm).max() < 1.5
    wrong = a.field.error_um - b.field.error_um
    nodes = a.grid.nominal_mm + difference.picture.exaggeration * MM_PER_UM * wrong
    assert not read_map(difference, nodes, np.linalg.norm(wrong, axis=-1)).agrees()


def test_machine_figure_shows_the_same_volume_as_the_error_map():
    scene = load_scene("dvf5000_first")
    machine, volume = (draw_figure(n, [scene]).maps[0].picture for n in ("machine", "error-map"))
    assert np.array_equal(machine.values, volume.values)
    assert np.allclose(machine.drawn_mm, volume.drawn_mm)
    assert machine.scale == volume.scale
