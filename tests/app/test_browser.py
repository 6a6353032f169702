"""The app in a real Chromium: what a user does, and what is then on the screen."""

from collections.abc import Callable

import numpy as np
import pytest

from app.page_tab import Tab, drawn_nodes
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.viewport.tone_map import vertex_colours
from warpspace.scene.library import load_scene

pytestmark = pytest.mark.browser
LIVE = LiveModel()
START = start_state(load_scene("dvf5000_first"))


def model(state: AppState) -> LivePicture:
    return LIVE.evaluate(state)


def check_numbers(tab: Tab, picture: LivePicture) -> None:
    for name, value in (
        ("mean", picture.statistics.mean_um),
        ("RMS", picture.statistics.rms_um),
        ("P95", picture.statistics.p95_um),
        ("max", picture.statistics.max_um),
    ):
        assert tab.number(name) == pytest.approx(value, abs=0.006)


def test_first_screen(tab: Tab) -> None:
    picture = model(START)
    tab.until(lambda: tab.shows(drawn_nodes(picture)))
    check_numbers(tab, picture)
    assert tab.text("factor") == "exaggeration ×1000"
    place = "axes X 275 Y −225 Z −480 · in R x 275 y −225 z −51"
    assert tab.text("max at").startswith(place)
    assert "DVF5000, first machine measured" in tab.page.title()
    for words in ("EAX · ε_xX · roll of X [µrad]", "|E| [µm]", "DVF5000, chain wCBFXYZt"):
        assert tab.page.get_by_text(words).first.is_visible()
    # colours as sent by the model
    _, colours = tab.surface()
    values = picture.values.reshape(-1)[picture.topology.surface.nodes]
    np.testing.assert_allclose(colours, vertex_colours(picture.scale, values), atol=1e-5)


def test_mesh_is_drawn_in_the_colours_of_the_bar(tab: Tab) -> None:
    middle = tab.screenshot()[250:750, 500:1100].reshape(-1, 3)
    green = (middle[:, 1] > middle[:, 0] + 40) & (middle[:, 2] > middle[:, 0])
    assert green.mean() > 0.2


def test_keyboard_on_a_slider_bends_the_box_and_reset_brings_it_back(tab: Tab) -> None:
    start = model(START)
    tab.until(lambda: tab.shows(drawn_nodes(start)))
    tab.thumb("EXX").focus()
    for _ in range(25):
        tab.page.keyboard.press("ArrowRight")
        tab.page.wait_for_timeout(20)
    moved = model(START.with_amplitude("EXX", 2.5))
    tab.until(lambda: tab.shows(drawn_nodes(moved)))
    check_numbers(tab, moved)
    assert tab.box("EXX").input_value() == "2.5"
    assert np.abs(drawn_nodes(moved) - drawn_nodes(start)).max() > 2.0
    tab.page.get_by_role("button", name="Reset", exact=True).click()
    tab.until(lambda: tab.shows(drawn_nodes(start)))
    check_numbers(tab, start)
    assert float(tab.box("EXX").input_value()) == 0.0


def test_last_position_of_a_fast_drag_is_what_is_shown(tab: Tab) -> None:
    for value in np.linspace(-10.0, 10.0, 60).round(1):
        tab.send("EYX", f"{value}")
        tab.page.wait_for_timeout(8)
    tab.until_shown(START.with_amplitude("EYX", 10.0))
    check_numbers(tab, model(START.with_amplitude("EYX", 10.0)))


@pytest.mark.parametrize(
    ("sent", "kept"), [("1e9", 20.0), ("-1e9", -20.0), ("NaN", 5.5), ("Infinity", 20.0)]
)
def test_hostile_values_are_clamped_and_shown_as_clamped(tab: Tab, sent: str, kept: float) -> None:
    tab.send("EAX", sent)
    tab.until(lambda: tab.page.get_by_text("Clamped").count() > 0)
    expected = START.with_amplitude("EAX", kept)
    tab.until_shown(expected)
    tab.until(lambda: float(tab.box("EAX").input_value()) == kept)
    check_numbers(tab, model(expected))
    assert tab.page.get_by_text(r"EAX =").first.is_visible()


def test_hostile_density_factor_and_words(tab: Tab) -> None:
    tab.send("Grid density", "NaN")
    tab.page.wait_for_timeout(100)
    tab.send("Exaggeration", "-5")
    tab.until(lambda: tab.text("factor") == "exaggeration ×0.001")  # the least there is
    tab.send("Component", "'<script>'")
    tab.page.wait_for_timeout(500)
    tab.send("EXX", "4")
    wanted = START.with_amplitude("EXX", 4.0).with_exaggeration(0.001)
    tab.until_shown(wanted)


def test_number_box_takes_a_typed_value(tab: Tab) -> None:
    tab.box("EXX").fill("5.5")
    tab.box("EXX").press("Enter")
    tab.until_shown(START.with_amplitude("EXX", 5.5))


def test_exaggeration_component_density_loop_and_positions(tab: Tab) -> None:
    tab.page.get_by_role("button", name="True scale").click()
    tab.until(lambda: "true scale" in tab.text("factor"))
    tab.page.get_by_role("button", name="Auto").click()
    tab.until(lambda: "1000" in tab.text("factor"))
    tab.choose("Component", "E_x")
    tab.choose("Structural loop", "tool relative to workpiece")
    tab.send("Grid density", "11")
    tab.page.wait_for_timeout(100)
    tab.send("B [°]", "-30")
    state = START.with_component("x").with_loop("relative").with_nodes(11).with_position("B", -30.0)
    picture = model(state)
    tab.until(lambda: tab.shows(drawn_nodes(picture)))
    values = picture.values.reshape(-1)[picture.topology.surface.nodes]
    _, colours = tab.surface()
    np.testing.assert_allclose(colours, vertex_colours(picture.scale, values), atol=1e-5)
    check_numbers(tab, picture)


def test_another_scene_brings_its_title_sliders_and_box(tab: Tab) -> None:
    scene = load_scene("teach_tilted_c")
    tab.choose("Scene", scene.title)
    tab.until_shown(start_state(scene))
    tab.until(lambda: scene.title in tab.page.title())
    assert float(tab.box("EA0C").input_value()) == 40.0
    assert tab.page.get_by_text("Rotary positions").is_visible()


def test_two_tabs_are_independent(tab: Tab, open_tab: Callable[[], Tab]) -> None:
    other = open_tab()
    tab.send("EXX", "6")
    tab.until_shown(START.with_amplitude("EXX", 6.0))
    other.page.wait_for_timeout(500)
    assert other.shows_state(START)
    ended = other.session
    other.page.close()
    tab.until(lambda: ended not in tab.viewer.sessions)
    assert tab.session in tab.viewer.sessions


def test_exception_in_the_session_is_shown_and_the_session_goes_on(
    tab: Tab, caplog: pytest.LogCaptureFixture
) -> None:
    def broken(state: AppState) -> AppState:
        raise RuntimeError("a wheel came off")

    tab.session.context.post(broken)
    tab.until(lambda: tab.page.get_by_text("a wheel came off").count() > 0)
    assert "a wheel came off" in caplog.text
    tab.send("EXX", "4")
    tab.until_shown(START.with_amplitude("EXX", 4.0))
