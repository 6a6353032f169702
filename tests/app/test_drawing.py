"""Colours, files and camera that reach the browser."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator

from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.readouts import summary as legend
from warpspace.app.state.app_state import start_state
from warpspace.app.viewport.camera import fit_camera
from warpspace.app.viewport.tone_map import (
    inverse_tone_map,
    line_colour,
    tone_map,
)
from warpspace.geometry.colour import colour_table
from warpspace.geometry.srgb import linear_to_srgb, srgb_to_linear
from warpspace.picture.ticks import tick_values
from warpspace.scene.library import load_scene, parse_scene


@pytest.mark.parametrize("diverging", [False, True])
def test_tone_map_turns_the_sent_colours_into_the_wanted_ones(diverging: bool) -> None:
    wanted = colour_table(diverging=diverging)
    arrived = linear_to_srgb(tone_map(inverse_tone_map(wanted).astype(float))) * 255.0
    assert np.abs(arrived - wanted).max() < 0.6


@given(st.tuples(*[st.integers(min_value=0, max_value=225)] * 3))
def test_grey_and_dark_line_colours_arrive(rgb: tuple[int, int, int]) -> None:
    grey = (max(rgb), max(rgb), max(rgb))
    sent = srgb_to_linear(np.array(line_colour(grey)) / 255.0)
    arrived = linear_to_srgb(tone_map(sent)) * 255.0
    assert np.abs(arrived - np.array(grey)).max() < 4.0


@given(
    st.floats(min_value=0.3, max_value=4.0),
    st.floats(min_value=0.0, max_value=0.3),
    st.floats(min_value=0.0, max_value=0.45),
    st.lists(st.tuples(*[st.floats(min_value=-500, max_value=500)] * 3), min_size=2, max_size=12),
)
def test_camera_sees_every_point_between_heading_and_foot(
    aspect: float, top: float, bottom: float, points: list[tuple[float, float, float]]
) -> None:
    spread = np.array([*points, (600.0, 0.0, 0.0), (-600.0, 0.0, 0.0)])
    pose = fit_camera(spread, aspect, top=top, bottom=bottom)
    back = pose.position - pose.look_at
    back = back / np.linalg.norm(back)
    right = np.cross((0, 0, 1), back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    seen = spread - pose.position
    depth = -(seen @ back)
    half = np.tan(pose.fov_rad / 2)
    assert (depth > 0).all()
    x, y = seen @ right / depth / (half * aspect), seen @ up / depth / half
    assert np.abs(x).max() <= 1.02
    assert y.min() >= -1.02 + 2 * bottom
    assert y.max() <= 1.02 - 2 * top


def test_ticks_are_round_and_inside() -> None:
    assert tick_values(-275.0, 275.0, 6) == [-200.0, -100.0, 0.0, 100.0, 200.0]
    assert tick_values(5.0, 5.0, 6) == [5.0]


def test_legend_escapes_what_a_scene_file_says() -> None:
    text = 'title = "<script>alert(1)</script>"\nmachine = "dvf5000"\n'
    workspace = "[workspace]\nX = [0, 10]\nY = [0, 10]\nZ = [-20, -10]\nB = 0\nC = 0\n"
    scene = parse_scene(text + workspace, "evil")
    picture = LiveModel().evaluate(start_state(scene, nodes=3))
    assert "<script>" not in legend.heading(picture)
    assert "&lt;script&gt;" in legend.heading(picture)


def test_legend_says_factor_units_numbers_and_place() -> None:
    live = LiveModel()
    picture = live.evaluate(start_state(load_scene("dvf5000_first")))
    assert "exaggeration ×1000" in legend.heading(picture)
    summary = legend.summary(picture)
    assert f"{picture.statistics.mean_um:.2f} µm" in summary
    assert "axes X 275 Y −225 Z −480 · in R x 275 y −225 z −51" in summary
    assert "|E| [µm]" in summary
    assert "100 mm geometry" in summary
    assert "100 µm error" in summary
    true = live.evaluate(picture.state.with_exaggeration(1.0))
    assert "true scale" in legend.heading(true)
    assert "(auto)" not in legend.heading(true)


def marks(picture) -> dict[str, float]:
    found = re.findall(r'data-mark="(\w+)" title="([^ ]+) (µm|µrad)"', legend.colour_bar(picture))
    assert {unit for _, _, unit in found} == {picture.scale.unit}
    return {name: float(value.replace("−", "-")) for name, value, _ in found}


def p95_of_volume(values: np.ndarray) -> float:
    """The value that 95 % of the volume stay below, from 100 × 100 × 100 interpolated points."""
    axes = [np.linspace(0.0, 1.0, nodes) for nodes in values.shape]
    fine = np.linspace(0.005, 0.995, 100)
    points = np.stack(np.meshgrid(fine, fine, fine, indexing="ij"), axis=-1)
    return float(np.percentile(RegularGridInterpolator(axes, values)(points), 95))


def test_the_bar_marks_what_is_coloured() -> None:
    live, start = LiveModel(), start_state(load_scene("dvf5000_first"))
    tilted = replace(start, look=start.look.with_choice(quantity="orientation"))
    for state in (start, tilted):
        lengths = live.evaluate(state)
        weights = lengths.grid.weights
        found = marks(lengths)
        # the bar interpolates 40 cells an axis
        assert found.pop("P95") == pytest.approx(p95_of_volume(lengths.values), abs=0.03)
        assert found == pytest.approx(
            {"mean": (weights * lengths.values).sum(), "max": lengths.values.max()}, abs=0.006
        )
        signed = live.evaluate(state.with_component("y"))
        assert marks(signed) == pytest.approx(
            {
                "min": signed.values.min(),
                "mean": (weights * signed.values).sum(),
                "max": signed.values.max(),
            },
            abs=0.006,
        )
