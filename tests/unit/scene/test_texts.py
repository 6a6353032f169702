"""Texts of a scene: a title is one line, a description may have several."""

import pytest

from warpspace.analysis.blocks import Column, Table, table_markdown
from warpspace.exceptions import SceneError
from warpspace.scene.library import parse_scene
from warpspace.scene.scene_writer import scene_to_toml
from warpspace.scene.starter import starter_text

SCENE = 'title = "T"\nmachine = "dvf5000"\n'
NOTE = '[[notes]]\nid = "a"\ntext = "one\\ntwo"\nauthor = "A"\ndate = 2026-01-02T03:04:05Z\n'
BREAKS = [chr(code) for code in (*range(32), *range(0x7F, 0xA0), 0x2028, 0x2029)]


@pytest.mark.parametrize("written", ['title = "T', 'author = "A'])
def test_no_title_or_author_has_a_line_break_or_control_character(written):
    for character in BREAKS:
        text = (SCENE + NOTE).replace(written, f"{written}\\u{ord(character):04x}G91 G0 Z-300")
        with pytest.raises(SceneError, match="expected one line without control characters"):
            parse_scene(text, "s")


def test_the_title_of_a_machine_is_one_line():
    text = starter_text("wFXYZt").replace('[machine]\ntitle = "', '[machine]\ntitle = "a\\n')
    with pytest.raises(SceneError, match=r"machine\.title = .*: expected one line"):
        parse_scene(text, "s")


def test_descriptions_and_notes_have_line_breaks():
    scene = parse_scene(SCENE + 'description = "a\\nb"\n' + NOTE, "s")
    assert (scene.description, scene.review[0].text) == ("a\nb", "one\ntwo")


def test_a_scene_named_by_a_hostile_file_is_read_back():
    scene = parse_scene('machine = "dvf5000"\n', "a\nG0 Z-300\u2028b")
    assert scene.title == "a G0 Z-300 b"
    assert parse_scene(scene_to_toml(scene), "s").title == scene.title


def test_nothing_in_a_table_is_mathematics():
    table = Table((Column("text"),), [("$x$",)], "a $b$")
    assert r"\$x\$" in table_markdown(table)
    assert r"a \$b\$" in table_markdown(table)
