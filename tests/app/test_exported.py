"""Exports while comparing: what is drawn, under its own name, with its own numbers and colours."""

import csv
import io
import json
import struct
import threading
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from warpspace.app.documents.export_request import build_request, exported_words, file_stem
from warpspace.app.documents.offline_page import build_offline_html
from warpspace.app.documents.view_image import view_png
from warpspace.app.evaluation.compare import scene_side, with_pin, with_sides
from warpspace.app.evaluation.conventions import with_choice
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.comparison import Side
from warpspace.cli.services import draw_figure, write_export
from warpspace.exceptions import OptionError
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.figures.catalogue import draw_figure as draw
from warpspace.picture.scene_picture import evaluate_picture
from warpspace.scene.library import load_scene

LIVE = LiveModel()
FIRST, SECOND = (load_scene(f"dvf5000_{name}") for name in ("first", "second"))
START = start_state(FIRST, nodes=5).with_amplitude("EXX", 6.0)
BOTH = with_sides(START, Side(), scene_side(SECOND))
WORDS = {
    "a": f"A: present errors: {FIRST.title}",
    "b": f"B: {SECOND.title}",
    "difference": f"B − A: {SECOND.title} − present errors: {FIRST.title}",
}


def picture_of(shown: str, state: AppState = BOTH) -> LivePicture:
    return LIVE.evaluate(replace(state, comparison=state.comparison.with_shown(shown)))


def read_glb(data: bytes) -> dict:
    return json.loads(data[20 : 20 + struct.unpack("<I", data[12:16])[0]])


@pytest.mark.parametrize("shown", WORDS)
def test_csv_holds_the_numbers_that_are_drawn(shown: str) -> None:
    picture = picture_of(shown)
    text = write_export(build_request(picture), ".csv").decode()
    rows = list(csv.DictReader(io.StringIO(text)))
    errors = np.array([[float(row[f"error_{c}_um"]) for c in "xyz"] for row in rows])
    np.testing.assert_allclose(errors, picture.field.error_um.reshape(-1, 3), atol=1e-6)
    assert all(title in rows[0]["scene"] for title in WORDS[shown].split(": ", 1)[1].split(" − "))
    assert rows[0]["loop"] == "tool"


@pytest.mark.parametrize("shown", WORDS)
def test_glb_has_the_title_the_factor_and_the_shared_colours(shown: str) -> None:
    picture = picture_of(shown)
    document = read_glb(write_export(build_request(picture), ".glb"))
    extras = document["asset"]["extras"]
    assert extras["settings"]["exaggeration"] == picture.exaggeration
    assert (extras["colours"]["low"], extras["colours"]["high"]) == (
        picture.scale.low,
        picture.scale.high,
    )
    assert extras["statistics"]["max_um"] == pytest.approx(picture.statistics.max_um)
    for title in picture.compared.titles if shown == "difference" else [WORDS[shown][3:]]:
        assert title in extras["title"]
    if shown == "difference":
        assert extras["settings"]["difference"] == "B − A"
        assert extras["a"]["parameters"]["EXX"]["amplitude"] == 6.0
        assert "parameters" not in extras
    names = {node.get("name", "") for node in document["nodes"]}
    assert "deformed_surface" in names
    assert any(name.startswith("trace actual") for name in names)


def test_traces_of_a_difference_are_displaced_by_the_difference() -> None:
    picture = picture_of("difference", with_sides(START, Side(), Side()))
    document = read_glb(write_export(build_request(picture), ".glb"))
    assert document["asset"]["extras"]["statistics"]["max_um"] == 0.0
    bounds = {
        node["name"]: document["accessors"][
            document["meshes"][node["mesh"]]["primitives"][0]["attributes"]["POSITION"]
        ]
        for node in document["nodes"]
        if node.get("name", "").startswith("trace") and "mesh" in node
    }
    for name, found in bounds.items():
        if name.startswith("trace actual"):
            assert found["max"] == bounds[name.replace("actual", "nominal")]["max"]


@pytest.mark.parametrize("shown", WORDS)
def test_the_offline_page_says_what_it_shows(shown: str) -> None:
    page = build_offline_html(picture_of(shown))
    head = page.partition("<main>")[0]
    assert WORDS[shown] in head
    rest = page.partition("<aside>")[2]
    if shown == "difference":
        assert "unlike in A and B" in rest
        assert "A +6, B 0 µm" in rest
    else:
        assert "not zero" in rest
        assert ("+6 µm" in rest) == (shown == "a")


def test_the_page_of_a_difference_names_what_is_unlike_on_both_sides() -> None:
    other = with_choice(with_pin(START), "component_errors=before_motion").with_loop("relative")
    page = build_offline_html(picture_of("difference", other))
    assert "relative − tool loop" in page
    assert "component errors before the motion − component errors after the motion" in page


def test_pictures_of_the_view_carry_the_title_of_what_is_drawn() -> None:
    content = view_png(np.zeros((200, 300, 3), np.uint8), picture_of("difference"))
    assert Image.open(io.BytesIO(content)).info["Title"] == WORDS["difference"]


