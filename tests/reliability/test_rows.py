"""A small count of every row of docs/reliability.md, and the table itself."""

import importlib.util
import random
import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from reliability import (
    doors,
    kills,
    messages,
    pages,
    proxy,
    reading,
    rows,
    soak,
    surroundings,
    table,
)
from reliability.formats import FORMATS, WORDS, Format
from reliability.mutate import mutate
from reliability.row import Outcome, Row
from warpspace.exceptions import OptionError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks, limits and signals")


def holds(outcome: Outcome, count: int) -> None:
    assert outcome.faults == []
    assert outcome.count == count


@pytest.mark.parametrize("way", ["bytes", "hypothesis"])
def test_changed_files_are_read_or_refused(way: str) -> None:
    holds(reading.read_many(way, 200, 5), 200)


def test_killed_writers_leave_whole_files() -> None:
    holds(kills.run(15), 15)


@pytest.mark.proof
@pytest.mark.skipif(importlib.util.find_spec("atheris") is None, reason="needs atheris")
def test_a_fuzzer_that_sees_what_is_reached() -> None:
    holds(reading.read_many("atheris", 2000, 5), 2000)


@pytest.mark.proof
def test_an_honest_tab_works_on_while_others_attack() -> None:
    holds(messages.run(3000), 3000)


@pytest.mark.proof
def test_commands_in_odd_surroundings() -> None:
    holds(surroundings.run(8), 8)


@pytest.mark.proof
def test_tabs_for_a_minute() -> None:
    holds(soak.run(1), 1)


@pytest.mark.proof
def test_the_doors_stay_shut() -> None:
    holds(doors.run(400), 400)


@pytest.mark.proof
@pytest.mark.browser
def test_a_foreign_page_does_not_get_in() -> None:
    holds(pages.run(2 * pages.PER_PAGE), 2 * pages.PER_PAGE)


@pytest.mark.proof
@pytest.mark.skipif(not proxy.nginx_is_there(), reason="needs nginx and openssl")
def test_the_example_of_a_proxy() -> None:
    holds(proxy.run(20), 20)


# --- a row that must fail does ------------------------------------------------------------------


def read_in_process(read: Callable[[bytes, Path], object], folder: Path) -> list[str]:
    """Read one file of a made-up format."""
    reader = reading.Reader(folder)
    reader._formats = {"mine": Format("mine", lambda: [b"x"], read)}
    reader.read("mine", b"x")
    for fault in reader.faults:
        Path(re.findall(r"\((/[^)]*)\)$", fault)[0]).unlink()
    return reader.faults


def test_a_traceback_is_a_fault(tmp_path: Path) -> None:
    def fail(content: bytes, folder: Path) -> object:
        raise IndexError(content)

    (fault,) = read_in_process(fail, tmp_path)
    assert "IndexError" in fault


def test_a_message_is_none(tmp_path: Path) -> None:
    def refuse(content: bytes, folder: Path) -> object:
        raise OptionError("x: expected y")

    assert read_in_process(refuse, tmp_path) == []


def test_a_hang_is_a_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "LONGEST_S", 0.001)
    (fault,) = read_in_process(lambda content, folder: sum(range(500_000)), tmp_path)
    assert "s of CPU" in fault


def test_every_format_can_read_its_own_files(tmp_path: Path) -> None:
    for each in FORMATS:
        for number, content in enumerate(each.seeds()):
            if b"\0" * 80 + b"\0\0\0\x80" not in content[:84]:  # says that it is longer
                folder = tmp_path / f"{each.name}{number}"
                folder.mkdir()
                assert each.read(content, folder) is not None


@pytest.mark.parametrize("each", FORMATS, ids=lambda each: each.name)
def test_changed_files_get_past_the_first_check(each: Format, tmp_path: Path) -> None:
    reader, chance, seeds = reading.Reader(tmp_path), random.Random(3), each.seeds()
    for count in range(1, 401):
        reader.read(each.name, mutate(seeds, WORDS if each.text else [], chance))
        if 0 < reader.good[each.name] < count:  # some are refused, and some are read
            break
    assert reader.faults == []
    assert 0 < reader.good[each.name] < 400


# --- the table ----------------------------------------------------------------------------------

ROW = Row("kills", "what | must hold", 1000, "kills", kills.run)


def test_the_table_says_what_was_run_and_changes_no_other_row() -> None:
    page = f"before\n{table.BEGIN}\n| `doors` | x | 1 | d | r |\n{table.END}\nafter"
    line = table.spell_row(ROW, Outcome(20, "all\nwell"), "2026-01-02")
    assert "| 20 kills (of 1,000) | 2026-01-02 | held: all well |" in line
    text = table.put_rows(page, {"kills": line}, ("kills", "doors"))
    assert text.startswith("before\n")
    assert text.endswith("\nafter")
    assert list(table.read_table(text)) == ["kills", "doors"]
    assert table.put_rows(text, {}, ("kills", "doors")) == text
    failed = table.spell_row(ROW, Outcome(1000, "", ["in pieces"]), "2026-01-02")
    assert "| 1,000 kills | 2026-01-02 | **fails**: in pieces |" in failed


def test_every_row_is_described_on_the_page() -> None:
    text = table.PAGE.read_text("utf-8").partition(table.END)[2]
    for row in rows.ROWS:
        assert re.search(rf"\b{row.name}\b", text), row.name
