"""Text that would be expensive to parse is refused before it is parsed, and spelled in a line."""

import contextlib
import time
import tomllib
from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from warpspace.exceptions import SceneError
from warpspace.machine.limits import MAX_KEY_PARTS, MAX_KEYS, MAX_MARKS, MAX_NESTING, MAX_POINTS
from warpspace.resources import assets_dir, scenes_dir
from warpspace.scene.text_files import MAX_VALUE_LENGTH, check_outline, parse_toml, spell_value

FILES = [*scenes_dir().glob("*.toml"), *assets_dir().rglob("*.toml")]
BARE = st.text("abcXYZ019_-", min_size=1, max_size=6)
QUOTED = st.text(st.sampled_from(list("ab.=[]{}#'\"\\\n,")), max_size=12)


def basic(text):
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'


def multiline(text):
    return '"""\n' + text.replace("\\", "\\\\").replace('""', '"\\"') + '"""'


def literal(text):
    return "'''" + text.replace("''", "'") + "'''" if not text.endswith("'") else basic(text)


STRINGS = st.builds(
    lambda spell, text: spell(text), st.sampled_from([basic, multiline, literal]), QUOTED
)
VALUES = st.recursive(
    STRINGS | st.floats(-1e6, 1e6).map(repr) | st.integers(-99, 99).map(str) | st.just("true"),
    lambda inner: st.lists(inner, max_size=4).map(lambda many: f"[ # list ].[\n{','.join(many)}]"),
    max_leaves=12,
)
KEYS = st.lists(BARE | QUOTED.map(basic), min_size=1, max_size=MAX_KEY_PARTS - 1).map(" . ".join)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_bundled_file_passes(path):
    check_outline(path.read_text(encoding="utf-8"), path.name)


@given(st.lists(st.tuples(KEYS, VALUES), min_size=1, max_size=6))
def test_valid_text_passes_whatever_stands_in_its_strings_and_remarks(pairs):
    lines = [
        f"k{number}.{key} = {value} # a.b.c.d.e.f.g.h.i.j = [[["
        for number, (key, value) in enumerate(pairs)
    ]
    text = "\n".join(lines)
    tomllib.loads(text)
    check_outline(text, "x.toml")


@given(st.text(st.sampled_from(list("ab.=[]{}#'\"\\\n, 1")), max_size=80))
def test_anything_gives_a_table_or_one_message(text):
    with contextlib.suppress(SceneError):
        assert isinstance(parse_toml(text, "x.toml"), dict)


@pytest.mark.parametrize("part", ["a", '"a"', "'a'", " a "])
def test_a_key_may_have_so_many_parts_and_no_more(part):
    most = ".".join([part] * MAX_KEY_PARTS)
    for text in (f"{most} = 1", f"[{most}]", f"x = {{ {most} = 1 }}"):
        assert parse_toml(text, "x.toml")
        with pytest.raises(SceneError, match=r"line 2: a key of over 8 parts; expected at most 8"):
            parse_toml("\n" + text.replace(most, f"{most}.{part}"), "x.toml")


def test_nesting_ends_at_a_depth():
    assert parse_toml(f"x = {'[' * MAX_NESTING}{']' * MAX_NESTING}", "x.toml")
    for left, right in ("[]", ("{a = ", "}")):
        deep = f"x = {left * (MAX_NESTING + 1)}1{right * (MAX_NESTING + 1)}"
        with pytest.raises(SceneError, match="line 1: is not valid TOML: nested too deeply, more"):
            parse_toml(deep, "x.toml")


@pytest.mark.parametrize("entry", ["k{} = 1\n", "[k{}]\n", "[[k{}]]\n"])
def test_keys_and_empty_tables_are_counted(entry):
    assert parse_toml("".join(map(entry.format, range(1000))), "x.toml")
    with pytest.raises(SceneError, match="more than 50,000 parts of keys"):
        parse_toml("".join(map(entry.format, range(MAX_KEYS + 1))), "x.toml")
    with pytest.raises(SceneError, match="more than 50,000 parts of keys"):
        parse_toml(f"x = [{'{},' * (MAX_KEYS + 1)}]", "x.toml")


@pytest.mark.parametrize(
    "text",
    [
        '"""\n' + '\\"""\n' * 200_000 + "\\",
        "'''\n" + "''\n" * 300_000,
        '"' * 1_000_000,
        "=" * 1_000_000,
        "a" + ".a" * 30_000 + " = 1",  # took 13 s and 3.5 GB
    ],
    ids=["escaped quotes", "single quotes", "quotes", "signs", "parts of a key"],
)
def test_time_grows_with_the_length_only(text):
    started = time.process_time()
    with pytest.raises(SceneError):
        parse_toml(text, "x.toml")
    assert time.process_time() - started < 5.0


@pytest.mark.parametrize("entry", ["1,", "[],", "#\n", "\n", "1.5,", "'',"])
def test_more_marks_than_a_reader_gets_through_in_seconds_are_refused(entry):
    with pytest.raises(SceneError, match=r"line \d+: more than 1,000,000 brackets.*CSV files"):
        parse_toml(f"x = [{entry * MAX_MARKS}]", "x.toml")


def test_a_table_of_the_most_points_is_read():
    rows = ",".join(f"[{index}.5, 1.5]" for index in range(MAX_POINTS))
    assert len(parse_toml(f"x = [{rows}]", "x.toml")["x"]) == MAX_POINTS  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("value", "spelling"),
    [
        ('a "b" \\ \n\x1b', '"a \\"b\\" \\\\ \\n\\u001b"'),
        (datetime(2024, 2, 1, 7, 32, tzinfo=UTC), "2024-02-01T07:32:00+00:00"),
        ([1, "a", [2.5], True], '[1, "a", [2.5], true]'),
        ({"ramp": -1.5, "a b": {}}, '{ ramp = -1.5, "a b" = {} }'),
        pytest.param(-(2**100_000), "a whole number of 100001 bits", id="huge"),
    ],
)
def test_value_is_spelled_as_in_toml(value, spelling):
    assert spell_value(value) == spelling


def nested(depth, kind):
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
def test_value_is_spelled_in_a_line_however_large_or_deep(value):
    spelling = spell_value(value)
    assert len(spelling) <= MAX_VALUE_LENGTH
    assert "…" in spelling
    assert "\n" not in spelling
