"""A small count of every row of docs/reliability.md, and the table itself."""

import importlib.util
import random
import re
import sys
from pathlib import Path

import pytest

from reliability import doors, kills, messages, proxy, reading, rows, surroundings
from reliability.formats import FORMATS, WORDS, Format
from warpspace.exceptions import OptionError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks, limits and signals")


def holds(outcome, count):
    assert outcome.faults == []
    assert outcome.count == count


@pytest.mark.parametrize("way", ["bytes", "hypothesis"])
def test_changed_files_are_read_or_refused(way):
    holds(reading.read_many(way, 200, 5), 200)


def test_killed_writers_leave_whole_files():
    holds(kills.run(15), 15)


@pytest.mark.nightly
@pytest.mark.skipif(importlib.util.find_spec("atheris") is None, reason="needs atheris")
def test_a_fuzzer_that_sees_what_is_reached():
    holds(reading.read_many("atheris", 2000, 5), 2000)


@pytest.mark.nightly
def test_an_honest_tab_works_on_while_others_attack():
    holds(messages.run(3000), 3000)


@pytest.mark.nightly
def test_commands_in_odd_surroundings():
    holds(surroundings.run(8), 8)


@pytest.mark.nightly
def test_tabs_for_a_minute():
    holds(rows.soak(1), 1)


@pytest.mark.nightly
def test_the_doors_stay_shut():
    holds(doors.run(1200), 1200)  # every file that is built to exhaust


@pytest.mark.nightly
@pytest.mark.skipif(not proxy.nginx_is_there(), reason="needs nginx and openssl")
def test_the_example_of_a_proxy():
    holds(proxy.run(20), 20)


def fail(content, folder):
    raise IndexError(content)


def refuse(content, folder):
    raise OptionError("x: expected y")


@pytest.mark.parametrize(
    ("read", "said"),
    [(fail, "IndexError"), (refuse, ""), (lambda *_: sum(range(500_000)), "s of CPU")],
    ids=["traceback", "message", "hang"],
)
def test_a_traceback_and_a_hang_are_faults_and_a_message_is_none(read, said, tmp_path, monkeypatch):
    if said == "s of CPU":
        monkeypatch.setattr(reading, "LONGEST_S", 0.001)
    reader = reading.Reader(tmp_path)
    reader._formats = {"mine": Format("mine", lambda: [b"x"], read)}
    reader.read("mine", b"x")
    assert [said in fault for fault in reader.faults] == [True] * bool(said)
    for fault in reader.faults:
        Path(re.findall(r"\((/[^)]*)\)$", fault)[0]).unlink()


@pytest.mark.parametrize("each", FORMATS, ids=lambda each: each.name)
def test_files_are_read_as_they_are_and_changed_ones_get_past_the_first_check(each, tmp_path):
    reader, chance, seeds = reading.Reader(tmp_path), random.Random(3), each.seeds()
    for content in seeds:
        if b"\0" * 80 + b"\0\0\0\x80" not in content[:84]:  # says that it is longer
            assert each.read(content, tmp_path) is not None
    for count in range(1, 401):
        reader.read(each.name, reading.mutate(seeds, WORDS if each.text else [], chance))
        if 0 < reader.good[each.name] < count:  # some are refused, and some are read
            break
    assert reader.faults == []
    assert 0 < reader.good[each.name] < 400


def test_every_row_is_described_on_the_page():
    text = rows.PAGE.read_text("utf-8")
    outcome = rows.Outcome(7, "a | b", [])
    for name in rows.ROWS:
        assert re.search(rf"\b{name}\b", text.partition("What the rows do")[2]), name
        assert text.count(f"\n| `{name}` | ") == 1
        text = rows.put_row(text, name, outcome, "2026-01-02")
    assert text.count("| 2026-01-02 | held: a \\| b |\n") == len(rows.ROWS)
