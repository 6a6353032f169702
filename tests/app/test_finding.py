"""Errors are found by what people call them."""

import pytest

from warpspace import load_scene
from warpspace.app.tasks.errors import find_parameters
from warpspace.machine.axes import parameter


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
