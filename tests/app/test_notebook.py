"""`warpspace.show`: the offline page in an iframe, a line of text outside notebooks."""

import html
import re
from dataclasses import replace

import pytest

import warpspace
from warpspace.app.documents.offline_page import build_offline_html, offline_picture
from warpspace.exceptions import OptionError
from warpspace.kinematics.model import Loop


@pytest.fixture(scope="module")
def scene():
    return replace(warpspace.load_scene("teach_squareness"), title='Squareness "<b>" & more')


def without_ids(page):
    return re.sub(r"[0-9a-f]{8,}|[A-Za-z0-9+/=]{60,}", "", page)


def test_the_frame_holds_the_offline_page(scene):
    view = warpspace.show(scene, grid=3, loop="relative", height=300)
    markup = view._repr_html_()
    source = html.unescape(re.search('srcdoc="([^"]*)"', markup)[1])
    picture = offline_picture(scene, nodes=3, loop=Loop.RELATIVE, exaggeration=scene.exaggeration)
    assert without_ids(source) == without_ids(build_offline_html(picture))
    assert "height: 300px" in markup
    assert '"<b>"' not in markup.partition("srcdoc")[0]


def test_outside_a_notebook_it_is_a_line(scene, capfd):
    text = repr(warpspace.show(scene, grid=3))
    assert re.fullmatch(r"<warpspace scene: Squareness .*, max \|E\| [\d.]+ µm>", text)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "options",
    [{"grid": 2}, {"grid": 33}, {"loop": "part"}, {"component": "q"}, {"exaggeration": -1.0}],
)
def test_choices_out_of_range_are_refused(scene, options):
    with pytest.raises(OptionError, match=next(iter(options))):
        warpspace.show(scene, **options)
