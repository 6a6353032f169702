"""Every figure: drawn at any size for any machine, nothing clipped, the same bytes every time."""

import io
import itertools
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.text import Text
from PIL import Image

from warpspace import load_scene, scene_names
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.outputs.drawing.content import Drawing
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.figures.catalogue import draw_figure, figure_kinds
from warpspace.outputs.save import figure_bytes, render_figure, write_figure
from warpspace.picture.scene_picture import evaluate_picture
from warpspace.picture.traces import trace_lines
from warpspace.picture.words import spell
from warpspace.scene.library import parse_scene
from warpspace.scene.model import Scene

FIGURES = tuple(kind.name for kind in figure_kinds())
TWO = tuple(kind.name for kind in figure_kinds() if kind.scenes == 2)

pytestmark = [pytest.mark.render, pytest.mark.usefixtures("renderer")]

MACHINES = {
    "two": '[machine]\nchain="wFXZt"\n[workspace]\nX=[-100,300]\nZ=[0,500]\n'
    "[errors]\nEXX={ramp=12.5}\nEBX=30\nEB0Z=-45\n",
    "one": '[machine]\nchain="wFXt"\n[workspace]\nX=[0,500]\n[errors]\nEXX={ramp=9}\n',
    "rotary": '[machine]\nchain="wCFt"\n[workspace]\nC=0\n[points_mm]\ntraces=[[100,0,0]]\n'
    "[errors]\nEXC=5\n",
    "huge": 'machine="dvf5000"\n[workspace]\nX=[-275,275]\nY=[-225,225]\nZ=[-480,-80]\n'
    "[errors]\nEXX={ramp=90000}\nEYX={ramp=-70000}\nEC0Y=90000\n",
    "tiny": 'machine="dvf5000"\n[workspace]\nX=[-275,275]\nY=[-225,225]\nZ=[-480,-80]\n'
    "[errors]\nEXX={ramp=0.00012}\n",
    "six": '[machine]\nchain="wBFXYZACt"\n[workspace]\nX=[0,300]\nY=[0,200]\nZ=[0,100]\n'
    "[errors]\nEXX={ramp=9}\nEAA=20\nEBC={harmonics=[[1,8,0]]}\n",
}


def scene_of(name: str) -> Scene:
    title = f"{name}: a $title$ with 中文, very long, that goes on and on and never ends"
    return parse_scene(f"title = {title!r}\n{MACHINES[name]}", name)


def pair(name: str) -> list[Scene]:
    first = load_scene("dvf5000_first")
    return [first, load_scene("dvf5000_second")] if name in TWO else [first]


def inside(drawing: Drawing, size: tuple[int, int]) -> None:
    """Check that no text leaves the figure."""
    assert drawing.rects
    rects = np.array(drawing.rects)
    assert (rects[:, :2] >= -0.5).all(), drawing.title
    assert (rects[:, 2] <= size[0] + 0.5).all(), drawing.title
    assert (rects[:, 3] <= size[1] + 0.5).all(), drawing.title


@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_in_every_format(name: str) -> None:
    settings = FigureSettings(size=(800, 600), grid=7)
    for form, start in (("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")):
        assert render_figure(name, pair(name), settings, form).startswith(start)


@pytest.mark.parametrize("size", [(400, 300), (1600, 1200), (1920, 700), (700, 1500)])
@pytest.mark.parametrize(
    "name", [n for n in FIGURES if n not in ("gains", "montecarlo", "ballbar", "rotary")]
)
def test_text_stays_inside(name: str, size: tuple[int, int]) -> None:
    drawing = draw_figure(name, pair(name), FigureSettings(size=size, grid=11))
    inside(drawing, size)


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("figure", ["error-map", "orientation-map", "machine", "error-curves"])
@pytest.mark.parametrize("machine", MACHINES)
def test_any_machine_is_drawn(machine: str, figure: str, dark: bool) -> None:
    size = (900, 700)
    settings = FigureSettings(size=size, grid=6, dark=dark, component="x" if dark else "norm")
    inside(draw_figure(figure, [scene_of(machine)], settings), size)


