"""Every figure: drawn at any size for any machine, nothing clipped, the same bytes every time."""

import io
import itertools
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text
from PIL import Image

from products import first, pairwise
from warpspace import load_scene, scene_names
from warpspace.exceptions import OptionError
from warpspace.machine.errors import ToleranceSet
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.figure_files import figure_bytes, render_figure
from warpspace.outputs.figures.registry import draw_figure, figure_kinds
from warpspace.picture.model import evaluate_picture
from warpspace.picture.traces import trace_lines
from warpspace.scene.library import parse_scene
from warpspace.units import spell_fixed

FIGURES = tuple(kind.name for kind in figure_kinds())
MAPS = tuple(n for n in FIGURES if n not in ("gains", "montecarlo", "ballbar", "rotary"))
SIZES = ((400, 300), (1600, 1200), (1920, 700), (700, 1500))
STARTS = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
NEAR = ("dvf5000_first", "teach_squareness", "machine_scara", "machine_nutating_head")
TWO = tuple(kind.name for kind in figure_kinds() if kind.scenes == 2)

NIGHTLY = pytest.mark.nightly
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


def scene_of(name):
    title = f"{name}: a $title$ with 中文, very long, that goes on and on and never ends"
    return parse_scene(f"title = {title!r}\n{MACHINES[name]}", name)


FIRST, SECOND = load_scene("dvf5000_first"), load_scene("dvf5000_second")


def pair(name):
    return [FIRST, SECOND] if name in TWO else [FIRST]


def words_of(drawing):
    return " ".join(text.get_text() for axes in drawing.figure.axes for text in axes.texts)


def inside(drawing, size):
    assert drawing.rects
    rects = np.array(drawing.rects)
    assert (rects[:, :2] >= -0.5).all(), drawing.title
    assert (rects[:, 2:] <= np.array(size) + 0.5).all(), drawing.title


@pytest.mark.parametrize(("name", "form"), pairwise(FIGURES, [*STARTS]))
def test_every_figure_in_every_format(name, form):
    settings = FigureSettings(size=(800, 600), grid=7)
    assert render_figure(name, pair(name), settings, form).startswith(STARTS[form])


@pytest.mark.parametrize(("name", "size"), pairwise(MAPS, SIZES))
def test_text_stays_inside(name, size):
    inside(draw_figure(name, pair(name), FigureSettings(size=size, grid=11)), size)


@pytest.mark.parametrize(
    ("machine", "figure", "dark"),
    pairwise(
        [*MACHINES], ["error-map", "orientation-map", "machine", "error-curves"], [False, True]
    ),
)
def test_any_machine_is_drawn(machine, figure, dark):
    size = (900, 700)
    settings = FigureSettings(size=size, grid=6, dark=dark, component="x" if dark else "norm")
    inside(draw_figure(figure, [scene_of(machine)], settings), size)


@pytest.mark.parametrize(
    "name", [name if name in NEAR else pytest.param(name, marks=NIGHTLY) for name in scene_names()]
)
def test_corner_labels_of_every_scene_keep_apart(name):
    drawing = draw_figure("error-map", [load_scene(name)])
    inside(drawing, (1600, 1200))
    for a, b in itertools.combinations(drawing.rects, 2):
        across = min(a[2], b[2]) - max(a[0], b[0])
        along = min(a[3], b[3]) - max(a[1], b[1])
        assert across < 2.0 or along < 2.0, (name, a, b)


@pytest.mark.parametrize(
    ("form", "present", "absent"),
    [
        ("png", [], []),
        ("svg", [b"exaggeration=1000", b"<path"], [b"<dc:date>", b"<text"]),
        ("pdf", [b"exaggeration=1000", b"/FontFile2", b"DejaVuSans"], [b"/Type3", b"CreationDate"]),
    ],
)
def test_repeated_pictures_are_the_same_bytes_without_dates(form, present, absent):
    settings = FigureSettings(size=(800, 600), grid=5)
    data, again = (render_figure("error-map", pair("error-map"), settings, form) for _ in range(2))
    assert data == again
    assert [part for part in present if part not in data] == []
    assert [part for part in absent if part in data] == []


def test_files_say_what_they_show():
    image = Image.open(io.BytesIO(figure_bytes(draw_figure("error-map", [FIRST]), "png")))
    assert image.size == (1600, 1200)
    assert image.text["Scene"] == "dvf5000_first"
    assert image.text["Exaggeration"] == "1000"
    assert image.text["Software"].startswith("warpspace ")
    assert "component=norm, view=iso, loop=relative, grid=21" in image.text["Description"]
    assert "first machine measured" in image.text["Title"]


def test_different_volumes_cannot_be_compared():
    with pytest.raises(OptionError, match="working volumes differ"):
        draw_figure("comparison", [FIRST, scene_of("six")])


def test_auto_overrides_the_exaggeration_of_a_scene():
    text = f"title='s'\n{MACHINES['tiny']}\n[view]\nexaggeration = 500\n"
    scene = parse_scene(text.replace("0.00012", "12"), "s")
    for requested, factor in ((None, 500.0), ("auto", 5000.0)):
        settings = FigureSettings(size=(500, 400), grid=3, exaggeration=requested)
        assert draw_figure("error-map", [scene], settings).maps[0].picture.exaggeration == factor


