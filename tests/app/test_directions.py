"""Direction of travel, readings and uncertainties in the app."""

from dataclasses import replace

import numpy as np
import pytest

from warpspace.app.documents.conditions import picture_conditions
from warpspace.app.documents.scene_file import open_text, state_to_toml
from warpspace.app.evaluation.conventions import costs_of, with_own_conventions, with_travel
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.resulting_scene import scene_of
from warpspace.app.readouts.conventions import COST_WORDS, conventions_html
from warpspace.app.readouts.curve_chart import SERIES, curve_data, value_span
from warpspace.app.readouts.summary import heading
from warpspace.app.state.app_state import start_state
from warpspace.app.state.curve_text import kind_titles, spell_rows
from warpspace.app.state.edits import curve_of
from warpspace.machine.chain import parse_chain
from warpspace.machine.errors import Directional
from warpspace.machine.travel import TravelDirection
from warpspace.scene.editing.edited import rearranged, with_machine
from warpspace.scene.library import parse_scene

SCENE = parse_scene(
    """title = "two ways"
machine = "dvf5000"
[workspace]
X = [-275, 275]
Y = [-225, 225]
Z = [-480, -80]
[errors]
EXX = { table2 = { axes = ["X", "Z"], X = [-275, 275], Z = [-480, -80], values = [
  [0, 4], [3, 9]] } }
EYX = { forward = { table = [[-275, 1], [275, 3]] }, backward = { ramp = 2 } }
[uncertainty]
EYX = 0.4
[measured.EYX]
runs = [
  { direction = "+", points = [[-275, 1.1], [0, 2], [0, 2.2]] },
  { direction = "-", points = [[0, 1]] },
]
""",
    "two_ways",
)
START = start_state(SCENE, nodes=5)
LIVE = LiveModel()


@pytest.mark.parametrize("way", TravelDirection)
def test_the_box_the_heading_and_files_have_the_direction(way: str) -> None:
    state = with_travel(START, way)
    picture = LIVE.evaluate(state)
    words = "reversal" if way == "difference" else {"mean": "mean of both"}.get(way, way)
    assert words in heading(picture)
    assert words in picture_conditions(picture)[0]
    shares = {"mean": 3.25, "forward": 3.0, "backward": 2.0, "difference": 1.0}
    at_end = float(picture.field.error_um[-1, 0, 0, 1])
    assert at_end == pytest.approx(2.5 if way == "mean" else shares[way])
    back, _ = open_text(state_to_toml(state), "two_ways", "x.toml")
    assert back.scene.model.direction == way
    assert with_own_conventions(state).scene == SCENE


def test_the_slider_scales_both_directions_and_the_whole_surface() -> None:
    state = START.with_amplitude("EYX", 6.0).with_amplitude("EXX", 4.5)
    errors = scene_of(state).errors.functions
    both = errors["EYX"]
    assert isinstance(both, Directional)
    assert (both.forward.amplitude, both.backward.amplitude) == (6.0, 4.0)
    assert errors["EXX"].to_toml()["table2"]["values"] == [[0.0, 2.0], [1.5, 4.5]]
    field = LIVE.evaluate(state).field.error_um[-1, 0, :, 0]
    np.testing.assert_allclose(field, [1.5, 2.25, 3.0, 3.75, 4.5])


def test_readings_and_uncertainties_are_saved_with_what_is_changed() -> None:
    changed = START.with_amplitude("EYX", 6.0)
    back, _ = open_text(state_to_toml(changed), "two_ways", "x.toml")
    assert back.scene.measured == SCENE.measured
    assert back.scene.uncertainty == SCENE.uncertainty
    assert changed.reset().scene == SCENE


def test_the_chart_has_lines_bands_and_dots() -> None:
    own = (SCENE.uncertainty["EYX"], SCENE.measured["EYX"])
    data = curve_data(curve_of(START, "EYX"), (-275.0, 275.0), *own)
    assert len(data) == len(SERIES) + 1
    at, value, forward, backward, above, below, _, dots, open_dots = data
    assert (np.diff(at) >= 0.0).all()
    np.testing.assert_allclose(value, (forward + backward) / 2.0)
    np.testing.assert_allclose(above - below, 0.8)
    shown = np.isfinite(dots)
    assert list(zip(at[shown], dots[shown], strict=True)) == [(-275, 1.1), (0, 2.0), (0, 2.2)]
    assert at[np.isfinite(open_dots)].tolist() == [0.0]


def test_the_ends_of_the_chart_hold_its_numbers_whatever_there_is_none_of() -> None:
    """The chart cannot find them where a value is NaN, and would then draw nothing."""
    own = (SCENE.uncertainty["EYX"], SCENE.measured["EYX"])
    for data in (
        curve_data(curve_of(START, "EYX"), (-275.0, 275.0), *own),
        curve_data(curve_of(START, "EXX"), (-275.0, 275.0)),
        curve_data(None, (0.0, 1.0)),
    ):
        low, high = value_span(data)
        assert low < np.nanmin(data[1:])
        assert np.nanmax(data[1:]) < high


def test_kinds_that_nobody_writes_are_not_offered_and_say_where_they_come_from() -> None:
    assert not {"table over two axes", "by direction of travel"} & {*kind_titles()}
    assert "come from a scene file" in spell_rows(curve_of(START, "EYX"))


def test_a_machine_without_the_second_axis_keeps_the_section_where_it_stood() -> None:
    machine = rearranged(SCENE.machine, parse_chain("wCBFXYt"))
    found = with_machine(SCENE, machine)
    assert "how EXX depends on it" in " ".join(found.notes)
    section = found.scene.errors.functions["EXX"]
    np.testing.assert_allclose(section.evaluate(np.array([-275.0, 275.0])), [2.0, 6.0])
    assert found.scene.measured == SCENE.measured


def test_the_tab_says_what_data_in_a_wrong_convention_would_cost() -> None:
    costs = costs_of(START)
    assert {cost.name for cost in costs} == {*COST_WORDS}
    page = conventions_html(START, {}, lambda *_: "", costs)
    for name, words in COST_WORDS.items():
        assert f'data-cost="{name}"' in page
        assert words.replace("°", "") in page.replace("°", "")
    nothing = costs_of(replace(START, amplitudes=dict.fromkeys(START.amplitudes, 0.0)))
    assert max(cost.max_um for cost in nothing) == 0.0