@pytest.mark.render
def test_the_figure_is_a_sheet_of_both_and_the_difference_as_the_app_takes_it(
    renderer: str,
) -> None:
    request = build_request(picture_of("a"))
    assert [scene.title for scene in request.pair] == [
        f"present errors: {FIRST.title}",
        SECOND.title,
    ]
    settings = FigureSettings(grid=5, exaggeration=request.exaggeration)
    drawing = draw("comparison", list(request.pair), settings)
    difference = picture_of("difference")
    np.testing.assert_allclose(drawing.maps[2].values, difference.values, atol=1e-6)
    np.testing.assert_allclose(drawing.maps[2].drawn_mm, difference.drawn_mm, atol=1e-6)
    assert any("B − A" in text.get_text() for text in drawing.figure.texts) or any(
        "B − A" in text.get_text() for axes in drawing.figure.axes for text in axes.texts
    )


def ranged(top: float) -> LivePicture:
    return LIVE.evaluate(replace(START, look=START.look.with_top(top)))


def tilted(top: float | None = None) -> LivePicture:
    look = START.look.with_choice(quantity="orientation")
    return LIVE.evaluate(replace(START, look=look if top is None else look.with_top(top)))


@pytest.mark.parametrize("top", [None, 7.0])
def test_glb_has_the_tilts_and_the_range_that_are_coloured(top: float | None) -> None:
    picture = tilted(top)
    extras = read_glb(write_export(build_request(picture), ".glb"))["asset"]["extras"]
    assert extras["settings"]["coloured"] == "tool-orientation error"
    assert extras["colours"] == {
        "map": picture.scale.name,
        "low": 0.0,
        "high": picture.scale.high if top is None else top,
        "label": "|φ|",
        "unit": "µrad",
    }
    request = build_request(picture)
    drawing = evaluate_picture(request.scene, grid=request.nodes, loop=request.loop)
    np.testing.assert_allclose(
        replace(drawing, quantity="orientation").values, picture.values, atol=1e-9
    )
    assert exported_words(picture).startswith("The figure shows the tilts")


@pytest.mark.render
@pytest.mark.parametrize(
    ("picture", "title", "figure"),
    [
        (tilted(7.0), "Orientation error of the tool axis", "orientation-map"),
        (
            LIVE.evaluate(replace(START, look=START.look.with_top(7.0))),
            "Volumetric error",
            "error-map",
        ),
    ],
)
def test_the_figure_shows_what_is_coloured_in_the_range_that_is_fixed(
    renderer: str, picture: LivePicture, title: str, figure: str
) -> None:
    content = draw_figure(build_request(picture), threading.Event())
    about = Image.open(io.BytesIO(content)).info
    assert about["Title"].startswith(title)
    said = dict(pair.split("=") for pair in about["Description"].partition(";")[0].split(", "))
    assert (said["figure"], said["range"]) == (figure, "7")


@pytest.mark.render
def test_tilts_are_compared_by_position_errors_on_the_sheet_and_it_says_so(renderer: str) -> None:
    look = BOTH.look.with_choice(quantity="orientation")
    picture = picture_of("difference", replace(BOTH, look=look))
    assert "shows the position errors of A, B and B − A" in exported_words(picture)
    content = draw_figure(build_request(picture), threading.Event())
    assert "range" not in Image.open(io.BytesIO(content)).info["Description"]


def test_two_loops_on_one_sheet_are_refused_in_words() -> None:
    picture = picture_of("difference", with_pin(START).with_loop("relative"))
    with pytest.raises(OptionError, match="one loop"):
        draw_figure(build_request(picture), threading.Event())
    # the other exports draw each side through its own
    text = write_export(build_request(picture), ".csv").decode()
    rows = list(csv.DictReader(io.StringIO(text)))
    errors = np.array([[float(row[f"error_{c}_um"]) for c in "xyz"] for row in rows])
    np.testing.assert_allclose(errors, picture.field.error_um.reshape(-1, 3), atol=1e-6)
    assert rows[0]["loop"] == "relative − tool"


@pytest.mark.parametrize(
    ("shown", "stem"),
    [("a", "A_present"), ("b", "B_dvf5000_second"), ("difference", "dvf5000_second_minus_present")],
)
def test_files_and_the_panel_name_what_is_exported(shown: str, stem: str) -> None:
    picture = picture_of(shown)
    assert file_stem(picture) == stem
    assert exported_words(picture).startswith(f"Pictures and exports show {WORDS[shown]}.")
    assert exported_words(LIVE.evaluate(START)) == ""
    assert file_stem(LIVE.evaluate(START)) == "dvf5000_first"


def test_volumes_that_differ_export_the_side_that_is_drawn() -> None:
    ranges = {**SECOND.workspace.ranges, "X": (-100.0, 100.0)}
    other = replace(SECOND, name="other", workspace=type(SECOND.workspace)(ranges))
    picture = picture_of("difference", with_sides(START, Side(), scene_side(other)))
    request = build_request(picture)
    assert request.pair is None
    assert request.beside is None
    assert file_stem(picture) == "B_other"
    assert "sheet" not in exported_words(picture)
