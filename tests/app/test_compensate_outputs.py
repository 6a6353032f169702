"""Points, pages, files and maps of a machine with a table of compensation."""

import io
import threading
from dataclasses import replace

import numpy as np
import pytest
from markupsafe import Markup
from PIL import Image

from app.test_compensate import LIVE, SCENE, START, computed
from still_scenes import still_scene
from warpspace.app.documents.export_request import build_request, file_stem
from warpspace.app.documents.offline_page import build_offline_html, point_words
from warpspace.app.documents.services import CancelledError, CompensationRequest
from warpspace.app.evaluation.budget import answer, pick_worst, with_picked
from warpspace.app.evaluation.compensation import BOTH, LEFT, Answer, ask, holds_for, with_box
from warpspace.app.evaluation.repair import with_preview
from warpspace.app.readouts.budget import answer_html
from warpspace.app.readouts.error_controls import slider_hint
from warpspace.app.readouts.summary import heading
from warpspace.app.state.app_state import start_state
from warpspace.app.state.compensation_choice import (
    CompensationChoice,
    format_titles,
    has_place_for_tilt,
    is_table,
)
from warpspace.app.state.table import without_table
from warpspace.cli.services import draw_compensation
from warpspace.exceptions import OptionError
from warpspace.machine.parameters import parameter
from warpspace.outputs.charts.compensation_column import draw_maps
from warpspace.scene.library import load_scene

WORDS = "with the table heidenhain (X 9, Y 9, Z 9 points)"


@pytest.fixture(scope="module")
def found() -> Answer:
    return computed()


def test_a_point_that_is_asked_about_lies_on_the_drawn_box(found: Answer) -> None:
    left = with_box(START, LEFT, found.found.controller)
    picture = LIVE.evaluate(left)
    asked = with_picked(left, pick_worst(picture))
    assert asked.picked is not None
    explained = answer(asked, asked.picked, picture.exaggeration)
    worst = np.unravel_index(int(np.argmax(picture.field.norm_um)), picture.shape)
    assert np.abs(explained.drawn_um - picture.field.error_um[worst]).max() < 1e-9
    assert np.abs(explained.drawn_mm - picture.drawn_mm[worst]).max() < 1e-6
    # what it is made of are the errors, of which the table is none
    plain = answer(without_table(asked), asked.picked, picture.exaggeration)
    assert np.array_equal(explained.explanation.error_um, plain.explanation.error_um)
    assert np.linalg.norm(plain.drawn_um) > 2.0 * np.linalg.norm(explained.drawn_um)
    left_um = f"|E| {picture.statistics.max_um:.2f} µm"
    assert left_um in answer_html(explained, "", lambda _: Markup(""))
    assert "the table leaves" not in answer_html(plain, "", lambda _: Markup(""))
    length = f"{picture.statistics.max_um:.1f} µm"
    assert length in point_words(LIVE.evaluate(asked))


def test_the_offline_page_shows_what_is_drawn_and_says_so(found: Answer) -> None:
    left = with_box(START, LEFT, found.found.controller)
    page = build_offline_html(LIVE.evaluate(left))
    assert WORDS in page
    assert "exact chain" in page
    assert "first-order model" not in page
    assert WORDS not in build_offline_html(LIVE.evaluate(START))


@pytest.mark.parametrize("box", [LEFT, BOTH])
def test_figures_and_exports_are_those_of_the_machine_without_it(found: Answer, box: str) -> None:
    state = with_box(START, box, found.found.controller)
    request = build_request(LIVE.evaluate(without_table(state)))
    assert request == build_request(LIVE.evaluate(START))
    assert file_stem(LIVE.evaluate(state)) == "dvf5000_first_with_table"
    assert file_stem(LIVE.evaluate(START)) == "dvf5000_first"


def test_a_repair_that_is_looked_at_keeps_the_table_and_its_heading(found: Answer) -> None:
    left = with_box(START, LEFT, found.found.controller)
    picture = LIVE.evaluate(with_preview(left, {"EC0Y": 0.0}))
    assert "after repair" in heading(picture)
    assert heading(picture).count(WORDS) == 1
    row = parameter("EC0Y")
    assert "without a table" in slider_hint(left, row, 3.0)
    assert "without a table" not in slider_hint(START, row, 3.0)


def test_the_table_of_another_machine_is_none_of_this_one(found: Answer) -> None:
    controller = found.found.controller
    assert holds_for(START, controller)
    assert not holds_for(start_state(load_scene("fork_head_bc")), controller)


def test_a_fork_head_takes_back_the_tilt_of_its_tool() -> None:
    scene = load_scene("fork_head_bc")
    state = replace(start_state(scene), nodes=7).with_amplitude("EAX", 15.0)
    state = state.with_position("B", 30.0)
    choice = CompensationChoice("csv", "5", orientation=True)
    given = computed(state, choice).found
    position, tilted = (
        computed(state, replace(choice, orientation=with_tilt)).found for with_tilt in (False, True)
    )
    assert tilted.tilt_urad(tilted.after)[1] < 0.5 * position.tilt_urad(position.after)[1]
    left = with_box(state, LEFT, given.controller)
    picture = LIVE.evaluate(left)
    now = ask(left, choice).start
    wanted = given.controller.field(picture.grid.coordinates, picture.grid.nominal_mm, now)
    assert np.abs(picture.field.error_um - wanted.error_um).max() < 1e-9
    assert np.abs(picture.field.orientation_urad - wanted.orientation_urad).max() < 1e-9


def test_widgets_know_what_a_format_has_a_place_for() -> None:
    titles = format_titles()
    assert "rtl" not in titles.values()
    assert len(titles) == len(set(titles.values()))
    assert is_table("heidenhain")
    assert not is_table("iso-text")
    assert has_place_for_tilt("sinumerik-cec", SCENE.machine)
    assert not has_place_for_tilt("heidenhain", SCENE.machine)


def test_maps_are_drawn_beside_the_page_and_can_be_cancelled(found: Answer) -> None:
    cancelled = threading.Event()
    sizes = [
        Image.open(io.BytesIO(draw_compensation(request, cancelled))).size
        for request in (
            CompensationRequest(found.found, dark=False, narrow=True),
            CompensationRequest(found.found, dark=True),
        )
    ]
    assert sizes[0][0] < sizes[1][0]
    cancelled.set()
    with pytest.raises(CancelledError):
        draw_compensation(CompensationRequest(found.found, dark=False), cancelled)


@pytest.mark.parametrize("name", ["wFXt", "wXFt", "only Y moves", "only X stands still"])
def test_machines_with_few_moving_axes_have_box_and_maps_too(name: str) -> None:
    state = start_state(still_scene(name))
    given = computed(state, CompensationChoice("heidenhain", "5")).found
    picture = LIVE.evaluate(with_box(state, BOTH, given.controller))
    assert picture.compared is not None
    assert picture.compared.b.max_um <= picture.compared.a.max_um
    for narrow in (True, False):
        assert draw_maps(given, dark=False, narrow=narrow).startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["wCFt", "nothing moves"])
def test_machines_with_nothing_to_correct_are_refused_in_one_line(name: str) -> None:
    with pytest.raises(OptionError, match="to correct") as refused:
        computed(start_state(still_scene(name)), CompensationChoice("heidenhain", "5"))
    assert "\n" not in str(refused.value)
