"""Every finding of the validation library is put into words, whatever shape it has."""

import pytest

from warpspace.scene.curves import read_curve
from warpspace.scene.sections import Problems

FINDINGS = [
    ("range", "w.X", [1, "a"], 'w.X[1] = "a": expected a number'),
    ("range", "w.X", [1e6, 2e6], "w.X[0] = 1000000.0: expected at most 100000"),
    ("range", "w.X", float("inf"), "w.X = inf: expected a finite number"),
    ("range", "w.X", {}, "w.X = {}: expected a number or [lower, upper]"),
    ("tolerance", "t.EAX", {"half_width": -1}, "t.EAX.half_width = -1: expected at least 0"),
    ("tolerance", "t.EAX", {"centre": 1}, "t.EAX.half_width: is missing"),
    (
        "tolerance",
        "t.EAX",
        [1],
        "t.EAX = [1]: expected a half width or { centre = , half_width = }",
    ),
    ("error", "e.EAX", {"csv": 5, "column": "a"}, "e.EAX.csv = 5: expected a text"),
    ("error", "e.EAX", {"csv": "", "column": "a"}, 'e.EAX.csv = "": expected at least 1 character'),
    ("error", "e.EAX", {"csv": "a"}, "e.EAX.column: is missing"),
    ("error", "e.EAX", {"ramp": 10**400}, "e.EAX.ramp = a whole number of 1329 bits: is too large"),
    (
        "error",
        "e.EAC",
        {"harmonics": [[-1, 2, 3]]},
        "e.EAC.harmonics[0][0] = -1: expected at least",
    ),
    ("error", "e.EAC", {"harmonics": "x"}, 'e.EAC.harmonics = "x": expected a list'),
    ("error", "e.EAX", {"poly": [0.0] * 17}, "expected at most 16 entries"),
    ("default", "t.default", {"rotatoin": 2}, "t.default.rotatoin: unknown key: did you mean"),
    ("machine", "m", {"chain": "x" * 101}, "expected at most 100 characters"),
    (
        "machine",
        "m",
        {"chain": "c", "travel": {"X": [1]}},
        "m.travel.X = [1]: expected [lower, upp",
    ),
    ("machine", "m", {"chain": "c", "offset_mm": 3}, "m.offset_mm = 3: expected a table"),
    ("machine", "", {"chian": "c"}, "chian: unknown key: did you mean 'chain'?"),
    ("convention", "c", 5, "c = 5: expected a table"),
    ("points_mm", "p", {"tool": "x"}, 'p.tool = "x": expected [x, y, z]'),
    ("points_mm", "p", {"traces": [[0, 0, 0]] * 65}, "expected at most 64 entries"),
    ("view", "view", {"exaggeration": 1e9}, "view.exaggeration = 1000000000.0: expected at most"),
    ("view", "view", {"exaggeration": -1}, "view.exaggeration = -1: expected a number above 0"),
    (
        "view",
        "view",
        {"reference": {"X": 1e9}},
        "view.reference.X = 1000000000.0: expected at most",
    ),
    ("text", "title", "x" * 4001, "expected at most 4000 characters"),
]


def validate(problems: Problems, adapter: str, key: str, value: object) -> object:
    """Validate a value of any kind; errors are read by their kinds of curve."""
    if adapter == "error":
        return read_curve(value, (-275.0, 275.0), key, None, problems)
    return problems.validate(adapter, key, value)


@pytest.mark.parametrize(("adapter", "key", "value", "line"), FINDINGS)
def test_finding_names_key_value_and_expectation(adapter, key, value, line) -> None:
    problems = Problems()
    assert validate(problems, adapter, key, value) is None
    assert any(line in found for found in problems.lines), problems.lines


@pytest.mark.parametrize(("adapter", "key", "value", "line"), FINDINGS)
def test_no_word_of_the_library_is_left(adapter, key, value, line) -> None:
    problems = Problems()
    validate(problems, adapter, key, value)
    for word in ("input should", "Input", "valid", "tuple", "dictionary", "string", "instance"):
        assert word not in "".join(problems.lines)


@pytest.mark.parametrize(
    ("adapter", "value"),
    [
        ("range", 3),
        ("range", [1, 2]),
        ("tolerance", 0),
        ("tolerance", {"half_width": 2.5}),
        ("error", -1e5),
        ("error", {"table": [[0, 1], [1, 1]]}),
        ("error", {"harmonics": [[1, 3.0, -90]]}),
        ("view", {"exaggeration": "auto", "reference": "absolute"}),
        ("view", {"exaggeration": 2000, "reference": {"X": 0}}),
        ("machine", {"chain": "wFXt", "direction": {"X": -1}}),
    ],
)
def test_what_the_format_allows_is_taken(adapter: str, value: object) -> None:
    problems = Problems()
    assert validate(problems, adapter, "k", value) is not None
    assert problems.lines == []


def test_table_of_anything_else_is_empty_and_a_problem() -> None:
    problems = Problems()
    assert problems.table("errors", [1]) == {}
    assert problems.lines == ["errors = [1]: expected a table"]
    assert problems.table("errors", None) == {}
    assert len(problems.lines) == 1
