"""Errors in a real Chromium: looked at, entered, bent, excluded, undone, and shared."""

import numpy as np
import pytest

from app.page_tab import SCENES, drawn_nodes, open_page, pixels_of_the_map
from app.wire import end_work
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.server.viewer import Viewer
from warpspace.app.state import edits
from warpspace.app.state.app_state import start_state
from warpspace.app.state.listing import used_keys
from warpspace.app.viewport.tone_map import vertex_colours
from warpspace.machine.errors import Table

LIVE = LiveModel()
START = start_state(SCENES[0])
KEYS = "[...document.querySelectorAll('input[data-number]')].map(box => box.dataset.number)"
CURVE = """() => Object.values(window.__viserTestpoints.uplots).map(plot => plot.chart)
  .filter(chart => chart.data.length === 9)
  .map(({scales, data}) => [[...data[0]], [...data[1]], scales.y.min, scales.y.max])[0]"""
"""Positions, values and the ends in view of the chart of an error: other tabs have charts, too."""


def check_numbers(tab, picture):
    for name, value in (
        ("mean", picture.statistics.mean_um),
        ("RMS", picture.statistics.rms_um),
        ("P95", picture.statistics.p95_um),
        ("max", picture.statistics.max_um),
    ):
        tab.until(lambda name=name, value=value: abs(tab.number(name) - value) <= 0.006)


def check_colours(tab, picture):
    """Wait until the page has the colours that were to be sent."""
    values = picture.values.reshape(-1)[picture.topology.surface.nodes]
    wanted = vertex_colours(picture.scale, values)
    tab.until(lambda: tab.shows_colours(wanted))


def test_the_first_screen_has_the_numbers_and_colours_of_the_model(tab):
    picture = LIVE.evaluate(START)
    tab.until_shown(START)
    check_numbers(tab, picture)
    tab.until(lambda: tab.text("factor") == "exaggeration ×1000")
    place = "axes X 275 Y −225 Z −480 · in R x 275 y −225 z −51"
    tab.until(lambda: tab.text("max at").startswith(place))
    tab.until(lambda: SCENES[0].title in tab.page.title())
    for words in ("EAX · ε_xX · roll of X [µrad]", "|E| [µm]", "DVF5000, chain wCBFXYZt"):
        tab.until(tab.page.get_by_text(words).first.is_visible)
    for words in ("Dev Settings", "Orbit Origin Tool", "Save Canvas"):  # panels for developers
        tab.until(lambda words=words: not tab.page.get_by_text(words).first.is_visible())
    check_colours(tab, picture)
    # what three.js makes of them is again what the colour bar has
    tab.until(lambda: pixels_of_the_map(tab.screenshot()) > 20_000)


def test_a_slider_bends_the_box_is_clamped_undone_and_reset(tab):
    tab.drag("EXX", np.linspace(0.4, 8.0, 20).round(1).tolist())
    moved = START.with_amplitude("EXX", 8.0)
    tab.until_shown(moved)
    check_numbers(tab, LIVE.evaluate(moved))
    assert np.abs(drawn_nodes(LIVE.evaluate(moved)) - drawn_nodes(LIVE.evaluate(START))).max() > 7.9
    tab.choose("Component", "E_x")
    tab.until(lambda: tab.session.state.component == "x")
    tab.press("Control+z")
    tab.until(lambda: tab.page.get_by_text("Undone: component").count() > 0)
    tab.until_shown(moved)
    tab.button("Undo")  # the whole drag is one step
    tab.until_shown(START)
    tab.until(lambda: float(tab.box("EXX").input_value()) == 0.0)
    tab.press("Control+Shift+z")
    tab.until_shown(moved)
    tab.button("Redo")
    tab.until(lambda: "E_x" in tab.page.get_by_label("Component", exact=True).input_value())

    tab.send("EAX", "1e9")
    clamped = moved.with_amplitude("EAX", 20.0)
    tab.until(lambda: tab.page.get_by_text("Clamped").count() > 0)
    tab.until(tab.page.get_by_text("EAX =").first.is_visible)
    tab.until_shown(clamped)
    tab.until(lambda: float(tab.box("EAX").input_value()) == 20.0)

    tab.thumb("EYX").focus()
    for step in range(1, 6):
        tab.page.keyboard.press("ArrowRight")
        tab.until(lambda step=step: float(tab.box("EYX").input_value()) == step / 10)
    tab.until_shown(clamped.with_amplitude("EYX", 0.5))
    tab.button("Reset")
    tab.until_shown(START)
    check_numbers(tab, LIVE.evaluate(START))


