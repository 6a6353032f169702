"""The performance table: every benchmark is registered, ratios and exponents are what they say."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "benchmarks"


@pytest.fixture
def modules(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[ModuleType, ModuleType]]:
    """The modules `run` and `table` of the benchmarks, which find each other in their folder."""
    monkeypatch.syspath_prepend(FOLDER)
    import run
    import table

    yield run, table
    for name in ("run", "table"):
        sys.modules.pop(name)


def test_every_benchmark_is_registered_and_has_one_way_in(modules) -> None:
    run, _ = modules
    files = sorted(FOLDER.glob("bench_*.py"))
    assert [path.stem for path in files] == sorted([*run.BENCHMARKS, *run.APART])
    for path in files:
        if path.stem in run.APART:
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        assert "measure" in functions, path.name
        assert ast.get_docstring(tree), path.name


def test_a_row_says_its_ratio_and_whether_its_target_is_met(modules) -> None:
    _, table = modules
    row = table.Row("a field", 0.25, "a copy", 0.002, most_ratio=120.0)
    assert row.ratio == pytest.approx(125.0)
    assert not row.is_met
    assert row.target == "≤ 120 × (missed)"
    assert table.Row("a field", 0.2, "a copy", 0.002, most=1.0).target == "≤ 1.00 s"
    assert table.Row("memory", 501.0, "errors", 25.0, "MB", most=500.0).is_met is False


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
def test_an_exponent_is_that_of_the_large_sizes(modules, exponent: float) -> None:
    _, table = modules
    sizes = [1.0, 10.0, 100.0, 1000.0, 10_000.0]
    costs = [max(5.0, size**exponent) for size in sizes]
    assert table.Growth("x", "nodes", sizes, costs).exponent == pytest.approx(exponent)


def test_numbers_are_spelt_with_three_digits_in_units_that_suit(modules) -> None:
    _, table = modules
    spelt = {1.234: "1.23 s", 0.01234: "12.3 ms", 1.2e-5: "12.0 µs", 123.4: "123 s"}
    for value, words in spelt.items():
        assert table.spell(value) == words
    assert table.spell(24.73, "MB") == "24.7 MB"
    assert table.spell(1602.4, "MB") == "1,602 MB"


def test_the_page_says_where_and_how_it_was_measured_and_what_was_missed(modules) -> None:
    run, table = modules
    rows = [table.Row("slow", 2.0, "floor", 1.0, most_ratio=1.5), table.Row("fast", 1.0, "f", 2.0)]
    growth = [table.Growth("field", "nodes", [1e3, 1e6], [0.01, 10.0])]
    sections = [table.Section("A title", "What it is.", rows, growth)]
    text = run.page_text(sections, run.load_words(0.1, 99.0))
    for words in ("`make bench`", "cores", "GB of memory", "missed: slow", "numpy ", "pin "):
        assert words in text
    assert "other programs were running" in text
    assert "| slow | 2.00 s | floor | 1.00 s | 2.00 | ≤ 1.5 × (missed) |" in text
    assert "| field | nodes | 1,000, 1,000,000 | 10.0 ms, 10.0 s | 1.00 |" in text
    assert "/" not in run.machine_words()


def test_the_page_in_the_docs_has_every_benchmark_or_says_that_it_was_not_run(modules) -> None:
    run, _ = modules
    page = (ROOT / "docs" / "performance.md").read_text(encoding="utf-8")
    titles = [line[3:] for line in page.splitlines() if line.startswith("## ")]
    [left_out] = [line for line in page.splitlines() if line.startswith("| not run |")]
    for name in run.BENCHMARKS:
        source = (FOLDER / f"{name}.py").read_text(encoding="utf-8")
        shown = any(f'Section("{title}"' in source for title in titles)
        assert shown != (name in left_out), name
