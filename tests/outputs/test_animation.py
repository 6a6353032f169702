"""Animations read back: number of pictures, timing, one camera, honest factors."""

import subprocess
import sys
from dataclasses import replace

import imageio_ffmpeg
import numpy as np
import pytest
from matplotlib.text import Text
from PIL import Image

from products import first
from warpspace import load_scene
from warpspace.analysis.description import ignore_progress
from warpspace.exceptions import OptionError, OutputError
from warpspace.machine.axes import parameter
from warpspace.outputs.animation import (
    AnimationSettings,
    build_frames,
    one_round,
    shared_palette,
    sweep_factor,
    write_animation,
)
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.parts.program import Program


def decoded(path):
    """Pictures of an MP4 of 480 × 360, [n, 360, 480, 3]."""
    decoder = [imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-i", str(path)]
    raw = subprocess.run(
        [*decoder, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=True, check=True
    ).stdout
    return np.frombuffer(raw, np.uint8).reshape(-1, 360, 480, 3)


SMALL = AnimationSettings(frames=4, fps=10.0, figure=FigureSettings(size=(480, 361), grid=5))


def test_sweep_runs_from_true_scale_to_the_factor_and_back():
    factors = [sweep_factor(1000.0, n / 8) for n in range(9)]
    assert factors[0] == factors[8] == 1.0
    assert factors[4] == 1000.0
    assert factors[1:4] == pytest.approx(factors[7:4:-1], rel=0.01)
    assert all(float(f"{factor:.3g}") == factor for factor in factors)


def test_a_turn_covers_the_circle_of_every_point():
    axis, turn_deg, lines = one_round(load_scene("dvf5000_first"))
    assert axis == "C"
    assert (turn_deg[0], turn_deg[-1]) == (0.0, 360.0)
    assert len(lines) == 2
    for line in lines:
        np.testing.assert_allclose(line.nominal_mm[0], line.nominal_mm[-1], atol=1e-9)


@pytest.mark.render
def test_camera_and_scale_stand_still(renderer):
    scene = load_scene("dvf5000_first")
    frames = build_frames(scene, SMALL)
    first, middle = (frames[number]().maps[0] for number in (0, 2))
    assert first.picture.exaggeration == 1.0
    assert middle.picture.exaggeration == 1000.0
    assert first.picture.scale == middle.picture.scale
    corners = scene.workspace.ranges["X"]
    point = np.array([corners[0], 0.0, 0.0])
    np.testing.assert_allclose(first.projection.project(point), middle.projection.project(point))


@pytest.mark.render
@pytest.mark.parametrize("ending", first("gif", "webp", "mp4"))
def test_files_are_read_back(ending, renderer, tmp_path):
    target = tmp_path / f"a.{ending}"
    write_animation(load_scene("dvf5000_first"), target, SMALL)
    if ending == "mp4":
        pictures = decoded(target)
        assert len(pictures) == 4
        apart = np.abs(pictures[2].astype(int) - pictures[0]).mean()
    else:
        with Image.open(target) as image:
            assert image.n_frames == 4
            assert image.size == (480, 361)
            assert image.info["loop"] == 0
            shots = []
            for number in (0, 2):
                image.seek(number)
                shots.append(np.asarray(image.convert("RGB")).astype(int))
            apart = np.abs(shots[1] - shots[0]).mean()
    assert apart > 0.5


def test_all_pictures_of_a_gif_share_one_palette():
    colours = [(250, 10, 10), (10, 250, 10), (10, 10, 250)]
    pictures = [Image.new("RGB", (8, 8), colour) for colour in colours]
    palette = shared_palette(pictures)
    for picture, colour in zip(pictures, colours, strict=True):
        again = picture.quantize(palette=palette, dither=Image.Dither.NONE).convert("RGB")
        assert again.getpixel((0, 0)) == colour


def test_nothing_to_turn(tmp_path):
    path = tmp_path / "three.toml"
    path.write_text('title = "three"\n[machine]\nchain = "wFXYZt"\n')
    with pytest.raises(OptionError, match="no trace to animate"):
        one_round(load_scene(path))


def words(drawing):
    return [text.get_text() for text in drawing.figure.findobj(Text)]


@pytest.mark.render
def test_a_program_states_line_error_and_cause_in_each_picture(renderer):
    scene = load_scene("part_on_dvf5000")
    result = Program().run(scene, ignore_progress)
    worst, count = result.worst[0], len(result.path.line)
    figure = replace(SMALL.figure, size=(800, 600))
    frames = build_frames(scene, AnimationSettings("program", count, 8.0, figure))
    drawing = frames[int(np.argmax(result.path.norm_um))]()  # there is one picture of each sample
    code = [*result.analysis.lines()][worst.line - 1].strip()
    cause = parameter(max(worst.budget, key=worst.budget.get)).cause
    assert f"line {worst.line}: {code}" in words(drawing)
    assert f"|E| {worst.um:.1f} µm, mostly because {cause}" in words(drawing)
    assert f"{worst.um:.1f} µm" in words(frames[0]())  # max


def test_a_program_is_that_of_the_scene():
    with pytest.raises(OptionError, match="expected a program"):
        build_frames(load_scene("dvf5000_first"), replace(SMALL, motion="program"))


@pytest.mark.render
def test_the_steps_of_a_story_follow_each_other_with_their_texts(renderer, tmp_path):
    scene = load_scene("dvf5000_first")
    figures = [replace(SMALL.figure, component=component) for component in "xy"]
    steps = [
        (f"Step {figure.component}\n(note)", "error-map", [scene], figure) for figure in figures
    ]
    settings = replace(SMALL, motion="story", steps=steps)
    frames = build_frames(scene, settings)
    assert frames[0] is frames[1]  # drawn once
    assert [frame is frames[0] for frame in frames] == [True, True, False, False]
    for frame, name in ((frames[0], "x"), (frames[3], "y")):
        drawing = frame()
        assert f"Step {name}" in words(drawing)
        assert drawing.maps[0].picture.component == name
    write_animation(scene, tmp_path / "story.webp", settings)
    with Image.open(tmp_path / "story.webp") as film:
        assert film.n_frames == 2
        film.load()
        assert film.info["duration"] == 200
    with pytest.raises(OptionError, match="no story"):
        build_frames(scene, replace(settings, steps=()))


def test_mp4_without_its_package_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(OutputError, match="imageio-ffmpeg"):
        write_animation(load_scene("dvf5000_first"), tmp_path / "a.mp4", SMALL)
    assert list(tmp_path.iterdir()) == []