@pytest.mark.parametrize(
    ("name", "component"),
    pairwise(["error-map", "slices", "orientation-map", "machine", "comparison"], ["norm", "x"]),
)
def test_a_range_that_is_given_is_that_of_every_map(name, component):
    size, low = (1000, 750), 0.0 if component == "norm" else -7.0
    # the change B − A keeps a range of its own unless somebody chose the end
    fixed = name == "comparison"
    settings = FigureSettings(
        component=component, size=size, grid=5, range_top=7.0, range_fixed=fixed
    )
    drawing = draw_figure(name, pair(name), settings)
    scales = [part.picture.scale for part in drawing.maps]
    assert {(scale.low, scale.high) for scale in scales} == {(low, 7.0)}
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


@pytest.mark.parametrize("figure", ["error-map", "slices", "orientation-map", "error-curves"])
def test_figures_say_what_is_excluded(figure):
    settings = FigureSettings(
        grid=5, range_top=50.0, range_fixed=True, conditions=("excluded: EA0Z",)
    )
    held = replace(FIRST, reference={"X": 0.0, "Y": 0.0, "Z": -280.0})
    said = words_of(draw_figure(figure, [held], settings))
    assert "excluded: EA0Z" in said
    assert "reference point X 0 Y 0 Z −280" in said
    assert ("range fixed 0–50" in said) == (figure != "error-curves")


@pytest.mark.parametrize(("name", "panels"), [("dvf5000_first", 3), ("teach_squareness", 0)])
def test_error_curves_have_no_empty_panels(name, panels):
    # first machine: EAX, EAY, ECY and EAZ are curves; squareness is a constant beside them
    scene = replace(load_scene(name), tolerances=ToleranceSet())
    texts = [text.get_text() for text in draw_figure("error-curves", [scene]).figure.texts]
    assert sum(text.startswith(("translation of", "rotation of")) for text in texts) == panels


@pytest.mark.parametrize("name", first("gains", "montecarlo", "ballbar"))
def test_charts_stand_on_a_dark_ground_with_light_ink(name):
    settings = [FigureSettings(size=(900, 700), dark=dark) for dark in (True, False)]
    pictures = (io.BytesIO(render_figure(name, [FIRST], one, "png")) for one in settings)
    dark, light = (np.asarray(Image.open(picture).convert("L")) for picture in pictures)
    assert np.median(dark) < 40
    assert (dark > 200).mean() > 0.002
    assert np.median(light) > 240


TITLE = "A machine after its repair in November, measured with the laser tracker and the ball bar"


@pytest.mark.parametrize("name", ["error-map", "montecarlo", "ballbar"])
def test_a_long_title_is_wrapped(name):
    scene = replace(load_scene("dvf5000_general"), title=TITLE)
    figure = draw_figure(name, [scene], FigureSettings(size=(1000, 800), grid=7)).figure
    texts = figure.findobj(Text)
    assert TITLE in " ".join(" ".join(text.get_text() for text in texts).split())
    renderer, width = FigureCanvasAgg(figure).get_renderer(), figure.bbox.width
    assert max(text.get_window_extent(renderer).x1 for text in texts) <= width


@pytest.mark.parametrize(
    ("name", "words"),
    [("traces", "nominal traces only"), ("rotary", "No error"), ("ballbar", "No error")],
)
def test_a_figure_without_errors_says_so_and_draws_no_zeros(name, words):
    figure = draw_figure(name, [load_scene("dvf5000_nominal")], FigureSettings(grid=7)).figure
    texts = [text.get_text() for text in figure.findobj(Text)]
    assert words in " ".join(texts)
    assert not [text for text in texts if text.endswith((": 0 µm", "µm apart"))]


def test_numbers_of_neighbouring_panels_keep_apart():
    figure = draw_figure("gains", [FIRST], FigureSettings()).figure
    axes = sorted(figure.axes, key=lambda one: one.get_position().x0)
    boxes = [
        label.get_window_extent()
        for one in axes
        for label, at in zip(one.get_xticklabels(), one.get_xticks(), strict=True)
        if one.get_xlim()[0] <= at <= one.get_xlim()[1]
    ]
    assert all(left.x1 < right.x0 for left, right in itertools.pairwise(boxes))


def test_traces_of_the_figure_hold_the_reference_point_still_like_the_export():
    """Without the reference the figure showed 4.53 µm where the export had 2.23 µm."""
    scene = replace(load_scene("teach_wobbling_table"), reference={"X": 0.0, "Y": 0.0, "Z": -280.0})
    drawing = draw_figure("traces", [scene], FigureSettings(size=(800, 600)))
    words = words_of(drawing)
    lines = trace_lines(evaluate_picture(scene, grid=3).traces)
    found = {line.trace.label: spell_fixed(line.largest_um) for line in lines}
    over_b = [spell_fixed(line.largest_um) for line in lines if line.trace.axis == "B"]
    assert "2.2" in over_b
    assert "4.5" not in words
    assert all(f"{value} µm" in words for value in found.values())
