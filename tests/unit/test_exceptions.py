"""Messages: what a user wrote is shown, but never at any length."""

import pytest

from warpspace.exceptions import OptionError, SceneError, shorten


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"P{'9' * 300}; expected less", "P9999999999…9999999999; expected less"),
        ("1234567890" * 30 + " points", "1234567890…1234567890 points"),
        (f"{'a' * 5000} is unknown", f"{'a' * 80}…{'a' * 80} is unknown"),
        (f"/{'folder/' * 25}scene.toml: no such file", None),
        ("word " * 5000, f"{'word ' * 400}…{'word ' * 16}"),
        ("line\n" * 1000, None),
    ],
)
def test_endless_numbers_words_and_lines_are_shortened_everywhere(text, expected):
    expected = text if expected is None else expected
    assert shorten(text) == expected
    assert str(OptionError(text)) == OptionError(text).with_names(str) == expected


def test_problems_of_a_scene_are_shortened_one_by_one():
    problems = [f"line {line}: {'9' * 500}" for line in range(30)]
    shown = str(SceneError("s.toml", problems)).splitlines()
    assert shown[0] == "s.toml: 30 problems"
    assert shown[1:] == [f"  - line {line}: {'9' * 10}…{'9' * 10}" for line in range(30)]