@pytest.mark.parametrize("name", scene_names())
def test_corner_labels_of_every_scene_keep_apart(name: str) -> None:
    drawing = draw_figure("error-map", [load_scene(name)])
    inside(drawing, (1600, 1200))
    for a, b in itertools.combinations(drawing.rects, 2):
        across = min(a[2], b[2]) - max(a[0], b[0])
        along = min(a[3], b[3]) - max(a[1], b[1])
        assert across < 2.0 or along < 2.0, (name, a, b)


@pytest.mark.parametrize("form", ["png", "svg", "pdf"])
def test_repeated_pictures_are_the_same_bytes(form: str) -> None:
    settings = FigureSettings(size=(800, 600))
    scene = load_scene("dvf5000_first")
    assert render_figure("error-map", [scene], settings, form) == render_figure(
        "error-map", [scene], settings, form
    )


def test_files_say_what_they_show() -> None:
    drawing = draw_figure("error-map", [load_scene("dvf5000_first")])
    image = Image.open(io.BytesIO(figure_bytes(drawing, "png")))
    assert image.size == (1600, 1200)
    assert image.text["Scene"] == "dvf5000_first"
    assert image.text["Exaggeration"] == "1000"
    assert image.text["Software"].startswith("warpspace ")
    assert "component=norm, view=iso, loop=tool, grid=21" in image.text["Description"]
    assert "first machine measured" in image.text["Title"]


def test_vector_formats_embed_fonts_and_carry_no_date() -> None:
    scene = load_scene("dvf5000_first")
    settings = FigureSettings(size=(800, 600))
    pdf = render_figure("error-map", [scene], settings, "pdf")
    assert b"/FontFile2" in pdf
    assert b"DejaVuSans" in pdf
    assert b"/Subtype /Type3" not in pdf
    assert b"CreationDate" not in pdf
    assert b"exaggeration=1000" in pdf
    svg = render_figure("error-map", [scene], settings, "svg").decode()
    assert "<dc:date>" not in svg
    assert "exaggeration=1000" in svg
    assert "<path" in svg
    assert "<text" not in svg


@pytest.mark.parametrize(
    "size", [(399, 300), (0, 0), (100_000, 100_000), (12_000, 12_000), (-5, 9)]
)
def test_impossible_sizes_are_refused(size: tuple[int, int]) -> None:
    with pytest.raises(OptionError, match="expected 400x300 to"):
        FigureSettings(size=size)


@pytest.mark.parametrize("value", [0.0, -1.0, 1e7, float("nan"), float("inf")])
def test_impossible_exaggerations_are_refused(value: float) -> None:
    with pytest.raises(OptionError, match="exaggeration"):
        FigureSettings(exaggeration=value)


def test_unknown_figures_name_the_near_miss() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'error-map'"):
        draw_figure("eror-map", [load_scene("dvf5000_first")])
    with pytest.raises(OptionError, match="two scenes; given 1"):
        draw_figure("comparison", [load_scene("dvf5000_first")])


def test_different_volumes_cannot_be_compared() -> None:
    with pytest.raises(OptionError, match="working volumes differ"):
        draw_figure("comparison", [load_scene("dvf5000_first"), scene_of("six")])


def test_traces_need_a_rotary_axis() -> None:
    with pytest.raises(OptionError, match="no traces"):
        draw_figure("traces", [scene_of("two")])


def test_auto_overrides_the_exaggeration_of_a_scene() -> None:
    text = f"title='s'\n{MACHINES['tiny']}\n[view]\nexaggeration = 500\n"
    scene = parse_scene(text.replace("0.00012", "12"), "s")
    settings = FigureSettings(size=(500, 400), grid=3)
    assert draw_figure("error-map", [scene], settings).maps[0].exaggeration == 500.0
    settings = FigureSettings(size=(500, 400), grid=3, exaggeration="auto")
    assert draw_figure("error-map", [scene], settings).maps[0].exaggeration == 5000.0


