"""A small count of every row of docs/reliability.md, and the table itself."""

import random
import re
import sys
from pathlib import Path

import pytest

from reliability import reading, rows
from reliability.formats import FORMATS, WORDS, Format
from reliability.proxy import nginx_is_there
from warpspace.exceptions import OptionError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks, limits and signals")


NIGHTLY = pytest.mark.nightly
NGINX = pytest.mark.skipif(not nginx_is_there(), reason="needs nginx and openssl")


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("files", 100),
        ("scenes", 100),
        ("kills", 8),
        ("updates", 8),
        ("sets", 30),
        pytest.param("messages", 3000, marks=NIGHTLY),
        pytest.param("surroundings", 8, marks=NIGHTLY),
        pytest.param("soak", 1, marks=NIGHTLY),
        pytest.param("doors", 1200, marks=NIGHTLY),  # every file that is built to exhaust
        pytest.param("proxy", 20, marks=[NIGHTLY, NGINX]),
        pytest.param("failing states", 66, marks=NIGHTLY),
    ],
)
def test_a_small_count_of_a_row_holds(name, count):
    outcome = rows.ROWS[name].run(count)
    assert outcome.faults == []
    assert outcome.count == count


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
