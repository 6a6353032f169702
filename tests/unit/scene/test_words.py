"""Values, keys and places of a file as messages spell them."""

from datetime import UTC, date, datetime, time

import pytest

from warpspace.scene.words import SHOWN, location, spell_key, spell_value


@pytest.mark.parametrize(
    ("value", "spelling"),
    [
        (5, "5"),
        (-1.5, "-1.5"),
        (float("nan"), "nan"),
        (float("-inf"), "-inf"),
        (True, "true"),
        ("text", '"text"'),
        ('a "b" \\ \n\x1b', '"a \\"b\\" \\\\ \\n\\u001b"'),
        (date(2024, 2, 1), "2024-02-01"),
        (time(7, 32), "07:32:00"),
        (datetime(2024, 2, 1, 7, 32, tzinfo=UTC), "2024-02-01T07:32:00+00:00"),
        ([], "[]"),
        ({}, "{}"),
        ([1, "a", [2.5]], '[1, "a", [2.5]]'),
        ({"ramp": 1, "a b": {}}, '{ ramp = 1, "a b" = {} }'),
        (10**400, "a whole number of 1329 bits"),
        pytest.param(-(2**100_000), "a whole number of 100001 bits", id="huge"),
    ],
)
def test_value_is_spelled_as_in_toml(value: object, spelling: str) -> None:
    assert spell_value(value) == spelling


def nested(depth: int, kind: type) -> object:
    """A list in a list, or a table in a table."""
    value: object = 1
    for _ in range(depth):
        value = [value] if kind is list else {"a": value}
    return value


@pytest.mark.parametrize(
    "value",
    [
        "x" * 1_000_000,
        list(range(100_000)),
        {f"key{number}": number for number in range(100_000)},
        {"k" * 1_000_000: 1},
        nested(100_000, list),
        nested(100_000, dict),
    ],
    ids=["text", "list", "table", "key", "deep list", "deep table"],
)
def test_value_is_spelled_in_a_line_however_large_or_deep(value: object) -> None:
    spelling = spell_value(value)
    assert len(spelling) <= SHOWN
    assert "…" in spelling
    assert "\n" not in spelling


@pytest.mark.parametrize(
    ("name", "spelling"),
    [("EAX", "EAX"), ("a-b_1", "a-b_1"), ("a b", '"a b"'), ("", '""'), ("ä\x1b", '"ä\\u001b"')],
)
def test_key_is_bare_where_it_may_be(name: str, spelling: str) -> None:
    assert spell_key(name) == spelling


@pytest.mark.parametrize(
    ("key", "parts", "tag_at", "spelling"),
    [
        ("title", (), None, "title"),
        ("", ("chain",), None, "chain"),
        ("machine", ("offset_mm", "X", 1), None, "machine.offset_mm.X[1]"),
        ("machine", ("offset_mm", "table", 1), None, "machine.offset_mm.table[1]"),
        ("errors.EAX", ("number",), 0, "errors.EAX"),
        ("errors.EAX", ("ramp", "ramp"), 0, "errors.EAX.ramp"),
        ("errors.EAX", ("table", "table", 3, 1), 0, "errors.EAX.table[3][1]"),
        ("errors.EAX", ("csv", "column"), 0, "errors.EAX.column"),
        ("errors.EAC", ("harmonics", "harmonics", 0), 0, "errors.EAC.harmonics[0]"),
        ("errors.EAX", (), 0, "errors.EAX"),
        ("workspace.X", ("range", 1), 0, "workspace.X[1]"),
        ("tolerances.EAX", ("range", "centre"), 0, "tolerances.EAX.centre"),
        ("view", ("exaggeration", "number"), 1, "view.exaggeration"),
        ("view", ("reference", "axes", "axes"), 1, "view.reference.axes"),
        ("view", ("number",), 1, "view.number"),
    ],
)
def test_location_drops_the_tag_of_a_union_and_nothing_else(key, parts, tag_at, spelling) -> None:
    assert location(key, parts, tag_at) == spelling
