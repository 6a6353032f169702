"""What files must say: both coordinates of a point, excluded errors, fixed ranges."""

import csv
import io
import json
import struct
from dataclasses import replace

import pytest
from PIL import Image

from warpspace.app.documents.files import shown_sides
from warpspace.app.documents.legend import look_words, picture_conditions, state_conditions
from warpspace.app.documents.offline_page import build_offline_html
from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.evaluation.compare import scene_side, with_sides
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.state.app_state import Picked, Side, start_state
from warpspace.app.state.tree import put
from warpspace.cli.services import write_export
from warpspace.outputs.animation import shared_palette
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.figures.catalogue import draw_figure
from warpspace.picture.words import range_words
from warpspace.scene.library import load_scene

LIVE = LiveModel()
FIRST, SECOND = (load_scene(f"dvf5000_{name}") for name in ("first", "second"))
START = start_state(FIRST, nodes=5)


def without(key, state=START):
    return put(state, "exclusions.excluded", f"+{key}")


def fixed(state):
    return LIVE.evaluate(
        replace(state, look=replace(state.look, range_top=50.0, range_mode="fixed"))
    )


def test_conditions_name_what_is_excluded_and_the_range():
    assert picture_conditions(LIVE.evaluate(START)) == ()
    both = without("EA0Z", without("EAX"))
    assert picture_conditions(fixed(both)) == ("excluded: EAX, EA0Z", "range fixed 0–50 µm")
    only = put(START, "exclusions.only", "+EAX")
    assert picture_conditions(LIVE.evaluate(only)) == ("only: EAX",)
    # an error that is zero changes nothing when it is left out
    assert picture_conditions(LIVE.evaluate(without("EXX"))) == ()
    assert range_words(-20.0, 20.0, "µm") == "range fixed −20 to 20 µm"


def test_exports_of_the_app_say_the_conditions():
    picture = fixed(without("EA0Z"))
    rows = list(csv.DictReader(io.StringIO(write_export(picture, ".csv").decode())))
    assert rows[0]["conditions"] == "excluded: EA0Z; range fixed 0–50 µm"
    data = write_export(picture, ".glb")
    extras = json.loads(data[20 : 20 + struct.unpack("<I", data[12:16])[0]])["asset"]["extras"]
    assert extras["settings"]["conditions"] == ["excluded: EA0Z", "range fixed 0–50 µm"]
    assert extras["statistics"]["max_at_axes"]["Z"] in (-480.0, -80.0)
    page = build_offline_html(picture)
    assert "excluded: EA0Z" in page.partition("<footer>")[2]
    assert "range fixed 0–50 µm" in page.partition("<footer>")[2]
    assert "excluded: EA0Z" in look_words(picture)  # of pictures of the screen


def test_a_comparison_says_the_conditions_of_each_side():
    state = with_sides(without("EA0Z"), Side(), scene_side(SECOND))
    picture = LIVE.evaluate(
        replace(state, comparison=replace(state.comparison, shown="difference"))
    )
    assert picture_conditions(picture) == ("A excluded: EA0Z",)
    rows = list(csv.DictReader(io.StringIO(write_export(picture, ".csv").decode())))
    assert rows[0]["conditions"] == "A excluded: EA0Z"
    conditions = [state_conditions(one) for one in shown_sides(picture)]
    assert conditions == [("excluded: EA0Z",), ()]


def test_a_page_keeps_the_camera_and_the_point():
    at = {"X": 275.0, "Y": -225.0, "Z": -480.0}
    picture = LIVE.evaluate(replace(START, picked=Picked(at)))
    camera = CameraMemory((9.25, 1.5, 2.5), (0.5, 0.25, 0.125), (0.0, 0.0, 1.0), 0.5)
    page = build_offline_html(picture, camera=camera)
    assert "51.7 µm at X 275 Y −225 Z −480" in page.partition("<aside>")[2]
    assert page != build_offline_html(picture)


@pytest.mark.render
@pytest.mark.parametrize("figure", ["error-map", "slices", "orientation-map", "error-curves"])
def test_figures_say_what_is_excluded(renderer, figure):
    settings = FigureSettings(
        grid=5, range_top=50.0, range_fixed=True, conditions=("excluded: EA0Z",)
    )
    held = replace(FIRST, reference={"X": 0.0, "Y": 0.0, "Z": -280.0})
    drawing = draw_figure(figure, [held], settings)
    texts = [text.get_text() for axes in drawing.figure.axes for text in axes.texts]
    said = " ".join(texts)
    assert "excluded: EA0Z" in said
    assert "reference point X 0 Y 0 Z −280" in said
    assert ("range fixed 0–50" in said) == (figure != "error-curves")


@pytest.mark.render
@pytest.mark.parametrize(("name", "panels"), [("dvf5000_first", 3), ("teach_squareness", 0)])
def test_error_curves_have_no_empty_panels(renderer, name, panels):
    # first machine: EAX, EAY, ECY and EAZ are curves; squareness is a constant beside them
    scene = replace(load_scene(name), tolerances=type(FIRST.tolerances)())
    figure = draw_figure("error-curves", [scene], FigureSettings()).figure
    texts = [text.get_text() for text in figure.texts]
    heads = [text for text in texts if text.startswith(("translation of", "rotation of"))]
    assert len(heads) == panels


def test_all_pictures_of_a_gif_share_one_palette():
    colours = [(250, 10, 10), (10, 250, 10), (10, 10, 250)]
    pictures = [Image.new("RGB", (8, 8), colour) for colour in colours]
    palette = shared_palette(pictures)
    for picture, colour in zip(pictures, colours, strict=True):
        again = picture.quantize(palette=palette, dither=Image.Dither.NONE).convert("RGB")
        assert again.getpixel((0, 0)) == colour
