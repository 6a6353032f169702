"""Charts, help and tour in words, and scripts that carry a user's text only as data."""

import json

import numpy as np
import pytest

from warpspace.app.browser.accessible import tab_script
from warpspace.app.browser.tour import Stop, tour_script, tour_stops
from warpspace.app.panels.commands import Command, help_text
from warpspace.app.readouts.chart_text import chart_text, describe_curve, describe_histogram
from warpspace.app.readouts.help import about_scene

HOSTILE = "</script><img src=x onerror=alert(1)>\u2028\"'"


def test_a_curve_is_told_by_its_ends_and_what_lies_beyond_them():
    at = np.linspace(-225.0, 225.0, 10)
    ramp = describe_curve("EAY, pitch of Y", "µrad", "mm", at, np.linspace(0.0, -43.7, 10))
    assert ramp == (
        "Chart of EAY, pitch of Y: starts with 0 µrad at −225 mm, ends with −43.7 µrad at 225 mm"
    )
    value = np.array([0.0, 3.0, -2.5, 1.0])
    wave = describe_curve("EXX", "µm", "mm", np.array([0.0, 10.0, 20.0, 30.0]), value)
    assert wave.endswith(
        "starts with 0 µm at 0 mm, ends with 1.00 µm at 30.0 mm,"
        " least −2.50 µm at 20.0 mm, greatest 3.00 µm at 10.0 mm"
    )
    assert describe_curve("EC0Y", "µrad", "mm", at, np.full(10, 7.0)).endswith(
        "7.00 µrad everywhere"
    )


def test_a_histogram_is_told_by_its_ends_its_highest_bar_and_the_limit():
    said = describe_histogram(np.arange(4) * 20.0, np.array([5, 10, 2]), 50.0, "machines")
    assert said == (
        "Histogram of |E|: machines from 0 to 60.0 µm, most of them between 20.0 and 40.0 µm;"
        " the limit is 50.0 µm"
    )


def test_the_tour_has_five_steps_and_says_what_the_scene_is():
    stops = tour_stops("Mine", "Two\nlines.\n", "×1000")
    assert [stop.title for stop in stops] == ["What this is", "Drag", "Click", "Repair", "Compare"]
    assert stops[0].more == "This scene: Mine. Two lines."
    assert "exaggeration ×1000" in stops[0].text


@pytest.mark.parametrize("asked", [False, True])
def test_words_of_a_scene_are_data_in_the_script_of_the_tour(asked):
    script = tour_script([Stop("What", HOSTILE, more=HOSTILE)], asked=asked)
    told = json.JSONDecoder().raw_decode(script[script.rindex('({"stops"') + 1 :])[0]
    assert told["stops"][0]["text"] == told["stops"][0]["more"] == HOSTILE
    assert told["asked"] is asked
    assert "innerHTML" not in script
    assert json.dumps('a"b') in tab_script('a"b')


def test_words_of_a_scene_are_escaped_in_help_view_and_charts():
    command = Command("Fit", HOSTILE, "F", None, lambda: None)
    for html in (
        help_text((command,), HOSTILE, HOSTILE),
        about_scene(HOSTILE),
        chart_text(HOSTILE),
    ):
        assert "<img" not in html
        assert "&lt;img" in html
    assert about_scene(" \n") == ""


def test_help_says_what_colours_dashed_box_and_exaggeration_mean():
    text = help_text((), "Mine", "")
    for word in ("Colours", "Dashed box", "Exaggeration", "Component", "Quantity", "Ctrl + K"):
        assert f">{word}<" in text
    assert "This scene" not in text
