"""The templates of the readouts and their one style sheet."""

import re
from importlib.resources import files

import pytest
from jinja2 import UndefinedError
from markupsafe import Markup

from warpspace.app.browser.page import style_script
from warpspace.app.readouts.html import message, render, style_sheet

ROOM = files("warpspace.app.readouts")
TEMPLATES = sorted(
    path.name for path in (ROOM / "templates").iterdir() if path.name.endswith(".j2")
)


@pytest.mark.parametrize("name", TEMPLATES)
def test_templates_use_the_classes_of_the_style_sheet_and_no_style_of_their_own(name: str) -> None:
    text = (ROOM / "templates" / name).read_text(encoding="utf-8")
    used = set(re.findall(r"\bws-[a-z]+(?:-[a-z]+)*", text))
    assert used <= set(re.findall(r"\.(ws-[a-z-]+)", style_sheet()))
    # values that are data, as custom properties
    assert all(style.startswith("--") for style in re.findall(r'style="([^"]*)', text))
    assert "|safe" not in text


def test_every_class_of_the_style_sheet_is_used() -> None:
    text = "".join((ROOM / "templates" / name).read_text(encoding="utf-8") for name in TEMPLATES)
    text += (ROOM / "budget.py").read_text(encoding="utf-8")
    assert set(re.findall(r"\.(ws-[a-z-]+)", style_sheet())) <= set(re.findall(r"ws-[a-z-]+", text))


def test_words_are_escaped_unless_they_are_html_already() -> None:
    assert "&lt;b&gt;" in message("<b>")
    assert "<b>" in message(Markup("<b>"))


def test_a_forgotten_value_is_an_error() -> None:
    with pytest.raises(UndefinedError):
        render("message", text="no name, no size")


def test_the_script_carries_the_style_sheet_whole() -> None:
    script = style_script("readouts", 'a { content: "</script>\\" }')
    assert '"warpspace-readouts"' in script
    assert "\n  sheet.textContent" in script