@pytest.mark.parametrize(("component", "low"), [("norm", 0.0), ("x", -7.0)])
@pytest.mark.parametrize(
    "name", ["error-map", "slices", "orientation-map", "machine", "comparison"]
)
def test_a_range_that_is_given_is_that_of_every_map(name: str, component: str, low: float) -> None:
    size = (1000, 750)
    settings = FigureSettings(component=component, size=size, grid=5, range_top=7.0)
    drawing = draw_figure(name, pair(name), settings)
    assert {(part.scale.low, part.scale.high) for part in drawing.maps} == {(low, 7.0)}
    inside(drawing, size)
    assert ", range=7" in drawing.facts["settings"]
    # a value beyond the bar is marked as such, no other
    said = {text.get_text() for text in drawing.figure.findobj(Text)}
    plain = draw_figure(name, pair(name), replace(settings, range_top=None))
    marks = {text.get_text() for text in plain.figure.findobj(Text)} - said
    assert not any("↑" in text or "↓" in text for text in marks)
    if name in {"error-map", "orientation-map"}:
        assert "max ↑" in said
        assert "max" in marks


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_impossible_ranges_are_refused(value: float) -> None:
    with pytest.raises(OptionError, match="range_top"):
        FigureSettings(range_top=value)


def test_writing_keeps_an_existing_file(tmp_path) -> None:
    from warpspace.exceptions import OutputError

    target = tmp_path / "map.png"
    settings = FigureSettings(size=(400, 300), grid=3)
    scene = load_scene("dvf5000_first")
    write_figure(target, "error-map", [scene], settings, force=False)
    before = target.read_bytes()
    with pytest.raises(OutputError, match="--force"):
        write_figure(target, "error-map", [scene], settings, force=False)
    assert target.read_bytes() == before
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.slow
def test_a_poster_is_drawn() -> None:
    settings = FigureSettings(size=(8000, 6000))
    drawing = draw_figure("error-map", [load_scene("dvf5000_first")], settings)
    inside(drawing, (8000, 6000))
    image = Image.open(io.BytesIO(figure_bytes(drawing, "png")))
    assert image.size == (8000, 6000)


@pytest.mark.parametrize("name", ["gains", "montecarlo", "ballbar"])
def test_charts_stand_on_a_dark_ground_with_light_ink(name: str) -> None:
    settings = FigureSettings(size=(900, 700), dark=True)
    scene = load_scene("dvf5000_first")
    image = Image.open(io.BytesIO(render_figure(name, [scene], settings, "png"))).convert("L")
    levels = np.asarray(image)
    assert np.median(levels) < 40
    assert (levels > 200).mean() > 0.002
    light = render_figure(name, [scene], FigureSettings(size=(900, 700)), "png")
    assert np.median(np.asarray(Image.open(io.BytesIO(light)).convert("L"))) > 240


def test_traces_of_the_figure_hold_the_reference_point_still_like_the_export() -> None:
    """Without the reference the figure showed 4.53 µm where the export had 2.23 µm."""
    scene = replace(load_scene("teach_wobbling_table"), reference={"X": 0.0, "Y": 0.0, "Z": -280.0})
    drawing = draw_figure("traces", [scene], FigureSettings(size=(800, 600)))
    words = " ".join(text.get_text() for axes in drawing.figure.axes for text in axes.texts)
    lines = trace_lines(evaluate_picture(scene, grid=3).traces)
    found = {line.trace.label: spell(line.largest_um) for line in lines}
    over_b = [spell(line.largest_um) for line in lines if line.trace.axis == "B"]
    assert "2.23" in over_b
    assert "4.53" not in words
    assert all(f"{value} µm" in words for value in found.values())
