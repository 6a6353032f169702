"""What panels, charts, help and tour say."""

import json
import re
from importlib.resources import files

import pytest
from markupsafe import Markup

from warpspace import load_scene
from warpspace.app.browser.page import tab_script
from warpspace.app.browser.tour import Stop, tour_script
from warpspace.app.panels.commands import Command, help_text
from warpspace.app.readouts.curve_chart import chart_text
from warpspace.app.readouts.help import about_scene
from warpspace.app.readouts.html import message, style_sheet
from warpspace.app.state.listing import find_parameters
from warpspace.machine.axes import parameter

ROOM = files("warpspace.app.readouts")
TEMPLATES = sorted(
    path.name for path in (ROOM / "templates").iterdir() if path.name.endswith(".j2")
)


@pytest.mark.parametrize("name", TEMPLATES)
def test_templates_use_the_classes_of_the_style_sheet_and_no_style_of_their_own(name):
    text = (ROOM / "templates" / name).read_text(encoding="utf-8")
    used = set(re.findall(r"\bws-[a-z]+(?:-[a-z]+)*", text))
    assert used <= set(re.findall(r"\.(ws-[a-z-]+)", style_sheet()))
    # values that are data, as custom properties
    assert all(style.startswith("--") for style in re.findall(r'style="([^"]*)', text))
    assert "|safe" not in text


def test_words_are_escaped_unless_they_are_html_already():
    assert "&lt;b&gt;" in message("<b>")
    assert "<b>" in message(Markup("<b>"))


HOSTILE = "</script><img src=x onerror=alert(1)>\u2028\"'"


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


@pytest.fixture(scope="module")
def keys():
    return load_scene("dvf5000_first").parameter_keys


@pytest.mark.parametrize(
    ("query", "found"),
    [
        ("roll x", ["EAX"]),
        ("eax", ["EAX"]),
        ("c0y", ["EC0Y"]),
        ("squareness", ["EC0Y", "EA0Z", "EB0Z"]),
        ("squarness", ["EC0Y", "EA0Z", "EB0Z"]),
        ("γ", ["EC0Y", "EC0B"]),
        ("ε_xX", ["EAX"]),
        ("tilt c", ["EAC", "EBC"]),
        ("positioning z", ["EZZ"]),
        ("no such thing", []),
        ("<script>", []),
    ],
)
def test_finds(keys, query, found):
    assert list(find_parameters(query, keys)) == found


def test_every_parameter_is_found_by_its_key_symbol_and_name(keys):
    for key in keys:
        row = parameter(key)
        assert find_parameters(key, keys) == (key,)
        assert key in find_parameters(row.symbol, keys)
        assert key in find_parameters(row.name, keys)
    assert find_parameters("   ", keys) == keys
    assert find_parameters("x" * 1_000_000, keys) == ()