def test_how_it_is_drawn_where_it_stands_and_another_scene(tab):
    tab.button("True scale")
    tab.until(lambda: "true scale" in tab.text("factor"))
    tab.button("Auto")
    tab.until(lambda: "1000" in tab.text("factor"))
    tab.choose("Component", "E_y")
    tab.choose("Structural loop", "tool relative to workpiece")
    tab.send("Grid density", "11")
    tab.until(lambda: tab.session.state.nodes == 11)
    tab.send("B [°]", "-30")
    state = START.with_component("y").with_loop("relative").with_nodes(11).with_position("B", -30.0)
    tab.until_shown(state)
    check_colours(tab, LIVE.evaluate(state))
    check_numbers(tab, LIVE.evaluate(state))
    tab.choose("Quantity", "tool-orientation error [µrad]")
    colour = tab.page.get_by_label("Component", exact=True)
    tab.until(lambda: colour.input_value() == "φ_y tilt about y")
    tab.until(lambda: tab.session.state.look.quantity == "orientation")
    picture = LIVE.evaluate(tab.session.state)
    check_colours(tab, picture)
    worst = tab.page.locator("[data-mark='max']")
    tab.until(lambda: worst.get_attribute("title").endswith("µrad"))
    said = float(worst.get_attribute("title").split()[0].replace("−", "-"))
    assert said == pytest.approx(picture.values.max(), abs=0.006)
    scene = SCENES[2]
    tab.choose("Scene", scene.title)
    tab.until(lambda: scene.title in tab.page.title())
    tab.until(lambda: tab.session.state.scene is scene)
    tab.until_shown(tab.session.state)
    tab.until(lambda: float(tab.box("EA0C").input_value()) == 40.0)
    tab.until(tab.page.get_by_text("Rotary positions").is_visible)


def type_number(tab, key, text):
    """Type into the number box of an error as a user does, key by key."""
    tab.box(key).click()
    tab.page.keyboard.press("Control+a")
    tab.page.keyboard.type(text)
    tab.page.keyboard.press("Enter")


def test_an_error_is_found_typed_and_sorted_by_effect(tab):
    used, search = used_keys(START), tab.written("Find an error")
    tab.page.get_by_role("checkbox", name="Hide errors that are zero").check()
    tab.until(lambda: {*tab.page.evaluate(KEYS)} == {*used})
    search.fill("EXX")
    tab.until(lambda: tab.page.evaluate(KEYS) == ["EXX"])
    type_number(tab, "EXX", "87.3")  # beyond the slider's range, which grows
    state = edits.with_typed_amplitude(START, "EXX", 87.3)
    tab.until_shown(state)
    tab.until(lambda: tab.box("EXX").input_value() == "87.3")
    thumb = tab.thumb("EXX")
    tab.until(lambda: thumb.get_attribute("aria-valuemax") == "200")
    tab.until(lambda: float(thumb.get_attribute("aria-valuenow")) == 87.3)
    # the box keeps the focus
    tab.until(lambda: tab.page.evaluate("document.activeElement.dataset.number") == "EXX")
    search.fill("")
    tab.until(lambda: {*tab.page.evaluate(KEYS)} == {*used, "EXX"})
    type_number(tab, "EAX", "<b>12</b>")
    refused = "EAX: “<b>12</b>” is no number; it stays 5.5 µrad."
    tab.until(tab.page.get_by_text(refused).is_visible)
    tab.until(lambda: tab.box("EAX").input_value() == "5.5")
    assert tab.page.get_by_text("Not a number").count() == 1
    tab.page.get_by_role("checkbox", name="Sort by effect").check()
    alone = {
        key: LIVE.evaluate(edits.with_only(state, key, True)).statistics.rms_um
        for key in (*used, "EXX")
    }
    wanted = sorted(alone, key=lambda key: -alone[key])
    tab.until(lambda: tab.page.evaluate(KEYS) == wanted)
    # none leaves while it is being moved to zero
    type_number(tab, wanted[0], "0")
    tab.until(lambda: tab.session.state.amplitudes[wanted[0]] == 0.0)
    tab.until(lambda: tab.box(wanted[0]).input_value() == "0")
    assert tab.listed() == 8
    tab.page.get_by_role("checkbox", name="Sort by effect").uncheck()
    tab.list_all()


def test_a_table_is_pasted_for_an_error_that_is_zero(tab):
    # three actions: the curve of the error, its kind, and paste
    tab.button("Curve of EYX, straightness of X in y")
    error = tab.page.get_by_label("Error", exact=True)
    tab.until(lambda: error.input_value().startswith("EYX"))
    tab.choose("Curve", "table")
    numbers = tab.written("Numbers")
    tab.until(lambda: len(numbers.input_value().splitlines()) == 5)
    numbers.evaluate(
        """(box, text) => { box.focus(); box.select();
        document.execCommand('insertText', false, text); }""",
        "X [mm]\tEYX [µm]\n275\t-12,5\n-275\t0\n0\t30\n0\t34",
    )
    span = edits.axis_span(START, "EYX")
    curve = Table(span, ((-275.0, 0.0), (0.0, 32.0), (275.0, -12.5)))
    state = edits.with_curve(START, "EYX", curve)
    tab.until_shown(state)
    remark = (
        "Heading left out: “X [mm] EYX [µm]”. Rows sorted by position. Values of the same position"
        " averaged, at 0."
    )
    tab.until(lambda: tab.text("curve remark") == remark)
    tab.until(lambda: tab.box("EYX").input_value() == "32")
    # while it gets other axes there is no chart
    tab.until(lambda: (chart := tab.page.evaluate(CURVE)) is not None and chart[1][-1] == -12.5)
    at, value, low, high = tab.page.evaluate(CURVE)
    np.testing.assert_allclose(value, curve.evaluate(np.array(at)), atol=1e-9)
    assert -20.0 < low < -12.5  # NaN if the chart had to find them: no line then
    assert 32.0 < high < 40.0
    numbers.fill("-275 0\nbanana 8")
    tab.until(lambda: "no number" in tab.text("curve problem"))
    tab.until_shown(state)
    # its slider scales the table
    tab.send("EYX", "16")
    tab.until(lambda: tab.session.state.amplitudes["EYX"] == 16.0)
    scaled = edits.curve_of(tab.session.state, "EYX")
    np.testing.assert_allclose(scaled.evaluate(np.array([0.0, 275.0])), [16.0, -6.25])


def test_only_and_exclude(tab):
    only = tab.page.get_by_role("button", name="Only EC0Y, squareness of Y to X")
    exclude = tab.page.get_by_role("button", name="Exclude EC0Y, squareness of Y to X")
    exclude.click()
    tab.until_shown(edits.with_excluded(START, "EC0Y", True))
    tab.until(lambda: exclude.get_attribute("aria-pressed") == "true")
    tab.until(tab.page.get_by_text("1 excluded").is_visible)
    # both at once: no click is lost, none counts twice
    tab.page.evaluate(
        "for (const word of ['exclude EC0Y', 'only EC0Y'])"
        " document.querySelector(`[data-word='${word}']`).click()"
    )
    alone = edits.with_only(START, "EC0Y", True)
    tab.until_shown(alone)
    tab.until(lambda: only.get_attribute("aria-pressed") == "true")
    tab.until(lambda: exclude.get_attribute("aria-pressed") == "false")
    check_numbers(tab, LIVE.evaluate(alone))
    tab.until(lambda: float(tab.box("EAX").input_value()) == 5.5)
    tab.button("Include all")
    tab.until_shown(START)
    tab.until(lambda: tab.page.locator(".ws-excluded").count() == 0)


def test_in_a_shared_review_all_see_and_steer_one_state(browser):
    scene = SCENES[0]
    with Viewer(scene, {scene.title: scene}, shared=True) as viewer:
        one, two = open_page(viewer, browser), open_page(viewer, browser)
        one.send("EXX", "9")
        moved = START.with_amplitude("EXX", 9.0)
        two.until_shown(moved)
        two.until(lambda: float(two.box("EXX").input_value()) == 9.0)
        two.send("EYX", "-4")
        one.until_shown(moved.with_amplitude("EYX", -4.0))
        one.press("Control+z")
        two.until_shown(moved)
        assert one.errors == two.errors == []
        end_work(viewer)
        one.page.context.close()
        two.page.context.close()
